"""Count the functions and modules that a task passes through: ``python benchmarks/walks.py``.

Three walks: from a table of trees to the GeoPackage (`load`, `build` and `export` with the street
objects), and from a query to its answer, by distance and by likelihood with its index built.

Each walk is the first of a fresh process, from the call of the command to its end. Counted are

- functions: different functions and generators of semsig_gis that ran, those that ran because a
  module was imported on the way included; lambdas, comprehensions, bodies of classes and modules
  are not functions;
- modules: the files that these functions are in;
- changes: calls and returns of such functions, in their order, whose module is another than that
  of the call or return before; a return counts for the function that ends.

Also counted are the modules of semsig_gis that a plain `localize` loads, packages included.
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
    """Where the calls and returns go; a profile function of Python."""

    def __init__(self) -> None:
        self.functions: set[CodeType] = set()
        self.changes = 0
        self._module = ""

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """Take in a call or a return."""
        code = frame.f_code
        own = code.co_filename.startswith(SOURCE)  # not what dataclasses write
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
    """Read the options, count and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--commands", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.commands:
        print(json.dumps(_followed(options.commands)))
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
    """Count every walk in a process and a folder of its own."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "trees.csv").write_text(TREES, encoding="utf-8")
        (folder / "trees.toml").write_text(CATALOG, encoding="utf-8")
        walks = {}
        for name, commands in WALKS.items():
            if commands == (LIKELIHOOD,):
                _apart(folder, commands)  # builds the index
            walks[name] = _apart(folder, commands)
    return {"walks": walks, "loaded": walks["query, by distance"]["loaded"]}


def _apart(folder: Path, commands: tuple[str, ...]) -> dict[str, Any]:
    """Run commands in a fresh process and return what they passed through."""
    command = [sys.executable, "-P", str(Path(__file__).resolve()), "--commands", *commands]
    done = subprocess.run(  # noqa: S603
        command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True
    )
    counts: dict[str, Any] = json.loads(done.stdout)
    return counts


def _followed(commands: list[str]) -> dict[str, Any]:
    """Run commands in this process and count what they pass through."""
    walk = _Walk()
    by_command = {}
    for command in commands:
        before = walk.changes
        sys.argv = ["semsig", *command.split()]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            sys.setprofile(walk)
            try:
                semsig()
            except SystemExit as end:
                if end.code:
                    raise RuntimeError(printed.getvalue()) from end
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
