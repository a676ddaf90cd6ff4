"""`semsig export`: results for other programs."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import Database, app, known_identifiability
from semsig_gis.console import progress


class CellGeometry(enum.StrEnum):
    """How `semsig export` draws a cell."""

    polygon = "polygon"
    point = "point"


@app.command()
def export(
    database: Database,
    *,
    out: Annotated[Path, typer.Option(help="GeoPackage to write (.gpkg).")],
    objects: Annotated[
        Path | None, typer.Option(help="Street objects to add as a second layer.")
    ] = None,
    geometry: Annotated[
        CellGeometry, typer.Option(help="How a cell is drawn.")
    ] = CellGeometry.polygon,
) -> None:
    """Write the cells, and the street objects, to a GeoPackage for QGIS."""
    from semsig_gis.database_file import open_database
    from semsig_gis.export import export_geopackage
    from semsig_gis.objects import open_objects

    opened = open_database(database)
    seen = None if objects is None else open_objects(objects)
    with progress("writing the GeoPackage") as advance:
        export_geopackage(
            opened,
            out,
            objects=seen,
            identifiability=known_identifiability(database, opened),
            geometry=geometry.value,
            progress=advance,
        )
    typer.echo(f"GeoPackage: {out}")
