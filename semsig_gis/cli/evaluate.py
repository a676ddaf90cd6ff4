"""`semsig evaluate`, `experiment`, `compare`, `reproduce` and `identify`: accuracy of answers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from semsig_gis.cli.console import (
    MOST_METRES,
    MOST_QUERIES,
    MOST_SEED,
    MOST_WORKERS,
    AsJson,
    Database,
    MethodText,
    Paper,
    Scheduler,
    Workers,
    app,
    chosen_method,
    city_name,
    command_line,
    keep_inputs,
    known_identifiability,
    print_json,
    print_rows,
    print_tables,
    progress,
    remark,
    require_suffix,
    say,
)
from semsig_gis.cli.options import (
    DriftReport,
    MapAge,
    NoiseName,
    OnGrid,
    SurelyHere,
    read_noise,
)
from semsig_gis.core import LIKELIHOOD, InputError

if TYPE_CHECKING:
    from collections.abc import Callable

Seed = Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the random numbers.")]


@app.command()
def evaluate(
    database: Database,
    *,
    queries: Annotated[
        int, typer.Option(min=1, max=MOST_QUERIES, help="Number of queries to ask.")
    ] = 500,
    distortion: Annotated[
        str,
        typer.Option(
            help="Distort queries: none, light, medium or strong, or several, such as "
            "medium,compass:10,view:90."
        ),
    ] = "medium",
    keep_order: Annotated[
        bool,
        typer.Option("--keep-order", help="Do not sort the objects again after the bearing noise."),
    ] = False,
    false_class: Annotated[
        Literal["uniform", "frequency"] | None,
        typer.Option(help="How the class of a false object is drawn; uniform by default."),
    ] = None,
    method: MethodText = None,
    paper: Paper = False,
    noise: NoiseName = "generic",
    map_age: MapAge = 0.0,
    drift_report: DriftReport = None,
    surely_here: SurelyHere = False,
    foreign: Annotated[
        Path | None,
        typer.Option(
            help="Database of another city: also count how many of its views are answered, which "
            "is wrong for all of them."
        ),
    ] = None,
    top: Annotated[
        int,
        typer.Option(min=1, max=MOST_QUERIES, help="Count the best of this many candidates (t)."),
    ] = 1,
    seed: Seed = 0,
    out: Annotated[Path | None, typer.Option(help="Folder to write the results to.")] = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Write a page with curves, a map and the worst failures (.html)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure how often, and how closely, queries from known places are located."""
    require_suffix(".html", report)
    keep_inputs(report, read=[database, drift_report, foreign])
    ranking = chosen_method(method, paper=paper)
    if ranking != LIKELIHOOD:
        likelihood_options = {
            "--noise": noise != "generic",
            "--map-age": map_age,
            "--drift-report": drift_report,
            "--surely-here": surely_here,
            "--foreign": foreign,
        }
        for option in (name for name, value in likelihood_options.items() if value):
            raise InputError(
                f"{option} works only with the likelihood method, not with {ranking!r}; leave it "
                "out."
            )
    import dataclasses

    from semsig_gis.database import open_city
    from semsig_gis.evaluation import (
        Distortion,
        foreign_answers,
        parse_chain,
        plain_records,
        save_evaluation,
    )
    from semsig_gis.evaluation import evaluate as run
    from semsig_gis.localization import Method, build_index
    from semsig_gis.output import evaluation_headline, evaluation_tables

    if report is not None:  # if matplotlib is missing, fail before the work instead of after it
        from semsig_gis.output import evaluation_page, write_page
    chain = [
        dataclasses.replace(
            step,
            resort=step.resort and not keep_order,
            false_class=false_class or step.false_class,
        )
        if isinstance(step, Distortion)
        else step
        for step in parse_chain(distortion)
    ]
    city = open_city(database)
    measured = (
        build_index(
            city.database,
            read_noise(noise, city.database, map_age=map_age, drift_report=drift_report),
        )
        if ranking == LIKELIHOOD
        else Method.parse(ranking)
    )
    with progress("evaluating") as advance:
        evaluation = run(
            city.database,
            queries=queries,
            method=measured,
            distortion=chain,
            top=top,
            seed=seed,
            surely_here=surely_here,
            progress=advance,
        )
    others = None if foreign is None else open_city(foreign).database
    table = None if others is None else foreign_answers(evaluation, city.database, others)
    if out is not None:
        save_evaluation(evaluation, out)
    if report is not None:
        with progress("drawing the report"):
            page = evaluation_page(
                evaluation, city.database, name=city_name(database), command=command_line()
            )
            write_page(page, report)
    if as_json:
        rows = {} if table is None else {"foreign": plain_records(table)}
        print_json(evaluation.summary() | rows)
        return
    say(evaluation_headline(evaluation))
    print_tables(evaluation_tables(evaluation))
    if table is not None:
        print_rows(
            "Views of this city and of another",
            ("objects in the view", "own", "answered", "foreign", "answered"),
            table.round(3).astype(object).fillna("").to_numpy().tolist(),
        )
    if out is not None:
        say(f"results: {out}")
    if report is not None:
        say(f"report: {report}  (open it in a browser)")


