"""Which layer holds what, and how each kind of source is read."""

from __future__ import annotations

import contextlib
import importlib
import itertools
from dataclasses import astuple, dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, Protocol

from semsig_gis.core import (
    Displayed,
    SourceError,
    UnknownNameError,
    installed_readers,
    nearest_name,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from geopandas import GeoDataFrame

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.layers import LayerSpec

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

# Files with another suffix (.dbf, .prj, a README) accompany data and are not opened on their own.
FILE_SUFFIXES = frozenset(
    {".bz2", ".csv", ".fgb", ".geojson", ".geoparquet", ".gml", ".gpkg", ".gz", ".json",
     ".osm", ".parquet", ".pbf", ".shp", ".zip"}
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class RowCounts:
    """How many rows a layer has, and how many of them are left out for each reason.

    Rows are `unreadable`, `filtered` (by the catalogue), `excluded` (by what the catalogue says in
    ``not``), `outside` (of the area that is fetched or clipped to), `missing` (without a
    geometry), `duplicates` (the id of an earlier row, where ids are unique), `misplaced` (off the
    Earth, far from all others, or not finite in the metric CRS), `collapsed` (at the place of
    another object of the class, or an area around it) or `conflated` (merged into an object of an
    earlier layer).
    """

    read: int
    unreadable: int = 0
    filtered: int = 0
    excluded: int = 0
    outside: int = 0
    missing: int = 0
    duplicates: int = 0
    misplaced: int = 0
    collapsed: int = 0
    conflated: int = 0

    @property
    def kept(self) -> int:
        """Number of the others."""
        dropped: int = sum(astuple(self)[1:])
        return self.read - dropped


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RawLayer(Displayed):
    """One layer as its reader found it.

    Parameters
    ----------
    spec : LayerSpec
        What the catalogue says of the layer.
    table : GeoDataFrame
        One row a feature: ``class_name``, ``source_id`` and ``geometry`` (of any type, empty, or
        None), in the CRS of the source; ``half_width`` (metres from the centre line, or NaN)
        where the catalogue says something about the widths of streets, and ``name``, empty where
        there is none, where it says which field holds the names of streets.
    counts : RowCounts
        Features in the source, and those that are not in the table; ``counts.kept == len(table)``.
    errors : tuple of str
        What was wrong with features that could not be read, the first ten of them.
    notes : tuple of str
        Where the source differs from what the catalogue expects of it.
    extent : Area, optional
        The box that the source says it covers, where it says so.

    Examples
    --------
    >>> from semsig_gis import CitySpec, synthetic_city
    >>> layer = synthetic_city(CitySpec(size=300.0))[0]
    >>> layer.counts.kept == len(layer.table) <= len(demo_objects)
    True
    """

    spec: LayerSpec
    table: GeoDataFrame
    counts: RowCounts
    errors: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    extent: Area | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "layer": self.spec.name,
            "holds": self.spec.class_name or self.spec.role,
            "rows read": self.counts.read,
            "kept": self.counts.kept,
            "unreadable": self.counts.unreadable,
            "notes": len(self.notes),
        }


class Reader(Protocol):
    """What a reader is: a function that reads layers from one file in one pass.

    Those of `MERGING` take several files, too, and those of `PRUNING` an `area`.
    """

    def __call__(
        self,
        path: Path | Sequence[Path],
        specs: Sequence[LayerSpec],
        *,
        filters: bool = True,
        crs: str | None = None,
        **within: Area | None,
    ) -> tuple[RawLayer, ...]:
        """Return one layer for each of `specs`; `crs` is for a file that states none."""


def reader(name: str) -> Reader:
    """Return a built-in reader, or one of the entry-point group ``semsig_gis.readers``, by name."""
    if name in READERS:
        read: Reader = importlib.import_module(f"{__name__}.{READERS[name]}").read_layers
        return read
    others = installed_readers()
    if name in others:
        return others[name]
    names = sorted({*READERS, *others})
    raise UnknownNameError(
        f"reader {name!r} is unknown{nearest_name(name, names)}; "
        f"the readers are {', '.join(names)}."
    )


def require_file(path: Path, kind: str) -> None:
    """Refuse a path that is not a file, with a SourceError that says which kind is needed."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise SourceError(f"{path} {what}; give {kind}.")


def file_reader(path: Path, *, sure: bool = False) -> str | None:
    """Return the reader of a file of OpenStreetMap by its name, or by what is in it.

    None if it is none; if `sure`, it has to say which elements of the map it holds, beside tags.
    """
    from semsig_gis.sources.osm import features  # noqa: PLC0415 - it loads slowly
    from semsig_gis.sources.osm.file import FORMATS  # noqa: PLC0415 - it loads slowly

    if path.name.lower().endswith(tuple(FORMATS)):
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


def files_in(folder: Path) -> list[Path]:
    """Return the data in a folder, and in the partitions of a dataset that it is, sorted."""
    parts = (
        files_in(path) if "=" in path.name and path.is_dir() else [path]
        for path in folder.iterdir()
    )
    files = itertools.chain.from_iterable(parts)
    return sorted(path for path in files if path.suffix.lower() in FILE_SUFFIXES)


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
