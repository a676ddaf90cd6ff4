"""Formats of files: each module writes one, and its name is the suffix of the files.

To add a format, add its module, with a function that `writer` decorates. `export_database`,
`export_answer`, their messages, the commands and the general tests find it. Another package adds
one by an entry point of the group ``semsig_gis.exports``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from semsig_gis.core import EXPORTS, Registry, installed_outputs

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.database import CellGeometry

Content = Literal["layer", "layers", "raster", "answer"]


@dataclass(frozen=True, kw_only=True)
class Writer:
    """A format of files.

    ``write(content, path, *, progress)`` writes a layer, a sequence of layers, or ``write(content,
    path)`` a raster or the layers of an answer, as ``holds`` says.
    """

    write: Callable[..., None]
    holds: Content
    layers: tuple[str, ...] = ()  # names of the layers that it can hold; all by default
    cells: CellGeometry | None = "polygon"  # default geometry of cells; None: not to be chosen
    # Writes all layers of an answer, in a format that holds one layer of a database.
    write_answer: Callable[..., None] | None = None

    def __call__(self, content: Any, path: str | Path, **options: Any) -> None:  # noqa: ANN401 - as `holds` says
        """Write a file."""
        self.write(content, path, **options)


ONLY_ANSWERS = frozenset({"kml"})  # known without importing their modules

FORMATS: Registry[Writer] = Registry(
    "format",
    __name__,
    __path__,
    partial(installed_outputs, EXPORTS),
    without=("answers",),
)


def writer(holds: Content = "layer", **options: Any) -> Callable[[Callable[..., None]], Writer]:  # noqa: ANN401 - of `Writer`
    """Register a function as the writer of the format of its module; a decorator."""

    def register(write: Callable[..., None]) -> Writer:
        return FORMATS.register(Writer(write=write, holds=holds, **options), write.__module__)

    return register


def export_suffixes() -> list[str]:
    """Return the suffixes of files of a database, without those of other packages."""
    return [f".{name}" for name in FORMATS.names if name not in ONLY_ANSWERS]
