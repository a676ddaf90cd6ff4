"""`semsig build` and `semsig info`: street objects become a signature database."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli._app import AsJson, Database, app, numbers, print_table
from semsig_gis.console import print_json, progress, remark
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase


class Viewpoints(enum.StrEnum):
    """Which cells `semsig build` looks from."""

    all = "all"
    outdoor = "outdoor"
    streets = "streets"


@app.command()
def build(
    objects: Annotated[Path, typer.Argument(help="Street objects that `semsig load` wrote.")],
    *,
    out: Annotated[Path, typer.Option(help="Signature database to write (.parquet).")],
    step: Annotated[float, typer.Option(help="Side of a cell in metres.")] = 10.0,
    radius: Annotated[float, typer.Option(help="Visibility range in metres.")] = 30.0,
    levels: Annotated[int, typer.Option(help="Number of angle levels.")] = 16,
    origin: Annotated[
        str, typer.Option(help="Corner of a cell as X,Y in metres, in the CRS of the objects.")
    ] = "0,0",
    buildings: Annotated[
        Path | None, typer.Option(help="Building footprints: what they hide is not seen.")
    ] = None,
    streets: Annotated[Path | None, typer.Option(help="Centre lines of streets.")] = None,
    viewpoints: Annotated[
        Viewpoints,
        typer.Option(help="Every cell, those outside --buildings, or those along --streets."),
    ] = Viewpoints.all,
    street_width: Annotated[
        float, typer.Option(help="How far from a centre line a street reaches, in metres.")
    ] = 8.0,
    area: Annotated[Path | None, typer.Option(help="Polygons that the cells must lie in.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compute the signature of every cell that sees an object."""
    from semsig_gis.building import build_database
    from semsig_gis.database_file import save_database
    from semsig_gis.grid import GridSpec
    from semsig_gis.objects import open_objects
    from semsig_gis.signatures import SignatureSpec
    from semsig_gis.surroundings import read_area, read_surroundings
    from semsig_gis.viewpoints import ViewpointSpec

    corner = numbers(origin, "--origin")
    grid = GridSpec(step, tuple(corner))  # type: ignore[arg-type] # GridSpec checks the length
    spec = SignatureSpec(radius, levels)
    if streets is not None and viewpoints is not Viewpoints.streets:
        msg = "--streets was given, which only --viewpoints streets uses; give both or none."
        raise InputError(msg)
    opened = open_objects(objects)
    crs = opened.crs
    where = ViewpointSpec(
        mode=viewpoints.value,
        width=street_width,
        area=None if area is None else read_area(area, crs=crs),
    )
    houses = None if buildings is None else read_surroundings(buildings, role="buildings", crs=crs)
    lines = None if streets is None else read_surroundings(streets, role="streets", crs=crs)
    if houses is not None and (invalid := int((~houses.is_valid).sum())):
        remark(f"{invalid} building footprints in {buildings} are invalid polygons; repaired here")
    with progress("building") as advance:
        database = build_database(
            opened,
            grid=grid,
            spec=spec,
            viewpoints=where,
            footprints=houses,
            streets=lines,
            progress=advance,
        )
    save_database(database, out)
    if as_json:
        print_json(_info(database, out))
    else:
        typer.echo(
            f"{len(database):,} cells of mean length {database.lengths.mean():.3f}, "
            f"{out.stat().st_size / 1e6:.1f} MB: {out}"
        )


@app.command()
def info(database: Database, *, as_json: AsJson = False) -> None:
    """Print the paper's tables of properties for a database."""
    from semsig_gis.database_file import open_database
    from semsig_gis.report import database_tables

    opened = open_database(database)
    if as_json:
        print_json(_info(opened, database))
        return
    for table in database_tables(opened, file_bytes=database.stat().st_size):
        print_table(table)
    for line in opened.licenses:
        typer.echo(line)


def _info(database: SignatureDatabase, file: Path) -> dict[str, Any]:
    from semsig_gis.report import database_summary

    return database_summary(database, file_bytes=file.stat().st_size)
