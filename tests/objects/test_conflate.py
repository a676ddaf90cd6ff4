from __future__ import annotations

import dataclasses
import itertools
import math
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from geopandas.testing import assert_geodataframe_equal
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.objects.conflate import ConflatedPair, ConflationReport, conflate
from semsig_gis.objects.load import build_objects
from semsig_gis.objects.table import Licence, StreetObjects, open_objects, save_objects
from semsig_gis.sources.catalog import load_catalog, paper_taxonomy
from semsig_gis.sources.vector import read_layer

if TYPE_CHECKING:
    import random
    from collections.abc import Mapping, Sequence
    from pathlib import Path

TAXONOMY = paper_taxonomy()
LICENCES = (Licence("A (CC0)", ("a",)), Licence("B (ODbL)", ("b",)))

# class, source, identifier, count, x, y
Thing = tuple[str, str, str, int, float, float]


def code_of(thing: Thing) -> int:
    return TAXONOMY.by_name(thing[0]).code


def world(things: Sequence[Thing]) -> StreetObjects:
    _, sources, ids, counts, x, y = zip(*things, strict=True)
    table = gpd.GeoDataFrame(
        {
            "class_code": np.array([code_of(thing) for thing in things], np.uint8),
            "source": np.array(sources, dtype=object),
            "source_id": np.array(ids, dtype=object),
            "count": np.array(counts, np.int32),
        },
        geometry=shapely.points(x, y),
        crs="EPSG:2154",
    )
    return StreetObjects(table, TAXONOMY, LICENCES)


def content(objects: StreetObjects) -> list[tuple[object, ...]]:
    """Return what is in the table, row by row."""
    columns = ["class_code", "source", "source_id", "count", "merged"]
    rows = objects.table[columns].to_numpy().tolist()
    return [(*row, *place) for row, place in zip(rows, objects.xy.tolist(), strict=True)]


def bench(source: str, name: str, x: float, y: float = 0.0) -> Thing:
    return ("bench", source, name, 1, x, y)


def test_the_same_object_in_two_sources_is_one() -> None:
    objects, report = conflate(
        world([bench("city", "1", 0), bench("osm", "node/7", 3, 4), bench("osm", "node/8", 50)]),
        {"bench": 5.0},
    )
    assert content(objects) == [
        (10, "city", "1", 2, "osm:node/7", 0.0, 0.0),
        (10, "osm", "node/8", 1, "", 50.0, 0.0),
    ]
    types = objects.table.drop(columns="geometry").dtypes.astype(str).to_dict()
    assert (types["count"], types["class_code"]) == ("int32", "uint8")
    assert list(types) == ["class_code", "source", "source_id", "count", "merged"]
    assert objects.table.index.tolist() == [0, 1]
    assert objects.crs.to_epsg() == 2154
    # The identifier and the count of the merged row come from its source, so its licence holds.
    assert objects.licenses == LICENCES
    pair = ConflatedPair(
        class_name="bench", radius=5.0, kept="city", merged="osm",
        count=1, median_m=5.0, largest_m=5.0,
    )  # fmt: skip
    assert report == ConflationReport((pair,))
    assert report.count == 1


def test_pairs_of_sources_are_reported_apart() -> None:
    things = [
        bench("a", "1", 0),
        bench("a", "2", 100),
        bench("b", "3", 1),
        bench("b", "4", 102),
        bench("b", "5", 200),
        bench("c", "6", 203),
        ("bus_stop", "b", "7", 1, 0.0, 0.0),
        ("bus_stop", "c", "8", 1, 0.0, 0.0),
    ]
    _, report = conflate(world(things), {"bus_stop": 1.0, "bench": 5, "automatic_wc": 9})
    assert [dataclasses.astuple(pair) for pair in report.pairs] == [
        ("bus_stop", 1.0, "b", "c", 1, 0.0, 0.0),
        ("bench", 5.0, "a", "b", 2, 1.5, 2.0),
        ("bench", 5.0, "b", "c", 1, 3.0, 3.0),
    ]
    assert report.count == 4


def test_nothing_to_merge_is_no_error() -> None:
    for radii in ({}, {"automatic_wc": 5.0}, {"bench": 5.0}):
        objects, report = conflate(world([bench("a", "1", 0)]), radii)
        assert content(objects) == [(10, "a", "1", 1, "", 0.0, 0.0)]
        assert report.count == 0


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


def by_hand(things: Sequence[Thing], radii: Mapping[str, float]) -> list[tuple[object, ...]]:
    """Merge by looking at all pairs again and again."""
    sources = list(dict.fromkeys(source for _, source, *_ in things))
    counts = [count for _, _, _, count, *_ in things]
    merged: list[list[str]] = [[] for _ in things]
    left = list(range(len(things)))

    def order(row: int) -> tuple[object, ...]:
        _, source, name, count, x, y = things[row]
        return sources.index(source), x, y, name, count

    for (name, radius), source in itertools.product(radii.items(), sources):
        of_class = [row for row in left if things[row][0] == name]
        new = [row for row in of_class if things[row][1] == source]
        earlier = sources[: sources.index(source)]
        old = [row for row in of_class if things[row][1] in earlier]
        while near := [
            (metres, order(one), order(other), one, other)
            for one, other in itertools.product(old, new)
            if (metres := math.dist(things[one][4:], things[other][4:])) <= radius
        ]:
            *_, one, other = min(near)
            old.remove(one)
            new.remove(other)
            left.remove(other)
            counts[one] += counts[other]
            merged[one].append(f"{source}:{things[other][2]}")
    return [
        (code_of(things[row]), *things[row][1:3], counts[row], "; ".join(merged[row]),
         *things[row][4:])
        for row in left
    ]  # fmt: skip


