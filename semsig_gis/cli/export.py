"""`semsig export` and `import`: files for other programs, and databases from them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from semsig_gis.cli.console import (
    Database,
    app,
    keep_inputs,
    known_identifiability,
    progress,
    remark,
    require_suffix,
    say,
)
from semsig_gis.cli.options import Smooth
from semsig_gis.core import InputError


@app.command()
def export(
    database: Database,
    *,
    out: Annotated[
        Path,
        typer.Option(
            help="File to write. Its suffix is the format: .gpkg (all layers, for QGIS), "
            ".parquet, .fgb, .geojson or .csv (one layer), .pmtiles (cells for web maps), "
            ".tif (one number per cell) or .json (STAC item)."
        ),
    ],
    objects: Annotated[Path | None, typer.Option(help="Street objects to add as a layer.")] = None,
    evaluation: Annotated[
        Path | None,
        typer.Option(help="Folder written by `semsig evaluate --out`, to add its queries."),
    ] = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(
            help="Layer to write: cells, objects, evaluation, evaluation_lines or hexagons; "
            "by default cells, in a .gpkg all (repeat for several). In a .tif: ambiguity (the "
            "default), identifiability, error, or field (share of the queries around that fail)."
        ),
    ] = None,
    smooth: Smooth = None,
    h3: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=15,
            help="Write hexagons of this resolution of H3, such as 9, that sum up cells, "
            "objects and queries.",
            show_default=False,
        ),
    ] = None,
    geometry: Annotated[
        Literal["polygon", "point"] | None,
        typer.Option(
            help="How a cell is drawn; by default as a polygon, in CSV as a point.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Export cells, objects and queries for QGIS and other programs."""
    from semsig_gis.database import open_city
    from semsig_gis.objects import open_objects
    from semsig_gis.output import ITEM, export_database, export_item

    keep_inputs(out, read=(database, objects))
    if out.suffix.lower() == ITEM:
        if any(option is not None for option in (evaluation, layer, smooth, h3, geometry)):
            raise InputError(
                f"{out} describes the files of a database; give only --objects with it."
            )
        export_item(database, out, objects=objects)
        say(f"exported: {out}")
        return
    city = open_city(database)
    queries = None
    if evaluation is not None:
        from semsig_gis.evaluation import open_evaluation

        queries = open_evaluation(evaluation)
    # Hexagons count the objects that the database was built from, if they are stored with it.
    stored_objects = city.objects if h3 is not None and objects is None else None
    with progress(f"writing {out.name}") as advance:
        export_database(
            city.database,
            out,
            layers=layer or (),
            objects=stored_objects if objects is None else open_objects(objects),
            evaluation=queries,
            identifiability=known_identifiability(city),
            geometry=geometry,
            smooth=smooth,
            h3=h3,
            progress=advance,
        )
    say(f"exported: {out}")


@app.command(name="import")
def import_(
    geopackage: Annotated[Path, typer.Argument(help="GeoPackage written by `semsig export`.")],
    *,
    out: Annotated[Path, typer.Option(help="Signature database to write (.parquet).")],
    objects: Annotated[
        Path | None, typer.Option(help="Street objects to write, if exported.")
    ] = None,
) -> None:
    """Restore a database from an exported GeoPackage."""
    from semsig_gis.database import save_database
    from semsig_gis.evaluation import save_identifiability
    from semsig_gis.objects import save_objects
    from semsig_gis.output import read_geopackage

    keep_inputs(out, objects, read=(geopackage,))
    require_suffix(".parquet", out, objects)
    contents = read_geopackage(geopackage)
    if objects is not None and contents.objects is None:
        raise InputError(f"{geopackage} contains no street objects; leave out --objects.")
    for note in contents.notes:
        remark(note)
    if objects is not None and contents.objects is not None:
        save_objects(contents.objects, objects, keep_order=True)
    save_database(contents.database, out)
    if contents.identifiability is not None:
        save_identifiability(contents.identifiability, out)
    say(f"database: {out}  ({len(contents.database):,} cells)")
    if objects is not None:
        say(f"objects:  {objects}")
