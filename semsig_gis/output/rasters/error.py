"""Raster of the errors of an evaluation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.output.layers.model import cell_raster, group_means
from semsig_gis.output.layers.styles import ERRORS
from semsig_gis.output.rasters import RASTERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.layers.model import Raster


@RASTERS.register
def error_raster(database: SignatureDatabase, evaluation: Evaluation) -> Raster:
    """Return the mean error of the queries from each cell."""
    errors = cell_errors(evaluation, database)
    return cell_raster(database, "error", errors, unit="m", scale=ERRORS)


def cell_errors(evaluation: Evaluation, database: SignatureDatabase) -> NDArray[np.float64]:
    """Return the mean expected error in metres of the queries from each cell (float64, n).

    NaN for a cell without queries; queries that the distortion left empty do not count. Raises
    `InputError` if another database was searched.
    """
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    rows = evaluation.rows_in(database)
    counted = np.isfinite(errors) & (rows >= 0)
    return group_means(rows[counted], errors[counted], len(database))
