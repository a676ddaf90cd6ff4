"""Probe a data file: find out its format and its columns by opening it once."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from semsig_gis.sources import parquet, vector
from semsig_gis.sources.paths import file_stamp
from semsig_gis.sources.vector.formats import ARCHIVES, CSV, DRIVERS, WORKBOOKS

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources.vector.member import LayerDescription, Member

VECTOR_SUFFIXES = ARCHIVES | {
    suffix for suffix, driver in DRIVERS.items() if driver not in {CSV, *WORKBOOKS}
}
# An answer of Overpass is JSON, too, and has its key "elements" near the beginning.
OVERPASS_START_BYTES = 4096
MOST_PROBES = 256


@dataclass(frozen=True, slots=True)
class FileProbe:
    """Format of a data file, its layers with a geometry, and the columns of each layer.

    Only vector files have `layers`, and only these and Parquet files have `columns`.
    """

    format: Literal["overpass", "parquet", "vector", "other"]
    layers: tuple[tuple[Member, LayerDescription], ...] = ()
    columns: tuple[tuple[str, ...], ...] = ()


def probe_file(path: Path) -> FileProbe:
    """Return the probe of a file, which is opened again only after it has changed.

    SourceError if the file is damaged.
    """
    return _probe(path, path.suffix.lower(), file_stamp(path))


@functools.lru_cache(maxsize=MOST_PROBES)
def _probe(path: Path, suffix: str, stamp: tuple[tuple[int, int, int], ...]) -> FileProbe:
    """Open a file; `stamp` is the part of the cache's key that changes with the file."""
    if suffix in parquet.SUFFIXES and stamp:
        return FileProbe("parquet", columns=(tuple(parquet.column_names(path)),))
    if suffix not in VECTOR_SUFFIXES or not stamp:
        return FileProbe("other")
    if suffix == ".json":
        with path.open("rb") as stream:
            start = stream.read(OVERPASS_START_BYTES)
        if b'"elements"' in start and b'"Feature' not in start:
            return FileProbe("overpass")
    layers = vector.spatial_layers(path)
    return FileProbe("vector", layers, tuple(layer.fields for _, layer in layers))
