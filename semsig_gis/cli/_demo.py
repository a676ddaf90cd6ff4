"""`semsig demo`: the whole road on a made-up city."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import app, print_evaluation, tell_if_online
from semsig_gis.console import progress, remark

DEMO_QUERIES = 200


@app.command()
def demo(
    *,
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("demo"),
    queries: Annotated[int, typer.Option(help="Number of queries.")] = DEMO_QUERIES,
    seed: Annotated[int, typer.Option(help="Seed of the city and of the queries.")] = 0,
) -> None:
    """Run the whole road on the embedded synthetic city, without a network."""
    from semsig_gis.building import build_database
    from semsig_gis.catalog import paper_taxonomy
    from semsig_gis.database_file import save_database
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.exports import export_database
    from semsig_gis.map_objects import objects_map
    from semsig_gis.maps import evaluation_map, save_map
    from semsig_gis.objects import build_objects, save_objects
    from semsig_gis.sources.synthetic import CitySpec, synthetic_city

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
    evaluation.save(out / "evaluation")
    with progress("drawing the map"):
        drawn = objects_map(objects, map_=evaluation_map(evaluation, database))
        offline = save_map(drawn, out / "map.html")
    with progress("writing the GeoPackage") as advance:
        export_database(
            database,
            out / "city.gpkg",
            objects=objects,
            evaluation=evaluation,
            progress=advance,
        )
    print_evaluation(evaluation)
    typer.echo(f"map:        {out / 'map.html'}  (open it in a browser)")
    typer.echo(f"GeoPackage: {out / 'city.gpkg'}  (open it in QGIS)")
    typer.echo(f"database:   {out / 'city.parquet'}")
    tell_if_online(offline)
