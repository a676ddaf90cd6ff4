"""Write one number per cell as Cloud-Optimised GeoTIFF, with a style file for QGIS (QML)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import InputError
from semsig_gis.output.layers.model import group_means
from semsig_gis.output.layers.styles import AMBIGUITY, CHANCES, ERRORS, FAILED, IDENTIFIABILITY
from semsig_gis.output.qgis.qml import by_pixel
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import GridSpec
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import ErrorField, Evaluation
    from semsig_gis.output.layers.styles import Scale


SCALES: Mapping[str, Scale] = {
    "ambiguity": AMBIGUITY,
    "identifiability": IDENTIFIABILITY,
    "error": ERRORS,
    "field": FAILED,
    "posterior": CHANCES,
}
"""Classes of the first band of each raster."""


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
    overviews hold means. For the names in `STYLES`, a style file ``.qml`` in the same folder makes
    QGIS draw the raster in the colours of the maps.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/objects.tif"
    ...     export_geotiff(demo_database, demo_database.lengths, path, name="objects seen")
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (len(database),):
        raise InputError(
            f"{numbers.size} numbers were given for {len(database)} cells; give one for each."
        )
    _write_raster(
        database,
        path,
        {name: (numbers, unit)},
        grid=database.grid,
        places=(database.columns, database.rows),
        facts=facts or {},
        style=name,
    )


def export_field(field: ErrorField, database: SignatureDatabase, path: str | Path) -> None:
    """Write an error field as a GeoTIFF of three bands, with a style file for QGIS.

    ``failed`` is the share of the queries around a pixel that failed, ``error`` their mean error in
    metres, and ``queries`` their weighted number; NaN where no query is near. The radius is in the
    tags.
    """
    columns, rows = np.nonzero(np.isfinite(field.failed.T))
    units = {"failed": "", "error": "m", "queries": "queries"}
    bands = zip(units, (field.failed, field.errors, field.speaking), strict=True)
    _write_raster(
        database,
        path,
        {name: (values[rows, columns], units[name]) for name, values in bands},
        grid=field.grid,
        places=(columns.astype(np.int32), rows.astype(np.int32)),
        facts={"radius_m": field.radius},
        style="field",
    )


def _write_raster(
    database: SignatureDatabase,
    path: str | Path,
    bands: Mapping[str, tuple[NDArray[np.float64], str]],
    *,
    grid: GridSpec,
    places: tuple[NDArray[np.int32], NDArray[np.int32]],
    facts: Mapping[str, Any],
    style: str,
) -> None:
    """Write bands of values and units at columns and rows of a grid, and a style if it exists."""
    from semsig_gis.storage import write_cells  # noqa: PLC0415 - rasterio is an optional extra

    notes = {
        "licenses": "\n".join(database.licenses),
        "semsig_version": database.version,
        **{key: json.dumps(value) for key, value in facts.items()},
    }
    columns, rows = places
    write_cells(path, bands, grid=grid, columns=columns, rows=rows, crs=database.crs, notes=notes)
    if style in SCALES:
        write_whole(Path(path).with_suffix(".qml"), by_pixel(SCALES[style]))


def cell_errors(evaluation: Evaluation, database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the mean expected error in metres of the queries from each cell (float64, n).

    NaN for a cell without queries; queries that the distortion left empty do not count. Raises
    `InputError` if another database was searched.
    """
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    rows = evaluation.rows_in(database)
    counted = np.isfinite(errors) & (rows >= 0)
    return group_means(rows[counted], errors[counted], len(database))