@given(THINGS, RADII)
def test_the_fast_way_gives_what_the_slow_way_gives(
    things: list[Thing], radii: dict[str, float]
) -> None:
    objects, _ = conflate(world(things), radii)
    # Rows that are the same in every respect may stand for each other.
    assert sorted(content(objects)) == sorted(by_hand(things, radii))


@given(THINGS, RADII, st.randoms(use_true_random=False))
def test_the_order_of_rows_inside_a_source_does_not_matter(
    things: list[Thing], radii: dict[str, float], chance: random.Random
) -> None:
    shuffled = list(things)
    for name in {source for _, source, *_ in things}:
        places = [place for place, thing in enumerate(things) if thing[1] == name]
        moved = chance.sample(places, len(places))
        for place, other in zip(places, moved, strict=True):
            shuffled[place] = things[other]
    one, first = conflate(world(things), radii)
    two, second = conflate(world(shuffled), radii)
    assert sorted(content(one)) == sorted(content(two))
    assert first == second


@given(THINGS, RADII)
def test_every_row_is_accounted_for(things: list[Thing], radii: dict[str, float]) -> None:
    before = world(things)
    table = before.table.copy()
    objects, report = conflate(before, radii)
    assert_geodataframe_equal(before.table, table)
    assert len(objects) == len(before) - report.count
    assert objects.table["count"].sum() == before.table["count"].sum()
    named = [
        f"{source}:{name}"
        for source, name in zip(objects.table["source"], objects.table["source_id"], strict=True)
    ]
    for source, text in zip(objects.table["source"], objects.table["merged"], strict=True):
        merged = text.split("; ") if text else []
        named += merged
        sources = [source, *(entry.partition(":")[0] for entry in merged)]
        assert len(set(sources)) == len(sources)  # never two of one source
    assert sorted(named) == sorted(f"{source}:{name}" for _, source, name, *_ in things)


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
def test_bad_radii_are_refused(
    radii: dict[str, float], error: type[Exception], words: tuple[str, ...]
) -> None:
    with refused(error, *words):
        conflate(world([bench("a", "1", 0)]), radii)


def test_conflating_twice_is_refused() -> None:
    # What was left over for want of a partner would find one of a source already merged.
    things = [bench("a", "1", 0), bench("b", "2", 0), bench("b", "3", 1)]
    objects, _ = conflate(world(things), {"bench": 5.0})
    with refused(InputError, "conflated already", "all sources at once"):
        conflate(objects, {"bench": 5.0})


def test_provenance_is_kept_in_the_file(tmp_path: Path) -> None:
    before = world([bench("a", "1", 0), bench("b", "é;2", 1), bench("b", "3", 50)])
    after, _ = conflate(before, {"bench": 5.0})
    for objects, merged in ((before, None), (after, ["b:é;2", ""])):
        save_objects(objects, tmp_path / "objects.parquet")
        again = open_objects(tmp_path / "objects.parquet").table
        assert_geodataframe_equal(again, objects.table)
        assert (again["merged"].tolist() if "merged" in again else None) == merged


def test_disabled_bays_that_stand_in_two_layers(geodata: Path) -> None:
    catalog = load_catalog("montpellier")
    layers = []
    for name in ("disabled_bays", "reserved_bays"):
        spec = catalog.layer(name)
        (pattern,) = spec.files
        layers.append(read_layer(geodata / "montpellier" / pattern, spec, filters=False))
    objects, _ = build_objects(layers, taxonomy=catalog.taxonomy, crs=catalog.metric_crs or "")
    code = catalog.taxonomy.by_name("disabled_bay").code
    bays = objects.codes == code
    city, other = (
        objects.xy[bays & (objects.table["source"] == name).to_numpy()]
        for name in ("disabled_bays", "reserved_bays")
    )
    assert len(city) == 477
    merged, report = conflate(objects, {"disabled_bay": 10.0})
    (pair,) = report.pairs
    assert (pair.kept, pair.merged) == ("disabled_bays", "reserved_bays")
    assert len(merged) == len(objects) - pair.count
    # A plain loop over all pairs, nearest first.
    distance = np.hypot(*(city[:, None] - other[None]).transpose(2, 0, 1))
    near = sorted((distance[i, j], i, j) for i, j in zip(*np.nonzero(distance <= 10), strict=True))
    left: set[int] = set()
    right: set[int] = set()
    for _, i, j in near:
        if i not in left and j not in right:
            left.add(i)
            right.add(j)
    count = len(left)
    assert pair.count == count
    assert 0.4 < count / len(other) < 0.6  # about half of them
