"""Tables of an evaluation, with the paper's figures if the paper has the same settings."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, get_args

import numpy as np

from semsig_gis.core import ERROR_BREAKS, Table, figure, interval
from semsig_gis.evaluation import DISTORTIONS, Evaluation, FalseClass, chain_text, percentile
from semsig_gis.evaluation import published as paris
from semsig_gis.localization import DEFAULT_RULE, NEAR_METRES, NEAR_PLACES
from semsig_gis.output.tables.tables import method_words, short_percent

if TYPE_CHECKING:
    import pandas as pd


# Titles of the figures of an evaluation, by column; those of the tables by group are shorter.
FIGURES = {
    **{f"p{metres}": f"Placed within {metres} m" for metres in ERROR_BREAKS},
    **{f"recall{share}": f"True cell in the best {share} %" for share in (1, 10)},
    **{f"near{count}": f"Within {NEAR_METRES} m, best of {count}" for count in NEAR_PLACES},
    "coverage": f"Answered, with a chance of {DEFAULT_RULE.threshold:g} or more",
    "precision": "Right answers, of these",
    "in_region": "True cell in the region of 90 %",
}
GROUP_FIGURES = {
    **{f"p{metres}": f"Within {metres} m" for metres in ERROR_BREAKS[1:]},
    **{f"recall{share}": f"In best {share} %" for share in (1, 10)},
    "coverage": "Answered",
    "precision": "Right",
    "in_region": "In region",
}


def evaluation_headline(evaluation: Evaluation) -> str:
    """Return the result in one sentence: success within 50 m and, if there are any, answers."""
    means = evaluation.means()
    p50, low, high = (float(means[name]["p50"]) for name in ("value", "low", "high"))
    near = f"within {evaluation.success_metres} m"
    best = "" if evaluation.top == 1 else f" by the best of {evaluation.top:,} candidates"
    sentence = (
        f"Of {len(evaluation.queries):,} views, {short_percent(p50)} were placed {near}{best} "
        f"(95 %: {short_percent(low, unit='')} to {short_percent(high)})"
    )
    if "coverage" not in means.index:
        return f"{sentence}."
    answered, right = (float(means["value"][name]) for name in ("coverage", "precision"))
    if not answered:
        return f"{sentence}; the method was not sure enough to answer any of them."
    return (
        f"{sentence}; the method answers {short_percent(answered)} of them, and when it answers, "
        f"it is right in {short_percent(right)}."
    )


def evaluation_tables(evaluation: Evaluation) -> tuple[Table, ...]:
    """Return the settings and the figures of an evaluation, in total and by group.

    Parameters
    ----------
    evaluation : Evaluation
        The evaluation.

    Returns
    -------
    tuple of Table
        Settings, figures, figures by length and by ambiguity; for the likelihood method, also
        the calibration of the chances and the coverage of the answers.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=5)
    >>> evaluation_tables(evaluation)[0].rows[0]
    ('Method', 'likelihood, noise: generic, from the centres of cells')
    """
    tables = (
        Table("Settings", ("Setting", "Value"), tuple(evaluation_settings(evaluation).items())),
        _figure_table(evaluation),
        _group_table(evaluation.by_length(), "By length of the true signature", "Objects"),
        _group_table(evaluation.by_ambiguity(), "By ambiguity", "Cells of the same types"),
    )
    if evaluation.queries["chance"].isna().all():
        return tables
    bins, rules = evaluation.calibration(), evaluation.coverage_curve()
    return (
        *tables,
        Table.of_columns(
            "Stated chances",
            {
                "Chance stated": map("{:g} to {:g}".format, bins["from"], bins["to"]),
                "Queries": map("{:,}".format, bins["n"]),
                "Its mean": map(figure, bins["stated"]),
                "Came true": map(figure, bins["true"]),
                "95 %": map(interval, bins["low"], bins["high"]),
            },
        ),
        Table.of_columns(
            "Coverage and precision",
            {
                "Answered from a chance of": map("{:g}".format, rules["threshold"]),
                "Answers": map("{:,}".format, rules["answered"]),
                "Coverage": map(figure, rules["coverage"]),
                "Right": map(figure, rules["precision"]),
                "95 %": map(interval, rules["low"], rules["high"]),
            },
        ),
    )


def evaluation_settings(evaluation: Evaluation) -> dict[str, str]:
    """Return the settings of the queries, the method and the database, by title."""
    spec, database = evaluation.asked, evaluation.database
    megabytes = database["mb_per_km2"]
    city = "" if evaluation.city is None else f" of {evaluation.city}"
    return {
        "Method": method_words(evaluation.method),
        "Best candidates that count (t)": f"{evaluation.top:,}",
        "Distortions": chain_text(spec.distortions) or "none",
        "Queries": f"{len(evaluation.queries):,}",
        "Seen from": spec.seen_from + city,
        "Seeds": ", ".join(map(str, spec.seeds)),
        "Cells": f"{database['cells']:,}",
        "Mean length": f"{database['mean_length']:.3f} objects",
        "Visibility range": f"{database['radius_m']:g} m",
        "Grid step": f"{database['step_m']:g} m",
        "Angle levels": str(database["levels"]),
        **({} if megabytes is None else {"Size": f"{megabytes:.3f} MB per km²"}),
    }


def _figure_table(evaluation: Evaluation) -> Table:
    """Return the figures, with the paper's for comparison."""
    means = evaluation.means()
    p50, recall10 = paris_accuracy(evaluation)
    paper = {"p50": p50, "recall10": recall10}
    rows = []
    for name in [name for name in FIGURES if name in means.index]:
        value, low, high = (float(means[column][name]) for column in ("value", "low", "high"))
        cells = figure(value), interval(low, high), figure(paper.get(name))
        rows.append((FIGURES[name], *cells))
    errors = evaluation.queries["error_m"].to_numpy(dtype=np.float64)
    turns = evaluation.queries["heading_error"].to_numpy(dtype=np.float64)
    percentiles = [
        ("Median error", errors, 50, " m"),
        ("90th percentile of the error", errors, 90, " m"),
    ]
    if not np.isnan(turns).all():
        percentiles.append(("Median error of the heading", turns, 50, "°"))
    for title, values, share, unit in percentiles:
        value, low, high = percentile(values, share)
        text = figure(value, ",.1f") + (unit if np.isfinite(value) else "")
        rows.append((title, text, interval(low, high, ",.1f"), ""))
    rows += [
        ("Successful queries", f"{evaluation.successful.mean():.4f}", "", ""),
        ("Unlocalized queries", f"{evaluation.unlocalized:,}", "", ""),
        ("Seconds a query", figure(evaluation.seconds_per_query), "", ""),
    ]
    columns = ("Figure", "Ours", "95 %", paris.COLUMN)
    note = (
        "Ties are scored by expectation. A query is successful when its error is at most 50 m "
        "with probability 0.5 or more."
    )
    if p50 is None:
        return Table("Figures", columns[:3], tuple(row[:3] for row in rows), note)
    note += " The paper's figures are for another city, Paris."
    return Table("Figures", columns, tuple(rows), note)


