"""`semsig compare`: two results of queries from the same places."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semsig_gis.commands.model import Option, Reporter, Result, command

RESULT = Option(
    "Folder of an experiment or of an evaluation.",
    title="Folder of results",
    metavar="FOLDER",
    positional=True,
    reads=True,
)


@command(
    "compare",
    title="Compare results",
    group="Measure",
    order=3,
    returns="semsig_gis.evaluation:ComparisonRecord",
    examples=(
        "semsig compare results results_of_yesterday",
        "semsig compare results other_results --tables",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Compare:
    """Compare two results of queries from the same places."""

    first: Annotated[Path, RESULT]
    second: Annotated[Path, RESULT]

    def run(self, _reporter: Reporter) -> Result:
        """Return the differences of the figures by the name of the case."""
        from semsig_gis.evaluation import (
            changed_successes,
            common_cases,
            compare_evaluations,
            open_results,
            plain_records,
        )
        from semsig_gis.output import comparison_sentence, comparison_table

        pairs = common_cases(open_results(self.first), open_results(self.second))
        tables = {name: compare_evaluations(*pair) for name, pair in pairs.items()}

        def summary() -> Iterator[str]:
            names = str(self.first), str(self.second)
            for name, table in tables.items():
                changed = changed_successes(*pairs[name])
                yield _case(name) + comparison_sentence(table, changed, names=names)

        return Result(
            values=lambda: {name: plain_records(table) for name, table in tables.items()},
            summary=summary(),
            tables=(
                comparison_table(table, f"{_case(name)}{self.first} and {self.second}")
                for name, table in tables.items()
            ),
        )


def _case(name: str) -> str:
    """Return the name of a case before a text; a single case has no name."""
    return f"{name}: " if name else ""
