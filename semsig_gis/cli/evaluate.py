"""`semsig evaluate`, `semsig compare`: many distorted queries, and how far off the answers are."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli.app import LIKELIHOOD, AsJson, MethodText, app, print_evaluation, print_table
from semsig_gis.cli.console import print_json, progress, remark
from semsig_gis.cli.options import NoiseName, prepared_index, read_noise
from semsig_gis.core.errors import InputError


class FalseClass(enum.StrEnum):
    """How the class of a false object is drawn."""

    uniform = "uniform"
    frequency = "frequency"


@app.command()
def evaluate(
    context: typer.Context,
    database: Annotated[
        Path,
        typer.Argument(
            help="Signature database that `semsig build` wrote; or an experiment, a .toml file "
            "that says all but --out, --workers, --scheduler and --json."
        ),
    ],
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
        FalseClass | None,
        typer.Option(help="How the class of a false object is drawn; uniform by default."),
    ] = None,
    method: MethodText = "edit+edit",
    noise: NoiseName = "generic",
    top: Annotated[int, typer.Option(help="Number t of best candidates that count.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of all chances.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for the results.")] = None,
    workers: Annotated[
        int, typer.Option(help="Run an experiment in so many processes of this machine.")
    ] = 0,
    scheduler: Annotated[
        str | None, typer.Option(help="Run an experiment on a dask cluster: tcp://HOST:PORT.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Query a database with distorted signatures of its own and measure the answers."""
    if database.suffix == ".toml":
        _experiment(context, database, out, workers, scheduler, as_json=as_json)
        return
    if workers or scheduler is not None:
        option = "--workers" if workers else "--scheduler"
        msg = (
            f"{option} was given with a database; it is for experiments, so write a .toml file, or "
            "leave it out."
        )
        raise InputError(msg)
    if noise != "generic" and method != LIKELIHOOD:
        msg = f"--noise is for --method likelihood, not for {method!r}; leave it out."
        raise InputError(msg)
    import dataclasses

    from semsig_gis.database.file import open_database
    from semsig_gis.evaluation.evaluate import evaluate as run
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


def _experiment(
    context: typer.Context,
    file: Path,
    out: Path | None,
    workers: int,
    scheduler: str | None,
    *,
    as_json: bool,
) -> None:
    from semsig_gis.evaluation.spec import open_experiment_spec
    from semsig_gis.experiments.run import run_experiment
    from semsig_gis.reports.experiment import experiment_tables

    for name in context.params:
        source = context.get_parameter_source(name)
        free = {"database", "out", "workers", "scheduler", "as_json"}
        if name in free or source is None or source.name != "COMMANDLINE":
            continue
        option = name.replace("_", "-")
        msg = f"--{option} was given with an experiment; write that into {file} instead."
        raise InputError(msg)
    if out is None:
        msg = "an experiment needs a folder for its results; give --out."
        raise InputError(msg)
    spec = open_experiment_spec(file)
    with progress("answering") as advance:
        results = run_experiment(
            spec,
            out,
            folder=file.parent,
            workers=workers,
            scheduler=scheduler,
            note=remark,
            progress=advance,
        )
    if as_json:
        print_json({name: evaluation.summary() for name, evaluation in results.items()})
        return
    for table in experiment_tables(spec, results):
        print_table(table)
    typer.echo(f"results: {out}")


Results = Annotated[
    Path, typer.Argument(help="Folder of an experiment, or of one evaluation, to compare.")
]


@app.command()
def compare(first: Results, second: Results, *, as_json: AsJson = False) -> None:
    """Tell by how much two results differ that asked queries from the same places."""
    from semsig_gis.evaluation.compare import common_cases, compare_evaluations
    from semsig_gis.evaluation.figures import plain_records
    from semsig_gis.experiments.folder import open_results
    from semsig_gis.reports.experiment import comparison_table

    pairs = common_cases(open_results(first), open_results(second))
    found = {name: compare_evaluations(*pair) for name, pair in pairs.items()}
    if as_json:
        print_json({name: plain_records(table) for name, table in found.items()})
        return
    for name, table in found.items():
        print_table(comparison_table(table, f"{name}: " * bool(name) + f"{first} and {second}"))
