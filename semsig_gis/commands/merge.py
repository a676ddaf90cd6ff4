"""`semsig merge`: one database of two places."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command


class Merged(TypedDict):
    """Counts of a merged database."""

    cells: int
    objects: int
    shared_cells: int
    shared_objects: int
    recomputed: int


@command(
    "merge",
    title="Merge signature databases",
    group="Prepare",
    order=8,
    returns=Merged,
    examples=(
        "semsig merge west.parquet east.parquet --out city.parquet",
        "semsig merge west.parquet east.parquet --out city.parquet --json",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Merge:
    """Merge the databases of two places into one.

    Objects in both are kept once, and cells near both are computed again.
    """

    first: Annotated[
        Path,
        Option(
            "Signature database in one file or in tiles.",
            title="First database",
            positional=True,
            reads=True,
        ),
    ]
    second: Annotated[
        Path,
        Option(
            "Another signature database, built in the same way.",
            title="Second database",
            positional=True,
            reads=True,
        ),
    ]
    out: Annotated[
        Path,
        Option(
            "Signature database to write (.parquet).", title="Merged database", writes=".parquet"
        ),
    ]

    def run(self, reporter: Reporter) -> Result:
        """Write the database; return its counts."""
        from semsig_gis.database import merge_databases

        with reporter.progress("merging") as advance:
            report = merge_databases(self.first, self.second, out=self.out, progress=advance)
        sentence = (
            f"{report.cells:,} cells of {report.objects:,} objects. In both databases were "
            f"{report.shared_cells:,} cells and {report.shared_objects:,} objects; "
            f"{report.recomputed:,} cells near both were computed again."
        )
        return Result(
            values=report.to_dict, summary=[sentence], files={"signature database": self.out}
        )
