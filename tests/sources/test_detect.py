"""Catalogues of files, detected from their names and contents."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import pyogrio
import pytest
import shapely
from osm_xml import street_town, write_osm
from sentences import refused, sentence

from semsig_gis.core import InputError, SourceError
from semsig_gis.sources import detect_catalogs, probe_file
from semsig_gis.sources.vector import by_pyogrio, geojson

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

    from conftest import Run


def write(folder: Path, name: str, *, rows: int = 1) -> Path:
    """Write a file of the kind that its name says."""
    path = folder / name
    folder.mkdir(exist_ok=True)
    columns: dict[str, list[object]] = {"feature_id": ["node/1"], "tags": ['"amenity"=>"bench"']}
    if "overture" in name:
        columns = {"id": ["1"], "version": [1], "sources": ["x"], "bbox": ["x"]}
    elif "trees" in name:
        columns = {"amenity": ["bench"], "id": [1]}
    if name.endswith(".osm"):
        return write_osm(path, *street_town())
    if name.endswith(".json"):
        path.write_text(json.dumps({"version": 0.6, "elements": []}))
        return path
    columns = {key: values * rows for key, values in columns.items()}
    frame = gpd.GeoDataFrame(columns, geometry=[shapely.Point(2, 48)] * rows, crs="EPSG:4326")
    frame.to_parquet(path) if name.endswith("parquet") else frame.to_file(path)
    return path


@pytest.mark.parametrize(
    ("name", "catalog", "what"),
    [
        ("town.osm", "openstreetmap", "extract"),
        ("benches.parquet", "openstreetmap", "columns"),
        ("benches.gpkg", "openstreetmap", "columns"),
        ("answer.json", "openstreetmap", "Overpass"),
        ("overture.parquet", "overture", "Overture"),
    ],
)
def test_catalogue_is_detected(tmp_path: Path, name: str, catalog: str, what: str) -> None:
    path = write(tmp_path / "city", name)
    for item in (path, path.parent):
        names, (line,) = detect_catalogs([item])
        assert names == (catalog,)
        assert all(words in line for words in (str(path), what, catalog))


def test_file_of_an_unknown_catalogue_is_refused(tmp_path: Path) -> None:
    trees, osm = write(tmp_path, "trees.gpkg"), write(tmp_path, "town.osm")
    for item in (trees, tmp_path):
        with refused(InputError, "trees.gpkg", "--catalog", "semsig draft"):
            detect_catalogs([osm, item])
    (tmp_path / "empty").mkdir()
    with refused(InputError, "empty", "--catalog"):
        detect_catalogs([tmp_path / "empty"])
    with refused(SourceError, "nowhere.gpkg does not exist"):
        detect_catalogs([tmp_path / "nowhere.gpkg"])


def test_load_without_catalog_detects_it(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "objects.parquet"
    osm, trees = write(tmp_path, "town.osm"), write(tmp_path, "trees.gpkg")
    code, _, err = run("load", osm, "--out", out)
    assert (code, out.exists()) == (0, True)
    assert f"{osm} is read as an extract of OpenStreetMap, with the catalogue openstreetmap" in err
    sentence(run("load", trees, "--out", tmp_path / "none.parquet"), "trees.gpkg", "--catalog")


@pytest.mark.parametrize("name", ["benches.geojson", "benches.gpkg"])
def test_load_without_catalog_opens_a_file_twice(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The description and the rows are read once each, whatever steps need them."""
    calls: list[str] = []

    def count(module: ModuleType, name: str) -> None:
        function = getattr(module, name)

        def counted(*arguments: object, **options: object) -> object:
            calls.append(name)
            return function(*arguments, **options)

        monkeypatch.setattr(module, name, counted)

    count(geojson, "parse_json")
    for function in ("open_arrow", "read"):
        count(by_pyogrio, function)
    for function in ("read_info", "list_layers", "read_dataframe", "read_arrow"):
        count(pyogrio, function)
    path = write(tmp_path, name, rows=2_000)
    assert run("load", path, "--out", tmp_path / "objects.parquet")[0] == 0
    # Only a GeoPackage has to be opened to list its layers.
    lists = ["list_layers"] if name.endswith("gpkg") else []
    description = "read_info" if lists else "parse_json"
    assert calls == [*lists, description, "open_arrow"]


def test_changed_file_is_probed_again(tmp_path: Path) -> None:
    for suffix in ("geojson", "shp", "parquet"):
        path = write(tmp_path, f"benches.{suffix}")
        before = probe_file(path)
        assert probe_file(path) is before
        write(tmp_path, f"benches.{suffix}", rows=2)
        assert probe_file(path) is not before
    path = tmp_path / "benches.shp"
    before = probe_file(path)
    path.with_suffix(".prj").unlink()
    assert before.layers[0][1].crs is not None
    assert probe_file(path).layers[0][1].crs is None
