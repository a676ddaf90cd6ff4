from __future__ import annotations

import json
import math
import random
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import TAXONOMY, distorted, parts_of, random_database, random_query
from sentences import refused
from view_oracle import random_view
from worlds import CODES, World

from semsig_gis.core import InputError, Signature, Taxonomy, wilson_interval
from semsig_gis.database import visible_objects_in
from semsig_gis.localization import (
    ALL,
    Sample,
    database_tables,
    estimated_rates,
    expected_counts,
    extrapolated,
    fit_model,
    gather_evidence,
    learn_noise,
    model_change,
    next_model,
    noise_from_dict,
    read_samples,
    shrunk_rates,
)
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import NoiseEstimate

# What the simulated detector does; the estimator has no part in it.
DETECTION = {1: 0.9, 2: 0.7, 3: 0.8, 4: 0.6}
MISNAMED = {1: 0.05, 2: 0.1, 3: 0.02, 4: 0.2}
SIGMA = {1: 3.0, 2: 6.0, 3: 4.0, 4: 5.0}
CLUTTER = {1: 0.5, 2: 0.1, 3: 0.3, 4: 0.2}
TRUTH = {"detection": DETECTION, "misnamed": MISNAMED, "clutter": CLUTTER, "bearing_sigma": SIGMA}
DATABASE = random_database(1, cells=200)


def drawn_name(dice: random.Random, code: int) -> int:
    """Draw the class that is given to an object."""
    misnamed = dice.random() < MISNAMED[code]
    return dice.choice([other for other in DETECTION if other != code]) if misnamed else code


def false_detections(dice: random.Random, scale: float = 1.0) -> Iterator[int]:
    """Draw classes of false detections; each number of a class is a Poisson number by Knuth."""
    for code, rate in CLUTTER.items():
        alive = dice.random()
        while alive > math.exp(-scale * rate):
            yield code
            alive *= dice.random()


def detector(seed: int, objects: list[tuple[int, float, float]]) -> Signature:
    """Detect things as a plain loop over the throws of dice."""
    dice = random.Random(seed)  # noqa: S311
    detections: list[tuple[float, int]] = []
    for code, bearing, _ in objects:
        if dice.random() < DETECTION[code]:
            name = drawn_name(dice, code)
            detections.append(((bearing + dice.gauss(0, SIGMA[code])) % 360, name))
    detections += [(dice.uniform(0, 360), code) for code in false_detections(dice)]
    detections.sort()
    return Signature(
        np.array([code for _, code in detections], np.uint8),
        np.array([angle for angle, _ in detections]),
    )


def simulated(
    database: SignatureDatabase,
    count: int,
    *,
    seed: int = 0,
    observe: Callable[[int, list[tuple[int, float, float]]], Signature] = detector,
) -> list[Sample]:
    """Return what a detector observes in the cells, one after the other."""
    views = visible_objects_in(database, np.arange(len(database)))
    columns = (views.codes, views.bearings, views.distances)
    samples = []
    for number in range(count):
        cell = number % len(database)
        part = slice(views.offsets[cell], views.offsets[cell + 1])
        objects = list(zip(*(column[part].tolist() for column in columns), strict=True))
        signature = observe(seed * 100_000 + number, objects)
        samples.append(Sample(signature=signature, cell_id=int(database.cell_ids[cell])))
    return samples


def in_intervals(
    estimate: NoiseEstimate, truth: Callable[[str, int, float], float] | None = None
) -> list[bool]:
    """Return whether each true rate of a class is in its interval."""
    codes = {item.name: item.code for item in TAXONOMY.classes}
    rows = estimate.rates[estimate.rates["class"] != ALL].to_dict("records")
    truth = truth or (lambda quantity, code, _: TRUTH[quantity][code])
    truths = [truth(row["quantity"], codes[row["class"]], row["distance"]) for row in rows]
    return [row["low_95"] <= true <= row["high_95"] for row, true in zip(rows, truths, strict=True)]


@pytest.fixture(scope="module")
def estimate() -> NoiseEstimate:
    return learn_noise(simulated(DATABASE, 500), DATABASE)


