"""Probe a data file: find out its format and its columns by opening it once."""

from __future__ import annotations

import contextlib
import functools
import re
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Literal

from semsig_gis.core import SourceError
from semsig_gis.sources import parquet, vector
from semsig_gis.sources.compression import open_unpacked
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.paths import file_stamp
from semsig_gis.sources.vector.formats import ARCHIVES, CSV, DRIVERS, WORKBOOKS

if TYPE_CHECKING:
    from semsig_gis.sources.vector.member import LayerDescription, Member

# Sources with a catalogue of their own.
SourceFormat = Literal["gbfs", "gtfs", "mapillary"]
VECTOR_SUFFIXES = ARCHIVES | {
    suffix for suffix, driver in DRIVERS.items() if driver not in {CSV, *WORKBOOKS}
}
TABLES = frozenset(suffix for suffix, driver in DRIVERS.items() if driver == CSV)
# Suffixes of text files of certain sources, which their beginning shows.
TEXT_SUFFIXES = frozenset(
    {"", ".geojson", ".geojsonl", ".json", ".jsonl", ".ndjson", ".txt", ".xml"}
)
# Their beginning has the root of XML, or the first element of JSON: of an answer of a server,
# or of a list or lines of elements of OpenStreetMap.
START_BYTES = 2**16
BOM = b"\xef\xbb\xbf"
ROOT = re.compile(rb"<(osm\w*)[\s>]")
ELEMENT = re.compile(
    rb'"(?:elements"\s*:\s*\[|type"\s*:\s*"(?:node|way|relation)"|nodes"\s*:\s*\[\s*\{[^}]*"lat")'
)
# Keys of other sources; a file has all of them.
KEYS: dict[SourceFormat, tuple[re.Pattern[bytes], ...]] = {
    "gbfs": tuple(map(re.compile, (rb'"data"\s*:', rb'"stations"\s*:\s*\[', rb'"station_id"'))),
    "mapillary": tuple(
        map(re.compile, (rb'"(?:object_)?value"\s*:\s*"[a-z-]+--', rb'"coordinates"\s*:'))
    ),
}
GTFS_TABLES = frozenset({"agency.txt", "routes.txt", "stop_times.txt", "stops.txt", "trips.txt"})
MOST_PROBES = 256


@dataclass(frozen=True, slots=True)
class FileProbe:
    """Format of a data file, its layers with a geometry, and the columns of each layer.

    Only vector files have `layers`, and only these, CSV and Parquet files have `columns`.
    """

    format: Literal["osm", "overpass", "parquet", "table", "vector", "other"] | SourceFormat
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
    inner = Path(path.stem).suffix.lower() if suffix in {".bz2", ".gz"} else suffix
    if inner in TEXT_SUFFIXES and stamp and (kind := text_format(path)):
        return FileProbe(kind)
    if suffix == ".zip" and stamp and _is_feed(path):
        return FileProbe("gtfs")
    if suffix in TABLES and stamp:
        with contextlib.suppress(SourceError):  # its reader reports what is wrong
            file = open_csv(lambda: path.open("rb"), str(path))
            return FileProbe("table", columns=(file.layouts[file.separator],))
    if suffix not in VECTOR_SUFFIXES or not stamp:
        return FileProbe("other")
    layers = vector.spatial_layers(path)
    return FileProbe("vector", layers, tuple(layer.fields for _, layer in layers))


def text_format(path: Path) -> Literal["osm", "overpass"] | SourceFormat | None:
    """Return the format of a text file of a certain source, or None.

    Elements of OpenStreetMap are "osm" as XML and "overpass" as JSON.
    """
    packed = path.suffix.lower() in {".bz2", ".gz"}
    try:
        with open_unpacked(path) as stream:
            start = stream.read(START_BYTES)
    except (EOFError, OSError, zlib.error):
        if packed:
            return None  # not of this format, or damaged
        raise
    start = start.removeprefix(BOM).lstrip()
    if start.startswith(b"<"):
        return "osm" if ROOT.search(start) else None
    if path.name.lower() == "stops.txt" and b"stop_lat" in start:
        return "gtfs"
    for kind, keys in KEYS.items():
        if not packed and all(key.search(start) for key in keys):
            return kind
    return "overpass" if ELEMENT.search(start) and b'"Feature' not in start else None


def _is_feed(path: Path) -> bool:
    """Whether an archive is a feed of public transport."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = {PurePosixPath(name).name.lower() for name in archive.namelist()}
    except (OSError, ValueError, zipfile.BadZipFile):
        return False
    return "stops.txt" in names and len(names & GTFS_TABLES) > 1
