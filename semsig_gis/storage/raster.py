"""Read and write rasters at the cells of a grid, the only module that imports rasterio."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import CrsError, InputError, SourceError, extra
from semsig_gis.storage.text import require_regular
from semsig_gis.storage.whole import whole_file

with extra("raster", "a raster file"):
    import rasterio
    import rasterio.shutil
    from rasterio._err import CPLE_BaseError
    from rasterio.enums import ColorInterp, Resampling
    from rasterio.errors import CRSError, NotGeoreferencedWarning, RasterioError
    from rasterio.transform import Affine
    from rasterio.vrt import WarpedVRT
    from rasterio.windows import Window

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import GridSpec

TILE = 512
# 330 km by 330 km at a step of 10 m; a larger raster is a mistake in the data.
MAX_PIXELS = 1 << 30


def raster_at_cells(
    path: str | Path,
    *,
    grid: GridSpec,
    columns: ArrayLike,
    rows: ArrayLike,
    crs: CRS,
    band: int | None = None,
) -> NDArray[np.float64]:
    """Return the mean of a raster in each cell, weighted by the area of the pixels in it.

    The raster may have any format that GDAL reads, and any CRS; `crs` is the CRS of the grid. The
    mean is NaN where the raster has no data; a cell that touches the raster's edge from outside may
    get the value there. `band` counts from 1. SourceError if the file is not a raster, CrsError if
    its CRS is missing or cannot be transformed, InputError if `band` is wrong, or missing although
    there are several.
    """
    across, up = np.asarray(columns, dtype=np.int64), np.asarray(rows, dtype=np.int64)
    left, top = int(across.min()), int(up.max())
    west, north = grid.origin[0] + left * grid.step, grid.origin[1] + (top + 1) * grid.step
    try:
        with warnings.catch_warnings():
            # A missing CRS is an error below.
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            if os.path.exists(path):  # noqa: PTH110 - Path.exists raises for some names
                require_regular(path)
            source = rasterio.open(path)
        with source:
            if source.crs is None:
                raise CrsError(
                    f"{path} does not say its coordinate reference system; give a raster that "
                    "does, such as a GeoTIFF."
                )
            number = _band_number(source, str(path), band)
            # GDAL resamples the raster to pixels that are the cells.
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
                values: NDArray[np.float64] = warped.read(number)
    except (CRSError, CPLE_BaseError) as error:
        raise CrsError(
            f"the coordinate reference system of {path} cannot be turned into that of the cells; "
            "give a raster in another."
        ) from error
    except (RasterioError, OSError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).split(". ")[0].strip().rstrip(".")
        raise SourceError(
            f"{path} cannot be read as a raster ({reason}); give a file such as a GeoTIFF."
        ) from error
    return values[top - up, across - left]


def _band_number(source: rasterio.DatasetReader, path: str, band: int | None) -> int:
    """Return the number of the band to read; InputError if it is wrong or not unique."""
    # An alpha band contains the opacity of the others.
    kinds = enumerate(source.colorinterp, start=1)
    bands = [number for number, kind in kinds if kind != ColorInterp.alpha]
    if band is None and len(bands) == 1:
        return bands[0]
    if band is None or band not in source.indexes:
        which = "none was named" if band is None else f"band {band} was asked for"
        raise InputError(
            f"{path} has {len(bands)} bands, but {which}; name one, or give a raster of one band."
        )
    return band


def write_cells(
    path: str | Path,
    bands: Mapping[str, tuple[NDArray[np.float64], str]],
    *,
    grid: GridSpec,
    columns: NDArray[np.int32],
    rows: NDArray[np.int32],
    crs: CRS,
    notes: Mapping[str, str],
) -> None:
    """Write values of cells as a Cloud-Optimised GeoTIFF, atomically; other pixels are NaN.

    Each band has a name, one value per cell, and a unit. Cells, at least one, are sorted by column;
    they are written in strips to limit memory. InputError if the cells span too large an area, or
    the file cannot be written.
    """
    left, top = int(columns[0]), int(rows.max())
    width, height = int(columns[-1]) - left + 1, top - int(rows.min()) + 1
    if width * height > MAX_PIXELS:
        raise InputError(
            f"the cells span {width:,} by {height:,} pixels, which is too wide for a raster; "
            "export the distant parts of the city separately."
        )
    west, north = grid.origin[0] + left * grid.step, grid.origin[1] + (top + 1) * grid.step
    with whole_file(path) as partial:
        strips = partial.with_name("strips.tif")
        try:
            with rasterio.open(
                strips,
                "w",
                driver="GTiff",
                width=width,
                height=height,
                count=len(bands),
                dtype="float32",
                nodata=np.nan,
                crs=crs.to_wkt(),
                transform=Affine(grid.step, 0.0, west, 0.0, -grid.step, north),
                tiled=True,
                blockxsize=TILE,
                blockysize=TILE,
                sparse_ok=True,
            ) as file:
                file.update_tags(**notes)
                for band, (name, (_, unit)) in enumerate(bands.items(), start=1):
                    file.set_band_description(band, name)
                    file.set_band_unit(band, unit)
                # One strip of columns at a time, as wide as a tile.
                for start in range(0, width, TILE):
                    low, high = np.searchsorted(columns, [left + start, left + start + TILE])
                    strip = np.full((height, min(TILE, width - start)), np.nan, np.float32)
                    window = Window(start, 0, strip.shape[1], height)
                    across = columns[low:high] - left - start
                    for band, (values, _) in enumerate(bands.values(), start=1):
                        strip[top - rows[low:high], across] = values[low:high]
                        file.write(strip, band, window=window)
            rasterio.shutil.copy(
                strips,
                partial,
                driver="COG",
                blocksize=TILE,
                compress="DEFLATE",
                predictor="YES",
                overview_resampling="AVERAGE",
            )
            _check_blocks(partial)
        except (CPLE_BaseError, RasterioError) as error:
            # GDAL's message does not help the user; the cause has it.
            raise InputError(
                f"{path} could not be written whole, so what was there before is unchanged; free "
                "some space or choose another folder."
            ) from error


def _check_blocks(path: Path) -> None:
    """Read all blocks of a raster, to detect one that a full disk has truncated silently."""
    with rasterio.open(path) as file:
        for level in (None, *range(len(file.overviews(1)))):
            with rasterio.open(path, overview_level=level) as part:
                for _, window in part.block_windows(1):
                    part.read(window=window)
