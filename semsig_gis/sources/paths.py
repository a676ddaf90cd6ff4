"""Paths of data files: which files a folder contains, and whether a path is a file."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from semsig_gis.core.errors import SourceError

if TYPE_CHECKING:
    from pathlib import Path

# Files with another suffix (.dbf, .prj, a README) accompany data and are not opened on their own.
FILE_SUFFIXES = frozenset(
    {".bz2", ".csv", ".fgb", ".geojson", ".geoparquet", ".gml", ".gpkg", ".gz", ".json",
     ".osm", ".parquet", ".pbf", ".shp", ".zip"}
)  # fmt: skip


def require_file(path: Path, kind: str) -> None:
    """Refuse a path that is not a file, with a SourceError that says which kind is needed."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise SourceError(f"{path} {what}; give {kind}.")


def files_in(folder: Path) -> list[Path]:
    """Return the data in a folder, and in the partitions of a dataset that it is, sorted."""
    parts = (
        files_in(path) if "=" in path.name and path.is_dir() else [path]
        for path in folder.iterdir()
    )
    files = itertools.chain.from_iterable(parts)
    return sorted(path for path in files if path.suffix.lower() in FILE_SUFFIXES)
