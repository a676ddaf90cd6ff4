"""Paths of data files: which files a folder contains, and whether a path is a file."""

from __future__ import annotations

import itertools
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# Other files (.dbf, .prj, a README) only accompany data.
FILE_SUFFIXES = frozenset(
    {".bz2", ".csv", ".fgb", ".geojson", ".geoparquet", ".gml", ".gpkg", ".gz", ".json",
     ".osm", ".parquet", ".pbf", ".shp", ".umap", ".xlsx", ".zip",
     ".dxf", ".gdb", ".geojsonl", ".geojsons", ".geojsonseq", ".gpx", ".jsonl", ".kml", ".kmz",
     ".mif", ".ndjson", ".o5m", ".ods", ".osh", ".spatialite", ".sqlite", ".sqlite3", ".tab",
     ".topojson", ".tsv"}
)  # fmt: skip
# Formats of several files with the same name; each may be replaced.
OF_PARTS = frozenset({".mif", ".shp", ".tab"})


def is_geodatabase(path: Path) -> bool:
    """Whether a path is a file geodatabase, a folder that is one data file."""
    return path.suffix.lower() == ".gdb" and path.is_dir()


def is_folder(path: Path) -> bool:
    """Whether a path is a folder of files."""
    return path.is_dir() and not is_geodatabase(path)


def file_stamp(path: Path) -> tuple[tuple[int, int, int], ...]:
    """Return what changes with a file, or with a file in a geodatabase; empty if it is absent."""
    if is_geodatabase(path):
        parts = sorted(path.iterdir())
    elif path.suffix.lower() in OF_PARTS and path.is_file():
        stem = path.stem.casefold()
        parts = sorted(part for part in path.parent.iterdir() if part.stem.casefold() == stem)
    else:
        parts = [path]
    states = (part.stat() for part in parts if part.is_file())
    return tuple((state.st_mtime_ns, state.st_size, state.st_ino) for state in states)


def require_file(path: Path, kind: str) -> None:
    """Raise SourceError if a path is not a file; `kind` describes the file that is needed."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise SourceError(f"{path} {what}; give {kind}.")


def matches_pattern(name: str, patterns: Iterable[str]) -> bool:
    """Whether a file name matches one of some patterns; case is ignored."""
    return any(fnmatchcase(name.casefold(), pattern.casefold()) for pattern in patterns)


def files_in(folder: Path) -> list[Path]:
    """Return the data files in a folder and its partitions such as ``theme=base``, sorted."""
    parts = (
        files_in(path) if "=" in path.name and path.is_dir() else [path]
        for path in folder.iterdir()
    )
    files = itertools.chain.from_iterable(parts)
    return sorted(path for path in files if path.suffix.lower() in FILE_SUFFIXES)
