"""The encoding of the texts of a shapefile that does not state it."""

from __future__ import annotations

import itertools
import struct
from typing import TYPE_CHECKING

from semsig_gis.sources.encodings import Guess, guess_encoding, is_utf8, parse_encoding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.sources.vector.member import Member

# Language drivers that do not say which code page: none, and that of the computer.
UNSTATED = frozenset({0x00, 0x57})
HEADER_BYTES = FIELD_BYTES = 32
MOST_ROWS = 200_000


def guess_of(member: Member) -> Guess | None:
    """Return the likely encoding of a shapefile that is not ASCII; None if it states one."""
    table, page = member.sibling(".dbf"), member.sibling(".cpg")
    if table is None or (page is not None and _names_encoding(page)):
        return None
    try:
        words = list(dict.fromkeys(_words(table)))
    except (OSError, struct.error):
        return None  # GDAL says what is wrong
    if not words:
        return None
    return Guess("utf-8", sure=True) if is_utf8(words) else guess_encoding(words)


def _names_encoding(page: Member) -> bool:
    """Whether a file with the name of a code page has one, such as 1251 or GBK."""
    try:
        with page.open() as stream:
            name = stream.read(100).decode("ascii").strip()
        return any(map(str.isdigit, name)) or bool(parse_encoding(name))
    except (OSError, ValueError):
        return False


def _words(table: Member) -> Iterator[bytes]:
    """Yield the words that are not ASCII in the names and values of fields."""
    with table.open() as stream:
        header = stream.read(HEADER_BYTES)
        rows, start, size = struct.unpack_from("<IHH", header, 4)
        if header[29] in UNSTATED and size:
            names = stream.read(start - HEADER_BYTES)
            fields = (names[at : at + FIELD_BYTES] for at in range(0, len(names), FIELD_BYTES))
            at, slices = 1, []
            for field in itertools.takewhile(lambda field: field[:1] != b"\r", fields):
                if len(field) == FIELD_BYTES:
                    yield from _foreign(field[:11].partition(b"\0")[0])
                    slices += [slice(at, at + field[16])] if field[11:12] == b"C" else []
                    at += field[16]
            for _ in range(min(rows, MOST_ROWS)):
                row = stream.read(size)
                for part in slices if not row.isascii() else ():
                    yield from _foreign(row[part])


def _foreign(text: bytes) -> Iterator[bytes]:
    if not text.isascii():
        yield from (word for word in text.strip(b" \0").split() if not word.isascii())
