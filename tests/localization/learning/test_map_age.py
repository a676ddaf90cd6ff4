"""Noise for old maps: its values, and the calibration of its chances."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from noisy_cells import TAXONOMY, random_database
from sentences import refused

from benchmarks._later_city import later_city
from semsig_gis.core import InputError
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain, score_queries, scored_tables
from semsig_gis.localization import (
    Drift,
    LikelihoodLocator,
    NoiseSpec,
    aged_noise,
    build_index,
    cell_noise,
    fresh_noise,
    named_drift,
    named_noise,
    open_drift,
)
from semsig_gis.objects import ClassChange, build_objects, compare_objects
from semsig_gis.sources import CitySpec, load_catalog, paper_taxonomy, synthetic_city

if TYPE_CHECKING:
    from pathlib import Path

CITY = random_database(cells=40, seed=3)
NAMES = [TAXONOMY.by_code(code).name for code in CITY.present_codes.tolist()]
SEEN = np.bincount(CITY.codes, minlength=256)[CITY.present_codes] / len(CITY)


def change(name: str, before: int, **counts: float) -> ClassChange:
    none = {"after": 0, "added": 0, "removed": 0, "moved": 0, "gained": 0, "lost": 0}
    values: dict[str, Any] = {**none, "moved_m": None, **counts}
    return ClassChange(class_name=name, before=before, **values)


MANY = 10**9  # objects, so that no class rate is shrunk
HALVED = Drift(
    years=2.0,
    classes=tuple(
        change(name, MANY, removed=MANY // 2, added=MANY // 10, moved=MANY // 5, moved_m=2.0)
        for name in NAMES
    ),
)
LEAPT = Drift(
    years=2.0, classes=tuple(change(name, MANY, moved=MANY // 2, moved_m=20.0) for name in NAMES)
)


def test_map_age_changes_misses_clutter_and_sigma() -> None:
    spec = NoiseSpec(detection=0.8, clutter=2.0, position_sigma=1.0)
    aged = aged_noise(spec, 4.0, database=CITY, drift=HALVED)
    assert isinstance(aged, NoiseSpec)
    assert [aged.detection_by_class[name] for name in NAMES] == pytest.approx([0.2] * len(NAMES))
    clutter = aged.clutter * np.array([aged.clutter_shares[name] for name in NAMES])
    assert clutter == pytest.approx(2.0 / len(NAMES) + 0.2 * SEEN)
    assert aged.position_sigma == pytest.approx((1.0 + 0.36 * 4.0 / np.log(4.0)) ** 0.5)
    assert aged.name == "4-year-old map with custom"
    far = aged_noise(spec, 2.0, database=CITY, drift=LEAPT)
    assert isinstance(far, NoiseSpec)
    assert far.position_sigma == 1.0
    assert far.detection_by_class[NAMES[0]] == pytest.approx(0.4)
    assert far.clutter == pytest.approx(2.0 + 0.5 * SEEN.sum())


def test_age_changes_every_model_of_a_mixture_and_age_zero_none() -> None:
    generic = named_noise("generic")
    aged = aged_noise(generic, 1.5, database=CITY)
    assert (aged.name, aged.weights) == ("1.5-year-old map with generic", generic.weights)
    assert [spec.name for spec in aged.specs] == ["light", "medium", "strong"]
    assert aged_noise(generic, 0.0, database=CITY) is generic


def test_rates_of_small_classes_are_shrunk_to_the_overall_rate() -> None:
    few = Drift(years=1.0, classes=(change(NAMES[0], 2), change(NAMES[1], 90, removed=46)))
    aged = aged_noise(NoiseSpec(detection=1.0), 1.0, database=CITY, drift=few)
    assert isinstance(aged, NoiseSpec)
    removals = 1.0 - np.array([aged.detection_by_class[name] for name in NAMES[:3]])
    assert removals == pytest.approx([8 * 0.5 / 10, (46 + 8 * 0.5) / 98, 0.5])


def test_fresh_noise_is_the_inverse_of_aged_noise() -> None:
    spec = NoiseSpec(detection=0.8, clutter=2.0)
    aged = aged_noise(spec, 3.0, database=CITY)
    assert isinstance(aged, NoiseSpec)
    fresh = fresh_noise(aged, 3.0, database=CITY)
    assert fresh.detection == pytest.approx(0.8)
    assert fresh.detection_by_class == pytest.approx(dict.fromkeys(NAMES, 0.8))
    assert fresh.clutter == pytest.approx(2.0)
    clear = fresh_noise(NoiseSpec(detection=0.9, clutter=0.0), 50.0, database=CITY, drift=HALVED)
    assert max(clear.detection_by_class.values()) < 1.0
    assert 0.0 < clear.clutter < 0.01
    assert fresh_noise(spec, 0.0, database=CITY) is spec


def test_ranges_and_fading_do_not_age() -> None:
    fading = {"all": ((10.0, 1.0), (30.0, 0.4)), NAMES[0]: ((5.0, 0.9), (30.0, 0.1))}
    fields: dict[str, Any] = {
        "fading": fading,
        "range_sigma": 0.3,
        "range_sigma_by_class": {NAMES[1]: 0.5},
    }
    spec = NoiseSpec(detection=0.8, clutter=2.0, **fields)
    aged = aged_noise(spec, 3.0, database=CITY)
    assert isinstance(aged, NoiseSpec)
    for noise in (aged, fresh_noise(aged, 3.0, database=CITY), cell_noise(aged, 10.0)):
        assert {name: getattr(noise, name) for name in fields} == fields


def test_the_built_in_drift_has_classes_of_the_catalogue() -> None:
    drift = named_drift()
    names = {item.name for item in load_catalog("openstreetmap").taxonomy.classes}
    assert {item.class_name for item in drift.classes} <= names
    assert drift.years == 1.24


def test_a_drift_is_read_from_json_and_toml(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        'years = 2\nclasses = [{ class_name = "bench", before = 5, moved = 1, moved_m = 1.5 }]'
    )
    drift = open_drift(tmp_path / "a.toml")
    assert drift == Drift(years=2, classes=(change("bench", 5, moved=1, moved_m=1.5),))
    report = {"years": 2, "share": 0.1, "classes": [dataclasses.asdict(drift.classes[0])]}
    (tmp_path / "a.json").write_text(json.dumps(report))
    assert open_drift(tmp_path / "a.json") == drift


BENCH = {"class_name": "bench", "before": 5}


@pytest.mark.parametrize(
    ("values", "fault"),
    [
        ([], "drift.json is []; give a table"),
        ({"years": 1, "classes": {}}, "has classes = {}; give a list"),
        ({"classes": [BENCH]}, "lacks the key 'years'; add it"),
        ({"years": "two", "classes": [BENCH]}, "has years = 'two'; give years above 0"),
        ({"years": 0, "classes": [BENCH]}, "has years = 0; give years above 0 and up to 100"),
        ({"years": 1e9, "classes": [BENCH]}, "years above 0 and up to 100"),
        ({"years": 1, "classes": [{"class_name": "bench"}]}, "class 1 lacks the key 'before'"),
        ({"years": 1, "classes": ["bench"]}, "class 1 is 'bench'; give a table"),
        (
            {"years": 1, "classes": [{**BENCH, "addded": 1}]},
            "the nearest is 'added'; the keys are class_name, before",
        ),
        (
            {"years": 1, "classes": [{**BENCH, "class_name": 3}]},
            "class 1 has class_name = 3; give a string",
        ),
        (
            {"years": 1, "classes": [{**BENCH, "added": 0.5}]},
            "class 1 has added = 0.5; give a whole number",
        ),
        (
            {"years": 1, "classes": [{**BENCH, "removed": -1}]},
            "class 1 has removed = -1; give a whole number",
        ),
        ({"years": 1, "classes": [{**BENCH, "removed": 6}]}, "than the 5 there were before"),
        ({"years": 1, "classes": [{**BENCH, "moved": 1}]}, "lacks moved_m; give metres"),
        (
            {"years": 1, "classes": [{**BENCH, "moved_m": 1e9}]},
            "moved_m = 1000000000.0; give metres from 0 to 1,000,000",
        ),
        ({"years": 1, "classes": [{**BENCH, "before": 0}]}, "has no objects from before"),
    ],
)
def test_invalid_drifts_are_refused(tmp_path: Path, values: object, fault: str) -> None:
    (tmp_path / "drift.json").write_text(json.dumps(values))
    with refused(InputError, fault):
        open_drift(tmp_path / "drift.json")


@pytest.mark.parametrize("years", [-1.0, 100.5, float("nan"), float("inf")])
def test_an_age_out_of_its_range_is_refused(years: float) -> None:
    for change_noise in (aged_noise, fresh_noise):
        with refused(InputError, "give years from 0 to 100"):
            change_noise(NoiseSpec(), years, database=CITY)


def test_chances_on_an_old_map_are_calibrated_with_its_age() -> None:
    """Objects go, come and move, one by one and whole rows, by other rules than the model has."""
    layers = synthetic_city(CitySpec(size=500.0, seed=3))
    old, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    new = later_city(old, 3, seed=9)
    year = compare_objects(old, later_city(old, 1, seed=10))
    database, now = build_database(old), build_database(new)
    spec = QuerySpec(number=70, seen_from="anywhere", distortions=parse_chain("light"))
    queries = draw_queries(database, spec, store=ObjectStore.of(new), city=now)
    shares, counts = [], []
    for years in (0.0, 3.0):
        drift = Drift(years=1.0, classes=year.classes)
        noise = aged_noise(named_noise("generic"), years, database=database, drift=drift)
        index = build_index(database, cell_noise(noise, database.grid.step))
        outcomes = score_queries(database, LikelihoodLocator(index=index), queries)
        table = scored_tables(database, queries, outcomes)[1]
        sure = table["right"][table["chance"] >= 0.9]
        shares.append(sure.mean())
        counts.append(len(sure))
    assert shares[0] < 0.9 <= shares[1], (shares, counts)
    assert counts[1] > counts[0] / 2
