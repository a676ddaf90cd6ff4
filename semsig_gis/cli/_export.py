"""`semsig map` and `semsig export`: results for people and for other programs."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import Database, app, known_identifiability, tell_if_online
from semsig_gis.cli._ground import Buildings, Streets, draw_ground
from semsig_gis.console import progress
from semsig_gis.errors import InputError


class CellGeometry(enum.StrEnum):
    """How `semsig export` draws a cell."""

    polygon = "polygon"
    point = "point"


@app.command(name="map")
def map_(
    database: Database,
    *,
    evaluation: Annotated[
        Path | None, typer.Option(help="Folder that `semsig evaluate --out` wrote.")
    ] = None,
    identifiability: Annotated[
        bool,
        typer.Option(
            "--identifiability", help="Draw where a query can be placed (after `semsig identify`)."
        ),
    ] = False,
    objects: Annotated[
        Path | None, typer.Option(help="Draw the street objects that `semsig load` wrote.")
    ] = None,
    buildings: Buildings = None,
    streets: Streets = None,
    out: Annotated[Path, typer.Option(help="Map to write (.html).")],
) -> None:
    """Draw an evaluation, where a query can be placed at all, or the street objects."""
    from semsig_gis.database_file import open_database
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.map_identifiability import identifiability_map
    from semsig_gis.map_objects import objects_map
    from semsig_gis.maps import evaluation_map, save_map
    from semsig_gis.objects import open_objects

    given = (evaluation is not None) + identifiability
    if given > 1 or (given == 0 and objects is None):
        msg = "a map shows --evaluation or --identifiability, with --objects or without, or "
        msg += "--objects alone; give one of them."
        raise InputError(msg)
    results = None if evaluation is None else Evaluation.load(evaluation)
    opened = open_database(database)
    told = known_identifiability(database, opened) if identifiability else None
    if identifiability and told is None:
        msg = f"{database} does not tell where a query can be placed; run semsig identify first."
        raise InputError(msg)
    seen = None if objects is None else open_objects(objects)
    with progress("drawing the map"):
        if told is not None:
            drawn = identifiability_map(told)
        elif results is not None:
            drawn = evaluation_map(results, opened)
        elif seen is not None:
            drawn = objects_map(seen, database=opened)
        if seen is not None and given:
            objects_map(seen, map_=drawn)
        draw_ground(drawn, database, opened, buildings=buildings, streets=streets)
        offline = save_map(drawn, out)
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
        export_geopackage(
            opened,
            out,
            objects=seen,
            identifiability=known_identifiability(database, opened),
            geometry=geometry.value,
            progress=advance,
        )
    typer.echo(f"GeoPackage: {out}")
