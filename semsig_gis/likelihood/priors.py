"""What is known of the place before a query is looked at: log-priors by cell, shape (n,).

A prior is one number a cell, the logarithm of a chance up to a constant; minus infinity excludes
a cell. Priors that do not depend on each other are added.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import shapely

from semsig_gis.core.errors import CrsError, InputError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.database.database import SignatureDatabase


def area_prior(
    database: SignatureDatabase,
    area: shapely.Geometry,
    *,
    crs: CRS | str | None = None,
    outside: float = 0.0,
) -> NDArray[np.float64]:
    """Return the prior that the place lies in an area.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    area : shapely.Geometry
        A polygon or several.
    crs : pyproj.CRS or str, optional
        Coordinate reference system of the area; that of the database by default.
    outside : float, default 0
        Chance, 0 to below 1, that the place lies outside all the same.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell; every cell inside is as likely as every other, and so outside.

    Raises
    ------
    InputError
        If the area is no polygon, or no cell is left.
    CrsError
        If the coordinate reference system cannot be read.

    Examples
    --------
    >>> prior = area_prior(demo_database, shapely.Point(demo_database.xy[7]).buffer(3.0))
    >>> np.flatnonzero(np.isfinite(prior)).tolist()
    [7]
    """
    if not 0 <= outside < 1:
        msg = f"the chance of a place outside the area is {outside}; give 0 to below 1."
        raise InputError(msg)
    if not isinstance(area, (shapely.Polygon, shapely.MultiPolygon)) or area.is_empty:
        msg = f"the area is a {type(area).__name__} or empty; give a polygon that is not."
        raise InputError(msg)
    shape = area
    if crs is not None:
        try:
            shape = gpd.GeoSeries([area], crs=crs).to_crs(database.crs).iloc[0]
        except (RuntimeError, ValueError) as error:
            msg = (
                f"the coordinate reference system {crs!r} of the area cannot be read; give a code."
            )
            raise CrsError(msg) from error
    shapely.prepare(shape)
    inside = shapely.intersects_xy(shape, *database.xy.T)
    weights = np.where(
        inside,
        (1.0 - outside) / max(int(inside.sum()), 1),
        outside / max(int((~inside).sum()), 1),
    )
    return weight_prior(database, weights)


def position_prior(
    database: SignatureDatabase, position: tuple[float, float], *, sigma: float
) -> NDArray[np.float64]:
    """Return the prior that the place is near a position, such as the last one known.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    position : tuple of (float, float)
        x and y in the CRS of the database.
    sigma : float
        Standard deviation each way in metres, above 0.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell.

    Raises
    ------
    InputError
        If a number is not finite, or `sigma` is not above 0.

    Examples
    --------
    >>> x, y = demo_database.xy[7].tolist()
    >>> int(position_prior(demo_database, (x + 2.0, y), sigma=50.0).argmax())
    7
    """
    if not (math.isfinite(sigma) and sigma > 0):
        msg = f"the deviation of the position is {sigma} m; give metres above 0."
        raise InputError(msg)
    if not all(map(math.isfinite, position)):
        msg = f"the position is {position}; give x and y in metres."
        raise InputError(msg)
    away = ((database.xy - np.asarray(position, dtype=np.float64)) ** 2).sum(axis=1)
    logs = -0.5 * away / sigma**2
    # From the nearest cell on, so that a position far outside excludes nothing by rounding.
    return np.asarray(logs - np.logaddexp.reduce(logs))


def raster_prior(
    database: SignatureDatabase, path: str | Path, *, band: int | None = None
) -> NDArray[np.float64]:
    """Return the prior of a raster, such as how many people pass or how many photos were taken.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        Any raster that GDAL reads, in any coordinate reference system. Its values, 0 or more, are
        taken as a density: a cell weighs as much as the mean over it. A value of 0 excludes a
        cell. Where the raster has no data or ends, nothing is known, and a cell weighs as little
        as the least of the others that has any weight.
    band : int, optional
        Which band to read, from 1; needed only where there are several.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell.

    Raises
    ------
    SourceError
        If the file cannot be read as a raster.
    CrsError
        If the raster does not say its coordinate reference system.
    InputError
        If the raster covers no cell, a value is negative or infinite, all are 0, or the band is
        not there or not named.

    Examples
    --------
    >>> import tempfile
    >>> import rasterio
    >>> x, y = demo_database.xy.min(axis=0) - 5.0
    >>> options = {"count": 1, "dtype": "uint8", "crs": "EPSG:32631", "width": 2, "height": 1}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/people.tif"
    ...     place = rasterio.Affine(150, 0, x, 0, -400, y + 400)
    ...     with rasterio.open(path, "w", transform=place, **options) as file:
    ...         file.write(np.array([[1, 3]], np.uint8), 1)
    ...     chances = np.exp(raster_prior(demo_database, path))
    >>> round(float(chances.max() / chances.min()), 6)
    3.0
    """
    from semsig_gis.storage.raster import raster_at_cells  # noqa: PLC0415 - GDAL loads slowly

    weights = raster_at_cells(
        path,
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
        band=band,
    )
    missing = np.isnan(weights)
    if missing.all():
        msg = f"{path} has no data at any cell of the database; give a raster of its area."
        raise InputError(msg)
    values = weights[~missing]
    if np.isinf(values).any() or (values < 0).any():
        msg = f"{path} holds {values.min():g} to {values.max():g}; give finite values, 0 or more."
        raise InputError(msg)
    weights[missing] = values[values > 0].min(initial=values.max())
    return weight_prior(database, weights)


def weight_prior(database: SignatureDatabase, weights: ArrayLike) -> NDArray[np.float64]:
    """Return the prior of a weight for each cell, such as how many people pass it.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    weights : array_like of float, shape (n,)
        Weights, 0 or more; 0 excludes a cell.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell.

    Raises
    ------
    InputError
        If there is not one weight a cell, one is negative or not finite, or all are 0.

    Examples
    --------
    >>> prior = weight_prior(demo_database, np.arange(len(demo_database)))
    >>> float(prior[0]), bool(np.exp(prior).sum().round(9) == 1)
    (-inf, True)
    """
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != (len(database),):
        msg = f"{values.size} weights for {len(database)} cells were given; give one a cell."
        raise InputError(msg)
    if not np.isfinite(values).all() or (values < 0).any():
        msg = "the weights of the cells hold a negative number or none at all; give 0 or more."
        raise InputError(msg)
    total = values.sum()
    if not total > 0:
        msg = "the prior excludes every cell of the database; widen it."
        raise InputError(msg)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(values / total))
