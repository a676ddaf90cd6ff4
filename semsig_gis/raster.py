"""Read a raster at the cells of a grid; the home of rasterio."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import rasterio
from rasterio._err import CPLE_BaseError
from rasterio.enums import ColorInterp, Resampling
from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT

from semsig_gis.errors import CrsError, InputError, SourceError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.grid import GridSpec

__all__ = ["raster_at_cells"]


def raster_at_cells(
    path: str | Path,
    *,
    grid: GridSpec,
    columns: ArrayLike,
    rows: ArrayLike,
    crs: CRS,
    band: int | None = None,
) -> NDArray[np.float64]:
    """Return the mean of a raster over each of some cells.

    Parameters
    ----------
    path : str or Path
        Any raster that GDAL reads, in any coordinate reference system.
    grid : GridSpec
        The grid.
    columns, rows : array_like of int, shape (n,)
        Cells, at least one.
    crs : pyproj.CRS
        Coordinate reference system of the grid.
    band : int, optional
        Which band to read, from 1; needed only where there are several.

    Returns
    -------
    ndarray of float64, shape (n,)
        Means over the pixels in each cell, by area; NaN where the raster has no data. A cell that
        touches the edge from outside may get the value there.

    Raises
    ------
    SourceError
        If the file cannot be read as a raster.
    CrsError
        If the raster does not say its coordinate reference system, or it does not fit the grid's.
    InputError
        If the raster does not have that band, or has several and none was named.

    Examples
    --------
    >>> import tempfile
    >>> from pyproj import CRS
    >>> from semsig_gis.grid import GridSpec
    >>> options = {"count": 1, "dtype": "uint8", "crs": "EPSG:2154"}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/counts.tif"
    ...     shape = {"width": 2, "height": 1, "transform": Affine(20, 0, 0, 0, -20, 20)}
    ...     with rasterio.open(path, "w", **options, **shape) as file:
    ...         file.write(np.array([[7, 9]], np.uint8), 1)
    ...     raster_at_cells(
    ...         path, grid=GridSpec(), columns=[0, 3, 9], rows=[0, 1, 0], crs=CRS("EPSG:2154")
    ...     ).tolist()
    [7.0, 9.0, nan]
    """
    across, up = np.asarray(columns, dtype=np.int64), np.asarray(rows, dtype=np.int64)
    left, top = int(across.min()), int(up.max())
    west, north = grid.origin[0] + left * grid.step, grid.origin[1] + (top + 1) * grid.step
    try:
        with warnings.catch_warnings():
            # A raster without a place on the ground is told about below.
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            source = rasterio.open(path)
        with source:
            if source.crs is None:
                msg = (
                    f"{path} does not say its coordinate reference system; give a raster that "
                    "does, such as a GeoTIFF."
                )
                raise CrsError(msg)
            chosen = _chosen_band(source, str(path), band)
            with WarpedVRT(
                source,
                crs=crs.to_wkt(),
                transform=Affine(grid.step, 0.0, west, 0.0, -grid.step, north),
                width=int(across.max()) - left + 1,
                height=top - int(up.min()) + 1,
                resampling=Resampling.average,
                nodata=np.nan,
                dtype="float64",
            ) as warped:
                values: NDArray[np.float64] = warped.read(chosen)
    except (CRSError, CPLE_BaseError) as error:
        msg = (
            f"the coordinate reference system of {path} cannot be turned into that of the cells; "
            "give a raster in another."
        )
        raise CrsError(msg) from error
    except RasterioError as error:
        reason = str(error).split(". ")[0].strip().rstrip(".")
        msg = f"{path} cannot be read as a raster ({reason}); give a file such as a GeoTIFF."
        raise SourceError(msg) from error
    return values[top - up, across - left]


def _chosen_band(source: rasterio.DatasetReader, path: str, band: int | None) -> int:
    """Return the band to read."""
    # What only tells how opaque the others are is none to choose.
    kinds = enumerate(source.colorinterp, start=1)
    bands = [number for number, kind in kinds if kind != ColorInterp.alpha]
    if band is None and len(bands) == 1:
        return bands[0]
    if band is None or band not in source.indexes:
        asked = "none was named" if band is None else f"band {band} was asked for"
        msg = f"{path} has {len(bands)} bands, but {asked}; name one, or give a raster of one band."
        raise InputError(msg)
    return band
