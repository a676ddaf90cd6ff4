"""`semsig identify`: where in a city a query can be placed, before there is one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import AsJson, Database, app, print_table, tell_if_online
from semsig_gis.cli._build import object_counts
from semsig_gis.cli._likelihood import NoiseName, prepared_index, read_noise
from semsig_gis.console import print_json, progress


@app.command()
def identify(
    database: Database,
    *,
    noise: NoiseName = "generic",
    out: Annotated[
        Path | None,
        typer.Option(
            help="Table to write (.parquet), a row a cell; by default beside the database, where "
            "`semsig info` looks for it."
        ),
    ] = None,
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated queries.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Tell of every cell how well a query from it will be placed, and what it is taken for."""
    from semsig_gis.database_file import open_database
    from semsig_gis.identifiability import identify as identified
    from semsig_gis.identifiability_file import identifiability_path, save_identifiability
    from semsig_gis.identifiability_report import identifiability_tables
    from semsig_gis.map_identifiability import identifiability_map
    from semsig_gis.maps import save_map

    model = read_noise(noise)
    opened = open_database(database)
    index = prepared_index(database, opened, model)
    with progress("comparing cells") as advance:
        told = identified(index, seed=seed, threads=os.cpu_count() or 1, progress=advance)
    table = identifiability_path(database) if out is None else out
    save_identifiability(told, table)
    counts = object_counts(database)
    if as_json:
        print_json(told.summary(object_counts=counts))
    else:
        for part in identifiability_tables(told, object_counts=counts):
            print_table(part)
        typer.echo(f"table: {table}")
    if map_ is not None:
        offline = save_map(identifiability_map(told), map_)
        if not as_json:
            typer.echo(f"map: {map_}")
        tell_if_online(offline)
