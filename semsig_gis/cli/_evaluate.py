"""`semsig evaluate`: many distorted queries, and how far off their answers are."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli._app import (
    LIKELIHOOD,
    AsJson,
    Database,
    MethodText,
    app,
    print_evaluation,
)
from semsig_gis.cli._likelihood import NoiseName, prepared_index, read_noise
from semsig_gis.console import print_json, progress


class FalseClass(enum.StrEnum):
    """How the class of a false object is drawn."""

    uniform = "uniform"
    frequency = "frequency"


@app.command()
def evaluate(
    database: Database,
    *,
    queries: Annotated[int, typer.Option(help="Number of queries.")] = 500,
    distortion: Annotated[
        str,
        typer.Option(
            help="none, light, medium or strong; or several, such as medium,compass:10,view:90."
        ),
    ] = "medium",
    keep_order: Annotated[
        bool, typer.Option("--keep-order", help="Do not re-sort after the bearing noise.")
    ] = False,
    false_class: Annotated[
        FalseClass, typer.Option(help="How the class of a false object is drawn.")
    ] = FalseClass.uniform,
    method: MethodText = "edit+edit",
    noise: NoiseName = "generic",
    top: Annotated[int, typer.Option(help="Number t of best candidates that count.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of all chances.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for the results.")] = None,
    as_json: AsJson = False,
) -> None:
    """Query a database with distorted signatures of its own and measure the answers."""
    import dataclasses

    from semsig_gis.database_file import open_database
    from semsig_gis.distortion import Distortion
    from semsig_gis.distortion_chain import parse_chain
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.matching import Method

    chain = [
        dataclasses.replace(one, resort=not keep_order, false_class=false_class.value)
        if isinstance(one, Distortion)
        else one
        for one in parse_chain(distortion)
    ]
    opened = open_database(database)
    chosen = (
        prepared_index(database, opened, read_noise(noise))
        if method == LIKELIHOOD
        else Method.parse(method)
    )
    with progress("evaluating") as advance:
        evaluation = run(
            opened,
            queries=queries,
            method=chosen,
            distortion=chain,
            top=top,
            seed=seed,
            progress=advance,
        )
    if out is not None:
        evaluation.save(out)
    if as_json:
        print_json(evaluation.summary())
        return
    print_evaluation(evaluation)
    if out is not None:
        typer.echo(f"results: {out}")
