"""Tables of an evaluation, with the paper's figures beside them where it ran the same settings.

The same numbers as plain values are in `Evaluation.summary`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, get_args

import numpy as np

from semsig_gis.evaluation.figures import percentile
from semsig_gis.likelihood.answer_rule import DEFAULT_RULE
from semsig_gis.matching.ties import NEAR_METRES, NEAR_PLACES
from semsig_gis.queries.chain import chain_text
from semsig_gis.queries.paper_errors import DISTORTIONS, FalseClass
from semsig_gis.reports import paris
from semsig_gis.reports.tables import Table

if TYPE_CHECKING:
    import pandas as pd

    from semsig_gis.evaluation.result import Evaluation

_FIGURES = {
    **{f"p{metres}": f"P(error ≤ {metres} m)" for metres in (5, 10, 25, 50, 100)},
    **{f"recall{percent}": f"recall@{percent} %" for percent in (1, 10)},
    **{f"near{count}": f"recall@{count} within {NEAR_METRES} m" for count in NEAR_PLACES},
    "coverage": f"Answered, with a chance of {DEFAULT_RULE.threshold:g} or more",
    "precision": "Right answers, of these",
    "in_region": "True cell in the region of 90 %",
}
_GROUPED = {
    **{f"p{metres}": f"P(≤ {metres} m)" for metres in (10, 25, 50, 100)},
    **{f"recall{percent}": f"recall@{percent} %" for percent in (1, 10)},
    "coverage": "Answered",
    "precision": "Right",
    "in_region": "In region",
}


def evaluation_tables(evaluation: Evaluation) -> tuple[Table, ...]:
    """Return the settings and the figures of an evaluation, in all and group by group.

    Parameters
    ----------
    evaluation : Evaluation
        What to show.

    Returns
    -------
    tuple of Table
        Settings, figures, figures by length and by ambiguity; of the likelihood method, also
        what stated chances are worth. The paper's figures stand beside ours only where it
        published them for these settings.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> from semsig_gis.evaluation.evaluate import evaluate
    >>> evaluation = evaluate(build_database(objects), queries=5)
    >>> evaluation_tables(evaluation)[0].rows[0]
    ('Method', 'edit+edit')
    """
    tables = (
        _setting_table(evaluation),
        _figure_table(evaluation),
        _group_table(evaluation.by_length(), "By length of the true signature", "Objects"),
        _group_table(evaluation.by_ambiguity(), "By ambiguity", "Cells of the same types"),
    )
    if evaluation.queries["chance"].isna().all():
        return tables
    return (*tables, _chance_table(evaluation), _rule_table(evaluation))


def evaluation_markdown(evaluation: Evaluation) -> str:
    """Return the tables of an evaluation as Markdown."""
    sections = [table.markdown() for table in evaluation_tables(evaluation)]
    return "\n".join(["## Evaluation\n", *sections])


def _setting_table(evaluation: Evaluation) -> Table:
    asked, database = evaluation.asked, evaluation.database
    megabytes = database["mb_per_km2"]
    rows = (
        ("Method", str(evaluation.method)),
        ("Best candidates that count (t)", f"{evaluation.top:,}"),
        ("Distortions", chain_text(asked.distortions) or "none"),
        ("Queries", f"{len(evaluation.queries):,}"),
        ("Seen from", asked.seen_from if evaluation.city is None else _elsewhere(evaluation)),
        ("Seeds", ", ".join(map(str, asked.seeds))),
        ("Cells", f"{database['cells']:,}"),
        ("Mean length", f"{database['mean_length']:.3f} objects"),
        ("Visibility range", f"{database['radius_m']:g} m"),
        ("Grid step", f"{database['step_m']:g} m"),
        ("Angle levels", str(database["levels"])),
        *((("Size", f"{megabytes:.3f} MB a km²"),) if megabytes is not None else ()),
    )
    return Table(title="Settings", columns=("Setting", "Value"), rows=rows)


def _elsewhere(evaluation: Evaluation) -> str:
    return f"{evaluation.asked.seen_from} of {evaluation.city}"


def _figure_table(evaluation: Evaluation) -> Table:
    """Return the figures, the paper's beside those that it has."""
    means = evaluation.means()
    p50, recall10 = _paris_accuracy(evaluation)
    theirs = {"p50": p50, "recall10": recall10}
    rows = [
        (said, *_shares(means, name), _share(theirs.get(name)))
        for name, said in _FIGURES.items()
        if name in means.index
    ]
    errors = evaluation.queries["error_m"].to_numpy(dtype=np.float64)
    turns = evaluation.queries["heading_error"].to_numpy(dtype=np.float64)
    rows += [
        ("Median error", *_amounts(percentile(errors, 50), "m"), ""),
        ("90th percentile of the error", *_amounts(percentile(errors, 90), "m"), ""),
    ]
    if not np.isnan(turns).all():
        rows.append(("Median error of the heading", *_amounts(percentile(turns, 50), "°"), ""))
    seconds = evaluation.seconds_per_query
    rows += [
        ("Successful queries", f"{evaluation.successful.mean():.4f}", "", ""),
        ("Unlocalized queries", f"{evaluation.unlocalized:,}", "", ""),
        ("Seconds a query", _share(None if np.isnan(seconds) else seconds), "", ""),
    ]
    ties = (
        "Ties are scored by expectation. A query is successful when its error is at most 50 m "
        "with probability 0.5 or more."
    )
    elsewhere = "" if p50 is None else " The paper's figures are for another city, Paris."
    columns = ("Figure", "Ours", "95 %")
    return Table(
        title="Figures",
        columns=columns if p50 is None else (*columns, paris.COLUMN),
        rows=tuple(row[:3] if p50 is None else row for row in rows),
        note=ties + elsewhere,
    )


