"""`semsig map` and `semsig export`: results for people and for other programs."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli._app import (
    Database,
    app,
    known_identifiability,
    stored_objects,
    tell_if_online,
)
from semsig_gis.console import progress, remark
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from semsig_gis.objects import StreetObjects


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
    ambiguity: Annotated[
        bool, typer.Option("--ambiguity", help="Draw how many cells look the same.")
    ] = False,
    drift: Annotated[
        Path | None,
        typer.Option(help="Draw what has changed up to this newer database of the city."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Map to write (.html).")],
) -> None:
    """Draw an evaluation, where a query can be placed, cells that look the same, or changes."""
    from semsig_gis.database_file import open_database
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.map_ambiguity import ambiguity_map
    from semsig_gis.map_drift import drift_map
    from semsig_gis.map_identifiability import identifiability_map
    from semsig_gis.maps import evaluation_map, save_map

    if sum((evaluation is not None, identifiability, ambiguity, drift is not None)) != 1:
        msg = (
            "a map shows --evaluation, --identifiability, --ambiguity or --drift; give one of them."
        )
        raise InputError(msg)
    results = None if evaluation is None else Evaluation.load(evaluation)
    opened = open_database(database)
    told = known_identifiability(database, opened) if identifiability or ambiguity else None
    if identifiability and told is None:
        msg = f"{database} does not tell where a query can be placed; run semsig identify first."
        raise InputError(msg)
    with progress("drawing the map"):
        if ambiguity:
            drawn = ambiguity_map(opened, identifiability=told)
        elif drift is not None:
            newer = open_database(drift)
            before, after = _objects_of_both(database, drift)
            drawn = drift_map(opened, newer, objects_before=before, objects_after=after)
        elif told is not None:
            drawn = identifiability_map(told)
        elif results is not None:
            drawn = evaluation_map(results, opened)
        offline = save_map(drawn, out)
    typer.echo(f"map: {out}")
    tell_if_online(offline)


def _objects_of_both(older: Path, newer: Path) -> tuple[StreetObjects | None, StreetObjects | None]:
    """Return the street objects of two dates, where the stores of both have them."""
    before, after = stored_objects(older), stored_objects(newer)
    if before is None or after is None:
        remark("the street objects of both are not at hand, so only cells are drawn")
    return before, after


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
