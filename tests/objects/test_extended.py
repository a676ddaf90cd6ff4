"""Lines and areas as points with a group, and the optional columns of street objects."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from osm_xml import node, relation, way
from raw_layers import catalog_of, raw_layer
from sentences import refused

from semsig_gis.core import CatalogError
from semsig_gis.objects import (
    assemble,
    build_objects,
    compare_objects,
    conflate,
    joined_tables,
    load,
    objects_from_frame,
    open_objects,
    quality_report,
    replace_layers,
    save_objects,
)
from semsig_gis.output import quality_sentence
from semsig_gis.sources import built_in_taxonomy, clip_layer, load_catalog, parse_area

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.objects import StreetObjects
    from semsig_gis.sources import RawLayer

TAXONOMY = built_in_taxonomy()
CATALOG = """
name = "town"
title = "Town"
reader = "osm_file"
files = ["*.osm"]
height_field = "height"
levels_field = "building:levels"
[texts]
name = "name"
house_number = "addr:housenumber"
[[layers]]
name = "rivers"
class = "river"
tags = [{ waterway = "river" }]
[[layers]]
name = "parks"
class = "park"
tags = [{ leisure = "park" }]
[[layers]]
name = "benches"
class = "bench"
tags = [{ amenity = "bench" }]
"""


def things(
    shapes: Sequence[shapely.Geometry], *, kind: str = "river", names: Sequence[str] = ()
) -> RawLayer:
    layer = raw_layer(shapes, classes=kind, name=kind)
    layer = replace(layer, spec=replace(layer.spec, extended=True))
    texts = list(names) or [""] * len(shapes)
    return replace(layer, columns=layer.columns.append_column("name", [texts]))


def build(*layers: RawLayer) -> StreetObjects:
    return build_objects(layers, taxonomy=TAXONOMY, crs="EPSG:2154")[0]


def groups_of(objects: StreetObjects) -> list[int]:
    assert objects.groups is not None
    rows = np.unique(objects.arrow["source_id"].to_numpy().astype(int), return_index=True)[1]
    groups: list[int] = objects.groups[rows].tolist()
    return groups


steps = st.tuples(st.integers(-40, 40), st.integers(-40, 40)).filter(any)
walks = st.lists(steps, min_size=1, max_size=6)


@settings(max_examples=15, deadline=None)
@given(walks)
def test_points_of_a_line_are_on_it_and_at_most_five_metres_apart(
    walk: list[tuple[int, int]],
) -> None:
    line = shapely.LineString(np.cumsum([(0, 0), *walk], axis=0) / 4)
    objects = build(things([line]))
    points = shapely.points(objects.xy)
    assert shapely.distance(points, line).max() < 1e-6
    assert np.hypot(*np.diff(objects.xy, axis=0).T).max(initial=0) <= 5 + 1e-9
    assert objects.xy[0] == pytest.approx(line.coords[0])
    assert objects.xy[-1] == pytest.approx(line.coords[-1], abs=1e-6)
    assert set(groups_of(objects)) == {0}


def test_area_is_seen_at_all_its_rings_and_never_at_its_centroid() -> None:
    park = shapely.box(0, 0, 40, 40) - shapely.box(18, 18, 22, 22)
    objects = build(things([park, shapely.box(90, 0, 91, 1)], kind="park"))
    first = objects.xy[objects.arrow["source_id"].to_numpy() == "0"]
    assert len(first) == 32 + 4
    assert shapely.distance(shapely.points(first), park.boundary).max() < 1e-9
    assert groups_of(objects) == [0, 1]
    assert len(np.unique(objects.xy, axis=0)) == len(objects)


def test_lines_that_continue_each_other_are_one_thing() -> None:
    def line(*xy: tuple[float, float]) -> shapely.LineString:
        return shapely.LineString(xy)

    river = [line((0, 0), (9, 0)), line((20, 5), (9, 0)), line((9, 0), (9, 30))]
    assert groups_of(build(things(river, names=["Po", "Po", "Po"]))) == [0, 0, 0]
    assert groups_of(build(things(river, names=["Po", "Po", "Adda"]))) == [0, 0, 1]
    # Without a name, only two ends that meet are known to belong together.
    assert groups_of(build(things(river))) == [0, 1, 2]
    assert groups_of(build(things(river[:2]))) == [0, 0]
    # Areas that touch are several, and classes have things of their own.
    assert groups_of(build(things(river[:2], kind="park"))) == [0, 1]
    both = build(things(river[:2]), things(river[:2], kind="canal"))
    assert both.groups is not None
    assert len(np.unique(both.groups)) == 2


def test_points_keep_their_way_next_to_extended_things() -> None:
    benches = raw_layer([shapely.Point(0, 0), shapely.Point(0, 0)], name="seats", classes="bench")
    single, both = build(benches), build(benches, things([shapely.LineString([(0, 0), (0, 9)])]))
    assert single.groups is None
    assert both.arrow.select(single.arrow.column_names).slice(0, 1).equals(single.arrow)
    assert both.groups is not None
    assert both.groups.tolist() == [-1, 0, 0, 0]


def test_conflation_leaves_things_whole() -> None:
    line = shapely.LineString([(0, 0), (0, 30)])
    first, second = things([line]), things([shapely.transform(line, lambda xy: xy + 1.0)])
    second = replace(second, spec=replace(second.spec, name="other"))
    objects, report = conflate(build(first, second), {"river": 5.0})
    assert (report.count, len(objects)) == (0, 14)


def test_merged_object_gets_the_texts_that_the_other_one_lacks() -> None:
    places, classes = [shapely.Point(0, 0), shapely.Point(50, 0)], "bakery"
    first, second = (raw_layer(places, classes=classes, name=name) for name in ("a", "b"))
    texts = [["", "Brot"], ["Pain", "Pane"]]
    first, second = (
        replace(layer, columns=layer.columns.append_column("name", [column]))
        for layer, column in zip((first, second), texts, strict=True)
    )
    objects, _ = build_objects([first, second], taxonomy=TAXONOMY, crs="EPSG:2154",
                               apart=["bakery"])  # fmt: skip
    merged, report = conflate(objects, {"bakery": 5.0})
    assert report.count == 2
    assert merged.texts is not None
    assert merged.texts["name"].to_pylist() == ["Pain", "Brot"]


def test_river_of_two_merged_cities_is_one_thing() -> None:
    line = shapely.LineString([(0, 0), (0, 30)])
    shifted = shapely.LineString([(0, 2), (0, 40)])
    first = build(things([line]))
    second = build(things([shapely.LineString([(90, 0), (90, 30)]), shifted], names=["B", "A"]))
    table = second.table.assign(source_id=second.table["source_id"].map({"0": "7", "1": "0"}))
    joined = joined_tables(first.table, table)
    groups = joined.groupby("source_id")["group"].unique()
    assert groups["0"].tolist() == [0]
    assert groups["7"].tolist() == [1]


def test_clipped_line_ends_at_the_edge_of_the_area() -> None:
    degrees = [(2.0, 48.0), (2.02, 48.0)]
    layer = raw_layer([shapely.LineString(degrees)], classes="river", crs="EPSG:4326")
    layer = replace(layer, spec=replace(layer.spec, extended=True))
    area = parse_area("2.005,47.9,2.015,48.1")
    clipped = clip_layer(layer, area)
    assert clipped.geometry[0].bounds == pytest.approx((2.005, 48.0, 2.015, 48.0))
    # An area around everything is not seen from inside.
    around = raw_layer([shapely.box(1, 47, 3, 49)], classes="park", crs="EPSG:4326")
    around = replace(around, spec=replace(around.spec, extended=True))
    assert (len(clip_layer(around, area)), clip_layer(around, area).counts.outside) == (0, 1)


@pytest.fixture
def town(tmp_path: Path) -> tuple[Path, Path]:
    """Return a catalogue and an extract with a river of two ways, one of them incomplete."""
    (tmp_path / "town.toml").write_text(CATALOG, "utf-8")
    nodes = [node(number, 2.35 + 0.0001 * number, 48.85) for number in range(1, 8)]
    elements = [
        *nodes,
        way(1, [1, 2, 3], {"waterway": "river", "name": "Seine"}),
        way(2, [3, 4, 99], {"waterway": "river", "name": "Seine"}),
        way(3, [5, 6], {}),
        relation(1, {3: "outer", 77: "outer"}, {"type": "multipolygon", "leisure": "park"}),
        node(8, 2.3505, 48.8502, {"amenity": "bench", "name": "Repos", "height": "1.5 m"}),
        node(9, 2.3506, 48.8502, {"amenity": "bench", "building:levels": "2"}),
        node(10, 2.3507, 48.8502, {"amenity": "bench", "addr:housenumber": "12", "height": "x"}),
    ]
    file = tmp_path / "town.osm"
    file.write_text(f'<osm version="0.6">{"".join(elements)}</osm>', "utf-8")
    return tmp_path / "town.toml", file


def test_things_texts_and_heights_of_an_extract_are_kept(
    town: tuple[Path, Path], tmp_path: Path
) -> None:
    catalog, file = town
    objects = load(file, catalog=catalog).objects
    counts = {objects.taxonomy.by_code(code).name: n for code, n in objects.class_counts.items()}
    assert counts["bench"] == 3
    assert counts["river"] > 4
    assert counts["park"] == 3  # the known way of its outline
    assert objects.groups is not None
    assert objects.heights is not None
    assert objects.texts is not None
    assert len(np.unique(objects.groups)) == 3
    assert objects.heights[:3].tolist() == pytest.approx([1.5, 6.0, math.nan], nan_ok=True)
    assert objects.texts["name"].to_pylist()[:3] == ["Repos", "", ""]
    assert set(objects.texts["name"].to_pylist()[3:]) == {"Seine", ""}
    assert objects.texts["house_number"].to_pylist()[2] == "12"
    saved = tmp_path / "objects.parquet"
    save_objects(objects, saved, keep_order=True)
    again = open_objects(saved)
    assert again.table.equals(objects.table)
    back = objects_from_frame(
        again.to_geodataframe(), class_column="class_name", metric_crs=objects.crs
    )
    assert back.texts is not None
    assert back.texts.equals(objects.texts)
    assert back.groups is not None
    pairs = {*zip(back.groups.tolist(), objects.groups.tolist(), strict=True)}
    assert len(pairs) == 3  # the benches and two things
    # A layer that is loaded again gets groups that no other layer has.
    changed, _, _ = replace_layers(objects, load(file, catalog=catalog, layers=["rivers"]).objects)
    assert changed.groups is not None
    rivers = changed.codes == changed.taxonomy.by_name("river").code
    assert set(changed.groups[rivers]).isdisjoint(changed.groups[~rivers])
    assert changed.groups.dtype == np.int32


def test_file_without_optional_values_has_no_optional_columns(tmp_path: Path) -> None:
    save_objects(build(raw_layer([shapely.Point(0, 0)], classes="bench")), tmp_path / "a.parquet")
    names = pq.read_schema(tmp_path / "a.parquet").names
    assert names == ["class_code", "source", "source_id", "count", "geometry", "bbox"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "name"', 'nam = "name"', ["texts", "'nam'", "the nearest is 'name'"]),
        ('class = "park"', 'derive = "gaps"\nclass = "park"', ["derive", "class"]),
        ('class = "park"', 'derive = "corners"', ["'corners'", "building_corners"]),
        ('class = "park"', 'role = "streets"\nheight_field = "h"', ["streets", "height"]),
    ],
)
def test_wrong_key_is_refused(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    (tmp_path / "town.toml").write_text(CATALOG.replace(old, new, 1), "utf-8")
    with refused(CatalogError, *words):
        load_catalog(tmp_path / "town.toml")


def test_rivers_that_become_one_are_altered() -> None:
    lines = [shapely.LineString([(0, 0), (0, 20)]), shapely.LineString([(0, 20), (0, 40)])]
    apart, joined = (build(things(lines, names=names)) for names in (["Po", "Adda"], ["Po", "Po"]))
    changes = compare_objects(apart, joined)
    assert len(changes.altered) == len(changes.same) == len(apart)
    assert len(compare_objects(joined, joined).altered) == 0
    assert len(changes.obsolete_rows) == len(changes.new_rows) == len(apart)


def test_thing_is_one_object_of_a_report() -> None:
    line = shapely.LineString([(0, 0), (0, 100)])
    layer = things([line], names=["Po"])
    objects, load_report = build_objects([layer], taxonomy=TAXONOMY, crs="EPSG:2154")
    report = quality_report(objects, load_report)
    (river,) = report.classes
    assert (river.objects, river.points, river.rows, river.nearest_m) == (1, 21, 1, None)
    assert [(item.name, item.objects) for item in report.texts] == [("name", 21)]
    assert "1 extended thing as 21 points" in quality_sentence(report)


def test_landmarks_that_no_layer_has_are_no_classes() -> None:
    catalog = catalog_of(taxonomy=TAXONOMY, conflate=(("church_tower", 5.0),))
    for kind, there in (("bench", False), ("church_tower", True)):
        places = [shapely.Point(600_000 + 9 * row, 6_800_000) for row in range(4)]
        loaded = assemble([raw_layer(places, classes=kind)], catalog)
        names = {item.name for item in loaded.objects.taxonomy.classes}
        assert ("church_tower" in names) is there
        assert "minaret" not in names
