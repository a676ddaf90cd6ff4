"""Memory and time that work takes, estimated before it begins."""

from __future__ import annotations

import contextlib
import warnings
from pathlib import Path

from semsig_gis.core.errors import InputError
from semsig_gis.core.memory import address_space_left

# What a group of processes has used and may use, of Linux's two kinds of such groups.
GROUPS = (
    ("/sys/fs/cgroup/memory.current", "/sys/fs/cgroup/memory.max"),
    (
        "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
    ),
)
GB = 1e9
LONG_S = 600.0
"""Work that takes longer is announced."""


def free_memory() -> int:
    """Return how many bytes this process may still take."""
    import psutil  # noqa: PLC0415 - it loads slowly

    free = [psutil.virtual_memory().available]
    for used, most in GROUPS:
        with contextlib.suppress(OSError, ValueError):  # "max" is no number
            free.append(int(Path(most).read_text("ascii")) - int(Path(used).read_text("ascii")))
    left = address_space_left()
    return max(int(min(free if left is None else [*free, left])), 0)


def require_memory(needed: float, what: str, *, advice: str) -> None:
    """Raise InputError where work would take more bytes of memory than are free."""
    free = free_memory()
    if needed > free:
        raise InputError(
            f"{what} would take about {needed / GB:,.1f} GB of memory, and {free / GB:,.1f} GB are "
            f"free; {advice}."
        )


def announce(seconds: float, what: str) -> None:
    """Warn that work will take long, if it will."""
    if seconds > LONG_S:
        hours, minutes = divmod(round(seconds / 60.0), 60)
        time = f"{hours:,} h {minutes} min" if hours else f"{minutes} min"
        warnings.warn(f"{what} will take about {time}", stacklevel=3)
