from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from osm_xml import node, way, write_osm
from sentences import refused

from semsig_gis.core import InputError, SourceError
from semsig_gis.objects import licenses_of, read_area, read_surroundings, save_surroundings

if TYPE_CHECKING:
    from pathlib import Path

    Role = Literal["buildings", "streets", ""]

HOUSE = shapely.box(770_000, 6_280_000, 770_010, 6_280_010)
CRS = "EPSG:2154"


def write(path: Path, *shapes: shapely.Geometry | None) -> Path:
    table = gpd.GeoDataFrame({"n": range(len(shapes))}, geometry=list(shapes), crs=CRS)
    table = table.to_crs("EPSG:4326")
    table.to_parquet(path) if path.suffix == ".parquet" else table.to_file(path)
    return path


@pytest.mark.parametrize("name", ["houses.parquet", "houses.gpkg", "houses.geojson"])
def test_files_are_reprojected(tmp_path: Path, name: str) -> None:
    table = read_surroundings(write(tmp_path / name, HOUSE, None), role="buildings", crs=CRS)
    assert len(table) == 1
    assert table.geometry[0].hausdorff_distance(HOUSE) < 0.01
    area = read_area(write(tmp_path / name, HOUSE, HOUSE.buffer(5)), crs=CRS)
    assert area.area == pytest.approx(HOUSE.buffer(5).area, rel=1e-3)


def test_area_may_be_a_box_in_degrees() -> None:
    area = read_area("24.5,60,25.5,60.2", crs="EPSG:32635")
    south = gpd.GeoSeries(shapely.points([(25, 59.99999), (25, 60.00001)]), crs="EPSG:4326")
    inside = shapely.covers(area, south.to_crs("EPSG:32635").to_numpy())
    assert inside.tolist() == [False, True]  # though the edge is 190 m off a line in metres
    with refused(InputError, "west below east"):
        read_area("25,60,24,61", crs=CRS)


LYON = (842_500.0, 6_519_800.0, 842_800.0, 6_520_100.0)  # in the same CRS


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("area.csv", "id;wkt\n1;POLYGON (({1} {0}, {3} {0}, {3} {2}, {1} {2}, {1} {0}))\n"),
        ("area.poly", "area\n1\n {1} {0}\n {3} {0}\n {3} {2}\n {1} {2}\nEND\nEND\n"),
        ("", "{0},{1},{2},{3}"),
    ],
)
def test_area_must_be_near_the_objects(tmp_path: Path, name: str, text: str) -> None:
    """Areas of people: text of a table, of Osmosis and four numbers, latitude first and right."""
    south, west, north, east = 45.763, 4.834, 45.765, 4.837

    def given(*sides: float) -> str:
        path = tmp_path / name
        if name:
            path.write_text(text.format(*sides))
        return str(path) if name else text.format(*sides)

    order = (west, south, east, north)
    right = given(*order) if not name else given(south, west, north, east)
    area = read_area(right, crs=CRS, near=LYON)
    assert area.intersects(shapely.box(*LYON))
    with refused(InputError, "lies elsewhere", "near Lyon, France", "near Montpellier, France"):
        read_area(right, crs=CRS, near=HOUSE.bounds)
    wrong = given(south, west, north, east) if not name else given(*order)
    with refused(InputError, "latitude and longitude exchanged", "4.834,45.763,4.837,45.765"):
        read_area(wrong, crs=CRS, near=LYON)


def test_buildings_and_streets_of_an_openstreetmap_file(tmp_path: Path) -> None:
    nodes = [node(1, 24.9, 60.1), node(2, 24.91, 60.1), node(3, 24.91, 60.11)]
    ways = [way(n, ring, {"building": "yes"}) for n, ring in ((4, [1, 2, 3, 1]), (6, [1, 2, 3]))]
    ways += [way(5, [1, 2], {"highway": "residential"})]
    path = write_osm(tmp_path / "city.osm", *nodes, *ways)
    houses = read_surroundings(path, role="buildings", crs="EPSG:32635")
    streets = read_surroundings(path, role="streets", crs="EPSG:32635")
    assert (houses.geom_type.tolist(), streets.geom_type.tolist()) == (["Polygon"], ["LineString"])
    notes: list[str] = []
    read_surroundings(path, role="buildings", crs="EPSG:32635", remark=notes.append)
    why = "unreadable: is not closed, as the outline of a building is (1)"
    assert notes == [f"{path}: {why}"]
    lines = tuple(
        f"OpenStreetMap contributors (ODbL 1.0): {name}" for name in ("buildings", "streets")
    )
    assert licenses_of(houses, streets, houses) == lines
    shouted = path.rename(path.with_name("CITY.OSM"))
    assert licenses_of(read_surroundings(shouted, role="streets", crs=CRS)) == lines[1:]


LINE = shapely.LineString([(770_000, 6_280_000), (770_100, 6_280_000)])
FLAT = shapely.Polygon([(770_000, 6_280_000)] * 3)


@pytest.mark.parametrize("name", ["x.parquet", "x.gpkg"])
@pytest.mark.parametrize(
    ("shape", "role", "words"),
    [
        (LINE, "buildings", ("LineString", "polygons")),
        (HOUSE, "streets", ("Polygon", "lines")),
        (None, "", ("no polygon", "polygons")),
        (FLAT, "", ("encloses no area",)),
    ],
)
def test_other_geometries_are_refused(
    tmp_path: Path, name: str, shape: shapely.Geometry | None, role: Role, words: tuple[str, ...]
) -> None:
    path = write(tmp_path / name, shape)
    with refused(InputError, name, *words):
        read_surroundings(path, role=role, crs=CRS) if role else read_area(path, crs=CRS)


