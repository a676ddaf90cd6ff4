"""Count the functions and modules that a task passes through: ``python benchmarks/walks.py``.

Three walks: from a table of trees to the GeoPackage (`load`, `build` and `export` with the street
objects), and from a query to its answer, by distance and by likelihood with its index built.

Each walk is the first of a fresh process, from the call of the command to its end. Counted are

- functions: different functions and generators of semsig_gis that ran, including functions that ran
  because a module was imported; lambdas, comprehensions, bodies of classes and modules are not
  functions;
- modules: the files of these functions;
- changes: calls and returns of such functions, in their order, in another module than the call or
  return before; a return counts for the function that ends.

Also counted are the modules of semsig_gis that a plain `localize` loads, including packages. The
fronts of packages load names by functions of lazy_loader, which are not counted.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import io
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import semsig_gis
from semsig_gis.cli import main as semsig

if TYPE_CHECKING:
    from types import CodeType, FrameType

__all__ = ["main"]

PACKAGE = semsig_gis.__name__
SOURCE = str(Path(semsig_gis.__file__).parent)

TREES = """\
longitude,latitude
3.8767,43.6108
3.8769,43.6109
3.8771,43.6107
"""
CATALOG = """\
name = "trees"
title = "Trees"
license = "CC0"
attribution = "nobody"

[[layers]]
name = "trees"
class = "alignment_tree"
files = ["trees.csv"]
crs = "EPSG:4326"
"""

EXPORT = (
    "load trees.csv --catalog ./trees.toml --out objects.parquet",
    "build objects.parquet --out city.parquet",
    "export city.parquet --objects objects.parquet --out city.gpkg",
)
LIKELIHOOD = "localize city.parquet --types BB --bearings 10,80"
DISTANCE = f"{LIKELIHOOD} --method edit+edit"
WALKS = {
    "trees to GeoPackage": EXPORT,
    "query, by distance": (DISTANCE,),
    "query, by likelihood": (LIKELIHOOD,),
}


class _Walk:
    """Count calls and returns; a profile function of Python."""

    def __init__(self) -> None:
        self.functions: set[CodeType] = set()
        self.changes = 0
        self._module = ""

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """Count a call or a return."""
        code = frame.f_code
        own = code.co_filename.startswith(SOURCE)  # not the methods that dataclasses generate
        function = code.co_flags & inspect.CO_OPTIMIZED and not code.co_name.startswith("<")
        if own and function and event in {"call", "return"}:
            self.functions.add(code)
            self.changes += self._module not in {"", code.co_filename}
            self._module = code.co_filename

    @property
    def modules(self) -> int:
        """The number of modules passed."""
        return len({code.co_filename for code in self.functions})


def main() -> None:
    """Count the walks, or with ``--commands`` one walk, and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--commands", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.commands:
        print(json.dumps(_count(options.commands)))
        return
    figures = _figures()
    if options.json:
        print(json.dumps(figures, indent=2))
        return
    print(f"{'':22}{'functions':>10}{'modules':>10}{'changes':>10}")
    for name, walk in figures["walks"].items():
        counts = "".join(f"{walk[count]:10}" for count in ("functions", "modules", "changes"))
        parts = ", ".join(f"{command} {count}" for command, count in walk["by_command"].items())
        print(f"{name:22}{counts}   {parts}")
    print(f"modules that a plain localize loads: {figures['loaded']}")


def _figures() -> dict[str, Any]:
    """Count every walk in a new process."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "trees.csv").write_text(TREES, encoding="utf-8")
        (folder / "trees.toml").write_text(CATALOG, encoding="utf-8")
        walks = {}
        for name, commands in WALKS.items():
            if commands == (LIKELIHOOD,):
                _count_apart(folder, commands)  # builds the index
            walks[name] = _count_apart(folder, commands)
    return {"walks": walks, "loaded": walks["query, by distance"]["loaded"]}


def _count_apart(folder: Path, commands: tuple[str, ...]) -> dict[str, Any]:
    """Return the counts of commands that run in a new process."""
    command = [sys.executable, "-P", str(Path(__file__).resolve()), "--commands", *commands]
    counts: dict[str, Any] = json.loads(subprocess.check_output(command, cwd=folder))  # noqa: S603
    return counts


def _count(commands: list[str]) -> dict[str, Any]:
    """Return the counts of commands that run in this process."""
    walk = _Walk()
    by_command = {}
    for command in commands:
        before = walk.changes
        sys.argv = ["semsig", *command.split()]
        output = io.StringIO()
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            sys.setprofile(walk)
            try:
                semsig()
            except SystemExit as end:
                if end.code:
                    raise RuntimeError(output.getvalue()) from end
            finally:
                sys.setprofile(None)
        by_command[command.split()[0]] = walk.changes - before
    return {
        "functions": len(walk.functions),
        "modules": walk.modules,
        "changes": walk.changes,
        "by_command": by_command,
        "loaded": sum(name.partition(".")[0] == PACKAGE for name in sys.modules),
    }


if __name__ == "__main__":
    main()