def test_the_true_rates_are_recovered_within_their_intervals(estimate: NoiseEstimate) -> None:
    inside = in_intervals(estimate)
    assert len(inside) == 16
    assert sum(inside) >= 14
    assert (estimate.rates["low_95"] <= estimate.rates["low_90"]).all()
    assert (estimate.rates["high_95"] >= estimate.rates["high_90"]).all()
    assert np.isfinite(estimate.rates["value"]).all()
    spec = estimate.spec
    assert spec.detection_by_class["alignment_tree"] == pytest.approx(0.9, abs=0.04)
    assert spec.clutter == pytest.approx(sum(CLUTTER.values()), abs=0.15)
    assert spec.bearing_sigma_by_class["water_fountain"] == pytest.approx(6.0, abs=0.5)
    plain = json.loads(json.dumps(estimate.to_dict()))
    assert noise_from_dict(plain["spec"]) == spec
    assert (plain["samples"], plain["skipped"]) == (500, 0)
    assert estimate.objects == np.resize(DATABASE.lengths, 500).sum()
    detected = estimate.rates["samples"][estimate.rates.index[5]]  # what misnamed is a share of
    assert estimate.confusion.to_numpy().sum() == pytest.approx(detected, rel=1e-6)


def test_intervals_have_their_coverage() -> None:
    database = random_database(2, cells=100, longest=8)
    inside = []
    for seed in range(12):
        inside += in_intervals(learn_noise(simulated(database, 250, seed=seed + 1), database))
    assert 0.88 <= np.mean(inside) <= 0.995


def test_rates_of_a_rare_class_are_shrunk_to_the_overall_rate() -> None:
    rare = 5
    codes = DATABASE.codes.copy()
    codes[np.flatnonzero(codes == 1)[:2]] = rare  # which is never detected below
    estimate = learn_noise(simulated(DATABASE, 200), replace(DATABASE, codes=codes))
    name = TAXONOMY.by_code(rare).name
    row: Any = estimate.rates.set_index(["quantity", "class"]).loc["detection", name]
    overall = estimate.spec.detection
    assert row["samples"] == 2
    assert abs(row["value"] - overall) < abs(row["own"] - overall) + 1e-9
    assert row["value"] == pytest.approx(overall, abs=0.2)


def test_position_uncertainty_is_not_learnt_as_bearing_noise() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 300, (90, 2))
    world = World(tuple((x, y, int(rng.choice(CODES[:2]))) for x, y in places))
    database, objects = world.database, world.street_objects
    samples = []
    for _ in range(400):
        xy = rng.uniform(0, 300, 2)
        away = objects.xy - xy
        near = np.flatnonzero(np.hypot(*away.T) <= 30.0)
        angles = np.degrees(np.arctan2(away[near, 0], away[near, 1])) + rng.normal(0, 2, len(near))
        signature = Signature(objects.codes[near], np.asarray(angles % 360.0))
        samples.append(Sample(signature=signature, xy=(float(xy[0]), float(xy[1]))))
    exact = learn_noise(samples, objects)
    assert exact.spec.bearing_sigma == pytest.approx(2.0, abs=0.15)
    assert exact.spec.detection > 0.99
    distant = Sample(signature=samples[0].signature, xy=(9e6, 9e6))
    with_distant = learn_noise([distant, *samples], objects)
    assert (with_distant.skipped, with_distant.spec) == (exact.skipped + 1, exact.spec)
    naive = learn_noise(samples, database)
    informed = learn_noise(samples, database, position_sigma=10 / math.sqrt(12))
    assert naive.spec.bearing_sigma > 2 * informed.spec.bearing_sigma
    assert informed.spec.position_sigma == pytest.approx(2.89, abs=0.01)
    assert informed.skipped == naive.skipped > 0


def test_a_single_class_is_learnt() -> None:
    database = random_database(4, classes=1)
    ids = enumerate(database.cell_ids.tolist())
    samples = [Sample(signature=database.signature(cell), cell_id=number) for cell, number in ids]
    estimate = learn_noise(samples, database)
    assert estimate.spec.detection > 0.98
    assert estimate.spec.confusion == {"alignment_tree": {"alignment_tree": 1.0}}


