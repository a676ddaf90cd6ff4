"""Areas: bounding boxes, files of polygons, and clipping of layers."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import shapely
from geojson import collection, feature
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod
from raw_layers import raw_layer
from sentences import refused

from semsig_gis.core import CrsError, InputError, SemsigError
from semsig_gis.sources import (
    RawLayer,
    RowCounts,
    clip_layer,
    clip_layers,
    clip_to_extents,
    join_areas,
    names_place,
    note_outside,
    parse_area,
)

if TYPE_CHECKING:
    from pathlib import Path


BOX = (3.8, 43.5, 3.9, 43.7)


def write(folder: Path, *geometries: shapely.Geometry | None, crs: str | None = "EPSG:4326") -> str:
    path = folder / "quarter.gpkg"
    gpd.GeoDataFrame(geometry=list(geometries), crs=crs).to_file(path)
    return str(path)


@given(
    st.floats(-180, 179, allow_subnormal=False),
    st.floats(-90, 89, allow_subnormal=False),
    st.floats(0.001, 1),
    st.floats(0.001, 1),
)
def test_bounding_box_is_parsed(west: float, south: float, width: float, height: float) -> None:
    bounds = (west, south, west + width, south + height)
    area = parse_area(",".join(map(repr, bounds)))
    assert area.bounds == bounds
    assert area.polygon.equals(shapely.box(*bounds))


@pytest.mark.parametrize(
    ("text", "boxes"),
    [
        ("179.9,-17,-179.8,-16", [(179.9, -17, 180, -16), (-180, -17, -179.8, -16)]),
        ("180,-17,-179.8,-16", [(-180, -17, -179.8, -16)]),
        ("179.9,-17,-180,-16", [(179.9, -17, 180, -16)]),
        ("-10,-17,60,-16", [(-10, -17, 60, -16)]),
        ("-180,-90,180,90", [(-180, -90, 180, 90)]),
    ],
)
def test_bounding_box_may_cross_180_degrees(
    text: str, boxes: list[tuple[float, float, float, float]]
) -> None:
    area = parse_area(text)
    assert list(area.boxes) == boxes
    assert area.polygon.equals(shapely.union_all([shapely.box(*box) for box in boxes]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,2,3", "is not four numbers"),
        ("1,2,3,4,5", "is not four numbers"),
        ("1 2 3", "is not four numbers"),
        ("2.4,48.8,2.3,48.9", "west below east"),
        ("10,48,-170,49", "across 180 degrees"),
        ("190,48,-170,49", "across 180 degrees"),
        ("2.3,48.9,2.4,48.8", "south below north"),
        ("600000,6800000,600100,6800100", "in degrees"),
        ("2.3,48.8,2.3,48.9", "is not an area"),
        ("Helsinki", "neither a bounding box nor a file"),
        ("nan,1,2,3", "neither a bounding box nor a file"),
    ],
)
def test_invalid_area_is_refused(text: str, words: str) -> None:
    with refused(InputError, words):
        parse_area(text)


def test_place_names_are_distinguished_from_files(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    assert names_place("Saint-Denis, La Réunion")
    assert names_place("19th arrondissement")
    assert not names_place("nowhere.gpkg")
    assert not names_place("-1.5,2,3e0,4")
    assert not names_place(str(tmp_path / "plain"))


def test_polygons_of_a_file_are_joined(tmp_path: Path) -> None:
    east = shapely.box(3.9, 43.5, 4.0, 43.7)
    area = parse_area(write(tmp_path, shapely.box(*BOX), east, shapely.box(5, 5, 6, 6), None))
    assert area.name == "quarter"
    assert isinstance(area.polygon, shapely.MultiPolygon)
    assert len(area.polygon.geoms) == 2
    assert area.bounds == (3.8, 5, 6, 43.7)
    assert join_areas(np.array([shapely.Point(1, 2)])) is None


def test_area_of_a_table_of_polygons() -> None:
    table = gpd.GeoDataFrame(geometry=[shapely.box(*BOX)], crs="EPSG:4326")
    assert parse_area(table.to_crs(2154)).bounds == pytest.approx(BOX, abs=1e-6)
    with refused(InputError, "the table contains Point", "give a table of polygons"):
        parse_area(table.set_geometry(shapely.centroid(table.geometry.array)))
    with refused(CrsError, "the table has no coordinate reference system"):
        parse_area(table.set_crs(None, allow_override=True))


def test_polygon_is_transformed_to_degrees_and_made_valid(tmp_path: Path) -> None:
    box = gpd.GeoSeries([shapely.box(*BOX)], crs="EPSG:4326").to_crs(2154)
    area = parse_area(write(tmp_path, box.iloc[0], crs="EPSG:2154"))
    assert area.bounds == pytest.approx(BOX, abs=1e-6)
    bow = shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])
    area = parse_area(write(tmp_path, bow))
    assert area.polygon.is_valid
    assert area.polygon.area == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        (shapely.Point(3, 43), "contains Point"),
        (shapely.LineString([(3, 43), (4, 43)]), "contains LineString"),
        (None, "contains nothing"),
        (shapely.Polygon([(0, 0), (1, 1), (0, 0)]), "encloses no area"),
    ],
)
def test_file_without_area_is_refused(
    tmp_path: Path, geometry: shapely.Geometry | None, words: str
) -> None:
    with refused(InputError, words, "give a file of polygons"):
        parse_area(write(tmp_path, geometry))


def test_unreadable_polygon_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "quarter.geojson"
    with refused(SemsigError, "does not exist"):
        parse_area(str(path))
    broken = feature({"type": "Polygon", "coordinates": 5}, {})
    path.write_text(json.dumps(collection([broken])))
    with refused(InputError, "polygons that cannot be read", "correct the file"):
        parse_area(str(path))
    with refused(CrsError, "not degrees", "ogr2ogr -s_srs"):
        parse_area(unstated(tmp_path, shapely.box(770000, 6280000, 771000, 6281000)))
    poly = tmp_path / "quarter.poly"
    for text, words in (
        ("", "encloses no area"),
        ("quarter\n1\n 3.8 43.5\n 3.9 43.5\nEND\nEND\n", "at least three corners"),
        ("quarter\n1\n 3.8 43.5 9\nEND\nEND\n", "line 3"),
        ("quarter\n1\n 770000 6280000\n 771000 6280000\n 771000 6281000\nEND\n", "not degrees"),
    ):
        poly.write_text(text)
        with refused(SemsigError, str(poly), words):
            parse_area(str(poly))


def unstated(folder: Path, shape: shapely.Geometry) -> str:
    """Write a polygon as text of a table, which states no CRS."""
    path = folder / "quarter.csv"
    path.write_text(f"id;wkt\n1;{shapely.to_wkt(shape, rounding_precision=-1)}\n")
    return str(path)


def test_file_without_crs_is_in_degrees(tmp_path: Path) -> None:
    assert parse_area(unstated(tmp_path, shapely.box(*BOX))).bounds == BOX


def test_area_may_be_a_closed_line_and_the_only_layer_of_polygons(tmp_path: Path) -> None:
    places = write(tmp_path, shapely.Point(3.85, 43.6))
    line = shapely.LineString(shapely.box(*BOX).exterior.coords)
    outline = gpd.GeoDataFrame(geometry=[line], crs="EPSG:4326")
    outline.to_file(tmp_path / "outline.gpkg")
    assert parse_area(str(tmp_path / "outline.gpkg")).bounds == BOX
    square = gpd.GeoDataFrame(geometry=[shapely.box(*BOX)], crs="EPSG:4326")
    square.to_file(places, layer="square")
    assert parse_area(places).bounds == BOX
    square.to_file(places, layer="other")
    with refused(InputError, "2 layers of polygons", "ogr2ogr area.gpkg quarter.gpkg square"):
        parse_area(places)


RING = """
1
   {0} {1}
   {2} {1}
   {2} {3}
   {0} {3}
