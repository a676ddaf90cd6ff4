"""The layer of the streets."""

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
def streets_layer(
    database: SignatureDatabase,
    streets: gpd.GeoDataFrame,
    around: NDArray[np.object_] | None = None,
) -> Layer:
    """Return the layer of the streets near shapes, by default the box of the cells."""
    return ground_layer(
        database,
        streets,
        around,
        name="streets",
        title="Streets",
        description="Middle lines of streets.",
        geometry="line",
        symbol=Symbol(colour="#bdc3c9", metres=4.0, least_mm=0.2),
    )
