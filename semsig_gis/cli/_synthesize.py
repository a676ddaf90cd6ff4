"""`semsig synthesize`: a made-up city as ordinary files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import app
from semsig_gis.console import progress


@app.command()
def synthesize(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    size: Annotated[
        float | None,
        typer.Option(help="Side of the square city in metres; as many cells as Paris by default."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
) -> None:
    """Make up a city: street objects, buildings and streets of no real place."""
    from semsig_gis.catalog import paper_taxonomy
    from semsig_gis.objects import build_objects, save_objects
    from semsig_gis.sources.synthetic import (
        PARIS_LIKE,
        CitySpec,
        synthetic_city,
        synthetic_surroundings,
    )
    from semsig_gis.surroundings import save_surroundings

    spec = CitySpec(size=PARIS_LIKE.size if size is None else size, seed=seed)
    with progress("making up a city"):
        layers = synthetic_city(spec)
        surroundings = synthetic_surroundings(spec)
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    save_objects(objects, out / "objects.parquet")
    for layer in surroundings:
        save_surroundings(layer.table, out / f"{layer.spec.role}.parquet")
    for name in ("objects", *(layer.spec.role for layer in surroundings)):
        typer.echo(out / f"{name}.parquet")