Result = Annotated[Path, typer.Argument(help="Folder of an experiment or of an evaluation.")]


@app.command()
def experiment(
    spec: Annotated[Path, typer.Argument(help="Experiment, a .toml file.")],
    *,
    out: Annotated[Path, typer.Option(help="Folder to write the results to.")],
    workers: Workers = 0,
    scheduler: Scheduler = None,
    as_json: AsJson = False,
) -> None:
    """Run the evaluations of an experiment, or resume them."""
    from semsig_gis.evaluation import experiment_tables, open_experiment_spec, run_experiment

    opened = open_experiment_spec(spec)
    with progress("answering") as advance:
        results = run_experiment(
            opened,
            out,
            folder=spec.parent,
            workers=workers,
            scheduler=scheduler,
            progress=advance,
        )
    if as_json:
        print_json({name: evaluation.summary() for name, evaluation in results.items()})
        return
    print_tables(experiment_tables(opened, results))
    say(f"results: {out}")


@app.command()
def compare(first: Result, second: Result, *, as_json: AsJson = False) -> None:
    """Compare two results of queries from the same places."""
    from semsig_gis.evaluation import (
        changed_successes,
        common_cases,
        compare_evaluations,
        open_results,
        plain_records,
    )
    from semsig_gis.output import comparison_sentence, comparison_table

    pairs = common_cases(open_results(first), open_results(second))
    tables = {name: compare_evaluations(*pair) for name, pair in pairs.items()}
    if as_json:
        print_json({name: plain_records(table) for name, table in tables.items()})
        return
    for name, table in tables.items():
        case = f"{name}: " * bool(name)
        changed = changed_successes(*pairs[name])
        say(case + comparison_sentence(table, changed, names=(str(first), str(second))))
        print_tables([comparison_table(table, f"{case}{first} and {second}")])


NUMBER_KEYS = ("row", "column", "unit", "ours", "low", "high", "paper")


@app.command()
def reproduce(
    database: Annotated[
        Path | None,
        typer.Argument(
            help="Signature database written by `semsig build`; default: a made-up Paris."
        ),
    ] = None,
    *,
    out: Annotated[Path, typer.Option(help="Folder to write the report and results to.")],
    size: Annotated[
        Literal["full", "small"],
        typer.Option(help="Run the paper's 10,000 queries, or 300 in a small city."),
    ] = "full",
    queries: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_QUERIES, help="Number of queries, instead of that of --size."),
    ] = None,
    seed: Seed = 0,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=MOST_WORKERS,
            help="Number of processes, 0 to use this one only; default: all processors, 0 for "
            "--size small.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Repeat the paper's experiments and compare the results."""
    import contextlib

    from semsig_gis.evaluation import reproduce as run
    from semsig_gis.output import reproduction_report, write_report

    if workers is None:
        workers = (os.cpu_count() or 1) if size == "full" else 0
    with contextlib.ExitStack() as bar:

        def show(label: str) -> Callable[[int, int], None]:
            bar.close()  # only one bar at a time
            return bar.enter_context(progress(label))

        reproduction = run(
            out,
            database=database,
            size=size,
            queries=queries,
            seed=seed,
            workers=workers,
            note=remark,
            progress=show,
        )
    with progress("drawing the report"):
        report = reproduction_report(reproduction, command=command_line())
        write_report(report, out)
    numbers = [
        (section, number)
        for section in report.sections
        for number in section.numbers
        if number.paper is not None
    ]
    if as_json:
        print_json(
            [
                {"section": section.name, **{key: getattr(number, key) for key in NUMBER_KEYS}}
                for section, number in numbers
            ]
        )
        return
    rows = [
        (
            *(section.title, number.row, number.column, _number(number.ours)),
            ""
            if number.low is None or number.high is None
            else f"{number.low:.4g} to {number.high:.4g}",
            _number(number.paper),
        )
        for section, number in numbers
    ]
    say(report.headline)
    print_rows(report.title, ("Section", "What", "", "Ours", "95 %", "Paper"), rows)
    say(f"report: {out / 'report.html'}  (open it in a browser)")
    say(f"numbers: {out / 'numbers.csv'}")


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"  # noqa: PLR2004


