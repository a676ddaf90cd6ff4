"""Detect the catalogue of a file from its contents."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.sources.files import file_reader
from semsig_gis.sources.paths import files_in, is_folder, require_file
from semsig_gis.sources.probe import probe_file
from semsig_gis.sources.vector.formats import OTHERS, suffix_error
from semsig_gis.storage import file_kind

if TYPE_CHECKING:
    from collections.abc import Iterable

# Columns that every table of Overture Maps has.
OVERTURE_COLUMNS = frozenset({"id", "version", "sources", "bbox"})
# Catalogue of a file by its reader, and a description of the file for the user.
CATALOG_OF_READER = {
    "gbfs": ("gbfs", "stations of a GBFS feed"),
    "gtfs": ("gtfs", "a GTFS feed of public transport"),
    "mapillary": ("mapillary", "map features of Mapillary"),
    "osm_features": ("openstreetmap", "elements of OpenStreetMap, by its columns"),
    "osm_file": ("openstreetmap", "an extract of OpenStreetMap"),
    "overpass": ("openstreetmap", "an answer of an Overpass server"),
    "overture": ("overture", "a table of Overture Maps, by its columns"),
}


# What to do with a file that `semsig load` does not read, by what it is.
USES = {
    "street objects": "give it to `semsig build`",
    "signature database": "ask it with `semsig localize`, or see it with `semsig info`",
}
PICTURES = frozenset({".jpg", ".jpeg", ".png", ".webp", ".heic", ".tif", ".tiff", ".gif", ".bmp"})


def detect_catalogs(paths: Iterable[str | Path]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Detect the catalogue of each file; return the catalogues' names and a line on each file.

    Of a folder, every data file in it is examined. InputError if a file cannot be assigned.
    """
    names: list[str] = []
    lines: list[str] = []
    for path in map(Path, paths):
        if not path.is_dir():
            require_file(path, "a file or a folder of files")
        files = files_in(path) if is_folder(path) else [path]
        for file in files or [path]:
            reader = file_reader(file, sure=True) if files else None
            if reader is None and files and probe_file(file).format in CATALOG_OF_READER:
                reader = probe_file(file).format
            if reader is None and any(map(OVERTURE_COLUMNS.issubset, probe_file(file).columns)):
                reader = "overture"
            if reader is None:
                raise InputError(_unknown(file))
            name, description = CATALOG_OF_READER[reader]
            names.append(name)
            lines.append(f"{file} is read as {description}, with the catalogue {name}")
    return tuple(dict.fromkeys(names)), tuple(lines)


def _unknown(file: Path) -> str:
    """Return a sentence on a file that belongs to no catalogue: what it is, and what to do."""
    if file.suffix.lower() in PICTURES:
        return (
            f"{file} is a picture, and maps are read here; mark what is seen on it with `semsig "
            "serve`, or give the boxes of a detector to `semsig view`."
        )
    if file.suffix.lower() in OTHERS:
        return str(suffix_error(file))
    kind = file_kind(file) if file.suffix.lower() == ".parquet" else ""
    if kind in USES:
        return f"{file} is a {kind} file, which is read already; {USES[kind]}."
    if kind:
        return f"{file} holds {kind}, not street objects; give a file of street objects."
    return (
        f"{file} does not say what it contains; name its catalogue with --catalog (`semsig "
        "sources` lists them), or draft one with `semsig draft`."
    )
