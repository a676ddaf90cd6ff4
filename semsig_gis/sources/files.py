"""Find the files of layers and the readers of files."""

from __future__ import annotations

import contextlib
import importlib
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from semsig_gis.core.errors import SourceError, UnknownNameError, nearest_name
from semsig_gis.core.plugins import installed_readers
from semsig_gis.sources.osm import features
from semsig_gis.sources.paths import files_in

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.sources.layer import Reader
    from semsig_gis.sources.layer_spec import LayerSpec

PACKAGE = __name__.rpartition(".")[0]
# The module of this package that reads what a catalogue's `reader` names.
READERS = {
    "arcgis": "services.layers",
    "ckan": "services.layers",
    "mapillary": "mapillary",
    "ogc_features": "services.layers",
    "opendatasoft": "services.layers",
    "osm_features": "osm.features",
    "osm_file": "osm.file",
    "overpass": "osm.overpass",
    "overture": "overture",
    "socrata": "services.layers",
    "vector_file": "vector",
    "wfs": "services.layers",
}

# Those of them that take several files at once, which are extracts of one map, and those that need
# not read what is outside an `area`.
MERGING = frozenset({"mapillary", "osm_features", "osm_file", "overpass", "overture"})
PRUNING = frozenset({"overture"})

# The reader whose layers are told by their tags, whatever kind of file has them.
TAGS_READER = "osm_file"
# Layers of the same files that a message names.
NAMES_TOLD = 4


def reader(name: str) -> Reader:
    """Return a built-in reader, or one of the entry-point group ``semsig_gis.readers``, by name."""
    if name in READERS:
        read: Reader = importlib.import_module(f"{PACKAGE}.{READERS[name]}").read_layers
        return read
    others = installed_readers()
    if name in others:
        return others[name]
    names = sorted({*READERS, *others})
    raise UnknownNameError(
        f"reader {name!r} is unknown{nearest_name(name, names)}; "
        f"the readers are {', '.join(names)}."
    )


def file_reader(path: Path, *, sure: bool = False) -> str | None:
    """Return the reader of a file of OpenStreetMap by its name, or by what is in it.

    None if it is none; if `sure`, it has to say which elements of the map it holds, beside tags.
    """
    if path.name.lower().endswith(tuple(features.FORMATS)):
        return "osm_file"
    return features.file_reader(path, sure=sure)


def find_files(
    specs: Iterable[LayerSpec], paths: Iterable[str | Path]
) -> tuple[tuple[tuple[LayerSpec, Path], ...], tuple[LayerSpec, ...]]:
    """Pair the layers of a catalogue with the files that hold them.

    Parameters
    ----------
    specs : iterable of LayerSpec
        Layers to look for, by the file-name patterns in ``files`` (in upper or lower case).
    paths : iterable of str or Path
        Files, and folders to look in, not in the folders below them but for partitions such as
        ``theme=base``. A file given by itself goes before one found in a folder. Of a folder's
        files, a layer takes those that match the first of its patterns that any matches; of
        extracts of a map, all that match, and of OpenStreetMap vector files with columns of tags,
        too, in a folder if it holds no file of any pattern.

    Returns
    -------
    pairs : tuple of (LayerSpec, Path)
        Layers and their files, in the order of `specs`. One file may hold several layers, and a
        layer of OpenStreetMap may be in several extracts.
    missing : tuple of LayerSpec
        Layers that no file matches. SourceError if a path does not exist or matches no layer, or
        several files match another layer whose ids are not unique.

    Examples
    --------
    >>> from semsig_gis import LayerSpec, find_files
    >>> find_files([LayerSpec(name="trees", class_name="alignment_tree")], [])[1][0].name
    'trees'
    """
    specs = tuple(specs)
    files, in_folders, tagged = _sorted_out(specs, paths)
    pairs: list[tuple[LayerSpec, Path]] = []
    missing = []
    for spec in specs:
        by_hand = [path for path in files if _matches(path, spec.files)]
        merging = spec.reader in MERGING
        patterns = (spec.files,) if merging else tuple((pattern,) for pattern in spec.files)
        in_folder = ([path for path in in_folders if _matches(path, any_)] for any_ in patterns)
        candidates = by_hand or next(filter(None, in_folder), [])
        if spec.reader == TAGS_READER:
            candidates = [*candidates, *tagged]
        if len(candidates) > 1 and not (spec.unique_id or merging):
            names = " and ".join(str(path) for path in candidates)
            raise SourceError(f"layer {spec.name!r} is matched by {names}; give one of them.")
        pairs.extend((spec, path) for path in candidates)
        if not candidates:
            missing.append(spec)
    return tuple(pairs), tuple(missing)


def _sorted_out(
    specs: Sequence[LayerSpec], paths: Iterable[str | Path]
) -> tuple[list[Path], list[Path], list[Path]]:
    """Return files that are given and of a layer's name, those in folders, and those with tags."""
    files: list[Path] = []
    in_folders: list[Path] = []
    tagged: list[Path] = []
    for path in dict.fromkeys(Path(item) for item in paths):
        if not path.exists():
            raise SourceError(f"{path} does not exist; give a file or a folder of files.")
        inside = files_in(path) if path.is_dir() else [path]
        if any(_matches(file, spec.files) for file in inside for spec in specs):
            (in_folders if path.is_dir() else files).extend(inside)
            continue
        with_tags = [file for file in inside if _has_tags(file, specs, forgiving=path.is_dir())]
        if not with_tags:
            _refuse(path, specs)
        tagged.extend(with_tags)
    return files, in_folders, tagged


def _matches(path: Path, patterns: Iterable[str]) -> bool:
    name = path.name.casefold()
    return any(fnmatchcase(name, pattern.casefold()) for pattern in patterns)


def _has_tags(path: Path, specs: Iterable[LayerSpec], *, forgiving: bool) -> bool:
    """Tell whether a file of no layer's name has tags, where some layer is told by them."""
    if all(spec.reader != TAGS_READER for spec in specs):
        return False
    with contextlib.suppress(*([SourceError] if forgiving else [])):
        return file_reader(path) is not None
    return False


def _refuse(path: Path, specs: Iterable[LayerSpec]) -> NoReturn:
    patterns: dict[tuple[str, ...], list[str]] = {}
    for spec in specs:
        patterns.setdefault(spec.files, []).append(spec.name)
    known = ", ".join(
        f"{', '.join(names if len(names) <= NAMES_TOLD else (*names[:NAMES_TOLD], '...'))} "
        f"({', '.join(files)})"
        for files, names in patterns.items()
    )
    verb = "contains no file of" if path.is_dir() else "is not the file of"
    tags = any(spec.reader == TAGS_READER for spec in specs)
    more = ", or any vector file with columns of OpenStreetMap's tags" if tags else ""
    raise SourceError(f"{path} {verb} any layer; the layers and their files are {known}{more}.")