# --- Views ------------------------------------------------------------------------------------

LEFT = (1.0, 0.9, 0.7, 0.45, 0.3)  # of the detection, at fifths of 30 m
METRES = (6.0, 12.0, 18.0, 24.0, 30.0)
RANGE_SIGMA = {1: 0.2, 2: 0.4, 3: 0.25, 4: 0.3}


def left(distance: float) -> float:
    return float(np.interp(distance, METRES, LEFT))


def photographer(seed: int, objects: list[tuple[int, float, float]]) -> View:
    """Take two photos of things with their bearings and distances, by a plain loop."""
    dice = random.Random(seed)  # noqa: S311
    photos = tuple(
        Photo.looking(heading=dice.uniform(0, 360), fov=fov)
        for fov in dice.sample((60, 90, 120), 2)
    )
    rows: list[tuple[float, int, float, int]] = []
    for number, photo in enumerate(photos):
        detections = []
        for code, bearing, distance in objects:
            if dice.random() < DETECTION[code] * left(distance):
                name = drawn_name(dice, code)
                metres = max(distance, 0.1) * math.exp(dice.gauss(0, RANGE_SIGMA[code]))
                detections.append(((bearing + dice.gauss(0, SIGMA[code])) % 360, name, metres))
        detections += [
            (dice.uniform(0, 360), code, 30 * math.sqrt(dice.random()))
            for code in false_detections(dice, 3.0)
        ]
        rows += [(*detection, number) for detection in detections if photo.sees(detection[0])]
    scores = np.zeros((len(rows), 256))
    for row, (_, name, _, _) in enumerate(rows):
        both = [name, dice.choice([other for other in DETECTION if other != name])]
        # The truth is as likely as it scores; half are sure.
        scores[row, both if dice.random() < 0.75 else both[::-1]] = 0.75, 0.25
        if dice.random() < 0.5:
            scores[row] = np.eye(256)[name]
    columns = np.array(rows, np.float64).reshape(-1, 4).T
    ranged = [dice.random() < 0.7 for _ in rows]
    return View(
        columns[1].astype(np.uint8),
        columns[0],
        ranges=np.where(ranged, columns[2], np.nan),
        scores=scores,
        photo=columns[3].astype(np.int64),
        photos=photos,
    )


def photo_truth(quantity: str, code: int, distance: float) -> float:
    if quantity in {"detection", "fading"}:
        return DETECTION[code] * left(distance)
    if quantity == "clutter":
        return 3 * CLUTTER[code]
    return {**TRUTH, "range_sigma": RANGE_SIGMA}[quantity][code]


def test_photos_recover_rates_ranges_and_fading() -> None:
    inside = []
    for seed in range(2):
        database = random_database(seed, cells=100, longest=14)
        samples = simulated(database, 800, seed=seed, observe=photographer)
        inside += in_intervals(learn_noise(samples, database), photo_truth)
    assert len(inside) == 2 * 4 * (5 + 4)
    assert np.mean(inside) >= 0.87


@pytest.mark.parametrize("sigma", [10.0, math.inf])
def test_photos_of_uncertain_heading_recover_the_same_model(
    estimate: NoiseEstimate, sigma: float
) -> None:
    rng = np.random.default_rng(0)
    samples = []
    for number, sample in enumerate(simulated(DATABASE, 500)):
        # Every third heading is known; the others have an error of their own, or that of all.
        photo = Photo(north_sigma=(0.0, sigma, None)[number % 3])
        turn = 0.0 if number % 3 == 0 else rng.uniform(0, 360)
        if math.isfinite(sigma):
            turn = rng.normal(0.0, sigma) if number % 3 else 0.0
        view = View.of(sample.signature, photos=(photo,)).turned(turn)
        samples.append(Sample(signature=view, cell_id=sample.cell_id))
    uncertain = learn_noise(samples, DATABASE, north_sigma=sigma)
    assert sum(in_intervals(uncertain)) >= 13
    rows, bounds = uncertain.rates, estimate.rates
    assert (rows["value"].between(bounds["low_95"], bounds["high_95"])).all()
    assert (uncertain.samples, uncertain.objects) == (estimate.samples, estimate.objects)
    assert uncertain.detections == estimate.detections


