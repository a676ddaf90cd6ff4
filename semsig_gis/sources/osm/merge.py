"""Several extracts as one file: of every element that counts, the newest and fullest copy."""

from __future__ import annotations

import contextlib
import re
from typing import TYPE_CHECKING

import osmium
from osmium.filter import EntityFilter, KeyFilter
from osmium.osm import NODE, RELATION, WAY, Node, Relation, Way

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from semsig_gis.sources.osm.elements import TagIndex

NOT_PLAIN = re.compile(r"[^A-Za-z0-9_]")
# Kind and number of an element, as pyosmium has them: ("n", 123).
Name = tuple[str, int]


@contextlib.contextmanager
def readable(what: object) -> Iterator[None]:
    """Turn what pyosmium raises on reading a file into a `SourceError`."""
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
    """Write what counts in files, and the ways and nodes that it needs, to one file; return that.

    An element is known by its kind and number. The copy of the highest version is taken, and if
    that lacks the tags, or is deleted, the element does not count; of copies of one version, that
    with more nodes or members, as a file may be clipped; then that of the file given first.
    """
    closure = _closure(files, index)
    best: dict[Name, tuple[int, int, int]] = {}
    for number, (path, file) in enumerate(files.items()):
        with readable(path):
            for element in _elements(file):
                name = _name(element)
                if name in closure:
                    rank = (element.version, _size(element), -number)
                    best[name] = max(rank, best.get(name, rank))
    # As text, because pyosmium's own writers end the process where a disk is full.
    with merged.open("w", encoding="ascii") as stream:
        for number, (path, file) in enumerate(files.items()):
            with readable(path):
                for element in _elements(file):
                    rank = (element.version, _size(element), -number)
                    if not element.deleted and best.get(_name(element)) == rank:
                        print(_line(element), file=stream)
    return osmium.io.File(str(merged), "opl")


def _line(element: Node | Way | Relation) -> str:
    """Return an element in OPL, the format of a line for each."""
    parts = [f"{element.type_str()}{element.id}", f"v{element.version}"]
    if element.tags:
        parts.append("T" + ",".join(f"{_plain(tag.k)}={_plain(tag.v)}" for tag in element.tags))
    if isinstance(element, Way):
        parts.append("N" + ",".join(f"n{node.ref}" for node in element.nodes))
    elif isinstance(element, Relation):
        members = (f"{one.type}{one.ref}@{_plain(one.role)}" for one in element.members)
        parts.append("M" + ",".join(members))
    elif element.location.valid():
        parts += [f"x{element.location.lon:.7f}", f"y{element.location.lat:.7f}"]
    return " ".join(parts)


def _plain(text: str) -> str:
    """Return text in which all but letters and digits of ASCII are written by their numbers."""
    return NOT_PLAIN.sub(lambda match: f"%{ord(match[0]):x}%", text)


def _closure(files: Mapping[Path, osmium.io.File], index: TagIndex) -> set[Name]:
    """Return the elements that have the tags of a layer in any file, and those that they need."""
    closure: set[Name] = set()
    for path, file in files.items():
        with readable(path):
            for element in _elements(file, KeyFilter(*index.keys)):
                if index.layers({tag.k: tag.v for tag in element.tags}):
                    closure.add(_name(element))
                    closure.update(_parts(element))
    for path, file in files.items():
        with readable(path):
            for way in _elements(file, EntityFilter(WAY)):
                if _name(way) in closure:
                    closure.update(_parts(way))
    return closure


def _elements(
    file: osmium.io.File, *filters: KeyFilter | EntityFilter
) -> Iterator[Node | Way | Relation]:
    processor = osmium.FileProcessor(file, NODE | WAY | RELATION)
    for one in filters:
        processor.with_filter(one)
    for element in processor:
        if isinstance(element, Node | Way | Relation):
            yield element


def _name(element: Node | Way | Relation) -> Name:
    return element.type_str(), element.id


def _parts(element: Node | Way | Relation) -> Iterator[Name]:
    """Yield the nodes of a way, or the ways of a relation."""
    if isinstance(element, Way):
        for node in element.nodes:
            yield "n", node.ref
    elif isinstance(element, Relation):
        for member in element.members:
            if member.type == "w":
                yield "w", member.ref


def _size(element: Node | Way | Relation) -> int:
    if isinstance(element, Node):
        return int(element.location.valid())
    return len(element.nodes if isinstance(element, Way) else element.members)


def age_notes(files: Mapping[Path, osmium.io.File]) -> tuple[str, ...]:
    """Return a note on extracts of different days, which tell nothing of what was deleted since."""
    days = set()
    for path, file in files.items():
        with readable(path), osmium.io.Reader(file, osmium.osm.NOTHING) as reader:
            header = reader.header()
        date = header.get("osmosis_replication_timestamp") or header.get("timestamp")
        days |= {date[:10]} if date else set()
    if len(days) < 2:  # noqa: PLR2004 - two dates differ
        return ()
    return (
        f"the extracts are from {min(days)} to {max(days)}; what the map has lost since counts",
    )