EAST, NORTH = np.mgrid[770_000:770_900:10, 6_280_900:6_280_000:-10].reshape(2, -1)
HOUSES = gpd.GeoDataFrame(
    {"n": range(EAST.size)}, geometry=shapely.box(EAST, NORTH, EAST + 6, NORTH + 6), crs=CRS
)
NOWHERE = (0, 0, 9, 9)


def test_error_names_an_unusable_file(tmp_path: Path) -> None:
    (tmp_path / "broken.parquet").write_text("no", encoding="utf-8")
    gpd.GeoDataFrame(geometry=[HOUSE]).to_parquet(tmp_path / "bare.parquet")
    whole = pq.read_table(write(tmp_path / "open.parquet", HOUSE))
    (wkb,) = whole["geometry"].to_pylist()
    ring = pa.array([wkb[:-16] + bytes(16)])  # with another last point
    opened = whole.set_column(whole.schema.get_field_index("geometry"), "geometry", ring)
    pq.write_table(opened.replace_schema_metadata(whole.schema.metadata), tmp_path / "open.parquet")
    HOUSES.to_parquet(tmp_path / "unbounded.parquet")
    save_surroundings(HOUSES.iloc[:0], tmp_path / "empty.parquet")
    for name, words in (
        ("nowhere.parquet", "does not exist"),
        ("nowhere.gpkg", "does not exist"),
        ("broken.parquet", "damaged"),
        ("open.parquet", "Points of LinearRing do not form a closed linestring"),
        ("bare.parquet", "coordinate reference system"),
    ):
        with refused(SourceError, name, words):
            read_area(tmp_path / name, crs=CRS)
    with refused(SourceError, "unbounded.parquet"):
        read_surroundings(tmp_path / "unbounded.parquet", role="buildings", crs=CRS, box=NOWHERE)
    with refused(InputError, "contains no polygon"):
        read_surroundings(tmp_path / "empty.parquet", role="buildings", crs=CRS)


def test_table_is_read_like_a_file() -> None:
    assert len(read_surroundings(HOUSES, role="buildings", crs="EPSG:4326")) == len(HOUSES)
    box = (770_106.0, 6_280_400.0, 770_130.0, 6_280_456.0)
    near = read_surroundings(HOUSES, role="buildings", crs=CRS, box=box)
    assert near["n"].tolist() == HOUSES["n"][HOUSES.intersects(shapely.box(*box))].tolist()
    assert read_area(HOUSES, crs=CRS).area == pytest.approx(36 * len(HOUSES))
    with refused(InputError, "the table contains a Polygon", "give a table of lines"):
        read_surroundings(HOUSES, role="streets", crs=CRS)
    with refused(SourceError, "the table states no coordinate reference system"):
        read_surroundings(HOUSES.set_crs(None, allow_override=True), role="buildings", crs=CRS)


def test_openstreetmap_elements_are_selected_by_the_catalogue(tmp_path: Path) -> None:
    """A node is no building, a footway no street, and a street has a width by its kind."""
    shapes = [HOUSE, HOUSE.centroid, shapely.LineString([(1, 1), (2, 2)]), HOUSE.exterior]
    columns = {
        "element": ["way", "node", "way", "way"],
        "id": [1, 2, 3, 4],
        "building": ["yes", "yes", None, None],
        "highway": [None, None, "footway", "residential"],
    }
    table = gpd.GeoDataFrame(columns, geometry=shapes, crs=CRS)
    table.to_file(tmp_path / "town.gpkg")
    for source in (table, tmp_path / "town.gpkg"):
        houses = read_surroundings(source, role="buildings", crs=CRS)
        streets = read_surroundings(source, role="streets", crs=CRS)
        assert houses["source_id"].tolist() == ["way/1"]
        assert streets[["source_id", "half_width"]].to_numpy().tolist() == [["way/4", 8.0]]
        assert licenses_of(houses) == ("OpenStreetMap contributors (ODbL 1.0): buildings",)
    with refused(InputError, "has no buildings"):
        read_surroundings(table.iloc[2:], role="buildings", crs=CRS)


def test_saved_surroundings_are_read_by_box(tmp_path: Path) -> None:
    table = HOUSES.copy()
    table.attrs["licenses"] = ["City (CC0): houses"]
    path = tmp_path / "new" / "houses.parquet"
    save_surroundings(table, path)
    again = read_surroundings(path, role="buildings", crs=CRS)
    assert again.sort_values("n").reset_index(drop=True).equals(table)
    box = (770_106.0, 6_280_400.0, 770_130.0, 6_280_456.0)  # from an edge to a corner
    near = read_surroundings(path, role="buildings", crs=CRS, box=box)
    assert sorted(near["n"]) == sorted(table["n"][table.intersects(shapely.box(*box))])
    assert list(near.columns) == ["n", "geometry"]
    assert licenses_of(near) == licenses_of(again) == ("City (CC0): houses",)
    for crs in (CRS, "EPSG:32631"):
        none = read_surroundings(path, role="buildings", crs=crs, box=NOWHERE)
        assert (len(none), none.crs) == (0, crs)
    save_surroundings(again, tmp_path / "again.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()