@app.command()
def identify(
    database: Database,
    *,
    noise: NoiseName = "generic",
    on_grid: OnGrid = False,
    radius: Annotated[
        float,
        typer.Option(min=0, max=MOST_METRES, help="Largest error in metres that counts as found."),
    ] = 50.0,
    view: Annotated[
        float,
        typer.Option(
            min=10,
            max=360,
            help="Field of view of a query in degrees, in any direction; default: full turn.",
        ),
    ] = 360.0,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of the simulated queries.")
    ] = 0,
    threads: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_WORKERS, help="Number of threads; default: all processors."),
    ] = None,
    check: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1_000_000,
            help="Number of new queries to check the predictions with.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write a report of the check to.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Predict how well queries from each cell will be located.

    Adds columns to the database, which `semsig info`, `map` and `export` show.
    """
    from semsig_gis.database import open_city
    from semsig_gis.evaluation import check_identifiability, save_identifiability
    from semsig_gis.evaluation import identify as run
    from semsig_gis.localization import build_index, cell_noise
    from semsig_gis.output import check_tables, identifiability_page, identifiability_tables

    _require_check(check, out)
    city = open_city(database)
    counts = city.object_counts  # before the file changes
    model = read_noise(noise, city.database)
    if not on_grid:
        model = cell_noise(model, city.database.grid.step)
    columns = known_identifiability(city)
    settings = (model, radius, view, seed)
    if columns is not None:
        # Columns in the database are used again if they have the same settings.
        stored_settings = (columns.noise, columns.radius, columns.view, columns.seed)
        columns = columns if stored_settings == settings else None
    workers = (os.cpu_count() or 1) if threads is None else threads
    if columns is None or check is not None:
        index = build_index(city.database, model)
    if columns is None:
        with progress("comparing cells") as advance:
            columns = run(
                index, radius=radius, view=view, seed=seed, threads=workers, progress=advance
            )
        save_identifiability(columns, database)
    else:
        remark("The database already has these columns; they are used again.")
    verification = None
    if check is not None:
        with progress("checking") as advance:
            verification = check_identifiability(
                columns, index, queries=check, threads=workers, progress=advance
            )
    if out is not None and verification is not None:
        from semsig_gis.output import write_report  # imports matplotlib

        page = identifiability_page(
            columns,
            verification,
            name=database.name,
            object_counts=counts,
            command=command_line(),
        )
        write_report(page, out)
    if as_json:
        more = {} if verification is None else {"check": verification.to_dict()}
        print_json(columns.summary(object_counts=counts) | more)
        return
    print_tables(identifiability_tables(columns, object_counts=counts))
    if verification is not None:
        print_tables(check_tables(verification))
    say(f"columns: {database}")
    if out is not None:
        say(f"report: {out / 'report.html'}")


def _require_check(check: int | None, out: Path | None) -> None:
    """Raise an error if --out is given without --check, or no report can be drawn."""
    if out is None:
        return
    if check is None:
        raise InputError("--out was given without --check; give both or neither.")
    from semsig_gis.output import draw_plot  # noqa: F401 - matplotlib may be missing
