"""Kinds of sources: what `reader` of a catalogue names.

Each module of the package `readers` registers one: how its files are read and, if there is a
service, how they are fetched. To add a service that sends a layer as files or pages of records,
decorate its function with `sources.services.fetch.service`. The schema of catalogues and the
commands find the module.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import Registry, installed_readers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from semsig_gis.sources.layer import RawLayer


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A kind of source.

    `read` is a `Reader` of a file; with `merging` also of several files, as one map, and with
    `pruning` it accepts an `area` to skip rows outside. `fetch` takes layers and the keywords
    `endpoints`, `area`, `cache`, `spec` (settings of requests), `progress` and `filters`; it
    returns each layer with a text about its size and date, empty if it consists of tiles. It is
    None if there is no service.
    """

    read: Callable[..., tuple[RawLayer, ...]]
    fetch: Callable[..., Iterable[tuple[RawLayer, str]]] | None = None
    merging: bool = False
    pruning: bool = False


def _installed(reserved: tuple[str, ...]) -> Mapping[str, Source]:
    readers = installed_readers(reserved=reserved)
    return {name: Source(read=read) for name, read in readers.items()}


READERS: Registry[Source] = Registry(
    "reader",
    "semsig_gis.sources.readers",
    [str(Path(__file__).with_name("readers"))],
    _installed,
)
"""Every kind of source, also of other packages, by name."""


def fetch_by_tiles(
    fetch_layers: Callable[..., list[Path]], read: Callable[..., tuple[RawLayer, ...]]
) -> Callable[..., list[tuple[RawLayer, str]]]:
    """Return the `Source.fetch` of a service that sends an area in tiles, each a file."""
    return lambda specs, *, filters, **request: [
        (layer, "") for layer in read(fetch_layers(specs, **request), specs, filters=filters)
    ]
