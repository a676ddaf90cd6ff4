"""Save every result of ``make bench``, and plot all of them: ``python -m benchmarks.history``.

Results are saved in ``benchmarks/history/`` in the format of airspeed velocity (asv), which can
show them as well: ``asv publish --config benchmarks/asv.conf.json``.
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
"""Number of columns of the table, for the newest runs."""
COLUMNS = 3
"""Number of columns of plots."""
NEAR = 0.2
"""Difference of logarithms below which their labels would overlap."""

_HEAD = """# Benchmarks over time

This page is written by `python -m benchmarks.history`, which `make bench` ends with. All times are
from machines that other programs share, so the plots show the ratio to a peer, measured in turns in
the same process: 10 is ten times as fast, or a tenth of the size. [Figures](figures.md) lists the
peers.

![How many times better than its peer each benchmark with a bar was, run by run]({picture})

The dashed lines are the bars, which are the targets. The table has our values, and the ratios in
brackets, of the newest {shown} runs; blank cells were not measured. All runs are in
`benchmarks/history/`, in the format of [airspeed velocity](https://asv.readthedocs.io).

"""


@dataclass(frozen=True, slots=True)
class Run:
    """The results of one run.

    Parameters
    ----------
    date : datetime
        Time of the measured commit, in UTC.
    measured : mapping
        Ours and the peer's, by the name of the benchmark.
    """

    date: dt.datetime
    measured: Mapping[str, tuple[float, float]]


def main() -> None:
    """Save the results of this commit, and write the page."""
    argparse.ArgumentParser(prog="python -m benchmarks.history", description=__doc__).parse_args()
    rows = json.loads(RESULTS.read_text(encoding="utf-8"))
    commit, seconds = _git("log", "-1", "--format=%H %ct").split()
    record(rows, commit=commit, seconds=int(seconds), folder=FOLDER)
    saved = runs(FOLDER)
    write_whole(DOCS / "benchmarks.md", page(rows, saved))
    write_whole(DOCS / PICTURE, draw(rows, saved))
    print(f"wrote {DOCS / 'benchmarks.md'} of {len(saved)} runs")


def _git(*words: str) -> str:
    try:
        return subprocess.run(  # noqa: S603 - git, found by the shell
            ["git", *words],  # noqa: S607
            cwd=FOLDER.parent,
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        sys.exit("Results are saved by commit; run this in a checkout of git.")


def record(rows: Iterable[Mapping[str, Any]], *, commit: str, seconds: int, folder: Path) -> Path:
    """Write the results of a commit, and the list of benchmarks, in the format of asv.

    Parameters
    ----------
    rows : iterable of mapping
        Rows of ``results.json``.
    commit : str
        Full hash of the commit.
    seconds : int
        Time of the commit, since 1970.
    folder : Path
        Folder with a folder of results for each machine.

    Returns
    -------
    Path
        The file of results; one of the same commit, Python and machine is replaced.
    """
    python = ".".join(platform.python_version_tuple()[:2])
    system, processor, count = platform.system(), platform.machine(), os.cpu_count()
    machine = f"{system}-{processor}-{count}".lower()
    about = {"machine": machine, "os": system, "arch": processor, "num_cpu": str(count)}
    list_file = folder / "benchmarks.json"
    benchmarks = json.loads(list_file.read_text(encoding="utf-8")) if list_file.exists() else {}
    results = {}
    for row in rows:
        name = re.sub(r"\W+", "_", row["name"])
        params = [[repr(side) for side in SIDES]]
        results[name] = [[row["ours"], row["peer"]], params, "1"]
        benchmarks[name] = {
            "code": f"{row['name']}; peer: {row['peer_name']}",
            "name": name,
            "param_names": ["by"],
            "params": params,
            "pretty_name": row["name"],
            "type": "track",
            "unit": row["unit"],
            "version": "1",
        }
    content = {
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
    for path, value in (
        (list_file, benchmarks | {"version": 2}),
        (file.with_name("machine.json"), about | {"version": 1}),
        (file, content),
    ):
        write_whole(path, json.dumps(value, indent=1, sort_keys=True) + "\n")
    return file


def runs(folder: Path) -> list[Run]:
    """Return the saved runs of all machines, the oldest first."""
    benchmarks = json.loads((folder / "benchmarks.json").read_text(encoding="utf-8"))
    saved = []
    for file in folder.glob("*/*-py*.json"):
        content = json.loads(file.read_text(encoding="utf-8"))
        measured = {
            benchmarks[name]["pretty_name"]: tuple(result[0])
            for name, result in content["results"].items()
        }
        saved.append(Run(dt.datetime.fromtimestamp(content["date"] / 1000, dt.UTC), measured))
    return sorted(saved, key=lambda run: run.date)


def page(rows: Sequence[Mapping[str, Any]], saved: Sequence[Run]) -> str:
    """Return the page as Markdown, with a line for each row of ``results.json``."""
    newest = saved[-SHOWN:]
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


def draw(rows: Sequence[Mapping[str, Any]], saved: Sequence[Run]) -> str:
    """Plot the ratios of the rows of ``results.json`` that have a bar, as SVG."""
    barred = [row for row in rows if row["bar"] is not None]
    height = math.ceil(len(barred) / COLUMNS)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "semsig", "font.size": 8}):
        figure = Figure(figsize=(10, 1.7 * height), layout="constrained")
        panels = figure.subplots(height, COLUMNS, squeeze=False, sharex=True).flat
        for panel, row in itertools.zip_longest(panels, barred):
            if row is None:
                panel.set_axis_off()
                continue
            measured = [run for run in saved if row["name"] in run.measured]
            ratios = [peer / ours for ours, peer in (run.measured[row["name"]] for run in measured)]
            numbers = [saved.index(run) + 1 for run in measured]
            panel.plot(numbers, ratios, marker="o", markersize=3, color="#0072b2")
            panel.axhline(row["bar"], color="#d55e00", linestyle="--", linewidth=1)
            panel.set_yscale("log")
            panel.set_ylim(min([row["bar"], *ratios]) / 1.5, max([row["bar"], *ratios]) * 1.5)
            near = abs(math.log(ratios[-1] / row["bar"])) < NEAR
            ticks = [ratios[-1]] if near else [row["bar"], ratios[-1]]
            panel.set_yticks(ticks, [f"{tick:.2g}" for tick in ticks])
            panel.minorticks_off()
            panel.set_title(textwrap.fill(row["name"], 48), fontsize=8, loc="left")
            panel.set_xticks(range(1, len(saved) + 1), [f"{run.date:%m-%d}" for run in saved])
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return re.sub(r"[ \t]+$", "", stream.getvalue(), flags=re.MULTILINE)


if __name__ == "__main__":
    main()
