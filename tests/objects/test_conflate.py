from __future__ import annotations

import dataclasses
import itertools
import math
from collections import Counter
from statistics import median
from typing import TYPE_CHECKING

import pytest
from geopandas.testing import assert_geodataframe_equal
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused
from worlds import TAXONOMY, objects_of

from semsig_gis.core import InputError, UnknownNameError
from semsig_gis.objects import Licence, build_objects, conflate, open_objects, save_objects
from semsig_gis.sources import load_catalog, read_layer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from semsig_gis.objects import ConflationReport, StreetObjects

LICENCES = (Licence("A (CC0)", ("a",)), Licence("B (ODbL)", ("b",)))

# class, source, identifier, count, x, y
Thing = tuple[str, str, str, int, float, float]


def code_of(thing: Thing) -> int:
    return TAXONOMY.by_name(thing[0]).code


def world(things: Sequence[Thing]) -> StreetObjects:
    placed = [(*thing[4:], code_of(thing), *thing[1:3]) for thing in things]
    return objects_of(*placed, licenses=LICENCES, count=[thing[3] for thing in things])


def content(objects: StreetObjects) -> list[tuple[object, ...]]:
    """Return what is in the table, row by row."""
    columns = ["class_code", "source", "source_id", "count", "merged"]
    rows = objects.table[columns].to_numpy().tolist()
    return [(*row, *place) for row, place in zip(rows, objects.xy.tolist(), strict=True)]


def bench(source: str, name: str, x: float, y: float = 0.0) -> Thing:
    return ("bench", source, name, 1, x, y)


THINGS = st.lists(
    st.tuples(
        st.sampled_from(["bench", "bus_stop", "street_light"]),
        st.sampled_from(["a", "b", "c"]),
        st.sampled_from("0123456789"),
        st.integers(1, 3),
        st.integers(0, 6).map(float),
        st.integers(0, 3).map(float),
    ),
    min_size=1,
    max_size=25,
)
RADII = st.dictionaries(st.sampled_from(["bench", "bus_stop"]), st.sampled_from([1.0, 1.5, 3.0]))


def by_hand(
    things: Sequence[Thing], radii: Mapping[str, float]
) -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    """Merge by searching all pairs repeatedly; return the remaining objects and the report."""
    sources = list(dict.fromkeys(source for _, source, *_ in things))
    counts = [count for _, _, _, count, *_ in things]
    merged: list[list[str]] = [[] for _ in things]
    remaining = list(range(len(things)))
    report: list[tuple[object, ...]] = []

    def order(row: int) -> tuple[object, ...]:
        _, source, name, count, x, y = things[row]
        return sources.index(source), x, y, name, count

    for name, radius in radii.items():
        metres_of: dict[tuple[int, int], list[float]] = {}
        for number, source in enumerate(sources):
            of_class = [row for row in remaining if things[row][0] == name]
            new = [row for row in of_class if things[row][1] == source]
            old = [row for row in of_class if things[row][1] in sources[:number]]
            while near := [
                (metres, order(first), order(second), first, second)
                for first, second in itertools.product(old, new)
                if (metres := math.dist(things[first][4:], things[second][4:])) <= radius
            ]:
                metres, *_, first, second = min(near)
                old.remove(first)
                new.remove(second)
                remaining.remove(second)
                counts[first] += counts[second]
                merged[first].append(f"{source}:{things[second][2]}")
                metres_of.setdefault((sources.index(things[first][1]), number), []).append(metres)
        report += [
            (name, radius, sources[first_source], sources[number], len(far), median(far), max(far))
            for (first_source, number), far in sorted(metres_of.items())
        ]
    return [
        (code_of(things[row]), *things[row][1:3], counts[row], "; ".join(merged[row]),
         *things[row][4:])
        for row in remaining
    ], report  # fmt: skip


def check(things: Sequence[Thing], radii: Mapping[str, float]) -> ConflationReport:
    before = world(things)
    table = before.table.copy()
    objects, report = conflate(before, radii)
    assert_geodataframe_equal(before.table, table)
    rows, pairs = by_hand(things, radii)
    # The identifier and the count of a merged row come from its source, so its licence holds.
    assert objects.licenses == before.licenses
    assert objects.table.drop(columns="merged").dtypes.equals(before.table.dtypes)
    assert report.count == sum(pair.count for pair in report.pairs)
    # Rows with equal values are interchangeable.
    assert sorted(content(objects)) == sorted(rows)
    for pair, expected in zip(report.pairs, pairs, strict=True):
        assert dataclasses.astuple(pair) == pytest.approx(expected)
    return report


@given(THINGS, RADII)
@settings(max_examples=80)
def test_result_equals_a_simple_implementation(
    things: list[Thing], radii: dict[str, float]
) -> None:
    check(things, radii)


@pytest.mark.parametrize(
    ("radii", "error", "words"),
    [
        *(
            ({"bench": radius}, InputError, ("'bench'", repr(radius), "above 0 and below 100"))
            for radius in (0, -1, 100, math.nan, math.inf)
        ),
        ({"banch": 5.0}, UnknownNameError, ("'banch'", "'bench'")),
    ],
)
def test_invalid_radii_are_refused(
    radii: dict[str, float], error: type[Exception], words: tuple[str, ...]
) -> None:
    with refused(error, *words):
        conflate(world([bench("a", "1", 0)]), radii)


def test_conflating_twice_is_refused() -> None:
    # What was remaining over for want of a partner would find one of a source already merged.
    things = [bench("a", "1", 0), bench("b", "2", 0), bench("b", "3", 1)]
    objects, _ = conflate(world(things), {"bench": 5.0})
    with refused(InputError, "conflated already", "all sources at once"):
        conflate(objects, {"bench": 5.0})


def test_merged_sources_are_stored_in_the_file(tmp_path: Path) -> None:
    before = world([bench("a", "1", 0), bench("b", "é;2", 1), bench("b", "3", 50)])
    after, _ = conflate(before, {"bench": 5.0})
    for objects, merged in ((before, None), (after, ["b:é;2", ""])):
        save_objects(objects, tmp_path / "objects.parquet")
        again = open_objects(tmp_path / "objects.parquet").table
        assert_geodataframe_equal(again, objects.table)
        assert (again["merged"].tolist() if "merged" in again else None) == merged


def test_disabled_bays_in_two_layers_are_merged(geodata: Path) -> None:
    catalog = load_catalog("montpellier")
    layers = [
        read_layer(geodata / "montpellier" / spec.files[0], spec, filters=False)
        for spec in map(catalog.layer, ("disabled_bays", "reserved_bays"))
    ]
    objects, _ = build_objects(layers, taxonomy=TAXONOMY, crs=catalog.metric_crs or "")
    columns = (objects.table[name] for name in ("source", "source_id", "count"))
    things = [
        (TAXONOMY.by_code(code).name, *more)
        for code, *more in zip(objects.codes, *columns, *objects.xy.T.tolist(), strict=True)
    ]
    bays = Counter(source for name, source, *_ in things if name == "disabled_bay")
    assert bays["disabled_bays"] == 477
    (pair,) = check(things, {"disabled_bay": 10.0}).pairs
    assert (pair.kept, pair.merged) == ("disabled_bays", "reserved_bays")
    assert 0.4 < pair.count / bays["reserved_bays"] < 0.6  # about half of them
