"""Try to break the commands and the readers, many thousand times: ``python -m benchmarks.soak``.

Every command that writes is killed and interrupted at random moments, finds full and read-only
disks, closed pipes and odd environments; every format that is read gets damaged files. What was
there before must be whole, or what is new; the next run must work and clean up; a refusal must be
one sentence. What goes wrong is printed, and the table of all trials is written as JSON.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import pkgutil
import selectors
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import semsig_gis
from benchmarks import _soak_faults as faults
from benchmarks._soak_city import made_world
from benchmarks._soak_runs import forked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks._soak_city import World

RESULTS = Path(__file__).with_name("soak.json")
_KILLS = 700
_MUTANTS = 50_000
_SKIPPED = "skipped"


def main() -> None:
    """Read the options, run all trials, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="of all trials, such as 0.1")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--part", action="append", help="only this part; may be repeated")
    parser.add_argument("--lanes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    for module in pkgutil.walk_packages(semsig_gis.__path__, "semsig_gis."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        world = made_world(folder / "world")
        print(f"a city and {len(world.commands)} commands, {time.perf_counter() - start:.0f} s")
        trials = [
            case
            for case in faults.cases(round(_KILLS * options.share), seed=options.seed)
            if options.part is None or case.part in options.part
        ]
        (folder / "disk").mkdir()
        disks = faults.disks_possible(folder / "disk")
        for case, found in _all(world, trials, folder, lanes=options.lanes):
            print(case, found)


def _all(
    world: World, trials: list[faults.Case], folder: Path, *, lanes: int
) -> Iterator[tuple[faults.Case, list[str]]]:
    raise NotImplementedError


if __name__ == "__main__":
    main()
