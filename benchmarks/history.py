"""Keep every result of ``make bench``, and draw how they went: ``python -m benchmarks.history``.

Results are kept in ``benchmarks/history/`` in the format of airspeed velocity (asv), which can show
them too: ``asv publish --config benchmarks/asv.conf.json``.
"""

from __future__ import annotations

import argparse
import datetime as dt
import io
import itertools
import json
import math
import os
import platform
import re
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["Run", "draw", "main", "page", "record", "runs"]

FOLDER = Path(__file__).with_name("history")
RESULTS = Path(__file__).with_name("results.json")
DOCS = Path(__file__).parents[1] / "docs"
PICTURE = Path("images", "benchmarks.svg")
SIDES = ("semsig_gis", "peer")
SHOWN = 6
"""Columns of the table: the newest runs."""
COLUMNS = 3
"""Of panels."""
NEAR = 0.2
"""Of logarithms whose labels would lie on each other."""

_HEAD = """# Benchmarks over time

This page is written by `python -m benchmarks.history`, which `make bench` ends with. All times are
from machines that other programs share, so what is drawn is the ratio to a peer, measured in turns
in the same process: 10 is ten times as fast, or a tenth of the size. [Figures](figures.md) says
what the peers are.

![How many times better than its peer each benchmark with a bar was, run by run]({picture})

The dashed lines are the bars: what was asked for. The table has ours, and the ratio in brackets, of
the newest {shown} runs; what is blank was not measured then. All runs are in
`benchmarks/history/`, in the format of [airspeed velocity](https://asv.readthedocs.io).

"""


@dataclass(frozen=True, slots=True)
class Run:
    """What one run measured.

    Parameters
    ----------
    date : datetime
        When the commit that was measured was made, in UTC.
    measured : mapping
        Ours and the peer's, by the name of the benchmark.
    """

    date: dt.datetime
    measured: Mapping[str, tuple[float, float]]


def main() -> None:
    """Keep the results of this commit, and write the page."""
    argparse.ArgumentParser(prog="python -m benchmarks.history", description=__doc__).parse_args()
    rows = json.loads(RESULTS.read_text(encoding="utf-8"))
    commit, seconds = _git("log", "-1", "--format=%H %ct").split()
    record(rows, commit=commit, seconds=int(seconds), folder=FOLDER)
    kept = runs(FOLDER)
    write_whole(DOCS / "benchmarks.md", page(rows, kept))
    write_whole(DOCS / PICTURE, draw(rows, kept))
    print(f"wrote {DOCS / 'benchmarks.md'} of {len(kept)} runs")


