"""Plots and maps of results: how `plot` and `explore` reach the packages that draw.

A result draws itself in a notebook, but the packages that draw import the package of the result.
So the root of `semsig_gis`, which lists all public names, registers here how to load one, and the
methods of a result call a function by its public name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.core.display import Axes, MapFrame

_loaders: list[Callable[[str], Any]] = []


def register_loader(load: Callable[[str], Any]) -> None:
    """Set the function that returns a public function by its name."""
    _loaders[:] = [load]


def plot_with(name: str, *results: object, **options: Any) -> Axes:  # noqa: ANN401 - as it takes
    """Call the public function `name`, which draws results on axes."""
    return _loaders[0](name)(*results, **options)


def map_with(name: str, *results: object) -> MapFrame:
    """Show in a notebook the map that the public function `name` returns for results."""
    return _loaders[0]("show_map")(_loaders[0](name)(*results))
