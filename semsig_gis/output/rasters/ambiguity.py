"""Raster of the number of cells that look the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.layers.model import cell_raster
from semsig_gis.output.layers.styles import AMBIGUITY
from semsig_gis.output.rasters import RASTERS

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.layers.model import Raster


@RASTERS.register
def ambiguity_raster(database: SignatureDatabase) -> Raster:
    """Return the number of cells with the types of each cell."""
    sizes = database.type_group_sizes
    return cell_raster(database, "ambiguity", sizes, unit="cells", scale=AMBIGUITY)
