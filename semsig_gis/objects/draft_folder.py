"""Sort the files of a folder: those that need a catalogue, and what the others are."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from semsig_gis.core import InputError, SemsigError, listed
from semsig_gis.sources import (
    PICTURES,
    catalog_names,
    detect_catalogs,
    files_in,
    load_catalog,
    matches_pattern,
    tagged_class,
)
from semsig_gis.storage import file_kind

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from semsig_gis.objects.draft_layers import LayerDraft

# Files that accompany a data file of the same name.
SIDE_SUFFIXES = frozenset(
    {".cpg", ".dat", ".dbf", ".gfs", ".id", ".ind", ".lyr", ".map", ".mid", ".prj", ".qgz", ".qix",
     ".qlr", ".qml", ".qmd", ".qpj", ".sbn", ".sbx", ".shx", ".sld", ".xml", ".xsd"}
)  # fmt: skip
NAMES_SHOWN = 8


def sort_files(folder: Path) -> tuple[list[Path], list[str]]:
    """Return the files of a folder that need a catalogue, and a line on each other content."""
    data = files_in(folder)
    files: list[Path] = []
    lines = []
    for file in data:
        same = next((other for other in files if other.name.lower() == file.name.lower()), None)
        if same is not None:
            lines.append(
                f"{_within(file, folder)}: left out, because {_within(same, folder)} has the "
                "same name; rename it"
            )
        elif need := need_of(file):
            lines.append(f"{_within(file, folder)}: {need}")
        else:
            files.append(file)
    others = [path for path in sorted(folder.iterdir()) if path not in data]
    folders = [path for path in others if path.is_dir() and "=" not in path.name]
    lines += [
        f"{path.name}/: a folder, into which `semsig load` does not look; "
        f"draft it by itself: {command('draft', path)}"
        for path in folders
    ]
    names = {file.name.lower() for file in data} | {file.stem.lower() for file in data}
    kinds: dict[str, list[str]] = {}
    for path in others:
        if not path.is_dir():
            kinds.setdefault(_kind(path, names), []).append(path.name)
    for kind, members in kinds.items():
        more = f" and {len(members) - NAMES_SHOWN} others" if len(members) > NAMES_SHOWN else ""
        lines.append(f"{', '.join(members[:NAMES_SHOWN])}{more}: {kind}")
    return files, lines


def need_of(file: Path) -> str:
    """Return why a file needs no catalogue, and how it is loaded; empty if it needs one."""
    try:
        names, _ = detect_catalogs([file])
    except InputError as error:
        # Tables of this package, which other commands read.
        is_own = file.suffix.lower() == ".parquet" and file_kind(file)
        return f"left out: {str(error).rstrip('.')}" if is_own else ""
    except SemsigError:
        return ""  # a table of a portal, or a damaged file, as drafting will show
    return f"no catalogue is needed ({names[0]}): {command('load', file)}"


def known_sources(path: Path, drafts: Sequence[LayerDraft]) -> list[str]:
    """Return a line on each built-in catalogue that may read the files of a file or folder."""
    files: dict[str, list[str]] = {}
    with_tags = []
    for draft in drafts:
        fields = {column.name.casefold() for column in draft.columns}
        for name in catalog_names():
            if any(
                not spec.tags
                and matches_pattern(draft.file.name, spec.files)
                and all(_names(field, spec.aliases) & fields for _, field in spec.fields)
                for spec in load_catalog(name).layers
            ):
                files.setdefault(name, []).append(draft.file.name)
        tags = sum(
            number
            for column in draft.columns
            for value, number in column.counts.items()
            if isinstance(value, str) and tagged_class(column.name, value)
        )
        if 2 * tags >= len(draft.sample.rows) > 0:
            with_tags.append(draft.file.name)
    lines = [
        f"The built-in catalogue {name} has layers for {listed(list(dict.fromkeys(names)))}: "
        f"{command('load', path, f'--catalog {name}')}"
        for name, names in files.items()
    ]
    if with_tags:
        lines.append(
            f"Fields look like tags of OpenStreetMap in {listed(list(dict.fromkeys(with_tags)))}; "
            "if they are, no catalogue is needed but the built-in one: "
            f"{command('load', path, '--catalog openstreetmap')}"
        )
    return lines


def command(verb: str, path: Path, options: str = "") -> str:
    """Return a command for a file, to be copied."""
    return f"`{' '.join(filter(None, ['semsig', verb, shlex.quote(str(path)), options]))}`"


def _names(field: str, aliases: Iterable[tuple[str, tuple[str, ...]]]) -> set[str]:
    others = next((names for name, names in aliases if name == field), ())
    return {name.casefold() for name in (field, *others)}


def _within(file: Path, folder: Path) -> str:
    return str(file.relative_to(folder))


def _kind(path: Path, data_names: set[str]) -> str:
    """Return what a file is that is not read; `data_names` are the names of the data files."""
    suffix = path.suffix.lower()
    # lights.dbf, lights.shp.xml and lights.csv.gz.aux.xml accompany lights.
    name = path.name.lower()
    starts = {name[:index] for index, letter in enumerate(name) if letter == "."}
    if suffix in SIDE_SUFFIXES and not starts.isdisjoint(data_names):
        return "accompany a file of the same name"
    if suffix in PICTURES:
        return "left out: pictures"
    if suffix == ".toml":
        return "left out: catalogues and settings are no data"
    return "left out: not files of map data that `semsig load` reads"
