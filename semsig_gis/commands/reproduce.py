"""`semsig reproduce`: the paper's experiments."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command, command_line
from semsig_gis.commands.options import MOST_QUERIES, MOST_WORKERS, Seed
from semsig_gis.core import Table

if TYPE_CHECKING:
    from semsig_gis.output import Number, Section

LARGE = 1000  # numbers from here on have no decimals


class NumberRecord(TypedDict):
    """A number of the report with its interval, and the paper's."""

    section: str
    row: str
    column: str
    unit: str
    ours: float | None
    low: float | None
    high: float | None
    paper: float


@command(
    "reproduce",
    title="Repeat the paper's experiments",
    group="Research",
    order=3,
    returns=list[NumberRecord],
    examples=(
        "semsig reproduce --out paper --size small",
        "semsig reproduce city.parquet --out paper --queries 1000",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Repeat the paper's experiments and compare the results."""

    database: Annotated[
        Path | None,
        Option(
            "Signature database written by `semsig build`.",
            title="Signature database",
            default="a made-up Paris",
            positional=True,
            reads=True,
        ),
    ] = None
    out: Annotated[
        Path,
        Option(
            "Folder to write the report and results to.",
            title="Folder for the results",
            metavar="FOLDER",
            writes="",
        ),
    ]
    size: Annotated[
        Literal["full", "small"],
        Option(
            "Run the paper's 10,000 queries, or 300 in a small city.",
            title="Size of the experiments",
        ),
    ] = "full"
    queries: Annotated[
        int | None,
        Option(
            "Number of queries.",
            title="Number of queries",
            default="that of --size",
            low=1,
            high=MOST_QUERIES,
        ),
    ] = None
    seed: Seed = 0
    workers: Annotated[
        int | None,
        Option(
            "Number of processes, 0 to use this one only.",
            title="Processes",
            default="all processors, 0 for --size small",
            low=0,
            high=MOST_WORKERS,
            advanced=True,
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the report; return its numbers that the paper has as well."""
        from semsig_gis.evaluation import reproduce
        from semsig_gis.output import reproduction_report, write_report

        workers = self.workers
        if workers is None:
            workers = (os.cpu_count() or 1) if self.size == "full" else 0
        with contextlib.ExitStack() as bar:

            def show(label: str) -> Callable[[int, int], None]:
                bar.close()  # only one bar at a time
                return bar.enter_context(reporter.progress(label))

            reproduction = reproduce(
                self.out,
                database=self.database,
                size=self.size,
                queries=self.queries,
                seed=self.seed,
                workers=workers,
                note=reporter.remark,
                progress=show,
            )
        with reporter.progress("drawing the report"):
            report = reproduction_report(reproduction, command=command_line(self))
            write_report(report, self.out)
        numbers = [
            (section, number)
            for section in report.sections
            for number in section.numbers
            if number.paper is not None
        ]

        def values() -> list[NumberRecord]:
            keys = [name for name in NumberRecord.__annotations__ if name != "section"]
            rows: list[Any] = [
                {"section": section.name, **{key: getattr(number, key) for key in keys}}
                for section, number in numbers
            ]
            return rows

        return Result(
            values=values,
            summary=[report.headline],
            tables=[_table(report.title, numbers)],
            files={"report": self.out / "report.html", "numbers": self.out / "numbers.csv"},
        )


def _table(title: str, numbers: list[tuple[Section, Number]]) -> Table:
    return Table.of(
        title,
        ("Section", "What", "", "Ours", "95 %", "Paper"),
        [
            (
                *(section.title, number.row, number.column, _number(number.ours)),
                ""
                if number.low is None or number.high is None
                else f"{number.low:.4g} to {number.high:.4g}",
                _number(number.paper),
            )
            for section, number in numbers
        ],
    )


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= LARGE else f"{value:.4g}"