def test_photos_of_a_place_have_headings_of_their_own() -> None:
    database = random_database(1, cells=100, longest=14)
    rng, samples = np.random.default_rng(0), []
    for sample in simulated(database, 300, seed=1, observe=photographer):
        parts = [part.turned(rng.normal(0.0, 15.0)) for part in View.of(sample.signature).split()]
        photos = [replace(part.photos[0], north_sigma=15.0) for part in parts]
        views = [View.of(part, photos=(photo,)) for part, photo in zip(parts, photos, strict=True)]
        samples.append(Sample(signature=View.joined(views), cell_id=sample.cell_id))
    inside = in_intervals(learn_noise(samples, database), photo_truth)
    assert len(inside) == 4 * (5 + 4)
    assert np.mean(inside) >= 0.85


def test_verdicts_say_which_samples_suffice(estimate: NoiseEstimate) -> None:
    assert all(verdict == {"enough": True, "few": []} for verdict in estimate.verdicts.values())
    few = learn_noise(simulated(DATABASE, 3), DATABASE)
    assert not few.verdicts["clutter"]["enough"]
    for quantity, verdict in few.verdicts.items():
        rows = few.rates[(few.rates["quantity"] == quantity) & (few.rates["class"] != ALL)]
        assert verdict["few"] == rows[rows["samples"] < 8]["class"].tolist()
    assert few.to_dict()["verdicts"] == few.verdicts


def test_csv_and_json_lines_give_equal_samples(tmp_path: Path) -> None:
    (tmp_path / "seen.CSV").write_text(
        'note,cell_id,types,bearings,x,y\nfirst,7,DB,"10, 350",,\nnothing,8,,,,\n,,D,-10,1.5,2\n'
    )
    lines = [
        {"cell_id": 7, "types": "DB", "bearings": [10, 350]},
        {"cell_id": 8, "types": "", "bearings": []},
        {"x": 1.5, "y": 2, "types": "D", "bearings": -10},
    ]
    (tmp_path / "seen.jsonl").write_text("\n\n".join(map(json.dumps, lines)))
    for name in ("seen.CSV", "seen.jsonl"):
        samples = [
            (sample.cell_id, sample.xy, *(part.tolist() for part in parts_of(sample.signature)))
            for sample in read_samples(tmp_path / name, taxonomy=TAXONOMY)
        ]
        assert samples == [
            (7, None, [3, 1], [10.0, 350.0]),
            (8, None, [], []),
            (None, (1.5, 2.0), [3], [350.0]),
        ]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cell_id,types,bearings\n7,DB,10\n", ["line 2", "2 types", "1 bearings"]),
        ("cell_id,types,bearings\n7,D,10\n7,%,10\n", ["line 3", "%"]),
        ("cell_id,types,bearings\n7,?,10\n", ["line 2", "unknown class"]),
        ("cell_id,types,bearings\n7,D,nan\n", ["line 2", "nan"]),
        ("cell_id,types,bearings\n7,D,400\n", ["line 2", "400"]),
        ("cell_id,types,bearings\n7,D,north\n", ["line 2", "north"]),
        ("cell_id,types,bearings\nx7,D,10\n", ["line 2", "x7"]),
        ("x,types,bearings\n7,D,10\n", ["line 2", "place"]),
        ("x,y,types,bearings\n7,inf,D,10\n", ["line 2", "inf"]),
        ("x,y,bearings\n7,8,10\n", ["line 2", "types"]),
        ("x,y,types,bearings\n", ["no rows", "one sample"]),
        ("[1]", ["line 1"]),
        ("{", ["line 1"]),
        ('{"types": "D", "bearings": {"a": 1}, "cell_id": 7}', ["line 1"]),
    ],
)
def test_invalid_samples_are_refused(tmp_path: Path, text: str, words: list[str]) -> None:
    path = tmp_path / ("seen.jsonl" if text[0] in "[{" else "seen.csv")
    path.write_text(text)
    with refused(InputError, *words):
        read_samples(path, taxonomy=TAXONOMY)