def _group_table(groups: pd.DataFrame, title: str, heading: str) -> Table:
    """Return the figures of each group of queries."""
    figures = {
        label: map(figure, groups[name]) for name, label in GROUP_FIGURES.items() if name in groups
    }
    labels, numbers = map(str, groups.iloc[:, 0]), map("{:,}".format, groups["n"])
    return Table.of_columns(title, {heading: labels, "Queries": numbers, **figures})


def paris_accuracy(evaluation: Evaluation) -> tuple[float | None, float | None]:
    """Return the paper's P(error <= 50 m) and recall@10 % for these settings, else None."""
    if _paper_level(evaluation) != "medium":
        return None, None
    database = evaluation.database
    return paris.ACCURACY.get((database["radius_m"], database["levels"]), (None, None))


def paris_points(evaluation: Evaluation) -> tuple[tuple[float, float, str], ...]:
    """Return the points of the paper on the error curve of these settings, for a plot."""
    p50, _ = paris_accuracy(evaluation)
    if p50 is not None:
        return ((50.0, p50, "Paris, the same settings"),)
    share = paris.READ_OFF.get(f"{_paper_level(evaluation)}_small_error")
    return () if share is None else ((10.0, share, "Paris, small errors (text)"),)


def _paper_level(evaluation: Evaluation) -> str | None:
    """Return the level of distortion if the settings are those of the paper, else None."""
    spec = evaluation.asked
    # The paper does not say whether it normalised, sorted again or drew classes by frequency.
    measures = str(evaluation.method)
    same_method = measures in {"edit+edit:5%", "edit+edit:5%:raw"} and evaluation.top == 1
    if not (same_method and spec.seen_from == "cells"):
        return None
    if evaluation.database["step_m"] != paris.STEP_M:
        return None
    for level, resort, false_class in product(paris.ERRORS, (True, False), get_args(FalseClass)):
        distortion = replace(DISTORTIONS[level], resort=resort, false_class=false_class)
        if spec.distortions == (distortion,):
            return level
    return None


def comparison_sentence(
    comparison: pd.DataFrame, changed: tuple[int, int], *, names: tuple[str, str]
) -> str:
    """Return a sentence about the difference in success within 50 m, and whether it may be chance.

    `changed` are the numbers of queries gained and lost (`evaluation.changed_successes`); `names`
    are the names of the first and the second results.
    """
    figures = comparison.set_index("figure")
    points = figures.loc["p50", ["difference", "low", "high"]].to_numpy(np.float64) * 100.0
    first, second = names
    within, word = f"queries within {Evaluation.success_metres} m", "more"
    if points[0] < 0.0:
        points, word = -points[[0, 2, 1]], "fewer"
    if not points.any():
        return f"{second} places as many {within} as {first}."
    more, low, high = (f"{round(point, 1) + 0.0:.1f}" for point in points)  # no -0
    chance = "" if points[1] > 0.0 else ", which may be chance"
    gains, losses = changed
    return (
        f"{second} places {more} points {word} {within} than {first}{chance} "
        f"(95 %: {low} to {high}): {gains:,} queries gained, {losses:,} lost."
    )


def comparison_table(comparison: pd.DataFrame, title: str) -> Table:
    """Return a comparison (see `evaluation.compare_evaluations`), with a row for each figure."""
    low, high = comparison["low"], comparison["high"]
    verdicts = np.where(low * high > 0, np.where(low > 0, "more", "less"), "")
    return Table.of_columns(
        title,
        {
            "Figure": map(str, comparison["figure"]),
            "First": map(figure, comparison["first"]),
            "Second": map(figure, comparison["second"]),
            "Difference": [figure(value, "+.4f") for value in comparison["difference"]],
            "95 %": [interval(*ends, "+.4f") for ends in zip(low, high, strict=True)],
            "Second has": verdicts.tolist(),
        },
        "Intervals are bootstrapped over pairs; one that contains 0 shows no difference.",
    )
