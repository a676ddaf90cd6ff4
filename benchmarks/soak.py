"""Try to break commands and readers, some thousand times: ``python -m benchmarks.soak``.

Every command that writes is killed and interrupted at random moments, and run with full and
read-only disks, closed pipes and unusual environments; every reader gets damaged files. Either the
old or the new files must be complete; the next run must work and clean up; a refusal must be one
sentence. Faults are printed, and the table of all trials is saved as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import selectors
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import _soak_faults as trials
from benchmarks import _soak_mutants as mutants
from benchmarks import tables
from benchmarks._measuring import FOLDER
from benchmarks._soak_city import made_world
from benchmarks._soak_runs import forked, load_all

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from benchmarks._soak_city import World

KILLS = 700
MUTANTS = 50_000
FAULTS = (
    *("tracebacks", "hangs", "crashes", "lost or half-written"),
    *("read differently", "leftovers", "other"),
)
_MUTANTS = "damaged files"


@dataclass(frozen=True, kw_only=True)
class Place:
    """Inputs of all trials: the city, undamaged files, and whether disks can be mounted."""

    world: World
    corpus: Path
    disks: bool


def main() -> None:
    """Run all trials, print the table, and save it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="of all trials, such as 0.1")
    parser.add_argument("--seed", type=int, default=0, help="of the random trials")
    parser.add_argument("--part", action="append", help="only this part; others stay in --out")
    parser.add_argument("--lanes", type=int, default=os.cpu_count() or 1, help="trials at a time")
    parser.add_argument("--out", type=Path, default=FOLDER / "soak.json")
    options = parser.parse_args()
    start = time.perf_counter()
    load_all()
    # Not a TemporaryDirectory, because every forked process would remove it at its end.
    folder = Path(tempfile.mkdtemp(prefix="soak-"))
    try:
        place = _prepared(folder, round(KILLS * options.share))
        print(f"{len(place.world.commands)} commands, {time.perf_counter() - start:.0f} s")
        rows = {
            part: {"part": part, "cases": 0, "clean": 0, **dict.fromkeys(FAULTS, 0)}
            for part in (*trials.PARTS, _MUTANTS)
            if options.part is None or part in options.part
        }
        lanes = [
            _lane(place, folder / f"lane{number}", rows.keys(), options, number)
            for number in range(options.lanes)
        ]
        for part, count, faults in _results(lanes):
            _add(rows[part], count, faults)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    if options.part is not None and options.out.exists():
        rows = {row["part"]: row for row in json.loads(options.out.read_text("utf-8"))} | rows
    text = json.dumps([*rows.values()], indent=1)
    options.out.write_text(f"{text}\n", encoding="utf-8")
    print(tables.soak_table(rows.values()))
    print(f"{time.perf_counter() - start:.0f} s")
    sys.exit(int(any(row["cases"] != row["clean"] for row in rows.values())))


def _prepared(folder: Path, kills: int) -> Place:
    world = made_world(folder / "world", kills)
    forked(lambda: mutants.made_corpus(world, folder / "corpus"))
    disk = folder / "disk"
    disk.mkdir()
    disks = trials.disks_possible(disk)
    if not disks:
        print("This machine mounts no disks for the soak; full and read-only ones are left out.")
    return Place(world=world, corpus=folder / "corpus", disks=disks)


def _lane(
    place: Place, folder: Path, parts: Collection[str], options: argparse.Namespace, lane: int
) -> int:
    """Start a process for every n-th trial; return the descriptor that receives its results."""
    reading, writing = os.pipe()
    if os.fork():
        os.close(writing)
        return reading
    code = 1
    try:
        os.close(reading)
        folder.mkdir()
        with open(writing, "w", encoding="utf-8", buffering=1) as file:  # noqa: PTH123 - descriptor
            for number, trial in enumerate(_trials(place, parts, options)):
                if number % options.lanes == lane:
                    file.write(json.dumps(_outcome(place, trial, folder / "trial")) + "\n")
        code = 0
    except BaseException:  # noqa: BLE001 - printed, and the process ends
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


def _trials(
    place: Place, parts: Collection[str], options: argparse.Namespace
) -> Iterator[trials.Case | mutants.Batch]:
    for case in trials.cases(round(KILLS * options.share), seed=options.seed):
        if case.part in parts and (place.disks or not case.part.endswith("disks")):
            yield case
    if _MUTANTS in parts:
        yield from mutants.batches(round(MUTANTS * options.share), seed=options.seed)


def _outcome(
    place: Place, trial: trials.Case | mutants.Batch, folder: Path
) -> tuple[str, int, list[tuple[str, list[str]]]]:
    """Return the part of a trial, its number of cases, and the faults by case."""
    if isinstance(trial, mutants.Batch):
        form = mutants.FORMATS[trial.format].name
        faults = mutants.faults(trial, place.corpus, folder)
        return _MUTANTS, trial.count, [(f"{form}, mutant {n}", [fault]) for n, fault in faults]
    folder.mkdir()
    failed = forked(lambda: trials.faults(place.world, trial, folder))
    shutil.rmtree(folder, ignore_errors=True)
    command = place.world.command(trial.number).text
    return trial.part, 1, [(f"trial {trial.number}, semsig {command}", failed)] if failed else []


def _results(lanes: list[int]) -> Iterator[Any]:
    """Yield the results of all lanes as they arrive."""
    with selectors.DefaultSelector() as selector:
        for lane in lanes:
            file = open(lane, encoding="utf-8")  # noqa: PTH123, SIM115 - a descriptor
            selector.register(file, selectors.EVENT_READ, file)
        while selector.get_map():
            for key, _ in selector.select():
                line = key.data.readline()
                if line:
                    yield json.loads(line)
                else:
                    selector.unregister(key.fileobj)
                    key.data.close()


def _add(row: dict[str, Any], count: int, faults: list[tuple[str, list[str]]]) -> None:
    """Count trials, and print their faults."""
    row["cases"] += count
    row["clean"] += count - len(faults)
    for case, texts in faults:
        kinds = Counter(text.partition(":")[0] for text in texts)
        for kind in kinds:
            row[kind if kind in FAULTS else "other"] += 1
        print(f"{row['part']}, {case}", flush=True)
        for text in texts:
            print(f"    {text.strip()}")


if __name__ == "__main__":
    main()
