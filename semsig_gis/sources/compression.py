"""Packed files, and how much may come out of them."""

from __future__ import annotations

import bz2
import contextlib
import gzip
import zlib
from typing import TYPE_CHECKING

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from pathlib import Path

# Text about a city shrinks to a tenth or a thirtieth, fields that are all blank to less; a file
# that is made to fill a disk shrinks to a thousandth.
MOST_RATIO = 250
# What is no longer than this does no harm, however well it is packed.
HARMLESS_BYTES = 2**27
# As much of a file shows how well it is packed.
SAMPLE_BYTES = 2**23
BLOCK = 2**20


def swells(packed: int, unpacked: int) -> bool:
    """Tell whether so many bytes are too many to come out of so few."""
    return unpacked > max(HARMLESS_BYTES, MOST_RATIO * packed)


def bomb(what: object, remedy: str = "if you trust it, give what is inside") -> SourceError:
    """Return the plain sentence for a packed file out of which too much comes."""
    return SourceError(
        f"{what} unpacks to more than {MOST_RATIO} times its size, as archives made to fill a disk "
        f"do; {remedy}."
    )


def require_modest(path: Path) -> None:
    """Refuse a ``.gz`` or ``.bz2`` file whose beginning swells; other files pass.

    Damage is for the reader to tell.
    """
    suffix = path.suffix.lower()
    if suffix not in {".gz", ".bz2"}:
        return
    unpacked = 0
    with (
        path.open("rb") as packed,
        gzip.GzipFile(fileobj=packed) if suffix == ".gz" else bz2.BZ2File(packed) as stream,
        contextlib.suppress(EOFError, OSError, zlib.error),
    ):
        while block := stream.read(BLOCK):
            unpacked += len(block)
            if swells(packed.tell(), unpacked):
                raise bomb(path)
            if unpacked > SAMPLE_BYTES and unpacked <= MOST_RATIO * packed.tell():
                return
