"""Maps of failures and errors: weighted means of the queries around every place of a city."""

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

RADII = (250.0, 500.0, 1000.0, 2500.0, 5000.0)  # metres; the first with enough queries is used
ENOUGH_QUERIES = 5.0
"""Least effective number of queries at the median place, so that means are not of single ones."""

RADIUS_PIXELS = 10
MOST_PIXELS = 1 << 10  # across a square city


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ErrorField(Displayed):
    """Share of failed queries and mean error around each pixel of a grid.

    Parameters
    ----------
    radius : float
        Distance up to which a query counts, in metres; nearer queries count more.
    grid : GridSpec
        The pixels, in the CRS of the city; pixel (0, 0) is the one in the south-west.
    failed : ndarray of float64, shape (rows, columns)
        Weighted share of these queries that failed, from south to north; NaN without queries.
    errors : ndarray of float64, shape (rows, columns)
        Weighted mean of their expected errors in metres; NaN without queries.
    speaking : ndarray of float64, shape (rows, columns)
        Effective number of queries (Kish): the number of equal weight with the same variance.

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
        """Return the failed share and the effective number of queries at places, shape (..., 2).

        Both are interpolated between the four nearest pixels.
        """
        places = (xy - np.array(self.grid.origin)) / self.grid.step - 0.5
        first = np.floor(places).astype(np.int64)
        rest = places - first
        rows, columns = self.failed.shape
        # `valid` is the weight of the pixels that have a value.
        failed, speaking, valid = (np.zeros(xy.shape[:-1]) for _ in range(3))
        for right, up in itertools.product((0, 1), repeat=2):
            column, row = first[..., 0] + right, first[..., 1] + up
            inside = (column >= 0) & (row >= 0) & (column < columns) & (row < rows)
            pixel = np.where(inside, row, 0), np.where(inside, column, 0)
            weight = np.abs(1 - right - rest[..., 0]) * np.abs(1 - up - rest[..., 1]) * inside
            failed += weight * np.nan_to_num(self.failed[pixel])
            speaking += weight * self.speaking[pixel]
            valid += weight * np.isfinite(self.failed[pixel])
        enough = valid >= 0.5  # noqa: PLR2004 - at least half of the weight
        return np.divide(failed, valid, out=np.full(valid.shape, np.nan), where=enough), speaking


def guess_error(database: SignatureDatabase) -> float:
    """Return the root mean square distance of two random cells: the error of a guess."""
    return math.sqrt(2.0 * float(database.xy.var(axis=0).sum())) or database.grid.step


def error_field(
    evaluation: Evaluation, database: SignatureDatabase, *, radius: float | None = None
) -> ErrorField:
    """Return the share of failed queries and the mean error around every place.

    Parameters
    ----------
    evaluation : Evaluation
        The queries and their outcomes.
    database : SignatureDatabase
        The searched database.
    radius : float, optional
        Distance up to which a query counts, in metres, at least the step of the grid; by default
        the first of 250, 500, 1,000, 2,500 and 5,000 m with an effective number of at least 5
        queries at half of the places of the queries.

    Returns
    -------
    ErrorField
        The field, with NaN at places without queries.

    Raises
    ------
    InputError
        If the radius is out of range, or the evaluation was made with another database.

    Notes
    -----
    A query at distance d counts with the quartic kernel (1 - (d / r)^2)^2 of the radius r. Errors
    are limited to that of a guess (`guess_error`), so that queries without objects count, too.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=20)
    >>> field = error_field(evaluation, demo_database)
    >>> bool(0.0 <= np.nanmin(field.failed) and np.nanmax(field.failed) <= 1.0)
    True
    """
    evaluation.rows_in(database)  # raises InputError for another database
    queries = evaluation.queries
    xy = np.stack([queries.geometry.x, queries.geometry.y], axis=1)
    # The radius must not be so small that there are too many pixels.
    across = math.sqrt(float(np.ptp(xy, axis=0).prod()))
    least = max(2.0 * across / MOST_PIXELS, database.grid.step)
    if radius is not None and not (math.isfinite(radius) and radius >= least):
        raise InputError(
            f"a smoothing radius of {radius:g} m was given; give {least:,.0f} m or more in this "
            "city."
        )
    errors = np.minimum(queries["error_m"].to_numpy(np.float64), guess_error(database))
    values = np.stack([~evaluation.successful, errors], axis=1)
    for metres in RADII if radius is None else (radius,):
        field = _field(xy, values, database.grid, max(metres, least))
        if np.median(field.at(xy)[1]) >= ENOUGH_QUERIES:
            break
    return field


def _field(
    xy: NDArray[np.float64], values: NDArray[np.float64], grid: GridSpec, radius: float
) -> ErrorField:
    """Return the failed share and the mean error of the queries around each pixel.

    `values`, shape (n, 2), are whether each query failed (0 or 1), and its error in metres.
    """
    # The pixels: a whole number of cells wide, and a margin of the radius around the queries.
    across = math.sqrt(float((np.ptp(xy, axis=0) + 2.0 * radius).prod()))
    finest = max(radius / RADIUS_PIXELS, across / MOST_PIXELS)
    step = grid.step * max(1, round(finest / grid.step))
    reach = math.ceil(radius / step)
    columns, rows = GridSpec(step, grid.origin).cells_at(xy)
    corner = np.array([columns.min() - reach, rows.min() - reach])
    pixels = np.stack([columns, rows], axis=1) - corner
    origin = np.array(grid.origin) + corner * step
    width, height = (pixels.max(axis=0) + reach + 1).tolist()
    failed, errors, weights, squares = np.zeros((4, height, width))
    offsets = (xy - origin) / step - 0.5 - pixels
    # Each query adds its weighted values to every pixel within the radius.
    for right, up in itertools.product(range(-reach, reach + 1), repeat=2):
        squared = ((offsets - [right, up]) ** 2).sum(axis=1) * (step / radius) ** 2
        near = squared < 1.0
        weight = (1.0 - squared[near]) ** 2
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
