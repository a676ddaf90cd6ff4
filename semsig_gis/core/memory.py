"""Memory that is short, before and after something fails for it."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

if sys.platform != "win32":
    import resource

# What libraries say of it, where they raise nothing of their own: no memory, no further thread.
SHORT = tuple(os.strerror(number) for number in (errno.ENOMEM, errno.EAGAIN))


def raise_if_short(error: Exception) -> None:
    """Raise MemoryError for an error that says that memory is short."""
    if isinstance(error, MemoryError) or any(words in str(error) for words in SHORT):
        raise MemoryError(str(error)) from error


def require_address_space(size: int, what: str) -> None:
    """Raise MemoryError where a limit (``ulimit -v``) leaves fewer bytes to this process."""
    if sys.platform == "win32":
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except OSError:  # a system that does not tell
        return
    left = limit - pages * resource.getpagesize()
    if limit != resource.RLIM_INFINITY and left < size:
        msg = (
            f"{what} takes {size / 1e6:,.0f} MB, and the limit leaves {max(left, 0) / 1e6:,.0f} MB"
        )
        raise MemoryError(msg)
