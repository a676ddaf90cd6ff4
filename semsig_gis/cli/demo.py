"""`semsig demo` and `semsig synthesize`: made-up cities."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli.console import (
    MOST_QUERIES,
    MOST_SEED,
    app,
    print_tables,
    progress,
    remark,
    say,
    warn_if_online,
)


@app.command()
def demo(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("demo"),
    queries: Annotated[
        int, typer.Option(min=1, max=MOST_QUERIES, help="Number of queries to ask.")
    ] = 200,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of the city and the queries.")
    ] = 0,
) -> None:
    """Run every step on a small made-up city, offline."""
    from semsig_gis.database import build_database, save_database
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.evaluation import save_evaluation
    from semsig_gis.objects import build_objects, save_objects
    from semsig_gis.output import (
        evaluation_map,
        evaluation_tables,
        export_database,
        objects_map,
        save_map,
    )
    from semsig_gis.sources import CitySpec, paper_taxonomy, synthetic_city

    layers = synthetic_city(CitySpec(seed=seed))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    save_objects(objects, out / "objects.parquet")
    remark(f"a synthetic city with {len(objects):,} street objects")
    with progress("building") as advance:
        database = build_database(objects, progress=advance)
    save_database(database, out / "city.parquet")
    remark(f"its signature database: {len(database):,} cells")
    with progress("evaluating") as advance:
        evaluation = run(database, queries=queries, seed=seed, progress=advance)
    save_evaluation(evaluation, out / "evaluation")
    with progress("drawing the map"):
        map_ = objects_map(objects, map_=evaluation_map(evaluation, database))
        offline = save_map(map_, out / "map.html")
    with progress("writing the GeoPackage") as advance:
        export_database(
            database,
            out / "city.gpkg",
            objects=objects,
            evaluation=evaluation,
            progress=advance,
        )
    print_tables(evaluation_tables(evaluation))
    say(f"map:        {out / 'map.html'}  (open it in a browser)")
    say(f"GeoPackage: {out / 'city.gpkg'}  (open it in QGIS)")
    say(f"database:   {out / 'city.parquet'}")
    warn_if_online(offline)


@app.command()
def synthesize(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write to.")],
    size: Annotated[
        float | None,
        typer.Option(
            min=100,
            max=20_000,
            help="Side of the square city in metres; default: as many cells as Paris.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of the random numbers.")
    ] = 0,
) -> None:
    """Make up a city: street objects, buildings and streets."""
    from semsig_gis.objects import build_objects, save_objects, save_surroundings
    from semsig_gis.sources import (
        PARIS_LIKE,
        CitySpec,
        paper_taxonomy,
        synthetic_city,
        synthetic_surroundings,
    )

    spec = CitySpec(size=PARIS_LIKE.size if size is None else size, seed=seed)
    with progress("making up a city") as advance:
        advance(0, 2)
        layers = synthetic_city(spec)
        advance(1, 2)
        surroundings = synthetic_surroundings(spec)
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    save_objects(objects, out / "objects.parquet")
    for layer in surroundings:
        save_surroundings(layer.table, out / f"{layer.spec.role}.parquet")
    for name in ("objects", *(layer.spec.role for layer in surroundings)):
        say(out / f"{name}.parquet")
