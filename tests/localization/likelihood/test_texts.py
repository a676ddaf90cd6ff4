"""What was read on objects and signs, as evidence of the place."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from worlds import TAXONOMY, objects_of

from semsig_gis.core import Signature
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.localization import (
    NoiseSpec,
    build_index,
    cell_noise,
    locate,
    locate_route,
    plain_text,
    read_view,
    score_associations,
    text_fits,
)
from semsig_gis.objects import Licence
from semsig_gis.observation import Leg, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.localization import (
        LikelihoodIndex,
        Location,
    )

NAMES = "alignment_tree", "street_light", "bench"
TREE, LAMP, BENCH = (TAXONOMY.by_name(name).code for name in NAMES)
NOISE = NoiseSpec(detection=0.8, misnamed=0.1, clutter=0.5, bearing_sigma=5.0)
FEW = replace(NOISE, detection=0.15, clutter=0.02)
NOTHING, NEARLY, PART, EXACT = range(4)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("Rue de l'Église St.-Paul", "R. de l'eglise saint paul"),
        ("Große Hauptstraße", "GROSSE HAUPTSTR."),
        ("Avenida de la Paz", "Av. de la Paz"),
        ("C/ Mayor", "Calle Mayor"),
        ("Via Roma", "V. Roma"),
        ("Rua do Ouro", "R. do Ouro"),
        ("Alexanderplatz", "Alexanderpl."),
        ("Paul's", "Pauls"),
        ("Paul\u2019s", "PAUL'S"),
        ("12 A", "12a"),
    ],
)
def test_ways_to_write_a_name_are_equal(text: str, same: str) -> None:
    assert plain_text(text) == plain_text(same)


@pytest.mark.parametrize(
    ("text", "name", "fit"),
    [
        ("Boulangerie Paul", "Boulangerie Paul", EXACT),
        ("Boulangerie P", "Boulangerie Paul", PART),
        ("Paul", "Boulangerie Paul", PART),
        ("Boulangerie Paul Centre", "Boulangerie Paul", PART),
        ("Boulangrie Paul", "Boulangerie Paul", NEARLY),
        ("Kapeli", "Ravintola Kappeli", NEARLY),
        ("Paul Paul", "Boulangerie Paul", NOTHING),
        ("12", "12", EXACT),
        ("12", "12a", PART),
        ("1", "12", NOTHING),
        ("Linie 12 Nord", "Linie 13 Nord", NOTHING),
        ("", "Boulangerie Paul", NOTHING),
        ("!", "Boulangerie Paul", NOTHING),
        ("Zara", "Boulangerie Paul", NOTHING),
    ],
)
def test_text_fits_a_name(text: str, name: str, fit: int) -> None:
    assert text_fits(plain_text(text), [plain_text(name)]).tolist() == [fit]


@functools.cache
def _town() -> tuple[LikelihoodIndex, ObjectStore]:
    """Return a town in which one lamp in three has a name, with two streets."""
    rng = np.random.default_rng(5)
    places = rng.uniform(0.0, 200.0, (60, 2)).round(2).tolist()
    kinds = rng.choice([TREE, LAMP, BENCH], 60).tolist()
    names = [f"Kiosk {chr(97 + row) * 5}" if row % 3 == 0 else "" for row in range(26)]
    names = [*names, *[""] * 34]
    return _index(places, kinds, names)


def _index(
    places: Sequence[Sequence[float]], kinds: Sequence[int], names: Sequence[str]
) -> tuple[LikelihoodIndex, ObjectStore]:
    pairs = enumerate(zip(places, kinds, strict=True))
    things = [(x, y, kind, "town", str(row)) for row, ((x, y), kind) in pairs]
    objects = objects_of(*things, licenses=(Licence("Town", ("town",)),), name=list(names))
    lines = [shapely.LineString([(0, 20), (200, 20)]), shapely.LineString([(0, 180), (200, 180)])]
    streets = gpd.GeoDataFrame({"name": ["Rue du Pau", "Calle Mayor"]}, geometry=lines, crs=2154)
    store = ObjectStore.of(objects, streets=streets)
    return build_index(build_database(objects), NOISE), store


def _seen(row: int, text: str, **more: object) -> View:
    """Return a view of one object of the town from the centre of a cell near it."""
    index, store = _town()
    cell = int(np.hypot(*(index.database.xy - store.objects.xy[row] - [8.0, 3.0]).T).argmin())
    dx, dy = store.objects.xy[row] - index.database.xy[cell]
    bearing = math.degrees(math.atan2(dx, dy)) % 360.0
    sight = Signature(store.objects.codes[[row]], np.array([bearing]))
    return View.of(sight, texts=(text,), **more)


def _near_object(row: int) -> NDArray[np.bool_]:
    index, store = _town()
    return np.asarray(np.hypot(*(index.database.xy - store.objects.xy[row]).T) <= 30.0)


def _odds(answer: Location, cells: NDArray[np.bool_]) -> float:
    chance = float(answer.chances[cells].sum())
    return chance / (1.0 - chance)


@functools.cache
def _anywhere() -> LikelihoodIndex:
    return build_index(_town()[0].database, cell_noise(FEW, 10.0))


def _answer(view: Signature, log_prior: NDArray[np.float64] | None = None) -> Location:
    _, store = _town()
    return locate(_anywhere(), view, store=store, refined=True, explained=1, log_prior=log_prior)


@pytest.mark.parametrize("row", [0, 6, 12])
def test_name_raises_the_places_that_see_the_object(row: int) -> None:
    name = object_texts()[row]
    view = _seen(row, name.upper())
    near = _near_object(row)
    assert _odds(_answer(view), near) > 2.0 * _odds(_answer(replace(view, texts=None)), near)
    with_name = _answer(view, log_prior=np.where(near, 0.0, -20.0))
    first = with_name.explanations[0].to_dict()["rows"][0]
    assert (first["query_text"], first["object_text"]) == (view.text_rows[0], name)
    assert (first["object"], first["verdict"]) == (row, "matched")
    assert first["object_class"] == first["query_class"]
    assert with_name.to_dict()["texts"][0]["names"] == [name]
    assert f"'{name}'" in with_name.explain()["is there"][0]
    symbols = {item.symbol for item in TAXONOMY.classes}
    assert set("".join(with_name.candidates["types"])) <= symbols


def test_text_that_fits_nothing_changes_only_the_notes() -> None:
    view = _seen(0, "Zzyzx")
    with_text, without = _answer(view), _answer(replace(view, texts=None))
    assert np.array_equal(with_text.chances, without.chances)
    assert with_text.answer == without.answer
    assert [note for note in with_text.notes if "'Zzyzx'" in note]
    assert with_text.to_dict()["texts"][0]["fit"] == "none"
    assert "texts" not in without.to_dict()


def test_text_without_street_objects_is_not_used() -> None:
    view = _seen(0, "Kiosk aaaaa")
    index, _ = _town()
    answer = locate(index, view)
    assert np.array_equal(answer.chances, locate(index, replace(view, texts=None)).chances)
    assert any("street objects" in note for note in answer.notes)


def test_text_on_a_thing_of_a_class_that_is_not_there_is_used() -> None:
    code = next(item.code for item in TAXONOMY.classes if item.code not in {TREE, LAMP, BENCH})
    other = replace(_seen(6, "Kiosk ggggg"), codes=np.array([code], np.uint8))
    near = _near_object(6)
    assert not _answer(other).notes
    assert _odds(_answer(other), near) > 3.0 * _odds(_answer(replace(other, texts=None)), near)


def test_text_that_all_objects_have_says_little() -> None:
    rng = np.random.default_rng(2)
    places = rng.uniform(0.0, 150.0, (30, 2)).tolist()
    index, store = _index(places, [LAMP] * 15 + [TREE] * 15, ["Town lights"] * 30)
    view = View(np.array([LAMP, TREE]), np.array([10.0, 80.0]))
    without = locate(index, view, store=store)
    same = locate(index, replace(view, texts=("Town lights",) * 2), store=store)
    assert np.abs(same.chances - without.chances).max() < 1e-6


@given(st.permutations(range(3)))
def test_order_of_objects_makes_no_difference(order: list[int]) -> None:
    index, store = _town()
    codes, bearings = np.array([LAMP, TREE, BENCH], np.uint8), np.array([10.0, 10.0, 10.0])
    texts = ("Kiosk aaaaa", "", "Kiosk ggggg")
    view = View(codes, bearings, texts=texts)
    other = view.select(np.array(order))
    first, second = (read_view(each, index, store) for each in (view, other))
    scores = View.of(first.view).class_scores()
    assert np.allclose(scores[order], View.of(second.view).class_scores())
    assert first.extra is not None
    assert second.extra is not None
    assert np.allclose(first.extra, second.extra)


@pytest.mark.parametrize("text", ["Kiosk aaaaa", "Kiosk aaab", "kiosk", "aaaaa"])
@pytest.mark.parametrize("code", [LAMP, TREE, 0])
def test_likelihood_is_that_of_a_slow_sum(text: str, code: int) -> None:
    index, store = _town()
    view = View(np.array([code], np.uint8), np.array([100.0]), texts=(text,))
    reading = read_view(view, index, store)
    database = index.database
    cells = np.arange(len(database))
    loglik = score_associations(reading.index.database, reading.view, NOISE, cells)
    assert reading.extra is not None
    expected = [_slow(cell, code, 100.0, text) for cell in cells.tolist()]
    assert np.abs(loglik + reading.extra - expected).max() < 0.02


def _slow(cell: int, code: int, bearing: float, text: str) -> float:
    """Return the log-likelihood of one detection with a text, by a loop over the objects."""
    index, store = _town()
    database, codes = index.database, store.objects.codes.tolist()
    kinds = database.present_codes.tolist()
    texts = object_texts()
    weights = {kind: float(kind == code) for kind in kinds}
    if not code:
        for kind in kinds:
            has_text = [bool(texts[row]) for row, code in enumerate(codes) if code == kind]
            weights[kind] = max(sum(has_text) / len(has_text), 0.05)
    shares = {kind: weight / sum(weights.values()) for kind, weight in weights.items()}
    factors = [_slow_factor(text, row, tuple(shares.items())) for row in range(len(codes))]
    rest = {}
    for kind in kinds:
        own = [factors[row] for row, code in enumerate(codes) if code == kind and factors[row] < 2]
        rest[kind] = sum(own) / len(own)
    total = NOISE.clutter / len(kinds) * sum(weights.values()) / 360.0
    log = -NOISE.clutter
    for row, (x, y) in enumerate(store.objects.xy.tolist()):
        dx, dy = x - database.xy[cell, 0], y - database.xy[cell, 1]
        if math.hypot(dx, dy) > 30.0:
            continue
        away = (bearing - math.degrees(math.atan2(dx, dy)) + 180.0) % 360.0 - 180.0
        density = math.exp(-0.5 * (away / 5.0) ** 2) / (5.0 * math.sqrt(2.0 * math.pi))
        by_kind = rest if factors[row] < 2 else dict.fromkeys(kinds, factors[row])
        others = [by_kind[kind] * weights[kind] for kind in kinds if kind != codes[row]]
        name = 0.9 * by_kind[codes[row]] * weights[codes[row]] + 0.1 * sum(others) / len(others)
        total += 0.8 / 0.2 * density * name
        log += math.log(0.2)
    return log + math.log(total)


def object_texts() -> list[str]:
    table = _town()[1].objects.texts
    assert table is not None
    names: list[str] = table["name"].to_pylist()
    return names


@functools.cache
def _slow_factor(text: str, row: int, shares: tuple[tuple[int, float], ...]) -> float:
    """Return how much likelier a text is on an object than anywhere."""
    texts, codes = object_texts(), _town()[1].objects.codes.tolist()
    if not texts[row]:
        return 1.0
    fits = [int(text_fits(plain_text(text), [plain_text(name)])[0]) for name in texts]
    rows = [other for other in range(len(codes)) if texts[other]]

    def usual_share(level: int) -> float:
        usual = 20.0 * (sum(fits[other] >= level for other in rows) + 0.5) / (len(rows) + 1.0)
        parts: list[float] = [
            share
            * (sum(fits[other] >= level for other in rows if codes[other] == kind) + usual)
            / (sum(codes[other] == kind for other in rows) + 20.0)
            for kind, share in shares
        ]
        return sum(parts)

    if not fits[row]:
        return min(0.2 / max(1.0 - usual_share(NEARLY), 0.2), 1.0)
    return max({NEARLY: 0.1, PART: 0.2, EXACT: 0.5}[fits[row]] / usual_share(fits[row]), 1.0)


def _near_street(level: float) -> NDArray[np.bool_]:
    index, _ = _town()
    return np.abs(index.database.xy[:, 1] - level) <= 40.0


def test_name_of_a_street_is_evidence_along_the_street() -> None:
    index, store = _town()
    nothing = View(np.empty(0, np.uint8), np.empty(0))
    answer = locate(index, replace(nothing, signs=("R. du Pau",)), store=store)
    assert answer.to_dict()["texts"][0]["kind"] == "street"
    assert not answer.notes
    chances = answer.chances[_near_street(20.0)].sum()
    assert chances > 0.7
    assert np.ptp(np.log(answer.chances[_near_street(20.0)])) < 1e-6
    assert np.ptp(np.log(answer.chances[~_near_street(20.0)])) < 1e-6
    nearly = locate(index, replace(nothing, signs=("Rue du Paul",)), store=store)
    assert 0.2 < nearly.chances[_near_street(20.0)].sum() < chances
    sight = View(np.array([TREE]), np.array([20.0]), signs=("Rue du Pau",))
    both = locate(index, sight, store=store)
    plain = locate(index, replace(sight, signs=()), store=store)
    near = _near_street(20.0)
    ratio = both.chances[near] / plain.chances[near]
    assert np.allclose(ratio, ratio[0], rtol=0.05)
    assert both.chances[near].sum() > plain.chances[near].sum()


def test_name_of_an_object_in_an_unknown_direction() -> None:
    index, store = _town()
    nothing = View(np.empty(0, np.uint8), np.empty(0), signs=("Kiosk ggggg",))
    answer = locate(index, nothing, store=store)
    near = _near_object(6)
    plain = locate(index, replace(nothing, signs=()), store=store)
    assert answer.chances[near].sum() > 5.0 * plain.chances[near].sum()
    row = View(store.objects.codes[[6]], None, texts=("Kiosk ggggg",))
    blind = locate(index, row, store=store)
    plain = locate(index, replace(row, texts=None), store=store)
    assert blind.chances[near].sum() > 2.0 * plain.chances[near].sum()


def test_texts_of_a_route_are_those_of_their_views() -> None:
    index, store = _town()
    nothing = View(np.empty(0, np.uint8), np.empty(0))
    views = [nothing, replace(nothing, signs=("Calle Mayor",))]
    first, last = locate_route(index, views, [Leg(dx=0.0, dy=100.0, sigma=5.0)], store=store)
    assert last.chances[_near_street(180.0)].sum() > 0.7
    assert first.chances[_near_street(80.0)].sum() > 0.6
