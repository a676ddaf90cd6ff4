"""`semsig identify`: predict how well queries from each cell will be located."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semsig_gis.commands.model import Option, Reporter, Result, command, command_line
from semsig_gis.commands.options import (
    MOST_METRES,
    MOST_WORKERS,
    Database,
    NoiseName,
    OnGrid,
    Seed,
    known_identifiability,
    read_noise,
)
from semsig_gis.core import InputError, Table, percent

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.database import City
    from semsig_gis.evaluation import (
        Identifiability,
        IdentifiabilityCheck,
        IdentifiabilityRecord,
    )
    from semsig_gis.localization import Noise


@command(
    "identify",
    title="Predict the accuracy",
    group="Measure",
    order=2,
    returns="semsig_gis.evaluation:IdentifiabilityRecord",
    examples=(
        "semsig identify city.parquet",
        "semsig identify city.parquet --view 90 --check 1000",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Identify:
    """Predict how well queries from each cell will be located.

    Adds columns to the database, which `semsig info`, `map` and `export` show.
    """

    database: Database
    noise: NoiseName = "generic"
    on_grid: OnGrid = False
    radius: Annotated[
        float,
        Option(
            "Largest error that counts as found.",
            title="Largest error",
            unit="m",
            low=0,
            high=MOST_METRES,
        ),
    ] = 50.0
    view: Annotated[
        float,
        Option(
            "Field of view of a query, in any direction.",
            title="Field of view",
            unit="°",
            default="full turn",
            low=10,
            high=360,
        ),
    ] = 360.0
    seed: Seed = 0
    threads: Annotated[
        int | None,
        Option(
            "Number of threads.",
            title="Threads",
            default="all processors",
            low=1,
            high=MOST_WORKERS,
            advanced=True,
        ),
    ] = None
    check: Annotated[
        int | None,
        Option(
            "Number of new queries to check the predictions with.",
            title="Queries to check the predictions",
            low=1,
            high=1_000_000,
        ),
    ] = None
    out: Annotated[
        Path | None,
        Option(
            "Folder to write a report of the check to.",
            title="Folder of the check",
            metavar="FOLDER",
            writes="",
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Add the columns to the database; return a summary of them."""
        from semsig_gis.database import open_city
        from semsig_gis.evaluation import check_identifiability, identify, save_identifiability
        from semsig_gis.localization import build_index, cell_noise

        if self.out is not None:
            if self.check is None:
                raise InputError("--out was given without --check; give both or neither.")
            from semsig_gis.output import draw_plot  # noqa: F401 - matplotlib may be missing
        city = open_city(self.database)
        counts = city.object_counts  # before the file changes
        noise = read_noise(self.noise, city.database)
        if not self.on_grid:
            noise = cell_noise(noise, city.database.grid.step)
        columns = self._stored(city, noise, reporter)
        threads = (os.cpu_count() or 1) if self.threads is None else self.threads
        if columns is None or self.check is not None:
            index = build_index(city.database, noise)
        if columns is None:
            with reporter.progress("comparing cells") as advance:
                columns = identify(
                    index,
                    radius=self.radius,
                    view=self.view,
                    seed=self.seed,
                    threads=threads,
                    progress=advance,
                )
            save_identifiability(columns, self.database)
        else:
            reporter.remark("The database already has these columns; they are used again.")
        check = None
        if self.check is not None:
            with reporter.progress("checking") as advance:
                check = check_identifiability(
                    columns, index, queries=self.check, threads=threads, progress=advance
                )
        if self.out is not None and check is not None:
            from semsig_gis.output import identifiability_page, write_report  # needs matplotlib

            page = identifiability_page(
                columns,
                check,
                name=self.database.name,
                object_counts=counts,
                command=command_line(self),
            )
            write_report(page, self.out)

        def values() -> IdentifiabilityRecord:
            summary = columns.summary(object_counts=counts)
            return summary if check is None else {**summary, "check": check.to_dict()}

        report = {} if self.out is None else {"report": self.out / "report.html"}
        return Result(
            values=values,
            summary=self._summary(columns, check),
            tables=self._tables(columns, check, counts),
            files={"columns": self.database, **report},
        )

    def _stored(self, city: City, noise: Noise, reporter: Reporter) -> Identifiability | None:
        """Return the columns of the database if they have the same settings."""
        columns = known_identifiability(city, reporter)
        if columns is None:
            return None
        stored = columns.noise, columns.radius, columns.view, columns.seed
        return columns if stored == (noise, self.radius, self.view, self.seed) else None

    def _summary(
        self, columns: Identifiability, check: IdentifiabilityCheck | None
    ) -> Iterator[str]:
        from semsig_gis.output import identifiability_sentence

        fresh = (
            ""
            if check is None
            else f"; of {check.queries:,} fresh ones, {percent(check.found, 0)} were"
        )
        yield f"{identifiability_sentence(columns)}{fresh}."

    def _tables(
        self,
        columns: Identifiability,
        check: IdentifiabilityCheck | None,
        counts: Mapping[int, int] | None,
    ) -> Iterator[Table]:
        from semsig_gis.output import check_tables, identifiability_tables

        yield from identifiability_tables(columns, object_counts=counts)
        if check is not None:
            yield from check_tables(check)
