"""`semsig build`, `update`, `merge`, `info` and `clean`: signature databases."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from semsig_gis.cli.console import (
    MOST_METRES,
    AsJson,
    Database,
    Scheduler,
    Workers,
    app,
    keep_inputs,
    known_identifiability,
    numbers,
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
    from semsig_gis.objects import StreetObjects

MB = 1e6


@app.command()
def build(
    objects: Annotated[Path, typer.Argument(help="Street objects written by `semsig load`.")],
    *,
    out: Annotated[
        Path, typer.Option(help="Signature database to write (.parquet), or a folder with tiles.")
    ],
    step: Annotated[
        float, typer.Option(min=0.01, max=100_000, help="Side of a cell in metres.")
    ] = 10.0,
    radius: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=6000,
            help="Visibility range in metres for classes without a range in the catalogue.",
        ),
    ] = 30.0,
    levels: Annotated[int, typer.Option(min=1, max=255, help="Number of angle levels.")] = 16,
    origin: Annotated[
        str, typer.Option(help="Corner of a cell as X,Y in metres, in the CRS of the objects.")
    ] = "0,0",
    buildings: Annotated[
        Path | None, typer.Option(help="Building footprints that hide what is behind them.")
    ] = None,
    streets: Annotated[Path | None, typer.Option(help="Centre lines of streets.")] = None,
    viewpoints: Annotated[
        Literal["all", "outdoor", "streets"],
        typer.Option(
            help="Viewpoints: every cell, outdoor cells or cells near streets (needs --streets)."
        ),
    ] = "all",
    street_width: Annotated[
        float,
        typer.Option(
            min=0.1, max=400, help="Default street width in metres, where --streets has none."
        ),
    ] = 16.0,
    area: Annotated[
        Path | None,
        typer.Option(help="Keep the cells in WEST,SOUTH,EAST,NORTH in degrees, or in polygons."),
    ] = None,
    tile: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=MOST_METRES,
            help="Tile size in metres; 2000 with --workers or --scheduler.",
        ),
    ] = None,
    workers: Workers = 0,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Build a signature database from street objects."""
    from semsig_gis.core import GridSpec, SignatureSpec
    from semsig_gis.database import ViewpointSpec, open_city
    from semsig_gis.objects import open_objects, read_area
    from semsig_gis.storage import EMPTY_BOX

    if streets is not None and viewpoints != "streets":
        raise InputError("--streets is used only with --viewpoints streets; give both or neither.")
    keep_inputs(out, read=(objects, buildings, streets, area))
    grid = GridSpec(step, tuple(numbers(origin, "--origin")))  # type: ignore[arg-type]
    spec = SignatureSpec(radius, levels)
    in_tiles = tile is not None or workers or scheduler is not None
    if not in_tiles:
        require_suffix(".parquet", out)
    # The objects of tiles are read tile by tile; here only their CRS is needed.
    opened = open_objects(objects, box=EMPTY_BOX if in_tiles else None)
    polygons = None if area is None else read_area(area, crs=opened.crs)
    specs: dict[str, Any] = {
        "grid": grid,
        "spec": spec,
        "viewpoints": ViewpointSpec(mode=viewpoints, width=street_width / 2, area=polygons),
    }
    if not in_tiles:
        cells, entries = _build_whole(opened, out, buildings, streets, specs)
    else:
        from semsig_gis.database import TileSpec, build_tiles

        with progress("building tiles") as advance:
            manifest = build_tiles(
                objects,
                out,
                tile=None if tile is None else TileSpec(tile),
                buildings=buildings,
                streets=streets,
                workers=workers,
                scheduler=scheduler,
                progress=advance,
                tell=remark,
                **specs,
            )
        cells, entries = manifest.cells, manifest.entries
    if as_json:
        print_json(_info(out))
        return
    size = open_city(out).bytes / 1e6
    say(f"{cells:,} cells of mean length {entries / cells:.3f}, {size:.1f} MB: {out}")


def _build_whole(
    objects: StreetObjects,
    out: Path,
    buildings: Path | None,
    streets: Path | None,
    specs: dict[str, Any],
) -> tuple[int, int]:
    """Write a database in one file with its object store; return its cells and entries."""
    from semsig_gis.database import ObjectStore, build_database, save_with_store
    from semsig_gis.objects import read_surroundings

    notes: list[str] = []
    read = partial(read_surroundings, crs=objects.crs, tell=notes.append)
    houses = None if buildings is None else read(buildings, role="buildings")
    lines = None if streets is None else read(streets, role="streets")
    if houses is not None and (invalid := int((~houses.is_valid).sum())):
        notes.append(
            f"{invalid} building footprints in {buildings} are invalid polygons; they were repaired"
        )
    for note in notes:
        remark(note)
    objects = replace(objects, notes=(*objects.notes, *notes))
    with progress("building") as advance:
        database = build_database(
            objects, footprints=houses, streets=lines, progress=advance, **specs
        )
    save_with_store(database, ObjectStore.of(objects, footprints=houses, streets=lines), out)
    return len(database), len(database.codes)


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


@app.command()
def info(database: Database, *, as_json: AsJson = False) -> None:
    """Print the properties of a database next to those in the paper."""
    if as_json:
        print_json(_info(database))
        return
    from semsig_gis.database import companions, open_city
    from semsig_gis.output import database_tables, identifiability_tables

    city = open_city(database)
    counts = city.object_counts
    print_tables(database_tables(city.database, file_bytes=city.bytes, object_counts=counts))
    columns = known_identifiability(city)
    if columns is not None:
        print_tables(identifiability_tables(columns, object_counts=counts))
    if files := companions(database):
        print_rows("Files of the database", ("File", "What", "MB"), map(_companion_row, files))
    for line in city.licenses:
        say(line)


def _info(path: Path) -> dict[str, Any]:
    from semsig_gis.database import companions, database_summary, open_city

    city = open_city(path)
    counts = city.object_counts
    summary = database_summary(city.database, file_bytes=city.bytes, object_counts=counts)
    columns = known_identifiability(city)
    if columns is not None:
        summary["identifiability"] = columns.summary(object_counts=counts)
    summary["beside"] = [file.to_dict() for file in companions(path)]
    return summary


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
