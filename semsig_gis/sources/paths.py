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
     ".osm", ".parquet", ".pbf", ".shp", ".zip"}
)  # fmt: skip


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
