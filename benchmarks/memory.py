"""Peak memory of a process."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

__all__ = ["own_peak"]


def own_peak() -> float:
    """Return the peak memory of this process in MB."""
    status = Path("/proc/self/status")
    if status.exists():
        # On Linux, getrusage includes the process that started this one.
        lines = status.read_text(encoding="ascii").splitlines()
        return float(dict(line.split(":", 1) for line in lines)["VmHWM"].split()[0]) / 2**10
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
