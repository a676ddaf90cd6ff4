"""Read text and JSON files with limits: regular files only, maximum size, no deep nesting."""

from __future__ import annotations

import errno
import json
import math
import os
import stat
from pathlib import Path
from typing import Any

MAX_TEXT_BYTES = 2**28
MAX_INTEGER = 2**63


def require_regular(path: str | Path) -> int:
    """Return the size of a file in bytes; OSError if it is missing, a pipe or a device.

    Reading from a pipe or a device may never end.
    """
    status = os.stat(path)  # noqa: PTH116 - its errors contain the path unchanged
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        what = "it is a pipe or a device, not a file"
        raise OSError(errno.EINVAL, what, str(path))
    return status.st_size


def read_whole(path: str | Path, *, most: int = MAX_TEXT_BYTES) -> bytes:
    """Return the content of a regular file; OSError if it cannot be read or exceeds `most` bytes.

    The `strerror` of the error is a message for the user.
    """
    size = require_regular(path)
    if size > most:
        what = f"it has {size:,} bytes, and at most {most:,} are read"
        raise OSError(errno.EFBIG, what, str(path))
    return Path(path).read_bytes()


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file, with or without a byte order mark (see `read_whole`)."""
    return read_whole(path).decode("utf-8-sig")


def parse_json(text: str | bytes, *, finite: bool = False) -> Any:  # noqa: ANN401 - any JSON
    """Return the value of JSON; ValueError if it is not valid, or is nested too deeply.

    With `finite`, also for NaN, infinity and integers beyond 64 bits.
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
    if not -MAX_INTEGER <= value < MAX_INTEGER:
        raise ValueError(f"{text[:20]} is beyond 64 bits")
    return value