# --- One round of the fit ---------------------------------------------------------------------

NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


@given(st.integers(0, 500))
def test_counts_add_up(seed: int) -> None:
    database = random_database(seed, cells=20)
    detected = [NOTHING]
    for cell in range(1, 20):
        query = random_query(database, seed + cell, size=cell % 7)
        codes, bearings = parts_of(query)
        detected.append(Signature(codes[codes > 0], bearings[codes > 0]))
    views = visible_objects_in(database, np.arange(20))
    evidence = gather_evidence(views, detected, taxonomy=TAXONOMY, position_sigma=2.0)
    model = evidence.start
    counts = expected_counts(evidence, model)
    hits = counts.named.sum()
    assert hits == pytest.approx(counts.chances.sum())
    # Other detections are objects that are in range only of the observer.
    assert 0.8 * len(evidence.detections.bearings) < hits + counts.false.sum()
    assert hits + counts.false.sum() <= len(evidence.detections.bearings) + 0.05
    assert (counts.named.sum(axis=1) <= counts.trials.sum() + 0.05).all()
    assert (counts.turns >= 0).all()
    new = next_model(evidence, counts.totals, model)
    assert new.clutter.sum() * 20 == pytest.approx(counts.false.sum(), rel=0.02)
    assert new.named(0).sum(axis=1) == pytest.approx(1.0)


@given(st.integers(0, 500), st.sampled_from([0.0, 2.5]), st.floats(0.5, 30.0))
def test_what_is_far_away_changes_no_count(seed: int, position: float, sigma: float) -> None:
    database = random_database(seed, cells=6, longest=8)
    rng = np.random.default_rng(seed)
    photos = (Photo.looking(heading=40, fov=60),)
    detected = [random_view(database, rng, size=seed % 5, photos=photos) for _ in range(6)]
    if not sum(map(len, detected)):
        return
    views = visible_objects_in(database, np.arange(6))
    evidence = gather_evidence(views, detected, taxonomy=TAXONOMY, position_sigma=position)
    model = replace(evidence.start, sigma=np.full(len(evidence.names), sigma))
    near = evidence.near(model.sigma)
    assert len(near.pairs.away) <= len(evidence.pairs.away)
    counts, all_counts = expected_counts(near, model), expected_counts(evidence, model)
    assert counts.totals == pytest.approx(all_counts.totals, rel=1e-4, abs=1e-6)
    assert counts.log_likelihood == pytest.approx(all_counts.log_likelihood, abs=1e-5)


def test_the_fast_fit_equals_many_plain_rounds() -> None:
    database = random_database(3, cells=60, longest=5)
    rng = np.random.default_rng(0)
    detected = [distorted(database, cell, rng) for cell in range(60)]
    evidence = gather_evidence(
        visible_objects_in(database, np.arange(60)), detected, taxonomy=TAXONOMY
    )
    fast, rounds = fit_model(evidence, evidence.start, fading=False)
    model = evidence.start
    for _ in range(400):
        model = next_model(evidence, expected_counts(evidence, model).totals, model)
    assert rounds < 50
    assert model_change(model, fast) < 1e-3


@given(st.integers(0, 10_000))
def test_an_extrapolation_of_linear_rounds_ends_where_nothing_changes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix, end = rng.uniform(-0.25, 0.25, (3, 3)), rng.uniform(1.0, 2.0, 3)
    before = [(end + matrix @ rng.normal(0.0, 0.3, 3)) ** 2 for _ in range(5)]
    after = [(end + matrix @ (np.sqrt(value) - end)) ** 2 for value in before]
    assert extrapolated(before, after) == pytest.approx(end**2, rel=1e-4)


def test_rounds_of_the_fit_raise_the_likelihood() -> None:
    database = random_database(3, cells=60, longest=5)
    rng = np.random.default_rng(0)
    detected = [distorted(database, cell, rng) for cell in range(60)]
    evidence = gather_evidence(
        visible_objects_in(database, np.arange(60)), detected, taxonomy=TAXONOMY
    )
    model = evidence.start
    before = -math.inf
    for _ in range(8):
        counts = expected_counts(evidence, model)
        assert counts.log_likelihood > before - 0.1  # class rates are shrunk as well
        before = counts.log_likelihood
        new = next_model(evidence, counts.totals, model)
        assert model_change(model, model) == 0.0
        assert model_change(model, new) > 0
        model = new


