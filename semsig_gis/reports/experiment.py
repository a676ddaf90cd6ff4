"""Tables of an experiment: every method after every distortion, side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from semsig_gis.evaluation.figures import percentile
from semsig_gis.queries.chain import chain_text
from semsig_gis.reports.tables import Table

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.evaluation.spec import ExperimentSpec

METRES = {"error_median": 50, "error_p90": 90}
SHOWN = {
    **{f"p{metres}": f"P(≤ {metres} m)" for metres in (5, 10, 25, 50, 100)},
    "near5": "recall@5 at 25 m",
    "recall10": "recall@10 %",
    "coverage": "Answered",
    "precision": "Right",
    "in_region": "In region",
}


def experiment_figures(results: Mapping[str, Evaluation]) -> pd.DataFrame:
    """Return all figures of the evaluations, given by the names of their cases.

    One row a case and figure: ``case``, ``figure``, ``value``, ``low`` and ``high`` (95 %) and
    ``n``, how many queries have a say. The figures are shares (see
    `evaluation.figures.query_figures`), ``error_median`` and ``error_p90`` in metres,
    and ``heading_error_median`` in degrees where a heading was looked for.
    """
    parts = []
    for name, evaluation in results.items():
        table = evaluation.means().reset_index()
        errors = evaluation.queries["error_m"].to_numpy(dtype=np.float64)
        turns = evaluation.queries["heading_error"].to_numpy(dtype=np.float64)
        more = {figure: (errors, percent) for figure, percent in METRES.items()}
        if not np.isnan(turns).all():
            more["heading_error_median"] = (turns, 50)
        rows = []
        for figure, (values, percent) in more.items():
            value, low, high = percentile(values, percent)
            told = int((~np.isnan(values)).sum())
            rows.append({"figure": figure, "value": value, "low": low, "high": high, "n": told})
        both = pd.concat([table, pd.DataFrame(rows)], ignore_index=True)
        both.insert(0, "case", name)
        parts.append(both)
    return pd.concat(parts, ignore_index=True)


def experiment_tables(
    spec: ExperimentSpec, results: Mapping[str, Evaluation], *, times: bool = True
) -> tuple[Table, ...]:
    """Return the settings of an experiment, then for each distortion a table of its main figures.

    A row is a method and number of candidates. ``times`` tells whether to show the seconds of a
    query, which differ from run to run.
    """
    first = next(iter(results.values()))
    megabytes = first.database["mb_per_km2"]
    settings = (
        ("Database", f"{spec.database}, {first.database['cells']:,} cells"),
        *((("Size", f"{megabytes:.3f} MB a km²"),) if megabytes is not None else ()),
        ("Queries", f"{spec.queries:,} of each seed ({', '.join(map(str, spec.seeds))})"),
        ("Seen from", spec.seen_from if spec.city is None else f"{spec.seen_from} of {spec.city}"),
        *((f"Method {name}", str(method)) for name, method in spec.methods.items()),
    )
    tables = [Table(title="Experiment", columns=("Setting", "Value"), rows=settings)]
    for distortion, chain in spec.distortions.items():
        cases = [case for case in spec.cases if case.distortion == distortion]
        found = [results[case.name] for case in cases]
        means = [one.means() for one in found]
        shown = [name for name in SHOWN if any(name in one.index for one in means)]
        rows = tuple(
            (
                f"{case.method}, t = {case.top}",
                *(_told(mean, name) for name in shown),
                *_errors(one),
                *((f"{one.seconds_per_query:.4f}",) if times else ()),
            )
            for case, one, mean in zip(cases, found, means, strict=True)
        )
        columns = ("Method", *(SHOWN[name] for name in shown), "Median m", "90th percentile m")
        tables.append(
            Table(
                title=f"{distortion}: {chain_text(chain) or 'no distortion'}",
                columns=(*columns, "s a query") if times else columns,
                rows=rows,
            )
        )
    return tuple(tables)


def experiment_markdown(spec: ExperimentSpec, results: Mapping[str, Evaluation]) -> str:
    """Return the tables of an experiment as Markdown, the same whenever it is repeated."""
    sections = [table.markdown() for table in experiment_tables(spec, results, times=False)]
    return "\n".join(["## Experiment\n", *sections])


def comparison_table(found: pd.DataFrame, title: str) -> Table:
    """Return a comparison (see `evaluation.compare.compare_evaluations`), one row a figure."""
    rows = []
    for row in found.to_dict("records"):
        low, high = row["low"], row["high"]
        verdict = "" if not low * high > 0 else "more" if low > 0 else "less"
        rows.append(
            (
                str(row["figure"]),
                *(_number(row[name]) for name in ("first", "second")),
                _number(row["difference"], "+"),
                "" if np.isnan(low) else f"{_number(low, '+')} to {_number(high, '+')}",
                verdict,
            )
        )
    columns = ("Figure", "First", "Second", "Difference", "95 %", "Second has")
    note = "Queries are drawn again in pairs; where the interval holds 0, nothing is proven."
    return Table(title=title, columns=columns, rows=tuple(rows), note=note)


def _number(value: float, sign: str = "") -> str:
    shown = "infinite" if np.isinf(value) else f"{value:{sign}.4f}"
    return "" if np.isnan(value) else shown


def _told(means: pd.DataFrame, name: str) -> str:
    """Return a figure, P(error <= 50 m) with its interval."""
    value = float(means["value"][name]) if name in means.index else np.nan
    if np.isnan(value):
        return ""
    if name != "p50":
        return f"{value:.4f}"
    return f"{value:.4f} ({means['low'][name]:.4f} to {means['high'][name]:.4f})"


def _errors(evaluation: Evaluation) -> tuple[str, ...]:
    """Return the median and the 90th percentile of the error."""
    errors = evaluation.queries["error_m"].to_numpy(dtype=np.float64)
    found = (percentile(errors, percent)[0] for percent in METRES.values())
    return tuple("infinite" if np.isinf(one) else f"{one:,.1f}" for one in found)
