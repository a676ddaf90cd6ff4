"""Street objects of GeoDataFrames, as the programs write them that people have them from."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import osmium
import pytest
import shapely
from osm_xml import street_town, write_osm
from sentences import refused

from semsig_gis.core import CatalogError, CrsError, EmptyResultError, InputError
from semsig_gis.database import ObjectStore, ViewpointSpec, build_database
from semsig_gis.localization import localize
from semsig_gis.objects import assemble, choose_layers, objects_from_frame, read_files
from semsig_gis.sources import Catalog, LayerSpec, load_catalog, paper_taxonomy

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

OSM = load_catalog("openstreetmap")
KEYS = ["amenity", "highway", "natural", "traffic_sign", "building"]


@pytest.fixture(scope="module")
def extract(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a town as OpenStreetMap XML, with the same data as pbf in the same folder."""
    path = write_osm(tmp_path_factory.mktemp("town") / "town.osm", *street_town())
    with osmium.SimpleWriter(str(path.with_suffix(".osm.pbf"))) as writer:
        for element in osmium.FileProcessor(str(path)):
            writer.add(element)
    return path


@pytest.fixture(scope="module")
def expected(extract: Path) -> StreetObjects:
    return loaded(extract.with_suffix(".osm.pbf"))


@pytest.fixture(scope="module")
def frame(extract: Path) -> gpd.GeoDataFrame:
    """Return what osmnx makes of the town."""
    osmnx = pytest.importorskip("osmnx", reason="osmnx is not installed")
    return osmnx.features_from_xml(extract, tags=dict.fromkeys(KEYS, True))


