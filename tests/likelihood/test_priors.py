from __future__ import annotations

import math
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import pytest
import rasterio
import shapely
from noisy_cells import random_database
from sentences import refused

from semsig_gis.core.errors import InputError
from semsig_gis.likelihood.posterior import posterior
from semsig_gis.likelihood.priors import area_prior, position_prior, raster_prior, weight_prior

if TYPE_CHECKING:
    from pathlib import Path

DATABASE = random_database(3, cells=120)
BOX = shapely.box(0.0, 0.0, 100.0, 100.0)


def test_an_area_keeps_its_cells_alone() -> None:
    prior = area_prior(DATABASE, BOX)
    inside = (DATABASE.xy <= 100.0).all(axis=1)
    assert inside.any()
    assert np.array_equal(np.isfinite(prior), inside)
    assert len(np.unique(prior[inside])) == 1


def test_a_place_may_lie_outside_the_area_all_the_same() -> None:
    chances = np.exp(area_prior(DATABASE, BOX, outside=0.2))
    inside = (DATABASE.xy <= 100.0).all(axis=1)
    assert chances[inside].sum() == pytest.approx(0.8)
    assert chances[~inside].sum() == pytest.approx(0.2)


def test_an_area_may_come_in_other_coordinates() -> None:
    degrees = gpd.GeoSeries([BOX], crs=DATABASE.crs).to_crs("EPSG:4326").iloc[0]
    prior = area_prior(DATABASE, degrees, crs="EPSG:4326")
    assert np.array_equal(np.isfinite(prior), np.isfinite(area_prior(DATABASE, BOX)))


def test_a_position_is_a_normal_density() -> None:
    prior = position_prior(DATABASE, (50.0, 70.0), sigma=20.0)
    chances = np.exp(prior)
    assert chances.sum() == pytest.approx(1.0)
    away = np.hypot(*(DATABASE.xy - [50.0, 70.0]).T)
    slow = [math.exp(-0.5 * (one / 20.0) ** 2) for one in away]
    assert chances == pytest.approx(np.array(slow) / sum(slow))
    far = position_prior(DATABASE, (1e7, 0.0), sigma=1.0)
    assert np.isfinite(far).any()


def test_weights_and_priors_add_up() -> None:
    weights = np.arange(len(DATABASE), dtype=float)
    both = weight_prior(DATABASE, weights) + area_prior(DATABASE, BOX)
    chances = posterior(DATABASE, np.zeros(len(DATABASE)), log_prior=both).chances
    inside = (DATABASE.xy <= 100.0).all(axis=1)
    assert chances == pytest.approx(weights * inside / (weights * inside).sum())


def raster(folder: Path, values: object, *, left: float = 0.0, nodata: float | None = None) -> Path:
    """Write a raster of pixels of 100 m from the corner of the grid; the first row is southern."""
    bands = np.asarray(values, dtype=np.float64)[None, ::-1]
    folder.mkdir(exist_ok=True)
    path = folder / "raster.tif"
    options = {"driver": "GTiff", "count": 1, "dtype": "float64", "crs": "EPSG:2154"}
    shape = {"height": bands.shape[1], "width": bands.shape[2], "nodata": nodata}
    place = rasterio.Affine(100, 0, left, 0, -100, 100 * bands.shape[1])
    with rasterio.open(path, "w", transform=place, **options, **shape) as file:
        file.write(bands)
    return path


def test_a_raster_weighs_the_cells(tmp_path: Path) -> None:
    weights = np.array([[1.0, 4.0], [0.0, 2.5]])
    chances = np.exp(raster_prior(DATABASE, raster(tmp_path, weights)))
    column, row = (DATABASE.xy // 100).astype(int).T
    expected = weights[row, column]
    assert chances == pytest.approx(expected / expected.sum())
    assert (chances == 0).any()


def test_where_a_raster_tells_nothing_the_least_weight_is_taken(tmp_path: Path) -> None:
    column, row = (DATABASE.xy // 100).astype(int).T
    inside = np.array([[3.0, -1.0], [0.0, 8.0]])
    chances = np.exp(raster_prior(DATABASE, raster(tmp_path, inside, nodata=-1.0)))
    expected = np.array([[3.0, 3.0], [0.0, 8.0]])[row, column]
    assert chances == pytest.approx(expected / expected.sum())
    part = np.exp(raster_prior(DATABASE, raster(tmp_path, [[6.0], [2.0]])))
    expected = np.array([[6.0, 2.0], [2.0, 2.0]])[row, column]
    assert part == pytest.approx(expected / expected.sum())


def test_a_raster_that_says_nothing_usable_is_refused(tmp_path: Path) -> None:
    cases = [
        (raster(tmp_path / "a", [[1.0]], left=1e5), "has no data at any cell"),
        (raster(tmp_path / "b", np.zeros((2, 2))), "excludes every cell"),
        (raster(tmp_path / "c", [[1.0, -2.0]]), "holds -2 to 1; give finite values, 0 or more"),
        (raster(tmp_path / "d", [[1.0, np.inf]]), "give finite values, 0 or more"),
        (raster(tmp_path / "e", [[0.0]]), "excludes every cell"),
    ]
    for path, fault in cases:
        with refused(InputError, fault):
            raster_prior(DATABASE, path)