def test_intervals_of_certain_associations_equal_the_textbook() -> None:
    database = random_database(0, cells=300, longest=1, classes=1)
    views = visible_objects_in(database, np.arange(300))
    signatures = [
        Signature(views.codes[[row]], (views.bearings[[row]] + 1.0 - 2.0 * (row % 2)) % 360)
        if row % 10
        else NOTHING
        for row in range(300)
    ]
    evidence = gather_evidence(views, signatures, taxonomy=TAXONOMY)
    missed, clutter = np.array([[0.1]]), np.array([1e-6])
    model = replace(evidence.start, missed=missed, clutter=clutter, sigma=np.ones(1))
    rates = estimated_rates(evidence, expected_counts(evidence, model), model)
    rows = rates[rates["class"] == ALL].set_index("quantity").to_dict("index")
    detection = rows["detection"]
    assert detection["own"] == pytest.approx(0.9, abs=1e-4)
    assert detection["samples"] == 300
    expected = wilson_interval(0.9, 300)
    assert (detection["low_95"], detection["high_95"]) == pytest.approx(expected, abs=0.003)
    sigma = rows["bearing_sigma"]
    assert sigma["own"] == pytest.approx(1.0, abs=0.03)  # half a unit of bearing is noise too
    assert math.log(sigma["high_95"] / sigma["own"]) >= 1.96 / math.sqrt(2 * 270) - 1e-6
    assert len(rates) == 8


def test_the_overall_rate_counts_for_eight_samples() -> None:
    rates = shrunk_rates(np.array([0.0, 90.0]), np.array([10.0, 90.0]))
    assert rates == pytest.approx([8 * 0.9 / 18, (90 + 8 * 0.9) / 98])
    assert shrunk_rates(np.zeros(2), np.zeros(2)).tolist() == [0.0, 0.0]


def test_rare_classes_share_what_is_learned_of_their_family() -> None:
    hits, trials = np.array([0.0, 90.0, 10.0, 0.0]), np.array([1.0, 100.0, 100.0, 0.0])
    families = ("shop", "shop", "food", "food")
    rates = shrunk_rates(hits, trials, families)
    overall = 100.0 / 201.0
    shop, food = ((part + 8 * overall) / (total + 8) for part, total in ((90, 101), (10, 100)))
    expected = [8 * shop / 9, (90 + 8 * shop) / 108, (10 + 8 * food) / 108, food]
    assert rates == pytest.approx(expected)
    assert (shrunk_rates(hits, trials, ("",) * 4) == shrunk_rates(hits, trials)).all()


def test_what_is_learned_of_a_family_is_for_its_other_classes() -> None:
    families = ["shop", "shop", "food", "food", "food", *["shop"] * 6]
    classes = zip(TAXONOMY.classes, families, strict=True)
    taxonomy = Taxonomy(tuple(replace(item, family=family) for item, family in classes))
    database = replace(random_database(8, cells=120, classes=4), taxonomy=taxonomy)
    samples = []
    for cell in range(len(database)):
        view = View.of(database.signature(cell))
        codes = view.class_scores().argmax(axis=1)
        # Half of the shops are overlooked.
        mask = (codes > 2) | (np.arange(len(codes)) % 2 == 0)
        samples.append(Sample(signature=view.select(mask), cell_id=int(database.cell_ids[cell])))
    spec = learn_noise(samples, database).spec
    shop, food = (spec.detection_by_class[family] for family in ("shop", "food"))
    assert shop < 0.7
    assert food > 0.9
    # The classes 5 and 6 were not in the samples.
    (table,), _ = database_tables(replace(database, codes=database.codes + np.uint8(2)), spec)
    assert (1.0 - table.missed[0, 2:]).tolist() == pytest.approx([food, shop])
