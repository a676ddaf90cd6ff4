"""Memory that is short, before and after something fails for it."""

from __future__ import annotations

import errno
import os
import sys

if sys.platform != "win32":
    import resource

# What libraries say of it, where they raise nothing of their own: no memory, no further thread.
SHORT = tuple(os.strerror(number) for number in (errno.ENOMEM, errno.EAGAIN))


def raise_if_short(error: Exception) -> None:
    """Raise MemoryError for an error that says that memory is short."""
    if isinstance(error, MemoryError) or any(words in str(error) for words in SHORT):
        raise MemoryError(str(error)) from error


def address_space_left() -> int | None:
    """Return the bytes that a limit (``ulimit -v``) leaves to this process; None without one."""
    if sys.platform == "win32":
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return None
    import psutil  # noqa: PLC0415 - it loads slowly

    taken: int = psutil.Process().memory_info().vms
    return limit - taken


def require_address_space(size: int, what: str) -> None:
    """Raise MemoryError where a limit leaves fewer bytes to this process."""
    left = address_space_left()
    if left is not None and left < size:
        raise MemoryError(
            f"{what} takes {size / 1e6:,.0f} MB, and the limit leaves {max(left, 0) / 1e6:,.0f} MB"
        )
