"""Files that say themselves which catalogue theirs is."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
import shapely
from osm_xml import street_town, write_osm
from sentences import refused, sentence

from semsig_gis.core import InputError, SourceError
from semsig_gis.sources import told_catalogs

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def write(folder: Path, name: str) -> Path:
    """Write a file that tells what it is by its name, or by what is in it."""
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
        path.write_text(json.dumps({"elements": []}))
        return path
    frame = gpd.GeoDataFrame(columns, geometry=[shapely.Point(2, 48)], crs="EPSG:4326")
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
def test_files_tell_their_catalogue(tmp_path: Path, name: str, catalog: str, what: str) -> None:
    path = write(tmp_path / "city", name)
    for given in (path, path.parent):
        names, (line,) = told_catalogs([given])
        assert names == (catalog,)
        assert all(words in line for words in (str(path), what, catalog))


def test_a_file_that_does_not_tell_is_refused(tmp_path: Path) -> None:
    trees, osm = write(tmp_path, "trees.gpkg"), write(tmp_path, "town.osm")
    for given in (trees, tmp_path):
        with refused(InputError, "trees.gpkg", "--catalog", "semsig draft"):
            told_catalogs([osm, given])
    (tmp_path / "empty").mkdir()
    with refused(InputError, "empty", "--catalog"):
        told_catalogs([tmp_path / "empty"])
    with refused(SourceError, "nowhere.gpkg does not exist"):
        told_catalogs([tmp_path / "nowhere.gpkg"])


def test_no_catalogue_need_be_named_of_a_file_that_tells_it(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "objects.parquet"
    osm, trees = write(tmp_path, "town.osm"), write(tmp_path, "trees.gpkg")
    code, _, err = run("load", osm, "--out", out)
    assert (code, out.exists()) == (0, True)
    assert f"{osm} is read as an extract of OpenStreetMap, with the catalogue openstreetmap" in err
    sentence(run("load", trees, "--out", tmp_path / "none.parquet"), "trees.gpkg", "--catalog")
