"""Names of the metrics, for the help of commands: the metrics themselves take 0.1 s to import."""

from __future__ import annotations

import pkgutil
from pathlib import Path

METRIC_NAMES: tuple[str, ...] = tuple(
    module.name for module in pkgutil.iter_modules([str(Path(__file__).with_name("metrics"))])
)
"""The modules of the package `metrics`, in alphabetical order."""
