"""`semsig identify`: where in a city a query can be placed, before there is one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli.app import (
    AsJson,
    Database,
    app,
    known_identifiability,
    print_table,
)
from semsig_gis.cli.console import print_json, progress, remark
from semsig_gis.cli.options import NoiseName, OnGrid, prepared_index, read_noise
from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.identify.check import IdentifiabilityCheck
    from semsig_gis.evaluation.identify.result import Identifiability


@app.command()
def identify(
    database: Database,
    *,
    noise: NoiseName = "generic",
    on_grid: OnGrid = False,
    radius: Annotated[float, typer.Option(help="Distance in metres that counts as found.")] = 50.0,
    seed: Annotated[int, typer.Option(help="Seed of the simulated queries.")] = 0,
    threads: Annotated[
        int | None, typer.Option(help="Number of threads; default: all processors.")
    ] = None,
    check: Annotated[
        int | None,
        typer.Option(help="Number of new queries to verify the predictions with."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write a report of the check to.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Predict how well each cell can be found, before any query.

    Adds columns to the database, which `semsig info`, `map` and `export` show.
    """
    from semsig_gis.database.city import open_city
    from semsig_gis.evaluation.identify.check import check_identifiability
    from semsig_gis.evaluation.identify.identify import identify as run
    from semsig_gis.evaluation.identify.result import save_identifiability
    from semsig_gis.likelihood.noise.model import cell_noise
    from semsig_gis.reports.identifiability import check_tables, identifiability_tables

    _require_numbers(check, threads, out)
    model = read_noise(noise)
    city = open_city(database)
    if not on_grid:
        model = cell_noise(model, city.database.grid.step)
    columns = known_identifiability(city)
    if columns is not None and (columns.noise, columns.radius, columns.seed) != (
        model,
        radius,
        seed,
    ):
        columns = None
    workers = (os.cpu_count() or 1) if threads is None else threads
    if columns is None or check is not None:
        index = prepared_index(city, model)
    if columns is None:
        with progress("comparing cells") as advance:
            columns = run(index, radius=radius, seed=seed, threads=workers, progress=advance)
        save_identifiability(columns, database)
    else:
        remark("The database has these columns already; they are kept.")
    verification = None
    if check is not None:
        with progress("checking") as advance:
            verification = check_identifiability(
                columns, index, queries=check, threads=workers, progress=advance
            )
    counts = city.object_counts
    if out is not None and verification is not None:
        _write_page(columns, verification, database, counts, out)
    if as_json:
        more = {} if verification is None else {"check": verification.to_dict()}
        print_json(columns.summary(object_counts=counts) | more)
        return
    tables = identifiability_tables(columns, object_counts=counts)
    for part in tables if verification is None else (*tables, *check_tables(verification)):
        print_table(part)
    typer.echo(f"columns: {database}")
    if out is not None:
        typer.echo(f"report: {out / 'report.html'}")


def _write_page(
    columns: Identifiability,
    verification: IdentifiabilityCheck,
    database: Path,
    counts: Mapping[int, int] | None,
    out: Path,
) -> None:
    from semsig_gis.reports.identifiability import identifiability_page
    from semsig_gis.reports.page import write_report

    page = identifiability_page(columns, verification, name=database.name, object_counts=counts)
    write_report(page, out)


def _require_numbers(check: int | None, threads: int | None, out: Path | None) -> None:
    """Refuse options that cannot be used."""
    for option, number in (("--check", check), ("--threads", threads)):
        if number is not None and number < 1:
            msg = f"{option} was given as {number}; give a whole number from 1."
            raise InputError(msg)
    if out is not None and check is None:
        msg = "--out was given without --check; give both or none."
        raise InputError(msg)
