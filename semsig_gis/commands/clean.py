"""`semsig clean`: remove leftover files next to a database."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from typing_extensions import TypedDict

from semsig_gis import database as databases
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import Database
from semsig_gis.core import Table

if TYPE_CHECKING:
    from semsig_gis.database import Companion

MB = 1e6


class Cleaned(TypedDict):
    """The removed files, or with `dry_run` those that would be, and their total size."""

    dry_run: bool
    bytes: int
    removed: list[databases.Companion]


@command(
    "clean",
    title="Remove leftover files",
    group="Prepare",
    order=10,
    returns=Cleaned,
    examples=(
        "semsig clean city.parquet --dry-run",
        "semsig clean city.parquet --objects",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Clean:
    """Remove leftover files next to a database.

    Older versions and interrupted runs leave them; the database is not changed.
    """

    database: Database
    objects: Annotated[
        bool,
        Option(
            "Also remove the street objects, which updates and refined places need.",
            title="Also the street objects",
        ),
    ] = False
    dry_run: Annotated[
        bool, Option("List what would be removed, but remove nothing.", title="Only list the files")
    ] = False

    def run(self, _reporter: Reporter) -> Result:
        """Remove the files; return them."""
        removed = databases.remove_companions(
            self.database, objects=self.objects, dry_run=self.dry_run
        )
        total = sum(file.bytes for file in removed)
        return Result(
            values=lambda: {
                "dry_run": self.dry_run,
                "bytes": total,
                "removed": [file.to_dict() for file in removed],
            },
            summary=self._summary(removed, total),
        )

    def _summary(self, removed: tuple[Companion, ...], total: int) -> Iterator[str | Table]:
        from semsig_gis.output import companion_table

        if not removed:
            yield f"There is nothing to remove next to {self.database}."
            return
        yield companion_table("Would be removed" if self.dry_run else "Removed", removed)
        yield f"{total / MB:,.1f} MB in all."
