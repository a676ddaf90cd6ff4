"""Cells together, in hexagons of H3: their numbers add up to those of the city."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import h3
import numpy as np
import pyogrio
import pytest
from small_city import chances_of, small_city, small_evaluation

from semsig_gis.exports import export_database

if TYPE_CHECKING:
    from pathlib import Path

CITY, OBJECTS = small_city()
EVALUATION, CHANCES = small_evaluation(), chances_of(CITY)


@pytest.mark.parametrize("resolution", [8, 11])
def test_hexagons_hold_what_is_in_them(resolution: int, tmp_path: Path) -> None:
    file = tmp_path / "a.fgb"
    export_database(
        CITY, file, h3=resolution, identifiability=CHANCES, objects=OBJECTS, evaluation=EVALUATION
    )
    table = gpd.read_file(file).set_index("h3")
    assert table.crs == CITY.crs
    assert table[["cells", "objects", "queries"]].sum().tolist() == [
        len(CITY), len(OBJECTS), len(EVALUATION.queries),
    ]  # fmt: skip
    viewpoints = gpd.GeoSeries.from_xy(*CITY.xy.T, crs=CITY.crs).to_crs("EPSG:4326")
    homes = [h3.latlng_to_cell(one.y, one.x, resolution) for one in viewpoints]
    for index in (homes[0], homes[len(CITY) // 2]):
        inside, told = np.array(homes) == index, table.loc[index]
        sizes = np.sort(CITY.type_group_sizes[inside])
        assert told["cells"] == len(sizes)
        assert told["type_group_size"] == sizes[(len(sizes) - 1) // 2]
        assert told["ambiguous"] == pytest.approx((sizes > 1).mean())
        assert told["mean_length"] == pytest.approx(CITY.lengths[inside].mean())
        assert told["chance_found"] == pytest.approx(CHANCES.found[inside].mean())
        ring = gpd.GeoSeries([told.geometry], crs=CITY.crs).to_crs("EPSG:4326")[0].exterior.coords
        corners = [(lat, lon) for lon, lat in ring[:-1]]
        assert np.allclose(sorted(corners), sorted(h3.cell_to_boundary(index)), atol=1e-9)
    found = np.average(table["found"].fillna(0), weights=table["queries"])
    assert found == pytest.approx(EVALUATION.successful.mean())


def test_the_file_says_what_the_hexagons_are(tmp_path: Path) -> None:
    export_database(CITY, tmp_path / "a.fgb", h3=9)
    told = pyogrio.read_info(tmp_path / "a.fgb")["layer_metadata"]
    assert json.loads(told["h3_resolution"]) == 9
    assert json.loads(told["licenses"]) == list(CITY.licenses)
