"""Probe a data file: find out its format and its columns by opening it once."""

from __future__ import annotations

import functools
import re
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
# Suffixes of text files with elements of OpenStreetMap, which their beginning shows.
ELEMENT_SUFFIXES = frozenset(
    {"", ".geojson", ".geojsonl", ".json", ".jsonl", ".ndjson", ".txt", ".xml"}
)
# Their beginning has the root of XML, or the first element of JSON: of an answer of a server,
# or of a list or lines of elements.
START_BYTES = 2**16
BOM = b"\xef\xbb\xbf"
ROOT = re.compile(rb"<(osm\w*)[\s>]")
ELEMENT = re.compile(rb'"(?:elements"\s*:\s*\[|type"\s*:\s*"(?:node|way|relation)")')
MOST_PROBES = 256


@dataclass(frozen=True, slots=True)
class FileProbe:
    """Format of a data file, its layers with a geometry, and the columns of each layer.

    Only vector files have `layers`, and only these and Parquet files have `columns`.
    """

    format: Literal["osm", "overpass", "parquet", "vector", "other"]
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
    if suffix in ELEMENT_SUFFIXES and stamp and (kind := elements_format(path)):
        return FileProbe(kind)
    if suffix not in VECTOR_SUFFIXES or not stamp:
        return FileProbe("other")
    layers = vector.spatial_layers(path)
    return FileProbe("vector", layers, tuple(layer.fields for _, layer in layers))


def elements_format(path: Path) -> Literal["osm", "overpass"] | None:
    """Return whether a text file has elements as XML ("osm") or JSON ("overpass"), or None."""
    with path.open("rb") as stream:
        start = stream.read(START_BYTES)
    if start.removeprefix(BOM).lstrip().startswith(b"<"):
        return "osm" if ROOT.search(start) else None
    return "overpass" if ELEMENT.search(start) and b'"Feature' not in start else None
