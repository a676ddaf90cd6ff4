"""Rasters of a city: each module makes one, by its own name.

To add a raster, add its module, with a function that `RASTERS.register` decorates; its parameters
are those of a layer (see `output.layers`). Another package adds one by an entry point of the group
``semsig_gis.rasters``.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from semsig_gis.core import RASTERS as ENTRY_POINTS
from semsig_gis.core import Registry, installed_outputs

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.output.layers.model import Raster


RASTERS: Registry[Callable[..., Raster]] = Registry(
    "raster", __name__, __path__, partial(installed_outputs, ENTRY_POINTS)
)


def raster_names() -> list[str]:
    """Return the names of the rasters of a city, without those of other packages."""
    return [*RASTERS.names]
