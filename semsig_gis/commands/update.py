"""`semsig update`: changed street objects in a database."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NotRequired

from typing_extensions import TypedDict

from semsig_gis import objects as street_objects
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import Scheduler, Workers
from semsig_gis.core import InputError


class Updated(TypedDict):
    """Counts of the changes by an update; `years` as given."""

    classes: list[street_objects.ClassChange]
    replaced: list[str]
    kept: list[str]
    cells_before: int
    cells: int
    recomputed: int
    changed: int
    appeared: int
    vanished: int
    notes: list[str]
    share: float
    years: NotRequired[float]


@command(
    "update",
    title="Update signature database",
    group="Prepare",
    order=7,
    returns=Updated,
    examples=(
        "semsig update city.parquet --objects new_trees.parquet",
        "semsig update city.parquet --objects new.parquet --out new_city.parquet",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Update:
    """Apply changed street objects to a database."""

    database: Annotated[
        Path,
        Option(
            "Signature database written by `semsig build`.",
            title="Signature database",
            positional=True,
        ),
    ]
    objects: Annotated[
        Path,
        Option(
            "New street objects; their layers replace layers of the database.",
            title="New street objects",
            reads=True,
        ),
    ]
    out: Annotated[
        Path | None,
        Option(
            "Database to write.",
            title="Updated database",
            default="in place",
            writes=(".parquet", ""),
        ),
    ] = None
    workers: Workers = 0
    scheduler: Scheduler = None
    years: Annotated[
        float | None,
        Option(
            "Years between the old objects and the new ones, for the report of --json.",
            title="Time between the objects",
            unit="years",
            low=0.001,
            high=100,
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the new database; return the changes."""
        from semsig_gis.database import open_city, update_file, update_tiles
        from semsig_gis.objects import open_objects
        from semsig_gis.output import update_sentence, update_tables

        had_columns = open_city(self.database).has_columns
        tiled = self.database.is_dir()
        if not tiled and (self.workers or self.scheduler):
            raise InputError(
                f"{self.database} is a single file, not tiles; leave out --workers and --scheduler."
            )
        with reporter.progress("updating") as advance:
            if not tiled:
                report = update_file(
                    self.database, open_objects(self.objects), out=self.out, progress=advance
                )
            else:
                report = update_tiles(
                    self.database,
                    self.objects,
                    out=self.out,
                    workers=self.workers,
                    scheduler=self.scheduler,
                    progress=advance,
                )
        if had_columns:
            reporter.remark(
                "the new database lacks the columns of semsig identify; run semsig identify again"
            )
        for note in report.notes:
            reporter.remark(note)

        def values() -> dict[str, Any]:
            return report.to_dict() | ({} if self.years is None else {"years": self.years})

        return Result(
            values=values,
            summary=[update_sentence(report)],
            tables=update_tables(report),
            files={"signature database": self.out or self.database},
        )