def _share(value: float | None) -> str:
    return "" if value is None or np.isnan(value) else f"{value:.4f}"


def _shares(means: pd.DataFrame, name: str) -> tuple[str, str]:
    """Return a mean and its interval."""
    value, low, high = (float(means[part][name]) for part in ("value", "low", "high"))
    return _share(value), "" if np.isnan(value) else f"{low:.4f} to {high:.4f}"


def _amounts(values: tuple[float, float, float], unit: str) -> tuple[str, str]:
    """Return a percentile and its interval."""
    value, low, high = ("infinite" if np.isinf(one) else f"{one:,.1f}" for one in values)
    blank = "" if unit == "°" else " "
    shown = value if value == "infinite" else f"{value}{blank}{unit}"
    return shown, f"{low} to {high}"


def _group_table(found: pd.DataFrame, title: str, heading: str) -> Table:
    """Return figures group by group."""
    figures = [name for name in _GROUPED if name in found]
    rows = tuple(
        (
            str(row[found.columns[0]]),
            f"{row['n']:,}",
            *(_share(row[name]) for name in figures),
        )
        for row in found.to_dict("records")
    )
    return Table(
        title=title,
        columns=(heading, "Queries", *(_GROUPED[name] for name in figures)),
        rows=rows,
    )


def _chance_table(evaluation: Evaluation) -> Table:
    """Return what stated chances are worth."""
    rows = tuple(
        (
            f"{row['from']:g} to {row['to']:g}",
            f"{row['n']:,}",
            _share(row["stated"]),
            _share(row["true"]),
            "" if np.isnan(row["true"]) else f"{row['low']:.4f} to {row['high']:.4f}",
        )
        for row in evaluation.calibration().to_dict("records")
    )
    columns = ("Chance stated", "Queries", "Its mean", "Came true", "95 %")
    return Table(title="Stated chances", columns=columns, rows=rows)


def _rule_table(evaluation: Evaluation) -> Table:
    """Return what each rule of answering gives."""
    rows = tuple(
        (
            f"{row['threshold']:g}",
            f"{row['answered']:,}",
            _share(row["coverage"]),
            _share(row["precision"]),
            "" if np.isnan(row["precision"]) else f"{row['low']:.4f} to {row['high']:.4f}",
        )
        for row in evaluation.coverage_curve().to_dict("records")
    )
    columns = ("Answered from a chance of", "Answers", "Coverage", "Right", "95 %")
    return Table(title="Coverage and precision", columns=columns, rows=rows)


def _paris_accuracy(evaluation: Evaluation) -> tuple[float | None, float | None]:
    """Return the paper's P(error <= 50 m) and recall@10 % if it ran these settings."""
    asked, database = evaluation.asked, evaluation.database
    # The paper does not say whether it normalised, sorted again or drew classes by frequency.
    measures = str(evaluation.method)
    same_method = measures in {"edit+edit:5%", "edit+edit:5%:raw"} and evaluation.top == 1
    medium = DISTORTIONS["medium"]
    same_noise = asked.seen_from == "cells" and any(
        asked.distortions == (replace(medium, resort=resort, false_class=false_class),)
        for resort in (True, False)
        for false_class in get_args(FalseClass)
    )
    if not (same_method and same_noise and database["step_m"] == paris.STEP_M):
        return None, None
    key = (database["radius_m"], database["levels"])
    return paris.ACCURACY.get(key, (None, None))
