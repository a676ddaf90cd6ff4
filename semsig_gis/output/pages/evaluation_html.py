"""The report of an evaluation: errors, map, groups of queries, chances and worst failures."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import percentile
from semsig_gis.localization import DEFAULT_RULE
from semsig_gis.output.figures.outcomes import outcome_map
from semsig_gis.output.figures.scenes import failure_pairs
from semsig_gis.output.figures.shares import calibration_plot, curve_of, plot_of
from semsig_gis.output.report_model import Curve, Number, Plot, Report, Section
from semsig_gis.output.tables.evaluation import (
    FIGURES,
    evaluation_headline,
    evaluation_settings,
    paris_accuracy,
    paris_points,
)
from semsig_gis.output.tables.tables import length

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation

GROUP_COLUMNS = {
    "p50": "within 50 m",
    "recall10": "true cell in the best 10 %",
    "coverage": "answered",
    "precision": "right, of these",
}


def evaluation_page(
    evaluation: Evaluation, database: SignatureDatabase, *, name: str, command: str = ""
) -> Report:
    """Return the report of an evaluation, for `write_page`.

    Parameters
    ----------
    evaluation : Evaluation
        The evaluation.
    database : SignatureDatabase
        The database that was searched.
    name : str
        Name of the city.
    command : str, optional
        Command line of the evaluation.

    Returns
    -------
    Report
        Headline, error curve, map, success by objects seen and by number of equal cells,
        calibration of the chances, and the worst failures as pairs of scenes.

    Raises
    ------
    InputError
        If another database was searched.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=10)
    >>> evaluation_page(evaluation, demo_database, name="A city").title
    'A city: how well queries are placed'
    """
    evaluation.rows_in(database)  # raises if another database was searched
    settings = evaluation_settings(evaluation)
    text = (
        "The true cell, next to the cell that it was mistaken for. Signs around the circle are "
        "the distorted query."
    )
    pairs = failure_pairs(evaluation, database)
    failure = Section(name="failures", title="The worst failures", text=(text,), pairs=pairs)
    failures = [failure] if pairs else []
    return Report(
        title=f"{name}: how well queries are placed",
        headline=evaluation_headline(evaluation),
        text=(
            (
                f"{settings['Queries']} views of known places were distorted "
                f"({settings['Distortions']}), and {settings['Method']} ranked "
                f"{settings['Cells']} cells for each."
            ),
        ),
        settings=(
            *settings.items(),
            ("Seconds a query", f"{evaluation.seconds_per_query:.4f}"),
            *evaluation.versions.items(),
            *((key.replace("_gb", ", GB"), str(fact)) for key, fact in evaluation.machine.items()),
        ),
        command=command,
        sections=(
            _error_section(evaluation, database),
            _group_section(evaluation),
            *_chance_sections(evaluation),
            *failures,
        ),
        taxonomy=database.taxonomy,
        credits=database.licenses,
        facts=evaluation.summary(),
    )


def _error_section(evaluation: Evaluation, database: SignatureDatabase) -> Section:
    errors = evaluation.queries["error_m"].to_numpy(np.float64)
    median, ninetieth = (percentile(errors, share) for share in (50, 90))
    means = evaluation.means()
    p50, recall10 = paris_accuracy(evaluation)
    paper = {"p50": p50, "recall10": recall10}
    numbers = [
        Number(FIGURES[name], "", value, low=low, high=high, paper=paper.get(name))
        for name, value, low, high, _ in means.itertuples()
        if name in FIGURES
    ]
    percentiles = {"Median error": median, "90th percentile of the error": ninetieth}
    numbers += [
        Number(row, "", value, low=low, high=high, unit="m", decimals=1)
        for row, (value, low, high) in percentiles.items()
    ]
    sentences = [f"Half of the queries are off by {length(median[0])} or less."]
    if evaluation.unlocalized:
        sentences.append(
            f"Of {evaluation.unlocalized:,} the distortion left nothing to compare: their error is "
            "infinite."
        )
    points = paris_points(evaluation)
    if points:
        sentences.append("The paper's figures are of another city, Paris.")
    best = "" if evaluation.top == 1 else f", best of {evaluation.top:,}"
    curve = curve_of(evaluation, f"{evaluation.method}{best}", "error")
    return Section(
        name="errors",
        title="How far off, and where",
        text=(" ".join(sentences),),
        numbers=tuple(numbers),
        plots=(plot_of("evaluation", "Share of queries by error", "error", [curve], points),),
        maps=(
            outcome_map(
                evaluation,
                database,
                name="evaluation-map",
                title=f"Queries: successful within {evaluation.success_metres} m, or failed",
            ),
        ),
    )


def _group_section(evaluation: Evaluation) -> Section:
    lengths, ambiguities = evaluation.by_length(), evaluation.by_ambiguity()
    ambiguity = "cells with the same types, the true one included"
    groups = (
        (lengths, "seen", "objects that are really seen", "objects seen: {}"),
        (ambiguities, "alike", ambiguity, "cells alike: {}"),
    )
    return Section(
        name="groups",
        title="Success by objects seen, and by cells that look the same",
        text=(
            (
                "Few objects say little, and a street that looks like a hundred others cannot be "
                "distinguished from them."
            ),
        ),
        numbers=tuple(itertools.chain(*(_group_numbers(table, row) for table, *_, row in groups))),
        plots=tuple(_group_plot(table, name, x_label) for table, name, x_label, _ in groups),
    )


def _group_numbers(groups: pd.DataFrame, label: str) -> Iterator[Number]:
    for group in groups.to_dict("records"):
        row = label.format(next(iter(group.values())))
        yield Number(row, "queries", group["n"], decimals=0)
        for name, column in GROUP_COLUMNS.items():
            if name in group:
                low, high = (group.get(f"{name}_{end}") for end in ("low", "high"))
                yield Number(row, column, group[name], low=low, high=high)


def _group_plot(groups: pd.DataFrame, name: str, x_label: str) -> Plot:
    numbered = groups.assign(position=np.arange(len(groups), dtype=np.float64))
    table = numbered.dropna(subset="p50")  # groups with queries
    columns = {label: tuple(table[label].tolist()) for label in table}
    x, low, high = (columns[label] for label in ("position", "p50_low", "p50_high"))
    curves = [Curve(label="within 50 m", x=x, y=columns["p50"], low=low, high=high)]
    if "coverage" in columns:
        curves.append(Curve(label="answered", x=x, y=columns["coverage"]))
    return Plot(
        name=f"evaluation-{name}",
        title=f"Success by {x_label}",
        x_label=x_label,
        y_label="share of the queries",
        curves=tuple(curves),
        ticks=tuple((float(x), text) for x, text in enumerate(groups.iloc[:, 0])),
    )


def _chance_sections(evaluation: Evaluation) -> Iterator[Section]:
    """Yield the section about the predicted chances, if the method has chances."""
    if evaluation.method.noise is None:
        return
    bins, rules = evaluation.calibration(), evaluation.coverage_curve()
    numbers = []
    for chances in bins.to_dict("records"):
        row = f"{chances['from']:g} to {chances['to']:g}"
        numbers.append(Number(row, "queries", chances["n"], decimals=0))
        if chances["n"]:
            ends = {"low": chances["low"], "high": chances["high"]}
            numbers.append(Number(row, "stated", chances["stated"], decimals=3))
            numbers.append(Number(row, "came true", chances["true"], **ends, decimals=3))
    answered = rules[rules["answered"] > 0]
    columns = {name: tuple(answered[name].tolist()) for name in answered}
    x = columns["threshold"]
    right = Curve(
        label="right answers", x=x, y=columns["precision"], low=columns["low"], high=columns["high"]
    )
    yield Section(
        name="chances",
        title="What stated chances are worth",
        text=(
            (
                "The method says how likely its answer is within "
                f"{evaluation.success_metres} m. On the dashed line, stated chances come "
                "true. Answering only above some chance gives fewer answers, more of which "
                f"are right; by default that is {DEFAULT_RULE.threshold:g}."
            ),
        ),
        numbers=tuple(numbers),
        plots=(
            calibration_plot("evaluation", {"stated chances": evaluation}),
            Plot(
                name="evaluation-coverage",
                title="How many are answered, and how many answers are right",
                x_label="least chance that is answered",
                y_label="share",
                curves=(
                    Curve(label="answered queries", x=x, y=columns["coverage"]),
                    right,
                ),
            ),
        ),
    )
