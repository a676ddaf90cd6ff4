"""`semsig import`: a database from a GeoPackage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NotRequired

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.core import InputError


class Imported(TypedDict):
    """The files, the numbers of cells and street objects in them, and what was changed or lost."""

    database: str
    cells: int
    notes: list[str]
    objects: NotRequired[str]
    street_objects: NotRequired[int]


@command(
    "import",
    title="Import from QGIS",
    group="Prepare",
    order=9,
    returns=Imported,
    examples=(
        "semsig import city.gpkg --out city.parquet",
        "semsig import city.gpkg --out city.parquet --objects objects.parquet",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Import:
    """Restore a database from an exported GeoPackage."""

    geopackage: Annotated[
        Path,
        Option(
            "GeoPackage written by `semsig export`.",
            title="GeoPackage",
            positional=True,
            reads=True,
        ),
    ]
    out: Annotated[
        Path,
        Option(
            "Signature database to write (.parquet).", title="Signature database", writes=".parquet"
        ),
    ]
    objects: Annotated[
        Path | None,
        Option("Street objects to write, if exported.", title="Street objects", writes=".parquet"),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the database; return its file and its number of cells."""
        from semsig_gis.database import save_database
        from semsig_gis.evaluation import save_identifiability
        from semsig_gis.objects import save_with_ground
        from semsig_gis.output import read_geopackage

        contents = read_geopackage(self.geopackage)
        if self.objects is not None and contents.objects is None:
            raise InputError(f"{self.geopackage} contains no street objects; leave out --objects.")
        for note in contents.notes:
            reporter.remark(note)
        cells = len(contents.database)
        values: Imported = {
            "database": str(self.out),
            "cells": cells,
            "notes": list(contents.notes),
        }
        files = {"signature database": self.out}
        if self.objects is not None and contents.objects is not None:
            # A GeoPackage has no ground, and that of earlier objects is removed.
            save_with_ground(
                contents.objects, self.objects, keep_order=True, remark=reporter.remark
            )
            values |= {"objects": str(self.objects), "street_objects": len(contents.objects)}
            files["street objects"] = self.objects
        save_database(contents.database, self.out)
        if contents.identifiability is not None:
            save_identifiability(contents.identifiability, self.out)
        return Result(
            values=lambda: values, summary=[f"A database of {cells:,} cells."], files=files
        )
