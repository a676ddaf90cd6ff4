"""`semsig experiment` and `semsig compare`: evaluations that a file describes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from semsig_gis.cli.app import AsJson, Scheduler, Workers, app, print_table
from semsig_gis.cli.console import print_json, progress, remark

Results = Annotated[Path, typer.Argument(help="Folder of an experiment or of an evaluation.")]


@app.command()
def experiment(
    spec: Annotated[Path, typer.Argument(help="Experiment, a .toml file.")],
    *,
    out: Annotated[Path, typer.Option(help="Folder to write the results to.")],
    workers: Workers = 0,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Run the evaluations of an experiment; an interrupted run goes on."""
    from semsig_gis.evaluation.spec import open_experiment_spec
    from semsig_gis.experiments.run import run_experiment
    from semsig_gis.reports.experiment import experiment_tables

    opened = open_experiment_spec(spec)
    with progress("answering") as advance:
        results = run_experiment(
            opened,
            out,
            folder=spec.parent,
            workers=workers,
            scheduler=scheduler,
            note=remark,
            progress=advance,
        )
    if as_json:
        print_json({name: evaluation.summary() for name, evaluation in results.items()})
        return
    for table in experiment_tables(opened, results):
        print_table(table)
    typer.echo(f"results: {out}")


@app.command()
def compare(first: Results, second: Results, *, as_json: AsJson = False) -> None:
    """Compare two results of queries from the same places."""
    from semsig_gis.evaluation.compare import common_cases, compare_evaluations
    from semsig_gis.evaluation.figures import plain_records
    from semsig_gis.experiments.folder import open_results
    from semsig_gis.reports.experiment import comparison_table

    pairs = common_cases(open_results(first), open_results(second))
    tables = {name: compare_evaluations(*pair) for name, pair in pairs.items()}
    if as_json:
        print_json({name: plain_records(table) for name, table in tables.items()})
        return
    for name, table in tables.items():
        print_table(comparison_table(table, f"{name}: " * bool(name) + f"{first} and {second}"))
