"""Options of the command line, rows of results and numbers, for all measurements of accuracy."""

from __future__ import annotations

import argparse
import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

SIZES = ("full", "small")
# Keys of results: the inputs of the method, and figures with only the last photo of a route.
INPUTS, LAST_ONLY = "told", "alone"
FOLDER = Path(__file__).parent


def option_parser(name: str, description: str | None) -> argparse.ArgumentParser:
    """Return the parser of a module, with the options ``--size`` and ``--out``."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=description)
    parser.add_argument("--size", choices=SIZES, default="full")
    parser.add_argument("--out", type=Path, default=FOLDER / f"{name}.json", metavar="FILE")
    return parser


def add_geodata(parser: argparse.ArgumentParser, default: str = "") -> None:
    """Add the option ``--geodata``; `default` is what happens without a folder, for the help."""
    parser.add_argument(
        "--geodata",
        type=Path,
        default=os.environ.get("SEMSIG_GEODATA"),
        metavar="FOLDER",
        help=f"folder of open data (default: SEMSIG_GEODATA{default})",
    )


def available_cities(names: Sequence[str], geodata: Path | None, *, made_up: str) -> Sequence[str]:
    """Return the cities that can be measured; without open data only the made-up one."""
    if geodata is not None:
        return names
    print("Real cities are left out: SEMSIG_GEODATA does not name the folder of open data.")
    return [name for name in names if name == made_up]


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file of results, none if there is no file."""
    rows: list[dict[str, Any]] = json.loads(path.read_text("utf-8")) if path.exists() else []
    return rows


def write_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write a file of results."""
    path.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


def short(value: float | None) -> float | None:
    """Return a number to four digits, integers unchanged; None if not finite, as in JSON."""
    if value is None or isinstance(value, int):
        return value
    return float(f"{value:.4g}") if math.isfinite(value) else None
