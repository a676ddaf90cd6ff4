"""Calls of public functions by name, for the methods `plot`, `explore` and `export` of results.

The packages that draw and write import the packages of the results, so a result cannot import them.
The root package `semsig_gis` lists all public names, and registers here a function that loads one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.core.display import Axes, MapFrame

_loaders: list[Callable[[str], Any]] = []


def register_loader(load: Callable[[str], Any]) -> None:
    """Register the function that returns a public function by name."""
    _loaders[:] = [load]


def plot_with(name: str, *results: object, **options: Any) -> Axes:  # noqa: ANN401 - as it takes
    """Return the axes on which the public function `name` draws results."""
    return _loaders[0](name)(*results, **options)


def export_with(name: str, *results: object, **options: Any) -> Any:  # noqa: ANN401 - as it takes
    """Write results by the public function `name`, and return what it returns."""
    return _loaders[0](name)(*results, **options)


def map_with(name: str, *results: object, ground: Mapping[str, Any] | None = None) -> MapFrame:
    """Return the map by the public function `name` of results, to show in a notebook.

    `ground` are the arguments of `ground_map`, for streets and buildings below the results.
    """
    map_ = _loaders[0](name)(*results)
    if ground:
        _loaders[0]("ground_map")(**ground, map_=map_)
    return _loaders[0]("show_map")(map_)
