"""The figures of an experiment, as a data frame and as tables for `report.md`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from semsig_gis.core import ERROR_BREAKS, Table, figure, interval
from semsig_gis.evaluation.figures import percentile
from semsig_gis.evaluation.queries.distortion_text import chain_text
from semsig_gis.evaluation.result import Evaluation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.spec import ExperimentSpec


PERCENTILES = {"error_median": 50, "error_p90": 90}
SHOWN = {
    **{f"p{metres}": f"P(≤ {metres} m)" for metres in ERROR_BREAKS},
    "near5": "recall@5 at 25 m",
    "recall10": "recall@10 %",
    "coverage": "Answered",
    "precision": "Right",
    "in_region": "In region",
}

MINOR = tuple(SHOWN[f"p{metres}"] for metres in ERROR_BREAKS if metres != Evaluation.success_metres)


def experiment_figures(results: Mapping[str, Evaluation]) -> pd.DataFrame:
    """Return all figures of the evaluations, given by the names of their cases.

    One row for each case and figure: ``case``, ``figure``, ``value``, ``low`` and ``high`` (95 %)
    and ``n`` (queries). Figures are shares, errors in metres, or ``heading_error_median`` in
    degrees.
    """
    tables = []
    for name, evaluation in results.items():
        errors = evaluation.queries["error_m"].to_numpy(dtype=np.float64)
        heading_errors = evaluation.queries["heading_error"].to_numpy(dtype=np.float64)
        columns = {label: (errors, percent) for label, percent in PERCENTILES.items()}
        if not np.isnan(heading_errors).all():
            columns["heading_error_median"] = (heading_errors, 50)
        rows = [
            (label, *percentile(values, percent), int((~np.isnan(values)).sum()))
            for label, (values, percent) in columns.items()
        ]
        percentiles = pd.DataFrame(rows, columns=["figure", "value", "low", "high", "n"])
        figures = pd.concat([evaluation.means().reset_index(), percentiles], ignore_index=True)
        figures.insert(0, "case", name)
        tables.append(figures)
    return pd.concat(tables, ignore_index=True)


def experiment_tables(
    spec: ExperimentSpec, results: Mapping[str, Evaluation], *, times: bool = True
) -> tuple[Table, ...]:
    """Return a table of the settings of an experiment, and one of main figures by distortion.

    With `times`, the tables have the seconds of a query, which differ from run to run.
    """
    database = next(iter(results.values())).database
    megabytes = database["mb_per_km2"]
    settings = {
        "Database": f"{spec.database}, {database['cells']:,} cells",
        **({} if megabytes is None else {"Size": f"{megabytes:.3f} MB per km²"}),
        "Queries": f"{spec.queries:,} of each seed ({', '.join(map(str, spec.seeds))})",
        "Seen from": spec.seen_from + ("" if spec.city is None else f" of {spec.city}"),
        **{f"Method {name}": str(method) for name, method in spec.methods.items()},
    }
    tables = [Table("Experiment", ("Setting", "Value"), tuple(settings.items()))]
    for distortion, chain in spec.distortions.items():
        cases = {
            f"{case.method}, t = {case.top}": results[case.name]
            for case in spec.cases
            if case.distortion == distortion
        }
        means = [case.means() for case in cases.values()]
        columns: dict[str, list[str]] = {"Method": list(cases)}
        for name, label in SHOWN.items():
            if any(name in table.index for table in means):
                columns[label] = [_mean(table, name) for table in means]
        for label, percent in (("Median m", 50), ("90th percentile m", 90)):
            errors = [case.queries["error_m"].to_numpy(dtype=np.float64) for case in cases.values()]
            columns[label] = [figure(percentile(values, percent)[0], ",.1f") for values in errors]
        if times:
            columns["s a query"] = [f"{case.seconds_per_query:.4f}" for case in cases.values()]
        title = f"{distortion}: {chain_text(chain) or 'no distortion'}"
        tables.append(Table.of_columns(title, columns, minor=MINOR))
    return tuple(tables)


def experiment_markdown(spec: ExperimentSpec, results: Mapping[str, Evaluation]) -> str:
    """Return the tables of an experiment as Markdown, without times, so that it is reproducible."""
    sections = [table.markdown() for table in experiment_tables(spec, results, times=False)]
    return "\n".join(["## Experiment\n", *sections])


def _mean(means: pd.DataFrame, name: str) -> str:
    """Return a figure as text, P(error <= 50 m) with its interval."""
    value = float(means["value"][name]) if name in means.index else np.nan
    if name != "p50" or np.isnan(value):
        return figure(value)
    return f"{value:.4f} ({interval(means['low'][name], means['high'][name])})"
