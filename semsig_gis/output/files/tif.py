"""Cloud-Optimised GeoTIFF: one raster, with a style file for QGIS (QML)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.output.files import writer
from semsig_gis.output.layers.model import cell_raster
from semsig_gis.output.qgis.qml import by_pixel
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.layers.model import Raster


def export_geotiff(
    database: SignatureDatabase,
    values: ArrayLike,
    path: str | Path,
    *,
    name: str,
    unit: str = "",
    facts: Mapping[str, Any] | None = None,
) -> None:
    """Write one number per cell as a Cloud-Optimised GeoTIFF.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    values : array_like of float, shape (n,)
        Numbers such as ``database.type_group_sizes`` or ``identifiability.found``; NaN is no data.
    path : str or Path
        File to write; a failure leaves an older file unchanged.
    name : str
        Name of the numbers.
    unit : str, optional
        Their unit.
    facts : mapping of str, optional
        Plain values about the numbers, stored in the tags of the file as JSON.

    Raises
    ------
    InputError
        If there is not one number per cell, the cells span too wide an area, or the file cannot be
        written.

    Notes
    -----
    A pixel is a cell of the grid of the database, in its CRS, as float32; NaN is no data. The
    overviews hold means.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/objects.tif"
    ...     export_geotiff(demo_database, demo_database.lengths, path, name="objects seen")
    """
    write_geotiff(cell_raster(database, name, values, unit=unit, facts=facts), path)


@writer("raster")
def write_geotiff(raster: Raster, path: str | Path) -> None:
    """Write a raster as one Cloud-Optimised GeoTIFF, and a style file if it has classes."""
    from semsig_gis.storage import write_cells  # noqa: PLC0415 - rasterio is an optional extra

    write_cells(
        path,
        raster.bands,
        grid=raster.grid,
        columns=raster.columns,
        rows=raster.rows,
        crs=raster.crs,
        notes={
            "licenses": "\n".join(raster.licenses),
            "semsig_version": raster.version,
            **{key: json.dumps(value) for key, value in raster.facts.items()},
        },
    )
    if raster.scale is not None:
        write_whole(Path(path).with_suffix(".qml"), by_pixel(raster.scale))
