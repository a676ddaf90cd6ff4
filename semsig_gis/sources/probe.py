"""Probe a data file: find out its format and its columns by opening it once."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from semsig_gis.sources import parquet, vector
from semsig_gis.sources.vector.member import DRIVERS

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.sources.vector.member import LayerDescription, Member

VECTOR_SUFFIXES = frozenset({*DRIVERS, ".zip"} - {".csv"})
# An answer of Overpass is JSON, too, and has its key "elements" near the beginning.
OVERPASS_START_BYTES = 4096
# A shapefile consists of several files, and each may be replaced.
SHAPEFILE_PARTS = (".shp", ".shx", ".dbf", ".prj", ".cpg")
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
    suffix = path.suffix.lower()
    names = SHAPEFILE_PARTS if suffix == ".shp" else (path.suffix,)
    states = (part.stat() for name in names if (part := path.with_suffix(name)).is_file())
    stamp = tuple((state.st_mtime_ns, state.st_size, state.st_ino) for state in states)
    return _probe(path, suffix, stamp)


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
