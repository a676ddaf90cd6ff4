"""Where queries fail, and by how much: means of those around every place of a city."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import Displayed, GridSpec, InputError, percent

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation

RADII = (250.0, 500.0, 1000.0, 2500.0, 5000.0)  # metres, of which the data decide
ENOUGH = 5.0
"""How many queries must speak of a place, lest its mean be of a few alone."""

PIXELS = 10  # to a radius
MOST_PIXELS = 1 << 10  # across a city as wide as high


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ErrorField(Displayed):
    """What became of the queries around each pixel of a grid.

    Parameters
    ----------
    radius : float
        How far away a query counts, in metres; the nearer, the more.
    grid : GridSpec
        The pixels, in the CRS of the city; pixel (0, 0) is the one in the south-west.
    failed : ndarray of float64, shape (rows, columns)
        Weighted share of these queries that failed, from south to north; NaN where none is near.
    errors : ndarray of float64, shape (rows, columns)
        Weighted mean of their expected errors in metres; NaN where none is near.
    speaking : ndarray of float64, shape (rows, columns)
        Their effective number (Kish): so many of equal weight would say as much.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> field = error_field(evaluate(demo_database, queries=20), demo_database, radius=100)
    >>> field.failed.shape == field.speaking.shape, field.radius
    (True, 100)
    """

    radius: float
    grid: GridSpec
    failed: NDArray[np.float64]
    errors: NDArray[np.float64]
    speaking: NDArray[np.float64]

    def _facts(self) -> dict[str, object]:
        rows, columns = self.failed.shape
        return {
            "radius": f"{self.radius:g} m",
            "pixels": f"{columns:,} x {rows:,} of {self.grid.step:g} m",
            "with queries near": percent(np.isfinite(self.failed).mean(), 0),
        }

    def at(self, xy: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the share that failed and how many speak at places, shape (..., 2).

        Both are interpolated between the pixels around.
        """
        places = (xy - np.array(self.grid.origin)) / self.grid.step - 0.5
        first = np.floor(places).astype(np.int64)
        rest = places - first
        rows, columns = self.failed.shape
        failed, speaking, told = (np.zeros(xy.shape[:-1]) for _ in range(3))
        for right, up in itertools.product((0, 1), repeat=2):
            column, row = first[..., 0] + right, first[..., 1] + up
            inside = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
            pixel = np.where(inside, row, 0), np.where(inside, column, 0)
            weight = np.abs(1 - right - rest[..., 0]) * np.abs(1 - up - rest[..., 1]) * inside
            failed += weight * np.nan_to_num(self.failed[pixel])
            speaking += weight * self.speaking[pixel]
            told += weight * np.isfinite(self.failed[pixel])
        known = told >= 0.5  # noqa: PLR2004 - the nearest pixels are known
        return np.divide(failed, told, out=np.full(told.shape, np.nan), where=known), speaking


def guess_error(database: SignatureDatabase) -> float:
    """Return how far two random cells lie apart: the error of a guess (root mean square)."""
    return math.sqrt(2.0 * float(database.xy.var(axis=0).sum())) or database.grid.step


def error_field(
    evaluation: Evaluation, database: SignatureDatabase, *, radius: float | None = None
) -> ErrorField:
    """Return which share of the queries around every place failed, and by how much they are off.

    Parameters
    ----------
    evaluation : Evaluation
        The queries and what became of them.
    database : SignatureDatabase
        The database that was searched.
    radius : float, optional
        How far away a query counts, in metres, at least the step of the grid; by default the first
        of 250, 500, 1,000, 2,500 and 5,000 m with which 5 queries or more speak of half of their
        places.

    Returns
    -------
    ErrorField
        The field, as far as a query is near.

    Raises
    ------
    InputError
        If the radius is out of range, or the evaluation was made with another database.

    Notes
    -----
    A query at distance d counts with the quartic kernel (1 - (d / r)^2)^2 of the radius r. An error
    counts with at most that of a guess, `guess_error`, so that queries of which nothing was left
    count, too.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=20)
    >>> field = error_field(evaluation, demo_database)
    >>> bool(0.0 <= np.nanmin(field.failed) and np.nanmax(field.failed) <= 1.0)
    True
    """
    evaluation.rows_in(database)  # refuses another database
    queries = evaluation.queries
    xy = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    # As far as the pixels are not too many in all.
    across = math.sqrt(float(np.ptp(xy, axis=0).prod()))
    least = max(2.0 * across / MOST_PIXELS, database.grid.step)
    if radius is not None and not (math.isfinite(radius) and radius >= least):
        raise InputError(
            f"a smoothing radius of {radius:g} m was given; give {least:,.0f} m or more in this "
            "city."
        )
    errors = np.minimum(queries["error_m"].to_numpy(np.float64), guess_error(database))
    values = np.stack([~evaluation.successful, errors], axis=1)
    for some in RADII if radius is None else (radius,):
        field = _field(xy, values, database.grid, max(some, least))
        if np.median(field.at(xy)[1]) >= ENOUGH:
            break
    return field


def _field(
    xy: NDArray[np.float64], values: NDArray[np.float64], grid: GridSpec, radius: float
) -> ErrorField:
    """Return the means of two values of queries: whether they failed, and their errors."""
    across = math.sqrt(float((np.ptp(xy, axis=0) + 2.0 * radius).prod()))
    finest = max(radius / PIXELS, across / MOST_PIXELS)
    step = grid.step * max(1, round(finest / grid.step))  # pixels hold whole cells
    reach = math.ceil(radius / step)
    columns, rows = GridSpec(step, grid.origin).cells_at(xy)
    corner = np.array([columns.min() - reach, rows.min() - reach])
    pixels = np.stack([columns, rows], axis=1) - corner
    origin = np.array(grid.origin) + corner * step
    width, height = (pixels.max(axis=0) + reach + 1).tolist()
    failed, errors, weights, squares = np.zeros((4, height, width))
    aside = (xy - origin) / step - 0.5 - pixels
    for right, up in itertools.product(range(-reach, reach + 1), repeat=2):
        away = ((aside - [right, up]) ** 2).sum(axis=1) * (step / radius) ** 2
        near = away < 1.0
        weight = (1.0 - away[near]) ** 2
        pixel = pixels[near, 1] + up, pixels[near, 0] + right
        np.add.at(weights, pixel, weight)
        np.add.at(squares, pixel, weight**2)
        np.add.at(failed, pixel, weight * values[near, 0])
        np.add.at(errors, pixel, weight * values[near, 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        return ErrorField(
            radius=radius,
            grid=GridSpec(step, (float(origin[0]), float(origin[1]))),
            failed=failed / weights,
            errors=errors / weights,
            speaking=np.where(weights > 0.0, weights**2 / squares, 0.0),
        )
