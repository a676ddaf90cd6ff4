"""PMTiles: tiles contain every cell, squares add up to the city, and MapLibre draws both."""

from __future__ import annotations

import dataclasses
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pmtiles.reader
import pytest
from machine import unavailable
from pyproj import Transformer
from sentences import refused
from servers import Answer, Server, published
from small_city import chances_of, small_city

from semsig_gis.core import InputError
from semsig_gis.output import export_database
from semsig_gis.output.features import write_features
from semsig_gis.output.files import pmtiles as pmtiles_module

if TYPE_CHECKING:
    from collections.abc import Callable

    from selenium.webdriver import Chrome

    from semsig_gis.output.layers.model import Layer

CITY, _ = small_city()
CHANCES = chances_of(CITY)
DETAIL = 15
ASSETS = Path(__file__).parents[2] / "assets"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiles") / "city.pmtiles"
    harmful = dataclasses.replace(CITY, licenses=("<script>alert(1)</script> (CC0)",))
    export_database(harmful, path, identifiability=dataclasses.replace(CHANCES, database=harmful))
    return path


def bytes_of(file: Path) -> Callable[[int, int], bytes]:
    content = file.read_bytes()
    return lambda offset, length: content[offset : offset + length]


def tiles_of(file: Path, zoom: int, layer: str) -> gpd.GeoDataFrame:
    """Return the features of a zoom as GDAL reads them, cut at the edges of tiles."""
    return gpd.read_file(file, layer=layer, ZOOM_LEVEL=zoom).to_crs(CITY.crs)


def test_tiles_contain_every_cell(file: Path) -> None:
    cells = tiles_of(file, DETAIL, "cells").dissolve("cell_id")
    assert cells.index.tolist() == sorted(CITY.cell_ids.tolist())
    cells = cells.loc[CITY.cell_ids]
    assert cells["types"].tolist() == [CITY.types(cell) for cell in range(len(CITY))]
    assert cells["type_group_size"].tolist() == CITY.type_group_sizes.tolist()
    assert cells["chance_found"].tolist() == pytest.approx(CHANCES.found.tolist())
    middles = gpd.GeoSeries.from_xy(*CITY.xy.T, index=cells.index, crs=CITY.crs)
    assert cells.geometry.centroid.distance(middles).max() < 0.5


@pytest.mark.parametrize("statement", ["DELETE FROM tiles", "DELETE FROM tiles WHERE rowid = 1"])
def test_tiles_that_gdal_loses_without_an_error_are_noticed(
    statement: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a full disk, where GDAL may end without an error."""

    def losing(layer: Layer, path: Path, *arguments: Any, **options: Any) -> None:  # noqa: ANN401
        write_features(layer, path, *arguments, **options)
        with closing(sqlite3.connect(path)) as tiles, tiles:
            assert tiles.execute(statement).rowcount

    path = tmp_path / "city.pmtiles"
    path.write_bytes(b"old")
    monkeypatch.setattr(pmtiles_module, "write_features", losing)
    with refused(InputError, "city.pmtiles", "unchanged"):
        export_database(CITY, path)
    assert path.read_bytes() == b"old"
    assert [*tmp_path.iterdir()] == [path]


def test_squares_at_low_zooms_add_up_to_the_city(file: Path) -> None:
    reader = pmtiles.reader.Reader(bytes_of(file))
    header, metadata = reader.header(), reader.metadata()
    squares, cells = metadata["vector_layers"]
    assert (squares["id"], cells["id"], cells["minzoom"]) == ("squares", "cells", DETAIL)
    cells_at = np.stack([CITY.columns, CITY.rows], axis=1)
    assert (squares["minzoom"], squares["maxzoom"]) == (header["min_zoom"], DETAIL - 1)
    for zoom in range(header["min_zoom"], DETAIL):
        side = 2 ** (DETAIL - zoom)
        expected = {*map(tuple, (cells_at // side).tolist())}
        table = tiles_of(file, zoom, "squares")
        points = table.geometry.representative_point()
        places = np.floor_divide(np.stack([points.x, points.y], axis=1), 10.0 * side).astype(int)
        # A square that is cut at the edges of tiles occurs more than once.
        counts = dict(zip(map(tuple, places.tolist()), table["cells"], strict=True))
        assert {*counts} == expected
        assert sum(counts.values()) == len(CITY)
    assert metadata["semsig"]["taxonomy"] == CITY.taxonomy.to_list()
    assert metadata["semsig"]["crs"] == CITY.crs.to_json_dict()
    assert metadata["attribution"] == "&lt;script&gt;alert(1)&lt;/script&gt; (CC0)"


def test_maplibre_draws_cells_and_squares(file: Path, browser: Chrome) -> None:
    names = ("maplibre-gl.js", "maplibre-gl.css", "pmtiles.js")
    if not all((ASSETS / name).is_file() for name in names):
        unavailable("browser", "the package was installed without npm, so MapLibre is not there")
    kinds = {".js": "text/javascript", ".css": "text/css", ".html": "text/html"}
    cell = len(CITY) // 2
    lat, lon = Transformer.from_crs(CITY.crs, "EPSG:4326").transform(*CITY.xy[cell].tolist())
    with Server() as server:
        for path in (
            *(ASSETS / name for name in names),
            Path(__file__).with_name("tiles_page.html"),
        ):
            server.on(f"/{path.name}", Answer(path.read_bytes(), type=kinds[path.suffix]))
        server.on("/city.pmtiles", published(file.read_bytes()))
        browser.get(f"{server.url}/tiles_page.html")
        near, far = (
            browser.execute_async_script("look(...arguments)", lon, lat, zoom)
            for zoom in (DETAIL + 2, DETAIL - 1.5)
        )
        requests = [request for request in server.requests if request.path == "/city.pmtiles"]
        assert {*server.paths()} == {
            "/tiles_page.html", "/city.pmtiles", *(f"/{name}" for name in names)
        }  # fmt: skip
    assert (near["failures"], far["failures"]) == ([], [])
    assert near["layers"] == ["cells"]
    assert far["layers"] == ["squares"]
    (feature,) = near["at"]
    assert feature["cell_id"] == CITY.cell_ids[cell]
    assert feature["types"] == CITY.types(cell)
    assert feature["type_group_size"] == CITY.type_group_sizes[cell]
    assert far["at"][0]["cells"] >= 1
    assert "<script>alert(1)</script> (CC0)" in near["credit"]
    assert all("range" in request.headers for request in requests)  # never the whole file
    log = [entry["message"] for entry in browser.get_log("browser")]
    assert [message for message in log if "GPU stall" not in message] == []
