"""Priors of the place of a query: log-priors by cell, shape (n,).

A prior is the logarithm of a chance by cell, up to a constant; minus infinity excludes a cell.
Independent priors are added.
"""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import geopandas as gpd
import numpy as np
import shapely

from semsig_gis.core import MOST_METRES, CrsError, InputError, require_number, to_degrees

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import AnyCrs
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.answers import PositionRecord

LEAST_SIGMA_M = 0.01
FARTHEST_SIGMAS = 3.0  # of a position from the nearest cell, beyond the visibility range

METRES, NORTH_EAST, EAST_NORTH = "X,Y", "LAT,LON", "LON,LAT"
_COORDINATE = re.compile(r"([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(m|°?\s*[NSEW])?", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPosition:
    """A position that is known without the query, in metres and in degrees.

    Parameters
    ----------
    x, y : float
        The position in metres, in the CRS of the database.
    lat, lon : float
        The same in degrees (WGS 84).
    sigma : float
        Standard deviation each way in metres.
    read_as : {"X,Y", "LAT,LON", "LON,LAT"}
        How the numbers were read.

    Examples
    --------
    >>> x, y = demo_database.xy[7].tolist()
    >>> position = KnownPosition.parse(f"{x},{y},50", demo_database)
    >>> same = KnownPosition.parse(f"{position.lon},{position.lat},50", demo_database)
    >>> position.read_as, same.read_as, round(same.x - x, 3)
    ('X,Y', 'LON,LAT', 0.0)
    """

    x: float
    y: float
    lat: float
    lon: float
    sigma: float
    read_as: str

    @classmethod
    def parse(cls, text: str, database: SignatureDatabase) -> Self:
        """Read a position with its deviation, such as ``60.171,24.947,200``.

        The numbers are x and y in the CRS of the database, or degrees in either order, whichever
        is in the city; ``60.171N,24.947E,200`` and ``386000m,6672000m,200`` are unambiguous.
        InputError if they cannot be read, or not exactly one reading is in the city.
        """
        parts = text.split(",")
        matches = [_COORDINATE.fullmatch(part.strip()) for part in parts[:2]]
        letters = "".join((match[2] or "?")[-1].upper() for match in matches if match)
        readings, sigma = [], math.nan
        if len(parts) == 3 and len(letters) == 2:  # noqa: PLR2004 - two coordinates and sigma
            with contextlib.suppress(ValueError):
                sigma = float(parts[2].strip().removesuffix("m"))
                values = [float(match[1]) for match in matches if match]
                readings = _readings(values, letters, database.crs)
        if not readings:
            raise InputError(
                f"the position was given as {text!r}; give {NORTH_EAST},SIGMA in degrees or "
                f"{METRES},SIGMA in metres of {database.crs.to_string()}, SIGMA in metres."
            )
        _check_sigma(sigma)
        near = []
        for form, (x, y, lon, lat) in readings:
            place = cls(x=x, y=y, lat=lat, lon=lon, sigma=sigma, read_as=form)
            if math.isfinite(x + y) and _is_near(database, (x, y), sigma):
                near.append(place)
        if len(near) != 1:
            read = " and ".join(place.read_as for place in near)
            raise InputError(
                f"the position {text!r} is in the city as {read}; write which is meant, such as "
                "60.171N,24.947E,200 or 386000m,6672000m,200."
                if near
                else f"the position {text!r} is in the city neither as {METRES} nor as "
                f"{NORTH_EAST} or {EAST_NORTH}: {_extent(database)}; give a place there, or a "
                "larger deviation."
            )
        return near[0]

    def to_dict(self) -> PositionRecord:
        """Return plain values, ready for JSON."""
        return {
            "x": self.x,
            "y": self.y,
            "lat": self.lat,
            "lon": self.lon,
            "sigma": self.sigma,
            "read_as": self.read_as,
        }


def _readings(
    values: list[float], letters: str, crs: CRS
) -> list[tuple[str, tuple[float, float, float, float]]]:
    """Return the possible readings of two numbers: form, x, y, longitude and latitude."""
    first, second = values
    readings = []
    if letters in {"??", "MM"}:
        readings.append((METRES, (first, second, *to_degrees(crs).transform(first, second))))
    for form, lon, lat in ((NORTH_EAST, second, first), (EAST_NORTH, first, second)):
        east, north = list(letters)[:: -1 if form == NORTH_EAST else 1]
        if east in "?EW" and north in "?NS" and (east == "?") == (north == "?"):
            place = (-lon if east == "W" else lon), (-lat if north == "S" else lat)
            if abs(lat) <= 90 and abs(lon) <= 180:  # noqa: PLR2004 - degrees
                xy = to_degrees(crs).transform(*place, direction="INVERSE")
                readings.append((form, (*xy, *place)))
    return readings


def _check_sigma(sigma: float) -> None:
    require_number(
        "deviation of the position", sigma, least=LEAST_SIGMA_M, most=MOST_METRES, unit="metres"
    )


def _is_near(database: SignatureDatabase, position: tuple[float, float], sigma: float) -> bool:
    """Whether a position may be in the city: near enough to a cell."""
    away = np.hypot(*(database.xy - np.asarray(position, dtype=np.float64)).T).min()
    return bool(away <= FARTHEST_SIGMAS * sigma + database.reach)


def _extent(database: SignatureDatabase) -> str:
    """Return a phrase with the extent of the cells, in metres and in degrees."""
    (west, south), (east, north) = database.xy.min(axis=0), database.xy.max(axis=0)
    bounds = to_degrees(database.crs).transform_bounds(west, south, east, north)
    low_lon, low_lat, high_lon, high_lat = bounds
    return (
        f"the cells lie at x {west:.0f} to {east:.0f}, y {south:.0f} to {north:.0f} "
        f"({database.crs.to_string()}), which is latitude {low_lat:.4f} to {high_lat:.4f}, "
        f"longitude {low_lon:.4f} to {high_lon:.4f}"
    )


def area_prior(
    database: SignatureDatabase,
    area: shapely.Geometry,
    *,
    crs: AnyCrs | None = None,
    outside: float = 0.0,
) -> NDArray[np.float64]:
    """Return the prior that the place lies in an area.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    area : shapely.Geometry
        A polygon or multipolygon.
    crs : int, str or pyproj.CRS, optional
        Coordinate reference system of the area; that of the database by default.
    outside : float, default 0
        Chance, 0 to below 1, that the place is outside the area.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell; all cells inside are equally likely, and all cells outside.

    Raises
    ------
    InputError
        If the area is no polygon, or no cell lies in it.
    CrsError
        If the coordinate reference system cannot be read.

    Examples
    --------
    >>> prior = area_prior(demo_database, shapely.Point(demo_database.xy[7]).buffer(3.0))
    >>> np.flatnonzero(np.isfinite(prior)).tolist()
    [7]
    """
    if not 0 <= outside < 1:
        raise InputError(
            f"the chance of a place outside the area is {outside}; give a number from 0 to below 1."
        )
    if not isinstance(area, (shapely.Polygon, shapely.MultiPolygon)) or area.is_empty:
        raise InputError(
            f"the area is a {type(area).__name__} or empty; give a polygon that is not."
        )
    shape = area
    if crs is not None:
        try:
            shape = gpd.GeoSeries([area], crs=crs).to_crs(database.crs).iloc[0]
        except (RuntimeError, ValueError) as error:
            raise CrsError(
                f"the coordinate reference system {crs!r} of the area cannot be read; give a code."
            ) from error
    shapely.prepare(shape)
    inside = shapely.intersects_xy(shape, *database.xy.T)
    if not inside.any():
        west, south, east, north = shape.bounds
        raise InputError(
            f"no cell lies in the area, which is at x {west:.0f} to {east:.0f}, y {south:.0f} to "
            f"{north:.0f}: {_extent(database)}; give an area there."
        )
    weights = np.where(
        inside,
        (1.0 - outside) / int(inside.sum()),
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
        Standard deviation each way in metres, from 0.01 to 1,000,000.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell.

    Raises
    ------
    InputError
        If a number is not finite, `sigma` is out of its range, or the position is farther from
        every cell than three deviations and the range of sight.

    Examples
    --------
    >>> x, y = demo_database.xy[7].tolist()
    >>> int(position_prior(demo_database, (x + 2.0, y), sigma=50.0).argmax())
    7
    """
    _check_sigma(sigma)
    if not all(map(math.isfinite, position)):
        raise InputError(f"the position is {position}; give x and y in metres.")
    if not _is_near(database, position, sigma):
        x, y = position
        raise InputError(
            f"the position ({x:.1f}, {y:.1f}) is outside the city: {_extent(database)}; give x and "
            "y of a place there, or a larger deviation."
        )
    away = ((database.xy - np.asarray(position, dtype=np.float64)) ** 2).sum(axis=1)
    logs = -0.5 * away / sigma**2
    # Normalised as logarithms, so that a position far outside excludes no cell by underflow.
    return np.asarray(logs - np.logaddexp.reduce(logs))


def raster_prior(
    database: SignatureDatabase, path: str | Path, *, band: int | None = None
) -> NDArray[np.float64]:
    """Return the prior of a raster, such as the number of people or photos.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        Any raster that GDAL reads, in any coordinate reference system. Its values, 0 or more, are
        a density: the weight of a cell is the mean over the cell. A value of 0 excludes a cell.
        Cells without data or beyond the raster get the least weight above 0 of the other cells.
    band : int, optional
        Band to read, from 1; required only if there are several.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell.

    Raises
    ------
    SourceError
        If the file cannot be read as a raster.
    CrsError
        If the raster has no coordinate reference system.
    InputError
        If the raster covers no cell, a value is negative or infinite, all are 0, or the band does
        not exist or is not given.

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
    from semsig_gis.storage import raster_at_cells  # noqa: PLC0415 - GDAL, 0.08 s

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
        raise InputError(
            f"{path} has no data at any cell: {_extent(database)}; give a raster of this area."
        )
    values = weights[~missing]
    if np.isinf(values).any() or (values < 0).any():
        raise InputError(
            f"{path} contains values from {values.min():g} to {values.max():g}; give finite "
            "values, 0 or more."
        )
    weights[missing] = values[values > 0].min(initial=values.max())
    return weight_prior(database, weights)


def weight_prior(database: SignatureDatabase, weights: ArrayLike) -> NDArray[np.float64]:
    """Return the prior of a weight for each cell, such as the number of people who pass.

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
        If there is not one weight per cell, a weight is negative or not finite, or all are 0.

    Examples
    --------
    >>> prior = weight_prior(demo_database, np.arange(len(demo_database)))
    >>> float(prior[0]), bool(np.exp(prior).sum().round(9) == 1)
    (-inf, True)
    """
    values = np.asarray(weights, dtype=np.float64)
    if values.shape != (len(database),):
        raise InputError(
            f"{values.size} weights for {len(database)} cells were given; give one for each cell."
        )
    if not np.isfinite(values).all() or (values < 0).any():
        raise InputError(
            "a weight of the cells is negative or not finite; give finite numbers, 0 or more."
        )
    total = values.sum()
    if not total > 0:
        raise InputError("the prior excludes every cell of the database; widen it.")
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(values / total))
