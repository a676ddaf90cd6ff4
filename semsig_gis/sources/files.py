"""Find the files of layers and the readers of files."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from semsig_gis.core import SourceError
from semsig_gis.sources.osm import features
from semsig_gis.sources.paths import files_in, is_folder, matches_pattern
from semsig_gis.sources.probe import SourceFormat, probe_file
from semsig_gis.sources.registry import READERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.sources.layer import Reader
    from semsig_gis.sources.layer_spec import LayerSpec

# The reader of layers that are selected by tags, in a file of any format.
TAGS_READER = "osm_file"
# Readers that are named as the format that they read.
SOURCE_FORMATS = frozenset(get_args(SourceFormat))
# Number of layers with the same files that a message lists.
MOST_NAMES = 4


def reader(name: str) -> Reader:
    """Return a built-in reader, or one of the entry points ``semsig_gis.readers``, by name."""
    return READERS[name].read


def file_reader(path: Path, *, sure: bool = False) -> str | None:
    """Return the reader of a file of OpenStreetMap by its name or content, or None.

    With `sure`, a table needs columns that identify its elements, not only columns of tags.
    """
    if path.name.lower().endswith((*features.FORMATS, *features.CHANGES)):
        return "osm_file"
    probe = probe_file(path)
    if probe.format in {"osm", "overpass"}:
        return "overpass" if probe.format == "overpass" else "osm_file"
    is_osm = features.has_element_columns if sure else features.has_tag_columns
    return "osm_features" if any(map(is_osm, probe.columns)) else None


def find_files(
    specs: Iterable[LayerSpec], paths: Iterable[str | Path]
) -> tuple[tuple[tuple[LayerSpec, Path], ...], tuple[LayerSpec, ...]]:
    """Pair the layers of a catalogue with the files that hold them.

    Parameters
    ----------
    specs : iterable of LayerSpec
        Layers to look for, by the file-name patterns in ``files`` (case is ignored).
    paths : iterable of str or Path
        Files, and folders to look in. Of their subfolders, only partitions such as
        ``theme=base`` are searched. A file that is given directly has priority over the files of
        folders. Of these, a layer gets the matches of its first pattern that matches a file. A
        layer of a map gets the extracts that match any pattern, and vector files with columns of
        OpenStreetMap tags; in a folder only if no file of the folder matches a pattern.

    Returns
    -------
    pairs : tuple of (LayerSpec, Path)
        Layers and their files, in the order of `specs`. One file may hold several layers, and a
        layer of OpenStreetMap may be in several extracts.
    missing : tuple of LayerSpec
        Layers without a file. SourceError if a path does not exist or matches no layer, or if
        several files match a layer that can have only one.

    Examples
    --------
    >>> from semsig_gis.sources import LayerSpec, find_files
    >>> find_files([LayerSpec(name="trees", class_name="alignment_tree")], [])[1][0].name
    'trees'
    """
    specs = tuple(specs)
    files, in_folders, tagged = _group_paths(specs, paths)
    pairs: list[tuple[LayerSpec, Path]] = []
    missing = []
    for spec in specs:
        direct_files = [path for path in files if matches_pattern(path.name, spec.files)]
        merging = READERS[spec.reader].merging
        patterns = (spec.files,) if merging else tuple((pattern,) for pattern in spec.files)
        in_folder = (
            [path for path in in_folders if matches_pattern(path.name, any_)] for any_ in patterns
        )
        candidates = direct_files or next(filter(None, in_folder), [])
        candidates = [*candidates, *(path for path, name in tagged if name == spec.reader)]
        if len(candidates) > 1 and not (spec.unique_id or merging):
            names = " and ".join(str(path) for path in candidates)
            raise SourceError(f"layer {spec.name!r} is matched by {names}; give one of them.")
        pairs.extend((spec, path) for path in candidates)
        if not candidates:
            missing.append(spec)
    return tuple(pairs), tuple(missing)


def _group_paths(
    specs: Sequence[LayerSpec], paths: Iterable[str | Path]
) -> tuple[list[Path], list[Path], list[tuple[Path, str]]]:
    """Return the files given directly, the files in folders, and other files with their readers."""
    files: list[Path] = []
    in_folders: list[Path] = []
    tagged: list[tuple[Path, str]] = []
    formats = {spec.reader for spec in specs} & SOURCE_FORMATS
    by_tags = any(spec.reader == TAGS_READER for spec in specs)
    for path in dict.fromkeys(Path(item) for item in paths):
        if not path.exists():
            raise SourceError(f"{path} does not exist; give a file or a folder of files.")
        inside = files_in(path) if is_folder(path) else [path]
        if any(matches_pattern(file.name, spec.files) for file in inside for spec in specs):
            (in_folders if is_folder(path) else files).extend(inside)
            continue
        with_tags = []
        # Layers that are selected by tags, and those of a format that shows by its content, may be
        # in a file of any name.
        for file in inside if by_tags or formats else ():
            with contextlib.suppress(*([SourceError] if is_folder(path) else [])):
                if by_tags and file_reader(file) is not None:
                    with_tags.append((file, TAGS_READER))
                elif (name := probe_file(file).format) in formats:
                    with_tags.append((file, name))
        if not with_tags:
            patterns: dict[tuple[str, ...], list[str]] = {}
            for spec in specs:
                patterns.setdefault(spec.files, []).append(spec.name)
            layers = ", ".join(
                f"{', '.join(names if len(names) <= MOST_NAMES else (*names[:MOST_NAMES], '...'))} "
                f"({', '.join(names_of_files)})"
                for names_of_files, names in patterns.items()
            )
            verb = "contains no file of" if is_folder(path) else "is not the file of"
            more = ", or any vector file with columns of OpenStreetMap's tags" if by_tags else ""
            raise SourceError(
                f"{path} {verb} any layer; the layers and their files are {layers}{more}."
            )
        tagged.extend(with_tags)
    return files, in_folders, tagged
