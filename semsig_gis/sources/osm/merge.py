"""Merge several extracts into one file with the newest and most complete copy of each element."""

from __future__ import annotations

import contextlib
import re
from typing import TYPE_CHECKING

import osmium
from osmium.filter import EntityFilter, KeyFilter
from osmium.osm import NODE, RELATION, WAY, Node, Relation, Way

from semsig_gis.core import SourceError
from semsig_gis.sources.osm.elements import number_in_files

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from semsig_gis.sources.osm.elements import TagIndex

NOT_PLAIN = re.compile(r"[^A-Za-z0-9_]")
# Kind and number of an element in pyosmium: ("n", 123).
ElementId = tuple[str, int]


@contextlib.contextmanager
def read_errors(what: object) -> Iterator[None]:
    """Raise errors of pyosmium as a `SourceError` that names the file `what`."""
    try:
        yield
    except (osmium.InvalidLocationError, RuntimeError, ValueError) as error:
        cause = " ".join(str(error).split()).rstrip(".")
        raise SourceError(
            f"{what} cannot be read ({cause}); it is damaged or not the kind of file that its name "
            "says, so download it again."
        ) from error


def merge_extracts(
    files: Mapping[Path, osmium.io.File], index: TagIndex, merged: Path
) -> osmium.io.File:
    """Write the elements with tags, and the ways and nodes that they need, to `merged`.

    Of the copies of an element, the one with the highest version is written, also if it lacks the
    tags, unless it is deleted. Of the same version, the copy with more nodes or members is written,
    because a file may be clipped, and then the copy of the first file.
    """
    closure = _closure(files, index)
    # First pass: the best copy of each element. Second pass: write it.
    best: dict[ElementId, tuple[int, int, int]] = {}
    for number, (path, file) in enumerate(files.items()):
        with read_errors(path):
            for element in _elements(file):
                name = _name(element, number)
                if name in closure:
                    rank = (element.version, _size(element), -number)
                    best[name] = max(rank, best.get(name, rank))
    # Not with a writer of pyosmium, which ends the process if the disk is full.
    with merged.open("w", encoding="ascii") as stream:
        for number, (path, file) in enumerate(files.items()):
            with read_errors(path):
                for element in _elements(file):
                    rank = (element.version, _size(element), -number)
                    if best.get(_name(element, number)) == rank:
                        del best[_name(element, number)]  # write it once
                        if not element.deleted:
                            print(_line(element, number), file=stream)
    return osmium.io.File(str(merged), "opl")


def _line(element: Node | Way | Relation, file: int) -> str:
    """Return an element of a file as a line of the OPL format."""
    kind, own = _name(element, file)
    parts = [f"{kind}{own}", f"v{element.version}"]
    if element.tags:
        tags = (f"{_escape(tag.k)}={_escape(tag.v)}" for tag in element.tags)
        parts.append("T" + ",".join(tags))
    if isinstance(element, Way):
        parts.append(
            "N" + ",".join(f"n{number_in_files(node.ref, file)}" for node in element.nodes)
        )
    elif isinstance(element, Relation):
        members = (
            f"{member.type}{number_in_files(member.ref, file)}@{_escape(member.role)}"
            for member in element.members
        )
        parts.append("M" + ",".join(members))
    elif element.location.valid():
        parts += [f"x{element.location.lon:.7f}", f"y{element.location.lat:.7f}"]
    return " ".join(parts)


def _escape(text: str) -> str:
    """Return text in the escapes of OPL for all but ASCII letters, digits and underscores."""
    return NOT_PLAIN.sub(lambda match: f"%{ord(match[0]):x}%", text)


def _closure(files: Mapping[Path, osmium.io.File], index: TagIndex) -> set[ElementId]:
    """Return the elements with tags of a layer in any file, their ways and their nodes."""
    closure: set[ElementId] = set()
    for number, (path, file) in enumerate(files.items()):
        with read_errors(path):
            for element in _elements(file, KeyFilter(*index.keys)):
                if index.layers({tag.k: tag.v for tag in element.tags}):
                    closure.add(_name(element, number))
                    closure.update(_parts(element, number))
    for number, (path, file) in enumerate(files.items()):
        with read_errors(path):
            for way in _elements(file, EntityFilter(WAY)):
                if _name(way, number) in closure:
                    closure.update(_parts(way, number))
    return closure


def _elements(
    file: osmium.io.File, *filters: KeyFilter | EntityFilter
) -> Iterator[Node | Way | Relation]:
    processor = osmium.FileProcessor(file, NODE | WAY | RELATION)
    for element_filter in filters:
        processor.with_filter(element_filter)
    for element in processor:
        if isinstance(element, Node | Way | Relation):
            yield element


def _name(element: Node | Way | Relation, file: int) -> ElementId:
    return element.type_str(), number_in_files(element.id, file)


def _parts(element: Node | Way | Relation, file: int) -> Iterator[ElementId]:
    """Yield the nodes of a way, or the ways of a relation."""
    if isinstance(element, Way):
        for node in element.nodes:
            yield "n", number_in_files(node.ref, file)
    elif isinstance(element, Relation):
        for member in element.members:
            if member.type == "w":
                yield "w", number_in_files(member.ref, file)


def _size(element: Node | Way | Relation) -> int:
    if isinstance(element, Node):
        return int(element.location.valid())
    return len(element.nodes if isinstance(element, Way) else element.members)


def age_notes(files: Mapping[Path, osmium.io.File]) -> tuple[str, ...]:
    """Return a note if extracts have different dates: an old one may have deleted elements."""
    days = set()
    for path, file in files.items():
        with read_errors(path), osmium.io.Reader(file, osmium.osm.NOTHING) as reader:
            header = reader.header()
        date = header.get("osmosis_replication_timestamp") or header.get("timestamp")
        days |= {date[:10]} if date else set()
    if len(days) < 2:  # noqa: PLR2004 - two dates differ
        return ()
    return (
        f"the extracts are from {min(days)} to {max(days)}; what the map has lost since counts",
    )
