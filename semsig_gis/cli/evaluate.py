"""`semsig evaluate`: many distorted queries, and how far off the answers are."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli.app import LIKELIHOOD, AsJson, Database, MethodText, app, print_evaluation
from semsig_gis.cli.console import print_json, progress
from semsig_gis.cli.options import NoiseName, prepared_index, read_noise
from semsig_gis.core.errors import InputError


class FalseClass(enum.StrEnum):
    """How the class of a false object is drawn."""

    uniform = "uniform"
    frequency = "frequency"


@app.command()
def evaluate(
    database: Database,
    *,
    queries: Annotated[int, typer.Option(help="Number of queries to ask.")] = 500,
    distortion: Annotated[
        str,
        typer.Option(
            help="Distort queries: none, light, medium or strong, or several, such as "
            "medium,compass:10,view:90."
        ),
    ] = "medium",
    keep_order: Annotated[
        bool,
        typer.Option("--keep-order", help="Do not sort again after the bearing noise."),
    ] = False,
    false_class: Annotated[
        FalseClass | None,
        typer.Option(help="How the class of a false object is drawn; uniform by default."),
    ] = None,
    method: MethodText = "edit+edit",
    noise: NoiseName = "generic",
    top: Annotated[int, typer.Option(help="Count the best of this many candidates (t).")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder to write the results to.")] = None,
    as_json: AsJson = False,
) -> None:
    """Ask queries from known places and measure the errors."""
    if noise != "generic" and method != LIKELIHOOD:
        msg = f"--noise is for --method likelihood, not for {method!r}; leave it out."
        raise InputError(msg)
    import dataclasses

    from semsig_gis.database.city import open_city
    from semsig_gis.evaluation.evaluate import evaluate as run
    from semsig_gis.evaluation.file import save_evaluation
    from semsig_gis.matching.method import Method
    from semsig_gis.queries.chain import parse_chain
    from semsig_gis.queries.paper_errors import Distortion

    chain = [
        dataclasses.replace(
            one,
            resort=one.resort and not keep_order,
            false_class=one.false_class if false_class is None else false_class.value,
        )
        if isinstance(one, Distortion)
        else one
        for one in parse_chain(distortion)
    ]
    city = open_city(database)
    cells = city.database
    chosen = (
        prepared_index(city, read_noise(noise)) if method == LIKELIHOOD else Method.parse(method)
    )
    with progress("evaluating") as advance:
        evaluation = run(
            cells,
            queries=queries,
            method=chosen,
            distortion=chain,
            top=top,
            seed=seed,
            progress=advance,
        )
    if out is not None:
        save_evaluation(evaluation, out)
    if as_json:
        print_json(evaluation.summary())
        return
    print_evaluation(evaluation)
    if out is not None:
        typer.echo(f"results: {out}")
