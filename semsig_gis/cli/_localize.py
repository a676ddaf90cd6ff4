"""`semsig localize`: one query, and its best cells."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import AsJson, Database, MethodText, app, numbers, tell_if_online
from semsig_gis.console import print_json, print_rows, progress


@app.command()
def localize(
    database: Database,
    *,
    types: Annotated[
        str | None, typer.Option(help="Symbols clockwise from north, such as DDBL.")
    ] = None,
    bearings: Annotated[
        str | None, typer.Option(help="Degrees clockwise from north, such as 10,80,200,310.")
    ] = None,
    method: MethodText = "edit+edit",
    top: Annotated[int, typer.Option(help="Number of candidates.")] = 10,
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None,
    as_json: AsJson = False,
) -> None:
    """Rank the cells of a database for one query."""
    from semsig_gis import matching
    from semsig_gis.database_file import open_database
    from semsig_gis.dataset import open_dataset
    from semsig_gis.signatures import Signature

    chosen = matching.Method.parse(method)
    opened = open_dataset(database) if database.is_dir() else open_database(database)
    angles = None if bearings is None else numbers(bearings, "--bearings")
    query = Signature.parse(types, angles, taxonomy=opened.taxonomy)
    localization = matching.localize(opened, query, method=chosen, top=top)
    if map_ is not None:
        from semsig_gis.maps import localization_map, save_map

        with progress("drawing the map"):
            drawn = localization_map(localization, open_database(database))
            tell_if_online(save_map(drawn, map_))
    result = localization.to_dict()
    if as_json:
        print_json(result)
        return
    candidates = result["candidates"]
    print_rows(
        f"{len(candidates)} best of {localization.cells:,} cells, by {localization.used}",
        ("rank", "cell", "x", "y", "lon", "lat", "distance", "types"),
        (
            [
                _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                f"{row['x']:.1f}",
                f"{row['y']:.1f}",
                f"{row['lon']:.6f}",
                f"{row['lat']:.6f}",
                f"{row['distance']:.4f}",
                row["types"],
            ]
            for row in candidates
        ),
    )
    if localization.tied_beyond:
        typer.echo(f"{localization.tied_beyond:,} further cells tie with the last one.")
    if map_ is not None:
        typer.echo(f"map: {map_}")


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"
