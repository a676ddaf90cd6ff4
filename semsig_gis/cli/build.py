"""`semsig build`, `update`, `merge`, `info` and `clean`: signature databases."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli.console import (
    AsJson,
    Database,
    Scheduler,
    Workers,
    app,
    keep_inputs,
    print_json,
    print_rows,
    print_tables,
    progress,
    remark,
    require_suffix,
    say,
)
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from semsig_gis.database import Companion

MB = 1e6


@app.command()
def update(
    database: Database,
    *,
    objects: Annotated[
        Path, typer.Option(help="New street objects; their layers replace layers of the database.")
    ],
    out: Annotated[Path | None, typer.Option(help="Database to write; default: in place.")] = None,
    workers: Workers = 0,
    scheduler: Scheduler = None,
    years: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=100,
            help="Years between the old objects and the new ones, for the report of --json.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Apply changed street objects to a database."""
    from semsig_gis.database import open_city, update_file, update_tiles
    from semsig_gis.objects import open_objects

    keep_inputs(out, read=(objects,))
    had_columns = open_city(database).has_columns
    tiled = database.is_dir()
    if not tiled and (workers or scheduler):
        raise InputError(
            f"{database} is a single file, not tiles; leave out --workers and --scheduler."
        )
    with progress("updating") as advance:
        if not tiled:
            report = update_file(database, open_objects(objects), out=out, progress=advance)
        else:
            report = update_tiles(
                database,
                objects,
                out=out,
                workers=workers,
                scheduler=scheduler,
                progress=advance,
            )
    if had_columns:
        remark("the new database lacks the columns of semsig identify; run semsig identify again")
    for note in report.notes:
        remark(note)
    if as_json:
        print_json(report.to_dict() | ({} if years is None else {"years": years}))
        return
    from semsig_gis.output import update_tables

    print_tables(update_tables(report))


@app.command()
def merge(
    first: Annotated[Path, typer.Argument(help="Signature database in one file or in tiles.")],
    second: Annotated[
        Path, typer.Argument(help="Another signature database, built in the same way.")
    ],
    *,
    out: Annotated[Path, typer.Option(help="Signature database to write (.parquet).")],
    as_json: AsJson = False,
) -> None:
    """Merge the databases of two places into one.

    Objects in both are kept once, and cells near both are computed again.
    """
    from semsig_gis.database import merge_databases

    keep_inputs(out, read=(first, second))
    require_suffix(".parquet", out)
    with progress("merging") as advance:
        report = merge_databases(first, second, out=out, progress=advance)
    if as_json:
        print_json(report.to_dict())
        return
    say(
        f"{report.cells:,} cells of {report.objects:,} objects: {out}. In both were "
        f"{report.shared_cells:,} cells and {report.shared_objects:,} objects; "
        f"{report.recomputed:,} cells near both were computed again."
    )


def _companion_row(file: Companion) -> tuple[str, str, str]:
    return file.path.name, file.what, f"{file.bytes / MB:,.1f}"


@app.command()
def clean(
    database: Database,
    *,
    objects: Annotated[
        bool,
        typer.Option(
            "--objects",
            help="Also remove the street objects, which updates and refined places need.",
        ),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="List what would be removed, but remove nothing.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Remove leftover files next to a database.

    Older versions and interrupted runs leave them; the database is not changed.
    """
    from semsig_gis.database import remove_companions

    removed = remove_companions(database, objects=objects, dry_run=dry_run)
    total = sum(file.bytes for file in removed)
    if as_json:
        print_json(
            {"dry_run": dry_run, "bytes": total, "removed": [file.to_dict() for file in removed]}
        )
        return
    if not removed:
        say(f"There is nothing to remove next to {database}.")
        return
    title = "Would be removed" if dry_run else "Removed"
    print_rows(title, ("File", "What", "MB"), map(_companion_row, removed))
    say(f"{total / MB:,.1f} MB in all.")
