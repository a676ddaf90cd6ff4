"""What a path contains: the members of a file, unpacked or converted where GDAL needs it."""

from __future__ import annotations

import csv
import functools
import gzip
import itertools
import json
import re
import shutil
import struct
import tempfile
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np
from pyogrio import read_info
from pyogrio.raw import read

from semsig_gis.core import SourceError
from semsig_gis.sources.compression import (
    check_compression_ratio,
    decompression_bomb_error,
    ratio_too_high,
)
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.paths import FILE_SUFFIXES, file_stamp, is_geodatabase, require_file
from semsig_gis.sources.vector.by_pyogrio import layer_names
from semsig_gis.sources.vector.dbf import guess_of
from semsig_gis.sources.vector.formats import (
    ARCHIVES,
    CSV,
    DRIVERS,
    GEODATABASE,
    GEOJSON,
    GPX,
    SHAPEFILE,
    STREAMED,
    WORKBOOKS,
    accepted,
    content_error,
    require_text,
    suffix_error,
)
from semsig_gis.sources.vector.json_forms import UNREADABLE, converted
from semsig_gis.sources.vector.member import START_BYTES, Copy, Member, unreadable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

# Files of an archive with other data, in which these contain a legend or metadata.
SIDE_SUFFIXES = frozenset({".csv", ".json", ".jsonl", ".ods", ".tsv", ".xlsx"})
# The only text file of an archive that is a table: that of a public transport feed.
STOPS = "stops.txt"
MOST_FILES = 16
MOST_NAMES = 8
SHAPEFILE_PARTS = (".shp", ".dbf", ".prj", ".cpg")
HEADER_BYTES = 100
# Numbers with all the decimals that a program computes with.
LONG_NUMBER = re.compile(r"-?\d+\.\d{15,}")
# Exceptions of zipfile for damaged archives.
_ZIP_FAULTS = (
    *(EOFError, IndexError, NotImplementedError, OSError, RuntimeError, ValueError),
    *(struct.error, zipfile.BadZipFile, zlib.error),
)


def members(path: Path) -> tuple[Member, ...]:
    """Return the members of a file: itself, its layers, or the vector files in an archive.

    SourceError if it is missing, damaged or of another kind.
    """
    if is_geodatabase(path):
        return (Member(path, None),)
    require_file(path, "a vector file")
    try:
        return _members(path, file_stamp(path))
    except OSError as error:
        raise SourceError(
            f"{path} cannot be unpacked in {tempfile.gettempdir()} ({error.strerror}); make room "
            "there, or name another folder in TMPDIR."
        ) from error


@functools.lru_cache(maxsize=MOST_FILES)
def _members(path: Path, stamp: object) -> tuple[Member, ...]:  # noqa: ARG001 - a part of the key
    """Open a file; `stamp` changes with the file."""
    suffix = path.suffix.lower()
    if suffix in ARCHIVES:
        return tuple(itertools.chain.from_iterable(map(_prepared, _archive(path))))
    if suffix == ".gz" and DRIVERS.get(Path(path.stem).suffix.lower()) in STREAMED:
        return tuple(_prepared(_unzipped(path)))
    if suffix not in DRIVERS:
        raise suffix_error(path)
    if suffix == ".gdb":
        raise SourceError(
            f"{path} is not the folder of a file geodatabase; give the folder that ends with .gdb, "
            "or a .zip of it."
        )
    return tuple(_prepared(Member(path, None)))


def _archive(path: Path) -> list[Member]:
    """Return the vector files in an archive; SourceError if it is damaged or has none."""
    names = _names(path, path)
    usable = [
        name
        for name in names
        if not name.startswith("__MACOSX/")
        and (DRIVERS.get(PurePosixPath(name).suffix.lower()) or "") not in {"", GEODATABASE}
        and (not name.lower().endswith(".txt") or PurePosixPath(name).name.lower() == STOPS)
    ]
    geodatabases = {
        str(PurePosixPath(name).parent) for name in names if name.lower().endswith(".gdbtable")
    }
    data = [name for name in usable if PurePosixPath(name).suffix.lower() not in SIDE_SUFFIXES]
    files = [Member(path, name) for name in (data if data or geodatabases else usable)]
    files += [_geodatabase(path, folder) for folder in sorted(geodatabases)]
    if files:
        return files
    examples = [*names[:MOST_NAMES], *(["..."] if len(names) > MOST_NAMES else [])]
    readable = next((name for name in names if Path(name).suffix.lower() in FILE_SUFFIXES), None)
    remedy = f"unpack it and give {readable}" if readable else f"one of {accepted()} is needed"
    contents = ", ".join(examples) or "nothing"
    raise SourceError(f"archive {path} contains no vector file, only {contents}; {remedy}.")