END
"""


def test_poly_file_has_rings_and_holes(tmp_path: Path) -> None:
    rings = [(0, 0, 4, 4), (1, 1, 3, 3), (6.5e0, 0, 7, 1)]
    outer, hole, other = (RING.format(*ring) for ring in rings)
    path = tmp_path / "quarter.poly"
    path.write_text(f"quarter{outer}{hole.replace('1', '!2', 1)}{other}END\n")
    area = parse_area(str(path))
    first, second, third = (shapely.box(*ring) for ring in rings)
    assert area.polygon.equals(shapely.union(shapely.difference(first, second), third))
    assert area.name == "quarter"


@given(
    st.tuples(st.floats(2, 60), st.floats(-70, -12)),
    st.tuples(st.floats(0.01, 1), st.floats(0.01, 1)),
    st.sampled_from(["wsen", "swne", "nesw", "snwe", "nsew", "wesn", "ewns", "wnes", "senw"]),
)
def test_box_in_another_order_is_noticed(
    corner: tuple[float, float], size: tuple[float, float], order: str
) -> None:
    """The box is written out, in the refusal or where the objects are known to be elsewhere."""
    west, south = (round(side, 3) for side in corner)
    east, north = round(west + size[0], 3), round(south + size[1], 3)
    sides = {"w": west, "s": south, "e": east, "n": north}
    text = ",".join(f"{sides[side]:.10g}" for side in order)
    right = f"{west:.10g},{south:.10g},{east:.10g},{north:.10g}"
    middle = ((west + east) / 2, (south + north) / 2)
    layer = benches(middle, middle)
    try:
        (clipped,) = clip_layers([layer], text)
    except InputError as error:
        assert right in str(error)  # noqa: PT017 - either is right
    else:
        assert len(clipped) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("60,24.9,60.1,25.1", ["would be right with latitude and longitude exchanged",
                               "24.9,60,25.1,60.1"]),
        ("2.3,48.8,2.4,48.9", ["near Paris, France", "near Helsinki, Finland", "1,9"]),
    ],
)  # fmt: skip
def test_area_elsewhere_is_refused(text: str, words: list[str], tmp_path: Path) -> None:
    layer = benches((24.95, 60.05), (24.94, 60.15))
    west, south, east, north = map(float, text.split(","))
    box = shapely.box(west, south, east, north)
    for area in (text, unstated(tmp_path, box), gpd.GeoDataFrame(geometry=[box], crs=4326)):
        with refused(InputError, "elsewhere" if "near" in words[0] else "somewhere else", *words):
            clip_layers([layer], area)


@pytest.mark.parametrize(
    ("role", "ids"), [("objects", ["1", "none"]), ("streets", ["1", "2", "none"])]
)
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:2154"])
def test_layer_is_clipped(role: str, ids: list[str], crs: str) -> None:
    inside = shapely.LineString([(3.81, 43.6), (3.82, 43.6)])
    across = shapely.LineString([(3.89, 43.6), (4.2, 43.6)])
    outside = shapely.LineString([(4.1, 43.6), (4.2, 43.6)])
    lines = [inside, across, outside, None]
    layer = raw_layer(lines, ids=["1", "2", "3", "none"], crs="EPSG:4326", filtered=5)
    spec = replace(layer.spec, role=role, geometry="line")  # type: ignore[arg-type]
    table = layer.table.to_crs(crs)
    layer = RawLayer(spec=spec, counts=layer.counts, table=table)
    clipped = clip_layer(layer, parse_area(",".join(map(str, BOX))))
    assert clipped.table["source_id"].tolist() == ids
    assert clipped.table.index.tolist() == list(range(len(ids)))
    assert clipped.table.crs == crs
    assert clipped.counts == RowCounts(read=9, filtered=5, outside=4 - len(ids))


def test_line_is_clipped_by_its_centroid_in_metres() -> None:
    # At 60 degrees north, a degree to the east is half as long as one to the north.
    line = shapely.LineString([(25.0, 60.0), (25.0, 60.001), (25.002, 60.001)])
    layer = raw_layer([line], crs="EPSG:4326")
    for east, count in ((25.00051, 1), (25.00049, 0)):
        assert len(clip_layer(layer, parse_area(f"24,59,{east},61")).table) == count


def benches(
    *places: tuple[float, float], extent: str | None = None, role: str = "objects"
) -> RawLayer:
    """Return a layer of points or small houses; `extent` is the box that its file states."""
    points = shapely.points(places)
    shapes = points if role == "objects" else shapely.buffer(points, 0.001)
    layer = raw_layer(shapes.tolist(), name="benches", classes="bench", crs="EPSG:4326")
    spec = replace(layer.spec, role=role)  # type: ignore[arg-type]
    return replace(layer, spec=spec, extent=parse_area(extent) if extent else None)


def test_rows_outside_the_box_of_their_file_are_noted_and_clipped() -> None:
    places = ((25.0, 60.0), (25.1, 60.1), (25.12, 60.0), (25.1005, 60.0))
    layer = benches(*places, extent="24.9,59.9,25.1,60.1")
    (note,) = note_outside(layer).notes
    assert note.startswith("2 of 4 rows are outside the box that the file says it covers")
    metres = Geod(ellps="WGS84").inv(25.1, 60.0, 25.12, 60.0)[2]
    distance = float(note.partition("up to ")[2].removesuffix(" m").replace(",", ""))
    assert distance == pytest.approx(metres, rel=0.005)
    # A house that crosses the edge is inside.
    houses = benches(*places, extent="24.9,59.9,25.1,60.1", role="buildings")
    assert note_outside(houses).notes[0].startswith("1 of 4 rows")
    other = benches((25.12, 60.0), (25.2, 60.0))
    for count, clipped in zip((2, 3, 0), clip_layers([layer, houses, other], "box"), strict=True):
        assert (clipped.counts.kept, clipped.counts.outside) == (count, clipped.counts.read - count)
        assert note_outside(clipped).notes == ()
    unstated = benches((25.12, 60.0), (25.2, 60.0))
    layers, note = clip_to_extents([layer, houses, unstated])
    assert [clipped.counts.kept for clipped in layers] == [2, 3, 2]
    assert "3 rows" in note
    assert "--clip none" in note
    assert clip_to_extents([unstated])[1] == ""
    other = benches((25.12, 60.0), extent="25.11,59.9,25.2,60.1")
    both = clip_layers([layer, other], "box")  # of both extracts
    assert [clipped.counts.kept for clipped in both] == [3, 1]
    (clipped,) = clip_layers([layer], "25.05,59.9,25.2,60.2")
    assert (clipped.counts.kept, clipped.counts.outside) == (3, 1)
    assert note_outside(clipped).notes[0].startswith("2 of 3 rows")


def test_clip_to_box_is_refused_without_a_stated_box() -> None:
    with refused(InputError, "none of the files", "'box'", "west,south,east,north"):
        clip_layers([benches((25.0, 60.0))], "box")
