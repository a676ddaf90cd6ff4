"""Memory and time: what work needs, what is free, and errors that say that memory is short."""

from __future__ import annotations

import contextlib
import errno
import os
import sys
import warnings
from pathlib import Path

from semsig_gis.core.errors import InputError

if sys.platform != "win32":
    import resource

# Memory usage and limit of the process's control group, in Linux's cgroups version 2 and 1.
CGROUP_FILES = (
    ("/sys/fs/cgroup/memory.current", "/sys/fs/cgroup/memory.max"),
    (
        "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ),
)
GB = 1e9
LONG_S = 60.0
"""Work that takes longer is announced."""

# The system's messages for "no memory" and "no further thread"; some libraries raise only these.
MEMORY_MESSAGES = tuple(os.strerror(number) for number in (errno.ENOMEM, errno.EAGAIN))


def free_memory() -> int:
    """Return the number of bytes that this process may still allocate."""
    import psutil  # noqa: PLC0415 - 10 ms, and rarely needed

    free = [psutil.virtual_memory().available]
    for usage, limit in CGROUP_FILES:
        with contextlib.suppress(OSError, ValueError):  # without a limit, the file contains "max"
            free.append(int(Path(limit).read_text("ascii")) - int(Path(usage).read_text("ascii")))
    address_space = free_address_space()
    if address_space is not None:
        free.append(address_space)
    return max(int(min(free)), 0)


def require_memory(size: float, what: str, *, advice: str) -> None:
    """Raise InputError if `what` needs more than the free memory; `size` is in bytes."""
    free = free_memory()
    if size > free:
        raise InputError(
            f"{what} would take about {size / GB:,.1f} GB of memory, and {free / GB:,.1f} GB are "
            f"free; {advice}."
        )


def free_address_space() -> int | None:
    """Return the bytes left under a limit on address space (``ulimit -v``); None without one."""
    if sys.platform == "win32":
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return None
    import psutil  # noqa: PLC0415 - as above

    size: int = psutil.Process().memory_info().vms
    return limit - size


def require_address_space(size: int, what: str) -> None:
    """Raise MemoryError if the memory limit of this process leaves fewer than `size` bytes free."""
    free = free_address_space()
    if free is not None and free < size:
        raise MemoryError(
            f"{what} takes {size / 1e6:,.0f} MB, and the limit leaves {max(free, 0) / 1e6:,.0f} MB"
        )


def raise_if_short(error: Exception) -> None:
    """Raise MemoryError if an error means that memory is short."""
    if isinstance(error, MemoryError) or any(text in str(error) for text in MEMORY_MESSAGES):
        raise MemoryError(str(error)) from error


class LongWorkWarning(UserWarning):
    """A warning of work that takes more than a minute."""


def announce(seconds: float, what: str) -> None:
    """Warn how long `what` will take if it takes more than a minute."""
    if seconds > LONG_S:
        warnings.warn(f"{what} will take {duration(seconds)}", LongWorkWarning, stacklevel=3)


def duration(seconds: float) -> str:
    """Return a time of a minute or more in words: ``about 4 minutes``, ``about 2 h 10 min``."""
    hours, minutes = divmod(max(round(seconds / 60.0), 1), 60)
    if hours:
        return f"about {hours:,} h {minutes} min"
    return "about a minute" if minutes == 1 else f"about {minutes} minutes"
