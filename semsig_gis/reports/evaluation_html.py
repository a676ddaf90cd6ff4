"""The report of an evaluation: how far off, where, for whom, how sure, and the worst failures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation import percentile
from semsig_gis.localization import DEFAULT_RULE
from semsig_gis.reports.evaluation import (
    FIGURES,
    evaluation_headline,
    evaluation_settings,
    paris_accuracy,
    paris_points,
)
from semsig_gis.reports.outcomes import outcome_map
from semsig_gis.reports.report_model import Curve, Number, Plot, Report, Section
from semsig_gis.reports.scenes import failure_pairs
from semsig_gis.reports.shares import calibration_plot, curve_of, plot_of
from semsig_gis.reports.tables import length

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation

GROUPED = {
    "p50": "P(error ≤ 50 m)",
    "recall10": "recall@10 %",
    "coverage": "answered",
    "precision": "right, of these",
}


def evaluation_page(
    evaluation: Evaluation, database: SignatureDatabase, *, name: str, command: str = ""
) -> Report:
    """Put together what an evaluation found, to be written by `reports.page.write_page`.

    Parameters
    ----------
    evaluation : Evaluation
        What was found.
    database : SignatureDatabase
        The database that was searched.
    name : str
        What the city is called.
    command : str, optional
        The command that did it.

    Returns
    -------
    Report
        Headline, error curve, map, success by objects seen and by how many cells look the same,
        what stated chances are worth, and the worst failures as pairs of scenes.

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
    evaluation.rows_in(database)
    settings = evaluation_settings(evaluation)
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
            *((name.replace("_gb", ", GB"), str(one)) for name, one in evaluation.machine.items()),
        ),
        command=command,
        sections=(
            _error_section(evaluation, database),
            _group_section(evaluation),
            *_chance_sections(evaluation),
            *_failure_sections(evaluation, database),
        ),
        taxonomy=database.taxonomy,
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
    words = [f"Half of the queries are off by {length(median[0])} or less."]
    if evaluation.unlocalized:
        words.append(
            f"Of {evaluation.unlocalized:,} the distortion left nothing to compare: their error is "
            "infinite."
        )
    points = paris_points(evaluation)
    if points:
        words.append("The paper's figures are of another city, Paris.")
    best = "" if evaluation.top == 1 else f", best of {evaluation.top:,}"
    curve = curve_of(evaluation, f"{evaluation.method}{best}", "error")
    return Section(
        name="errors",
        title="How far off, and where",
        text=(" ".join(words),),
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
    lengths, alike = evaluation.by_length(), evaluation.by_ambiguity()
    groups = (
        (lengths, "seen", "objects that are really seen", "objects seen: {}"),
        (alike, "alike", "cells with the same types, the true one included", "cells alike: {}"),
    )
    return Section(
        name="groups",
        title="Success by objects seen, and by cells that look the same",
        text=(
            (
                "Few objects say little, and a street that looks like a hundred others cannot be "
                "told apart from them."
            ),
        ),
        numbers=tuple(
            number for table, _, _, row in groups for number in _group_numbers(table, row)
        ),
        plots=tuple(_group_plot(table, name, x_label) for table, name, x_label, _ in groups),
    )


def _group_numbers(groups: pd.DataFrame, label: str) -> Iterator[Number]:
    for group in groups.to_dict("records"):
        row = label.format(next(iter(group.values())))
        yield Number(row, "queries", group["n"], decimals=0)
        for name, column in GROUPED.items():
            if name in group:
                low, high = (group.get(f"{name}_{end}") for end in ("low", "high"))
                yield Number(row, column, group[name], low=low, high=high)


def _group_plot(groups: pd.DataFrame, name: str, x_label: str) -> Plot:
    some = groups.assign(place=np.arange(len(groups), dtype=np.float64)).dropna(subset="p50")
    columns = {label: tuple(some[label].tolist()) for label in some}
    curves = [
        Curve(
            label="within 50 m",
            x=columns["place"],
            y=columns["p50"],
            low=columns["p50_low"],
            high=columns["p50_high"],
        )
    ]
    if "coverage" in columns:
        curves.append(Curve(label="answered", x=columns["place"], y=columns["coverage"]))
    return Plot(
        name=f"evaluation-{name}",
        title=f"Success by {x_label}",
        x_label=x_label,
        y_label="share of the queries",
        curves=tuple(curves),
        ticks=tuple((float(at), one) for at, one in enumerate(groups.iloc[:, 0])),
    )


def _chance_sections(evaluation: Evaluation) -> Iterator[Section]:
    """Yield what chances are worth, of a method that states them."""
    if evaluation.method.noise is None:
        return
    bins, rules = evaluation.calibration(), evaluation.coverage_curve()
    numbers = []
    for one in bins.to_dict("records"):
        row = f"{one['from']:g} to {one['to']:g}"
        numbers.append(Number(row, "queries", one["n"], decimals=0))
        if one["n"]:
            ends = {"low": one["low"], "high": one["high"]}
            numbers.append(Number(row, "stated", one["stated"], decimals=3))
            numbers.append(Number(row, "came true", one["true"], **ends, decimals=3))
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


def _failure_sections(evaluation: Evaluation, database: SignatureDatabase) -> Iterator[Section]:
    pairs = failure_pairs(evaluation, database)
    if pairs:
        yield Section(
            name="failures",
            title="The worst failures",
            text=(
                (
                    "The true cell, next to the cell that it was mistaken for. Letters "
                    "around the circle are the distorted query."
                ),
            ),
            pairs=pairs,
        )