def _names(path: Path, what: object) -> list[str]:
    """Return the names of the files in an archive; SourceError if it is damaged or unsafe."""
    try:
        with zipfile.ZipFile(path) as archive:
            items = [item for item in archive.infolist() if not item.is_dir()]
            for item in items:
                if ratio_too_high(item.compress_size, item.file_size):
                    raise decompression_bomb_error(f"{item.filename} in {what}")
            broken = archive.testzip()
    except SourceError:
        raise
    except _ZIP_FAULTS as error:
        with path.open("rb") as stream:
            start = stream.read(START_BYTES)
        if start.startswith(b"PK"):
            raise unreadable(what, error) from error
        raise content_error(what, start) from error
    if broken is not None:
        raise SourceError(f"archive {what} is damaged at {broken}; download it again.")
    return [item.filename for item in items]


def _geodatabase(path: Path, folder: str) -> Member:
    """Unpack a geodatabase, because GDAL finds it only in a folder with its suffix."""
    name = PurePosixPath(folder).name or path.stem
    copy = Copy(f"{PurePosixPath(name).stem}.gdb")
    copy.path.mkdir()
    with zipfile.ZipFile(path) as archive:
        for item in archive.infolist():
            at = PurePosixPath(item.filename)
            if str(at.parent) == folder and not item.is_dir():
                with archive.open(item) as source, (copy.path / at.name).open("wb") as target:
                    shutil.copyfileobj(source, target)
    return Member(path, folder, copy=copy)


def _unzipped(path: Path) -> Member:
    check_compression_ratio(path)
    copy = Copy(path.stem)
    try:
        with gzip.open(path, "rb") as source, copy.path.open("wb") as target:
            shutil.copyfileobj(source, target)
    except (EOFError, OSError, zlib.error) as error:
        raise unreadable(path, error) from error
    return Member(path, None, copy=copy)


def _prepared(member: Member) -> Iterable[Member]:
    """Return the layers of a file with their copies, if GDAL cannot open it as it is."""
    if member.driver == CSV:
        with member.open() as stream:
            require_text(member, stream.read(START_BYTES))
    if member.driver == GEOJSON:
        return _from_json(member)
    if member.driver in WORKBOOKS:
        return _from_workbook(member)
    if member.driver == GPX:
        return [_waypoints(member)]
    if member.path.suffix.lower() == ".tab":
        _require_parts(member)
    if member.driver == SHAPEFILE:
        member = member if member.sibling(".shx") else _indexed(member)
        return [replace(member, guess=guess_of(member))]
    return [member]


def _require_parts(member: Member) -> None:
    """Raise SourceError if a file of a MapInfo table is missing."""
    if member.sibling(".map") is None or not (member.sibling(".dat") or member.sibling(".dbf")):
        raise SourceError(
            f"{member} is only a part of a MapInfo table; put the files of the same name that end "
            "with .dat, .map and .id into its folder."
        )


def _waypoints(member: Member) -> Member:
    """Return a GPX file with a note on its tracks; SourceError if it has nothing else."""
    member.require_sound()
    try:
        counts = {
            layer: read_info(member.address, layer=layer, force_feature_count=True)["features"]
            for layer in ("waypoints", "routes", "tracks")
        }
    except Exception as error:
        raise unreadable(member, error) from error
    ways = f"{counts['tracks']:,} tracks and {counts['routes']:,} routes"
    if counts["waypoints"] or not counts["tracks"] + counts["routes"]:
        notes = (f"{ways} are left out",) if counts["tracks"] + counts["routes"] else ()
        return replace(member, notes=notes)
    raise SourceError(
        f"{member} has {ways}, but no waypoints, which are the places of objects; give a file with "
        "waypoints."
    )


