"""Compressed files: refuse files that would fill a disk or the memory."""

from __future__ import annotations

import bz2
import contextlib
import gzip
import zlib
from typing import TYPE_CHECKING, BinaryIO, cast

from semsig_gis.core import SourceError

if TYPE_CHECKING:
    from pathlib import Path

# Text about a city is compressed 10 to 30 times, columns of blanks more; a file that is made to
# fill a disk about 1,000 times.
MAX_RATIO = 250
# A result up to this size is harmless, whatever the ratio.
HARMLESS_BYTES = 2**27
# The ratio of this many bytes represents the ratio of the file.
SAMPLE_BYTES = 2**23
READ_BYTES = 2**20
# What a decompressor may read before it needs it; 2**17 since Python 3.12.
READ_AHEAD_BYTES = 2**18


def ratio_too_high(compressed: int, uncompressed: int) -> bool:
    """Whether the compression ratio is suspicious; sizes are in bytes."""
    return uncompressed > max(HARMLESS_BYTES, MAX_RATIO * compressed)


def decompression_bomb_error(
    what: object, remedy: str = "if you trust it, give what is inside"
) -> SourceError:
    """Return the error for a file with a compression ratio that is too high."""
    return SourceError(
        f"{what} unpacks to more than {MAX_RATIO} times its size, as archives made to fill a disk "
        f"do; {remedy}."
    )


def check_compression_ratio(path: Path) -> None:
    """Raise SourceError if the start of a ``.gz`` or ``.bz2`` file is compressed too highly.

    Other files pass. Damaged files are reported by the reader.
    """
    suffix = path.suffix.lower()
    if suffix not in {".gz", ".bz2"}:
        return
    uncompressed = 0
    with (
        path.open("rb") as compressed,
        gzip.GzipFile(fileobj=compressed) if suffix == ".gz" else bz2.BZ2File(compressed) as stream,
        contextlib.suppress(EOFError, OSError, zlib.error),
    ):
        while block := stream.read(READ_BYTES):
            uncompressed += len(block)
            if ratio_too_high(compressed.tell(), uncompressed):
                raise decompression_bomb_error(path)
            # Enough was read, and its ratio is low: accept the file.
            used = compressed.tell() - READ_AHEAD_BYTES
            if SAMPLE_BYTES < uncompressed <= MAX_RATIO * used:
                return


def open_unpacked(path: Path) -> BinaryIO:
    """Open a file, also if it is compressed by gzip or bzip2."""
    suffix = path.suffix.lower()
    if suffix == ".gz":
        return cast("BinaryIO", gzip.open(path))
    return cast("BinaryIO", bz2.open(path)) if suffix == ".bz2" else path.open("rb")
