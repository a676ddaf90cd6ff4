"""Cloud-Optimised GeoTIFF: one number a cell, one pixel a cell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.storage.raster import write_cells

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.evaluation.result import Evaluation


def export_geotiff(
    database: SignatureDatabase, values: ArrayLike, path: str | Path, *, name: str, unit: str = ""
) -> None:
    """Write one number a cell as a Cloud-Optimised GeoTIFF.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    values : array_like of float, shape (n,)
        Numbers such as ``database.type_group_sizes`` or ``identifiability.found``; NaN where there
        is none.
    path : str or Path
        File to write; it appears whole, by rename.
    name : str
        What the numbers are.
    unit : str, optional
        Their unit.

    Raises
    ------
    InputError
        If there is not one number a cell, the cells span too wide an area, or the file cannot be
        written.

    Notes
    -----
    A pixel is a cell of the grid of the database, in its CRS, as float32; NaN is no data. The
    overviews hold means, so that it is read fast from afar.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/objects.tif"
    ...     export_geotiff(demo_database, demo_database.lengths, path, name="objects seen")
    """
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (len(database),):
        msg = f"{numbers.size} numbers were given for {len(database)} cells; give one a cell."
        raise InputError(msg)
    write_cells(
        path,
        numbers,
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
        name=name,
        unit=unit,
        notes={"licenses": "\n".join(database.licenses), "semsig_version": database.version},
    )


def cell_errors(evaluation: Evaluation, database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the mean expected error in metres of the queries from each cell (float64, n).

    NaN where no query is from; queries of which the distortion left nothing do not count. Raises
    `InputError` if another database was searched.
    """
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    rows = evaluation.rows_in(database)
    kept = np.isfinite(errors) & (rows >= 0)
    counts = np.bincount(rows[kept], minlength=len(database))
    sums = np.bincount(rows[kept], errors[kept], minlength=len(database))
    means = np.full(len(database), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means