def _from_json(member: Member) -> Iterator[Member]:
    try:
        with member.open() as stream:
            content = stream.read()
        encoding = json.detect_encoding(content)
        text = content.decode(encoding, errors="replace")
        layers = converted(text)
    except (OSError, ValueError) as error:
        raise unreadable(member, error) from error
    if layers is None and encoding.startswith("utf-8"):
        yield member
        return
    if layers is None:
        copy = Copy(f"{member.path.stem}.geojson")
        copy.path.write_text(text, encoding="utf-8")
        yield replace(member, copy=copy)
        return
    stem = member.path.stem
    for name, records in layers.items():
        features = [_feature(record) for record in records]
        if records and all(item is None for item in features):
            yield replace(member, layer=name or None, copy=_table(records, stem))
            continue
        copy = Copy(f"{stem}.geojson")
        collection = {
            "type": "FeatureCollection",
            "name": name or stem,
            "features": [item or UNREADABLE for item in features],
        }
        copy.path.write_text(json.dumps(collection), encoding="utf-8")
        yield replace(member, layer=name or None, copy=copy)


def _feature(record: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the feature in a record, or None if it is plain."""
    if record.get("type") == "Feature":
        return record
    if "coordinates" in record and "type" in record:  # a geometry
        return {"type": "Feature", "properties": {}, "geometry": record}
    return None


def _table(records: Sequence[Mapping[str, Any]], stem: str) -> Copy:
    """Write plain records as a table, in which nested values are JSON."""
    copy = Copy(f"{stem}.csv")
    fields = list(dict.fromkeys(name for record in records for name in record))
    rows = (
        [
            value if isinstance(value, str) else "" if value is None else json.dumps(value)
            for value in map(record.get, fields)
        ]
        for record in records
    )
    _write_csv(copy.path, itertools.chain([fields], rows))
    return copy


def _write_csv(path: Path, rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream, delimiter="\t").writerows(rows)


def _from_workbook(member: Member) -> list[Member]:
    """Return the sheets of a workbook that have rows, as tables of text."""
    if member.inner is not None:
        copy = Copy(member.path.name)
        with member.open() as source, copy.path.open("wb") as target:
            shutil.copyfileobj(source, target)
        member = replace(member, copy=copy)
    _names(Path(member.path), member)
    sheets = []
    for name in layer_names(member):
        columns = read(
            member.address, layer=name, read_geometry=False, HEADERS="DISABLE", FIELD_TYPES="STRING"
        )[3]
        rows = np.array(columns, dtype=object).T.tolist()
        filled = [
            [repr(float(value)) if LONG_NUMBER.fullmatch(value or "") else value for value in row]
            for row in rows
            if any(value not in {None, ""} for value in row)
        ]
        if filled:
            table = Copy(f"{member.path.stem}.csv")
            _write_csv(table.path, filled)
            sheets.append(replace(member, layer=name, copy=table))
    if not sheets:
        raise SourceError(f"{member} has no sheet with rows; give a table with a row of names.")
    # A sheet of remarks, or without a header, is left out if there are others.
    return [sheet for sheet in sheets if _is_table(sheet)] or sheets


def _is_table(sheet: Member) -> bool:
    try:
        return len(open_csv(sheet.open, str(sheet)).layouts["\t"]) > 1
    except (KeyError, SourceError):
        return False


def _indexed(member: Member) -> Member:
    """Return a shapefile with an index, made from the lengths of its records."""
    copy = Copy(f"{member.path.stem}.shp")
    for suffix in SHAPEFILE_PARTS:
        part = member.sibling(suffix)
        if part is not None:
            with part.open() as source, copy.path.with_suffix(suffix).open("wb") as target:
                shutil.copyfileobj(source, target)
    content = copy.path.read_bytes()
    entries, at = bytearray(), HEADER_BYTES
    while at + 8 <= len(content):
        (words,) = struct.unpack_from(">i", content, at + 4)
        if words < 2 or at + 8 + 2 * words > len(content):  # noqa: PLR2004 - the type of geometry
            break
        entries += struct.pack(">ii", at // 2, words)
        at += 8 + 2 * words
    length = struct.pack(">i", (HEADER_BYTES + len(entries)) // 2)
    header = content[:24] + length + content[28:HEADER_BYTES]
    copy.path.with_suffix(".shx").write_bytes(header + entries)
    return replace(
        member, copy=copy, notes=("it has no index (.shx), which was made from the .shp",)
    )