@pytest.fixture(scope="module")
def quack(extract: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the GeoParquet file that QuackOSM makes of the town."""
    folder = tmp_path_factory.mktemp("quackosm")
    pytest.importorskip("quackosm", reason="QuackOSM is not installed")
    package = importlib.util.find_spec("duckdb_extension_spatial")
    assert package is not None
    assert package.origin is not None
    extension = next(Path(package.origin).parent.rglob("spatial.duckdb_extension"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(folder))  # where DuckDB keeps the extensions it has
        import duckdb
        import quackosm

        with duckdb.connect() as connection:
            connection.execute(f"INSTALL '{extension}'")
        written: Path = quackosm.convert_pbf_to_parquet(
            extract.with_suffix(".osm.pbf"),
            working_directory=folder,
            result_file_path=folder / "town.parquet",
            sort_result=False,
            verbosity_mode="silent",
        )
    return written


def loaded(*paths: Path) -> StreetObjects:
    layers, _ = read_files(choose_layers(OSM), paths)
    return assemble(layers, OSM).objects


def assert_same(database: SignatureDatabase, expected: SignatureDatabase) -> None:
    for name in ("columns", "rows", "offsets", "codes", "bearing_units", "distance_units"):
        assert np.array_equal(getattr(database, name), getattr(expected, name)), name


def test_osmnx_table_gives_the_same_objects_as_the_extract(
    frame: gpd.GeoDataFrame, expected: StreetObjects
) -> None:
    assert len(expected) == 12
    database = build_database(frame)
    assert_same(database, build_database(expected))
    assert database.licenses[0].startswith("OpenStreetMap contributors (ODbL 1.0)")
    objects = objects_from_frame(frame.to_crs("EPSG:3857"))
    assert sorted(objects.table["source_id"]) == sorted(expected.table["source_id"])
    assert np.abs(objects.xy - expected.xy).max() < 1e-6


def test_buildings_and_streets_may_be_an_osmnx_table(
    frame: gpd.GeoDataFrame, extract: Path
) -> None:
    """As they are, with what is neither among them."""
    # A table of objects says nothing of the streets that others are computed from.
    specs = [spec for spec in choose_layers(OSM, surroundings=True) if spec.derive is None]
    layers, _ = read_files(specs, [extract])
    town = assemble(layers, OSM)
    along = ViewpointSpec(mode="streets")
    expected = build_database(
        town.objects, footprints=town.buildings, streets=town.streets, viewpoints=along
    )
    database = build_database(frame, footprints=frame, streets=frame, viewpoints=along)
    assert_same(database, expected)
    assert database.licenses == expected.licenses
    store = ObjectStore.of(town.objects, footprints=frame, streets=frame)
    assert store.streets is not None
    assert store.streets["name"].tolist() == ["Rue"]


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".fgb", ".parquet"])
def test_osmnx_files_give_the_same_objects_as_the_extract(
    frame: gpd.GeoDataFrame, expected: StreetObjects, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"town{suffix}"
    frame.to_parquet(path) if suffix == ".parquet" else frame.to_file(path)
    result, extract = (
        objects.table.sort_values(["source", "source_id"]) for objects in (loaded(path), expected)
    )
    assert result["source_id"].tolist() == extract["source_id"].tolist()
    assert shapely.distance(result.geometry.array, extract.geometry.array).max() < 1e-6


def test_quackosm_file_gives_the_same_objects_as_the_extract(
    quack: Path, extract: Path, expected: StreetObjects
) -> None:
    assert_same(build_database(loaded(quack)), build_database(expected))
    assert_same(build_database(gpd.read_parquet(quack)), build_database(expected))
    # An element that is in files of several kinds is one.
    assert len(loaded(quack, extract)) == len(expected)
    surroundings = choose_layers(OSM, ["buildings", "streets"], surroundings=True)
    areas = [
        {
            layer.spec.name: sorted(shapely.area(layer.table.geometry.array).round(12).tolist())
            for layer in read_files(surroundings, [path])[0]
        }
        for path in (quack, extract)
    ]
    assert areas[0] == areas[1]
    assert [len(sizes) for sizes in areas[0].values()] == [2, 1]


def points(**columns: list[object]) -> gpd.GeoDataFrame:
    size = len(next(iter(columns.values())))
    places = [shapely.Point(2.35 + 1e-4 * number, 48.85) for number in range(size)]
    return gpd.GeoDataFrame(columns, geometry=places, crs="EPSG:4326")


def test_classes_are_read_from_a_column() -> None:
    frame = points(kind=["bench", "fire_hydrant", None, "street_light"])
    objects = objects_from_frame(frame, class_column="kind")
    assert objects.to_geodataframe()["class_name"].tolist() == [
        "bench",
        "fire_hydrant",
        "street_light",
    ]
    assert objects.table["source_id"].tolist() == ["0", "1", "3"]
    assert objects.notes == ()
    again = objects_from_frame(objects.to_geodataframe(), class_column="class_name")
    assert (again.xy == objects.xy).all()
    assert [*map(str, again.licenses)] == [*map(str, objects.licenses)]
    with refused(InputError, "'kind'", "'benhc'", "'bench'"):
        objects_from_frame(points(kind=["benhc", "bench"]), class_column="kind")
    with refused(InputError, "'fire_hydrant'", "street_light"):
        objects_from_frame(frame, class_column="kind", catalog=PAPER)


def test_classes_of_ones_own_are_added_by_name() -> None:
    frame = points(kind=["bench", "gargoyle", "rune_stone", None])
    advice = "new_classes=['gargoyle', 'rune_stone']"
    with refused(InputError, "'gargoyle'", advice):
        objects_from_frame(frame, class_column="kind")
    objects = objects_from_frame(frame, class_column="kind", new_classes=["gargoyle", "rune_stone"])
    assert objects.to_geodataframe()["class_name"].tolist() == ["bench", "gargoyle", "rune_stone"]
    view = "gargoyle at 10, rune stone at 90"
    assert len(localize(build_database(objects), view).query) == 2
    with refused(InputError, "'Statue'", "lower-case"):
        objects_from_frame(points(kind=["Statue"]), class_column="kind")
    with refused(CatalogError, "'bench'"):
        objects_from_frame(frame, class_column="kind", new_classes=["bench"])
    with refused(InputError, "class_column"):
        objects_from_frame(points(amenity=["bench"]), tags=True, new_classes=["statue"])


SPECS = (
    LayerSpec(name="trees", class_name="alignment_tree", where=(("art", ("tree",)),)),
    LayerSpec(name="seats", class_name="bench", where=(("seats", (">=2",)),)),
)
PAPER = Catalog(name="town", title="Town", taxonomy=paper_taxonomy(), layers=SPECS)


def test_table_is_read_with_a_catalogue() -> None:
    frame = points(seats=[1, 2, None, 4])
    assert objects_from_frame(frame, catalog=PAPER).table["source_id"].tolist() == ["1", "3"]
    both = frame.assign(art=["tree", "", None, "tree"])
    assert len(objects_from_frame(both, catalog=PAPER, layers=["trees"])) == 2
    with refused(InputError, "several of them", "trees, seats", "class_column"):
        objects_from_frame(both, catalog=PAPER)
    with refused(InputError, "none of them", "'town'"):
        objects_from_frame(points(other=[1]), catalog=PAPER)


def test_tables_with_unclear_contents_are_refused() -> None:
    tagged = points(amenity=["bench"])
    assert len(objects_from_frame(tagged, tags=True)) == 1
    assert len(objects_from_frame(tagged, catalog="openstreetmap")) == 1
    with refused(InputError, "amenity", "tags=True", "class_column"):
        build_database(tagged)
    with refused(InputError, "kind", "class_column"):
        build_database(points(kind=["bench"]))
    with refused(InputError, "city.parquet", "open_objects"):
        build_database("city.parquet")
    with refused(InputError, "one"):
        objects_from_frame(tagged, tags=True, class_column="amenity")
    with refused(InputError, "no geometry", "set_geometry"):
        objects_from_frame(gpd.GeoDataFrame({"amenity": ["bench"]}))
    with refused(CrsError, "set_crs"):
        objects_from_frame(tagged.set_crs(None, allow_override=True), tags=True)
    with refused(EmptyResultError, "none of the 1 rows", "'openstreetmap'"):
        objects_from_frame(points(amenity=["hunting"]), tags=True)
    double = points(amenity=["bench"], other=["bench"]).set_axis(
        ["amenity", "amenity", "geometry"], axis=1
    )
    with refused(InputError, "several columns 'amenity'"):
        objects_from_frame(double.set_geometry("geometry"), tags=True)
