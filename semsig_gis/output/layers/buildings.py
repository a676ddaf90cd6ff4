"""The layer of the buildings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.output.layers import LAYERS
from semsig_gis.output.layers.ground import ground_layer
from semsig_gis.output.layers.styles import Symbol

if TYPE_CHECKING:
    import geopandas as gpd
    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.layers.model import Layer


@LAYERS.register
def buildings_layer(
    database: SignatureDatabase,
    buildings: gpd.GeoDataFrame,
    around: NDArray[np.object_] | None = None,
) -> Layer:
    """Return the layer of the buildings near shapes, by default the box of the cells."""
    return ground_layer(
        database,
        buildings,
        around,
        name="buildings",
        title="Buildings",
        description="Outlines of buildings.",
        geometry="polygon",
        symbol=Symbol(colour="#e7e5e0", edge="#cbc8c1"),
    )
