"""Raster of the share of queries that fail around every place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import error_field
from semsig_gis.output.layers.model import Raster
from semsig_gis.output.layers.styles import FAILED
from semsig_gis.output.rasters import RASTERS

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation


@RASTERS.register
def field_raster(
    database: SignatureDatabase, evaluation: Evaluation, *, smoothing: float | None = None
) -> Raster:
    """Return three bands of the field of errors; the radius is in the facts.

    ``failed`` is the share of the queries around a pixel that failed, ``error`` their mean error in
    metres, and ``queries`` their weighted number; NaN where no query is near.
    """
    field = error_field(evaluation, database, radius=smoothing)
    columns, rows = np.nonzero(np.isfinite(field.failed.T))
    units = {"failed": "", "error": "m", "queries": "queries"}
    bands = zip(units, (field.failed, field.errors, field.speaking), strict=True)
    return Raster(
        name="field",
        grid=field.grid,
        columns=columns.astype(np.int32),
        rows=rows.astype(np.int32),
        crs=database.crs,
        bands={name: (values[rows, columns], units[name]) for name, values in bands},
        licenses=database.licenses,
        version=database.version,
        facts={"radius_m": field.radius},
        scale=FAILED,
    )
