"""Tables of an evaluation, with the paper's figures beside them where it ran the same settings.

The same numbers as plain values are in `Evaluation.summary`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.locating import DEFAULT_RULE
from semsig_gis.method import Method
from semsig_gis.paper_figures import PARIS, PARIS_ACCURACY, PARIS_STEP_M
from semsig_gis.tables import Table

if TYPE_CHECKING:
    from semsig_gis.evaluation import Evaluation

__all__ = ["evaluation_markdown", "evaluation_tables"]


def evaluation_tables(evaluation: Evaluation) -> tuple[Table, Table, Table]:
    """Return the settings, the figures and the figures by signature length of an evaluation.

    Parameters
    ----------
    evaluation : Evaluation
        What to show.

    Returns
    -------
    tuple of Table
        Settings, figures and figures by length. The paper's figures stand beside ours only
        where it published them for these settings.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> from semsig_gis.evaluation import evaluate
    >>> evaluation = evaluate(build_database(objects), queries=5)
    >>> evaluation_tables(evaluation)[0].rows[0]
    ('Method', 'edit+edit')
    """
    return _setting_table(evaluation), _figure_table(evaluation), _length_table(evaluation)


def evaluation_markdown(evaluation: Evaluation) -> str:
    """Return the tables of an evaluation as Markdown.

    Parameters
    ----------
    evaluation : Evaluation
        What to show.

    Returns
    -------
    str
        A document of sections, ending in a newline.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> from semsig_gis.evaluation import evaluate
    >>> evaluation = evaluate(build_database(objects), queries=5)
    >>> evaluation_markdown(evaluation).splitlines()[0]
    '## Evaluation'
    """
    sections = [table.markdown() for table in evaluation_tables(evaluation)]
    return "\n".join(["## Evaluation\n", *sections])


def _setting_table(evaluation: Evaluation) -> Table:
    distortion, database = evaluation.distortion, evaluation.database
    rows = (
        ("Method", str(evaluation.method)),
        ("Best candidates that count (t)", f"{evaluation.top:,}"),
        ("Distortion", f"{distortion.name}, {distortion.occurrences} occurrences"),
        (
            "Bearing noise",
            f"{distortion.bearing_sigma:g}°, at most {distortion.bearing_clip:g}°"
            if distortion.bearing_sigma
            else "none",
        ),
        ("After the noise", "sorted again" if distortion.resort else "order kept"),
        (
            "Class of a false object",
            "by frequency" if distortion.false_class == "frequency" else "uniform",
        ),
        ("Queries", f"{len(evaluation.queries):,}"),
        ("Seed", str(evaluation.seed)),
        ("Cells", f"{database['cells']:,}"),
        ("Mean length", f"{database['mean_length']:.3f} objects"),
        ("Visibility range", f"{database['radius_m']:g} m"),
        ("Grid step", f"{database['step_m']:g} m"),
        ("Angle levels", str(database["levels"])),
    )
    return Table(title="Settings", columns=("Setting", "Value"), rows=rows)


def _figure_table(evaluation: Evaluation) -> Table:
    results = evaluation.summary()["results"]
    p50, recall10 = _paris_accuracy(evaluation)
    median = results["median_error_m"]
    rows = [
        (
            f"P(error ≤ {x} m)",
            f"{results['p_error_within_m'][x]:.4f}",
            f"{p50:.4f}" if x == "50" and p50 is not None else "",
        )
        for x in ("10", "25", "50", "100")
    ]
    rows += [
        (
            f"recall@{k} %",
            f"{results['recall_at_percent'][k]:.4f}",
            f"{recall10:.4f}" if k == "10" and recall10 is not None else "",
        )
        for k in ("1", "10")
    ]
    rows += [
        ("Median error", "infinite" if median is None else f"{median:,.1f} m", ""),
        ("Successful queries", f"{results['successful']:.4f}", ""),
        ("Unlocalized queries", f"{results['unlocalized']:,}", ""),
        ("Seconds a query", f"{results['seconds_per_query']:.4f}", ""),
    ]
    said = {
        "coverage": f"Answered, with a chance of {DEFAULT_RULE.threshold:g} or more",
        "precision": "Right answers, of these",
        "in_region": "True cell in the region of 90 %",
    }
    rows += [
        (said[name], "" if np.isnan(value) else f"{value:.4f}", "")
        for name, value in evaluation.answers().items()
    ]
    ties = (
        "Ties are scored by expectation. A query is successful when its error is at most 50 m "
        "with probability 0.5 or more."
    )
    paris = "" if p50 is None else " The paper's figures are for another city, Paris."
    return Table(
        title="Figures",
        columns=("Figure", "Ours", PARIS) if p50 is not None else ("Figure", "Ours"),
        rows=tuple(row if p50 is not None else row[:2] for row in rows),
        note=ties + paris,
    )


def _length_table(evaluation: Evaluation) -> Table:
    titles = {
        **{f"p{metres}": f"P(≤ {metres} m)" for metres in (10, 25, 50, 100)},
        **{f"recall{percent}": f"recall@{percent} %" for percent in (1, 10)},
        "coverage": "Answered",
        "precision": "Right",
        "in_region": "In region",
    }
    by_length = evaluation.by_length()
    figures = [name for name in titles if name in by_length]
    rows = tuple(
        (
            row["length"],
            f"{row['n']:,}",
            *("" if np.isnan(row[name]) else f"{row[name]:.4f}" for name in figures),
        )
        for row in by_length.to_dict("records")
    )
    return Table(
        title="By length of the true signature",
        columns=("Objects", "Queries", *(titles[name] for name in figures)),
        rows=rows,
    )


def _paris_accuracy(evaluation: Evaluation) -> tuple[float | None, float | None]:
    """Return the paper's P(error <= 50 m) and recall@10 % if it ran these settings."""
    method, distortion, database = evaluation.method, evaluation.distortion, evaluation.database
    # The paper does not say whether it normalised, sorted again or drew classes by frequency.
    same_method = (
        isinstance(method, Method)
        and (method.types, method.angles, method.alpha, method.keep) == ("edit", "edit", 0.5, 5.0)
        and method.weights.as_tuple() == (1, 1, 1)
        and evaluation.top == 1
    )
    same_noise = (
        distortion.occurrences,
        distortion.bearing_sigma,
        distortion.bearing_clip,
    ) == (7, 5.0, 30.0)
    if not (same_method and same_noise and database["step_m"] == PARIS_STEP_M):
        return None, None
    key = (database["radius_m"], database["levels"])
    return PARIS_ACCURACY.get(key, (None, None))