def _git(*words: str) -> str:
    try:
        return subprocess.run(  # noqa: S603 - git, of which the shell knows where it is
            ["git", *words],  # noqa: S607
            cwd=FOLDER.parent,
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        sys.exit("Results are kept by commit; run this in a checkout of git.")


def record(rows: Iterable[Mapping[str, Any]], *, commit: str, seconds: int, folder: Path) -> Path:
    """Write the results of a commit, and what they are, as asv does.

    Parameters
    ----------
    rows : iterable of mapping
        Rows of ``results.json``.
    commit : str
        Full hash of what was measured.
    seconds : int
        When it was made, since 1970.
    folder : Path
        Where results are kept, a folder a machine.

    Returns
    -------
    Path
        The file of results; one of the same commit, Python and machine is replaced.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    system, processor, count = platform.system(), platform.machine(), os.cpu_count()
    machine = f"{system}-{processor}-{count}".lower()
    about = {"machine": machine, "os": system, "arch": processor, "num_cpu": str(count)}
    known_file = folder / "benchmarks.json"
    known = json.loads(known_file.read_text(encoding="utf-8")) if known_file.exists() else {}
    results = {}
    for row in rows:
        name = re.sub(r"\W+", "_", row["name"])
        params = [[repr(side) for side in SIDES]]
        results[name] = [[row["ours"], row["peer"]], params, "1"]
        known[name] = {
            "code": f"{row['name']}; peer: {row['peer_name']}",
            "name": name,
            "param_names": ["by"],
            "params": params,
            "pretty_name": row["name"],
            "type": "track",
            "unit": row["unit"],
            "version": "1",
        }
    told = {
        "commit_hash": commit,
        "date": 1000 * seconds,
        "durations": {},
        "env_name": f"py{python}",
        "env_vars": {},
        "params": about | {"python": python},
        "python": python,
        "requirements": {},
        "result_columns": ["result", "params", "version"],
        "results": results,
        "version": 2,
    }
    file = folder / machine / f"{commit[:8]}-py{python}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    for path, content in (
        (known_file, known | {"version": 2}),
        (file.with_name("machine.json"), about | {"version": 1}),
        (file, told),
    ):
        write_whole(path, json.dumps(content, indent=1, sort_keys=True) + "\n")
    return file


def runs(folder: Path) -> list[Run]:
    """Return the runs of all machines, the oldest first.

    Parameters
    ----------
    folder : Path
        Where results are kept.

    Returns
    -------
    list of Run
        A run for each file of results.
    """
    known = json.loads((folder / "benchmarks.json").read_text(encoding="utf-8"))
    found = []
    for file in folder.glob("*/*-py*.json"):
        told = json.loads(file.read_text(encoding="utf-8"))
        measured = {
            known[name]["pretty_name"]: tuple(result[0]) for name, result in told["results"].items()
        }
        found.append(Run(dt.datetime.fromtimestamp(told["date"] / 1000, dt.UTC), measured))
    return sorted(found, key=lambda run: run.date)


def page(rows: Sequence[Mapping[str, Any]], kept: Sequence[Run]) -> str:
    """Return the page, as Markdown.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of ``results.json``, which say what is shown and in which order.
    kept : sequence of Run
        What was measured, the oldest first.
    """
    newest = kept[-SHOWN:]
    lines = [
        " | ".join(["| benchmark", "unit", *(f"{run.date:%Y-%m-%d %H:%M}" for run in newest)]),
        " | ".join(["| ---", "---", *["---:"] * len(newest)]),
    ]
    for row in rows:
        cells = [f"| {row['name']}", row["unit"]]
        for run in newest:
            ours, peer = run.measured.get(row["name"], (math.nan, math.nan))
            cells.append("" if math.isnan(ours) else f"{ours:,.4g} ({peer / ours:.3g})")
        lines.append(" | ".join(cells))
    table = "".join(f"{line} |\n" for line in lines)
    return _HEAD.format(picture=PICTURE.as_posix(), shown=len(newest)) + table


def draw(rows: Sequence[Mapping[str, Any]], kept: Sequence[Run]) -> str:
    """Return a picture of the ratios of benchmarks that have a bar, as SVG.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of ``results.json``.
    kept : sequence of Run
        What was measured, the oldest first.
    """
    barred = [row for row in rows if row["bar"] is not None]
    height = math.ceil(len(barred) / COLUMNS)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "semsig", "font.size": 8}):
        figure = Figure(figsize=(10, 1.7 * height), layout="constrained")
        panels = figure.subplots(height, COLUMNS, squeeze=False, sharex=True).flat
        for panel, row in itertools.zip_longest(panels, barred):
            if row is None:
                panel.set_axis_off()
                continue
            held = [run for run in kept if row["name"] in run.measured]
            ratios = [peer / ours for ours, peer in (run.measured[row["name"]] for run in held)]
            numbers = [kept.index(run) + 1 for run in held]
            panel.plot(numbers, ratios, marker="o", markersize=3, color="#0072b2")
            panel.axhline(row["bar"], color="#d55e00", linestyle="--", linewidth=1)
            panel.set_yscale("log")
            panel.set_ylim(min([row["bar"], *ratios]) / 1.5, max([row["bar"], *ratios]) * 1.5)
            near = abs(math.log(ratios[-1] / row["bar"])) < NEAR
            ticks = [ratios[-1]] if near else [row["bar"], ratios[-1]]
            panel.set_yticks(ticks, [f"{tick:.2g}" for tick in ticks])
            panel.minorticks_off()
            panel.set_title(textwrap.fill(row["name"], 48), fontsize=8, loc="left")
            panel.set_xticks(range(1, len(kept) + 1), [f"{run.date:%m-%d}" for run in kept])
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return re.sub(r"[ \t]+$", "", stream.getvalue(), flags=re.MULTILINE)


if __name__ == "__main__":
    main()
