"""Layers of a city: each module makes one, with its columns and its styles, by its own name.

To add a layer, add its module, with a function that `LAYERS.register` decorates. Its parameters are
results of a city by name: ``database``, ``objects``, ``buildings``, ``streets``,
``identifiability``, ``evaluation``, ``geometry``, ``smoothing`` (metres) and ``resolution`` (of
hexagons). A layer needs those without a default, and uses the others. `export_database`, its
messages, the commands and the general tests find it. Another package adds one by an entry point of
the group ``semsig_gis.layers``.
"""

from __future__ import annotations

import inspect
from functools import partial
from typing import TYPE_CHECKING, Any

from semsig_gis.core import LAYERS as ENTRY_POINTS
from semsig_gis.core import Registry, installed_outputs

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.output.layers.model import Layer


LAYERS: Registry[Callable[..., Layer]] = Registry(
    "layer",
    __name__,
    __path__,
    partial(installed_outputs, ENTRY_POINTS),
    without=("answer", "columns", "ground", "model", "styles"),
)


def layer_names() -> list[str]:
    """Return the names of the layers of a city, without those of other packages."""
    return [*LAYERS.names]


def needed_results(make: Callable[..., Any]) -> set[str]:
    """Return the results that a layer or a raster needs in addition to the database."""
    parameters = inspect.signature(make).parameters.values()
    return {item.name for item in parameters if item.default is item.empty} - {"database"}


def used_results(make: Callable[..., Any]) -> set[str]:
    """Return the results that a layer or a raster needs or uses."""
    return {*inspect.signature(make).parameters}
