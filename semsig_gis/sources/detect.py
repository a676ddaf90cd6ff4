"""Detect the catalogue of a file from its contents."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.sources.files import file_reader
from semsig_gis.sources.paths import files_in, require_file
from semsig_gis.sources.probe import probe_file

if TYPE_CHECKING:
    from collections.abc import Iterable

# Columns that every table of Overture Maps has.
OVERTURE_COLUMNS = frozenset({"id", "version", "sources", "bbox"})
# Catalogue of a file by its reader, and a description of the file for the user.
CATALOG_OF_READER = {
    "osm_features": ("openstreetmap", "elements of OpenStreetMap, by its columns"),
    "osm_file": ("openstreetmap", "an extract of OpenStreetMap"),
    "overpass": ("openstreetmap", "an answer of an Overpass server"),
    "overture": ("overture", "a table of Overture Maps, by its columns"),
}


def detect_catalogs(paths: Iterable[str | Path]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Detect the catalogue of each file; return the catalogues' names and a line on each file.

    Of a folder, every data file in it is examined. InputError if a file cannot be assigned.
    """
    names: list[str] = []
    lines: list[str] = []
    for path in map(Path, paths):
        if not path.is_dir():
            require_file(path, "a file or a folder of files")
        files = files_in(path) if path.is_dir() else [path]
        for file in files or [path]:
            reader = file_reader(file, sure=True) if files else None
            if reader is None and any(map(OVERTURE_COLUMNS.issubset, probe_file(file).columns)):
                reader = "overture"
            if reader is None:
                raise InputError(
                    f"{file} does not say what it contains; name its catalogue with --catalog "
                    "(`semsig sources` lists them), or draft one with `semsig draft`."
                )
            name, description = CATALOG_OF_READER[reader]
            names.append(name)
            lines.append(f"{file} is read as {description}, with the catalogue {name}")
    return tuple(dict.fromkeys(names)), tuple(lines)
