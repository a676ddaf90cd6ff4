"""`semsig map` and `semsig export`: results for people and for other programs."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import Database, app, tell_if_online
from semsig_gis.console import progress


class CellGeometry(enum.StrEnum):
    """How `semsig export` draws a cell."""

    polygon = "polygon"
    point = "point"


@app.command(name="map")
def map_(
    database: Database,
    *,
    evaluation: Annotated[Path, typer.Option(help="Folder that `semsig evaluate --out` wrote.")],
    out: Annotated[Path, typer.Option(help="Map to write (.html).")],
) -> None:
    """Draw the errors and the query locations of an evaluation."""
    from semsig_gis.database_file import open_database
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.maps import evaluation_map, save_map

    results = Evaluation.load(evaluation)
    with progress("drawing the map"):
        offline = save_map(evaluation_map(results, open_database(database)), out)
    typer.echo(f"map: {out}")
    tell_if_online(offline)


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
        export_geopackage(opened, out, objects=seen, geometry=geometry.value, progress=advance)
    typer.echo(f"GeoPackage: {out}")
