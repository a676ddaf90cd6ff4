"""Text files that are read whole: regular ones up to a size, and JSON in them up to a depth."""

from __future__ import annotations

import errno
import json
import math
import os
import stat
from pathlib import Path
from typing import Any

MOST_BYTES = 2**28
MOST_INTEGER = 2**63


def require_regular(path: str | Path) -> int:
    """Return the size of a file in bytes; OSError if there is none, or it is a pipe or a device.

    Reading from these may never end.
    """
    status = os.stat(path)  # noqa: PTH116 - its errors say the path as it was given
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        what = "it is a pipe or a device, not a file"
        raise OSError(errno.EINVAL, what, str(path))
    return status.st_size


def read_whole(path: str | Path, *, most: int = MOST_BYTES) -> bytes:
    """Return the content of a regular file; OSError if it cannot be read or is longer than `most`.

    The error says in words what is wrong, as `strerror`.
    """
    size = require_regular(path)
    if size > most:
        what = f"it has {size:,} bytes, and at most {most:,} are read"
        raise OSError(errno.EFBIG, what, str(path))
    return Path(path).read_bytes()


def read_text(path: str | Path) -> str:
    """Return text in UTF-8, with or without a byte order mark, as `read_whole` does."""
    return read_whole(path).decode("utf-8-sig")


def parse_json(text: str | bytes, *, finite: bool = False) -> Any:  # noqa: ANN401 - any JSON
    """Return the value of JSON; ValueError if it is none, or is nested too deeply.

    With `finite`, NaN, infinity and whole numbers that 64 bits cannot hold are refused, too.
    """
    kinds: dict[str, Any] = (
        {"parse_constant": _finite, "parse_float": _finite, "parse_int": _whole} if finite else {}
    )
    try:
        return json.loads(text, **kinds)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is not a finite number")
    return value


def _whole(text: str) -> int:
    value = int(text)
    if not -MOST_INTEGER <= value < MOST_INTEGER:
        raise ValueError(f"{text[:20]} is beyond 64 bits")
    return value
