"""Raster of the chance that a query is found."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.layers.model import cell_raster
from semsig_gis.output.layers.styles import IDENTIFIABILITY
from semsig_gis.output.rasters import RASTERS

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability
    from semsig_gis.output.layers.model import Raster


@RASTERS.register
def identifiability_raster(database: SignatureDatabase, identifiability: Identifiability) -> Raster:
    """Return the chance that a query from each cell is found."""
    identifiability.require_cells_of(database)
    name = "identifiability"
    return cell_raster(database, name, identifiability.found, scale=IDENTIFIABILITY)
