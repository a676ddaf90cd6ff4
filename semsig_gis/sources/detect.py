"""What files say of themselves: which catalogue theirs is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core.errors import InputError
from semsig_gis.sources.files import file_reader
from semsig_gis.sources.parquet import SUFFIXES, column_names
from semsig_gis.sources.paths import files_in, require_file

if TYPE_CHECKING:
    from collections.abc import Iterable

# Of every table of Overture Maps.
OVERTURE = frozenset({"id", "version", "sources", "bbox"})
# The catalogue of a file by its reader, and what a user is told that it was taken for.
TOLD = {
    "osm_features": ("openstreetmap", "elements of OpenStreetMap, by its columns"),
    "osm_file": ("openstreetmap", "an extract of OpenStreetMap"),
    "overpass": ("openstreetmap", "an answer of an Overpass server"),
    "overture": ("overture", "a table of Overture Maps, by its columns"),
}


def told_catalogs(paths: Iterable[str | Path]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the catalogues of files that tell them, and a line on each file.

    InputError if one of the files, or of those in a folder, does not tell what it holds.
    """
    names: list[str] = []
    lines: list[str] = []
    for path in map(Path, paths):
        if not path.is_dir():
            require_file(path, "a file or a folder of files")
        files = files_in(path) if path.is_dir() else [path]
        silent = next((file for file in files if _reader(file) is None), None if files else path)
        if silent is not None:
            raise InputError(
                f"{silent} does not say what it contains; name its catalogue with --catalog "
                "(`semsig sources` lists them), or draft one with `semsig draft`."
            )
        for file in files:
            name, what = TOLD[str(_reader(file))]
            names.append(name)
            lines.append(f"{file} is read as {what}, with the catalogue {name}")
    return tuple(dict.fromkeys(names)), tuple(lines)


def _reader(path: Path) -> str | None:
    """Return the reader that a file tells by its name or by what is in it."""
    reader = file_reader(path, sure=True)
    if reader is None and path.suffix.lower() in SUFFIXES:
        return "overture" if OVERTURE.issubset(column_names(path)) else None
    return reader
