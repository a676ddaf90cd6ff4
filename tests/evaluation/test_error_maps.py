"""Error fields: means of all queries, weighted by their distance from each pixel."""

from __future__ import annotations

import dataclasses
import math

import geopandas as gpd
import numpy as np
import pytest
from sentences import refused
from small_city import small_city, small_evaluation

from semsig_gis.core import InputError
from semsig_gis.evaluation import ENOUGH_QUERIES, RADII, error_field, guess_error

CITY, EVALUATION = small_city()[0], small_evaluation()
XY = np.stack([EVALUATION.queries.geometry.x, EVALUATION.queries.geometry.y], axis=1)


@pytest.mark.parametrize("radius", [10.0, 55.0, 250.0, 4000.0])
def test_pixels_are_weighted_means(radius: float) -> None:
    field = error_field(EVALUATION, CITY, radius=radius)
    assert field.grid.step % CITY.grid.step == 0.0
    assert ((np.array(field.grid.origin) - CITY.grid.origin) % CITY.grid.step == 0.0).all()
    rows, columns = np.indices(field.failed.shape)
    centres = field.grid.viewpoints(columns, rows)
    away = ((centres[..., None, :] - XY) ** 2).sum(axis=-1)
    weights = np.maximum(0.0, 1.0 - away / radius**2) ** 2
    sums = weights.sum(axis=-1)
    near = sums > 1e-12
    assert near.any()
    assert not near[[0, -1]].any()
    assert not near[:, [0, -1]].any()
    limit = math.sqrt(2.0 * CITY.xy.var(axis=0).sum())
    assert guess_error(CITY) == pytest.approx(limit)
    errors = np.minimum(EVALUATION.queries["error_m"].to_numpy(), limit)
    for values, means in ((~EVALUATION.successful, field.failed), (errors, field.errors)):
        assert np.allclose(means[near], (weights @ values)[near] / sums[near])
        assert np.isnan(means[sums == 0.0]).all()
    speaking = sums**2 / np.maximum((weights**2).sum(axis=-1), 1e-300)
    assert np.allclose(field.speaking[near], speaking[near])
    # At the centres of pixels, interpolation gives their values.
    failed, speak = field.at(centres)
    assert np.allclose(failed, field.failed, equal_nan=True)
    assert np.allclose(speak, field.speaking)
    assert np.isnan(field.at(np.array([[1e9, 1e9]]))[0]).all()


def test_radius_increases_until_there_are_enough_queries() -> None:
    assert error_field(EVALUATION, CITY).radius == RADII[0]
    queries = EVALUATION.queries
    apart = XY.mean(axis=0) + 20.0 * (XY - XY.mean(axis=0))
    spread = queries.set_geometry(gpd.points_from_xy(*apart.T, crs=queries.crs))
    field = error_field(dataclasses.replace(EVALUATION, queries=spread), CITY)
    assert field.radius in RADII[1:]
    assert np.median(field.at(apart)[1]) >= ENOUGH_QUERIES
    single = dataclasses.replace(EVALUATION, queries=queries[:1])
    assert error_field(single, CITY).radius == RADII[-1]


@pytest.mark.parametrize("radius", [0.0, 9.0, -1.0, math.nan, math.inf])
def test_invalid_radius_and_other_database_are_refused(radius: float) -> None:
    with refused(InputError, f"{radius:g} m", "10 m or more"):
        error_field(EVALUATION, CITY, radius=radius)
    with refused(InputError, "give the database that it was made with"):
        error_field(EVALUATION, CITY.select(slice(5)), radius=250.0)
