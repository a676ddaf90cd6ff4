"""`semsig reproduce`: every table and plot of the paper's experiments, ours beside theirs."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli.app import AsJson, app
from semsig_gis.cli.console import print_json, print_rows, progress, remark

if TYPE_CHECKING:
    from collections.abc import Callable


class Size(enum.StrEnum):
    """How much is run."""

    full = "full"
    small = "small"


@app.command()
def reproduce(
    database: Annotated[
        Path | None,
        typer.Argument(
            help="Signature database written by `semsig build`; default: a made-up Paris."
        ),
    ] = None,
    *,
    out: Annotated[Path, typer.Option(help="Folder to write the report and results to.")],
    size: Annotated[
        Size, typer.Option(help="Ask the paper's 10,000 queries, or 300 of a small city.")
    ] = Size.full,
    queries: Annotated[
        int | None, typer.Option(help="Number of queries, in place of that of --size.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Number of processes, 0 for this one alone; default: all processors, 0 for "
            "--size small."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run the paper's experiments, ours beside its figures."""
    import contextlib
    import os

    from semsig_gis.experiments.paper.report import reproduction_report
    from semsig_gis.experiments.paper.reproduce import reproduce as run
    from semsig_gis.reports.page import write_report

    if workers is None:
        workers = (os.cpu_count() or 1) if size is Size.full else 0
    with contextlib.ExitStack() as bar:

        def show(label: str) -> Callable[[int, int], None]:
            bar.close()  # one at a time
            return bar.enter_context(progress(label))

        reproduction = run(
            out,
            database=database,
            size=size.value,
            queries=queries,
            seed=seed,
            workers=workers,
            note=remark,
            progress=show,
        )
    with progress("drawing the report"):
        report = reproduction_report(reproduction)
        write_report(report, out)
    numbers = [
        (section, number)
        for section in report.sections
        for number in section.numbers
        if number.paper is not None
    ]
    if as_json:
        print_json(
            [
                {
                    "section": section.name,
                    "row": one.row,
                    "column": one.column,
                    "unit": one.unit,
                    "ours": one.ours,
                    "low": one.low,
                    "high": one.high,
                    "paper": one.paper,
                }
                for section, one in numbers
            ]
        )
        return
    print_rows(
        report.title,
        ("Section", "What", "", "Ours", "95 %", "Paper"),
        [
            (section.title, one.row, one.column, *_shown(one.ours, one.low, one.high, one.paper))
            for section, one in numbers
        ],
    )
    typer.echo(f"report: {out / 'report.html'}  (open it in a browser)")
    typer.echo(f"numbers: {out / 'numbers.csv'}")


def _shown(
    ours: float | None, low: float | None, high: float | None, paper: float | None
) -> tuple[str, str, str]:
    interval = "" if low is None or high is None else f"{low:.4g} to {high:.4g}"
    return "" if ours is None else _number(ours), interval, "" if paper is None else _number(paper)


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"  # noqa: PLR2004
