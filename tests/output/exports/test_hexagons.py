"""Hexagons of H3: their statistics agree with the cells of the city."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import geopandas as gpd
import h3
import numpy as np
import pyogrio
import pytest
from small_city import chances_of, small_city, small_evaluation

from semsig_gis.output import export_database

if TYPE_CHECKING:
    from pathlib import Path

CITY, OBJECTS = small_city()
EVALUATION, CHANCES = small_evaluation(), chances_of(CITY)


@pytest.mark.parametrize("resolution", [8, 11])
def test_statistics_of_hexagons(resolution: int, tmp_path: Path) -> None:
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
    ids = [h3.latlng_to_cell(point.y, point.x, resolution) for point in viewpoints]
    for index in (ids[0], ids[len(CITY) // 2]):
        inside, row = np.array(ids) == index, table.loc[index]
        sizes = np.sort(CITY.type_group_sizes[inside])
        assert row["cells"] == len(sizes)
        assert row["type_group_size"] == sizes[(len(sizes) - 1) // 2]
        assert row["ambiguous"] == pytest.approx((sizes > 1).mean())
        assert row["mean_length"] == pytest.approx(CITY.lengths[inside].mean())
        assert row["chance_found"] == pytest.approx(CHANCES.found[inside].mean())
        ring = gpd.GeoSeries([row.geometry], crs=CITY.crs).to_crs("EPSG:4326")[0].exterior.coords
        corners = [(lat, lon) for lon, lat in ring[:-1]]
        assert np.allclose(sorted(corners), sorted(h3.cell_to_boundary(index)), atol=1e-9)
    share = np.average(table["found"].fillna(0), weights=table["queries"])
    assert share == pytest.approx(EVALUATION.successful.mean())
    metadata = pyogrio.read_info(file)["layer_metadata"]
    assert json.loads(metadata["h3_resolution"]) == resolution
    assert json.loads(metadata["licenses"]) == list(CITY.licenses)
