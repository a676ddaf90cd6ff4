"""Tables of a database and of an evaluation, with the source paper's Paris figures beside them.

Every table comes as rows of text, for a terminal or for Markdown; the same numbers as plain
values are in `database_summary` and in `Evaluation.summary`.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation

__all__ = [
    "Table",
    "database_markdown",
    "database_summary",
    "database_tables",
    "evaluation_markdown",
    "evaluation_tables",
]

# The paper's Tables 1, 2a and 2b.
_PARIS_OCCURRENCES: Mapping[str, int] = MappingProxyType(
    {
        "alignment_tree": 1_752_696,
        "water_fountain": 6_713,
        "street_light": 2_299_639,
        "indicator": 36_333,
        "traffic_light": 102_240,
        "bike_station": 14_397,
        "automatic_wc": 8_006,
        "car_station": 4_421,
        "taxi_station": 2_537,
        "bench": 135_748,
        "bus_stop": 32_320,
    }
)
_PARIS_GROUPS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "count": ("140,296", "204,891"),
        "mean": ("2.2", "1.5"),
        "std": ("121.5", "11.1"),
        "min": ("1", "1"),
        "25%": ("1", "1"),
        "50%": ("1", "1"),
        "75%": ("1", "1"),
        "max": ("29,958", "1,240"),
        # Of its 10,000 queries. It must mean types: at least 75 % of the 204,891 angle groups
        # hold one cell, which is 49 % of the cells or more.
        "alone": ("41.8 %", ""),
    }
)
# P(error <= 50 m) and recall at 10 % of its two-stage edit+edit at 5 %, medium distortion, t = 1,
# by visibility range and angle levels.
_PARIS_ACCURACY: Mapping[tuple[float, int], tuple[float, float | None]] = MappingProxyType(
    {
        (20.0, 16): (0.1793, 0.5110),
        (30.0, 16): (0.3733, 0.6462),
        (40.0, 16): (0.4946, 0.7269),
        (30.0, 8): (0.3243, None),
        (30.0, 24): (0.3861, None),
        (30.0, 32): (0.3766, None),
    }
)
_PARIS = "Paris (paper)"
_PARIS_STEP_M = 10.0


@dataclass(frozen=True, slots=True)
class Table:
    """A table to print.

    Parameters
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings; the first column is text, the others are numbers with their units.
    rows : tuple of tuple of str
        Cells as text, one for each column; empty where there is nothing to say.
    note : str, default ""
        What a reader must know to read it rightly.

    Examples
    --------
    >>> Table("Sizes", ("What", "m"), (("step", "10"),)).note
    ''
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """Return the table as a Markdown section.

        Returns
        -------
        str
            A heading of the third level, the table and the note, ending in a newline.

        Examples
        --------
        >>> print(Table("Sizes", ("What", "m"), (("step", "10"),)).markdown(), end="")
        ### Sizes
        <BLANKLINE>
        | What | m |
        | --- | ---: |
        | step | 10 |
        """
        rules = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [self.columns, tuple(rules), *self.rows]
        table = "\n".join(f"| {' | '.join(_escaped(cell) for cell in line)} |" for line in lines)
        note = f"\n{_escaped(self.note)}\n" if self.note else ""
        return f"### {_escaped(self.title)}\n\n{table}\n{note}"


def database_summary(
    database: SignatureDatabase, *, file_bytes: int | None = None
) -> dict[str, Any]:
    """Return the properties of a database as plain values for JSON.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    file_bytes : int, optional
        Size of its file in bytes, where it has one.

    Returns
    -------
    dict
        ``signatures``, ``mean_length``, ``covered_km2``, ``radius_m``, ``step_m``, ``levels``,
        ``crs``, ``file_mb`` (millions of bytes or None), ``version``, ``licenses``;
        ``occurrences``: one dict a class (``code``, ``symbol``, ``name``, ``title``, ``number``,
        ``share``); ``groups``: for ``type``, ``angle`` and ``both`` the statistics of the group
        sizes as `pandas.Series.describe` gives them (``std`` is the sample's, None for a single
        group) and ``alone``, the share of the cells that share their signature with no other;
        ``largest_type_group``: ``types`` and ``cells``.

    Notes
    -----
    Paper, Tables 1 and 2. An occurrence is an object in a signature: an object counts once in
    every cell that sees it. The covered area is the number of cells times that of a cell.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> facts = database_summary(build_database(objects))
    >>> facts["groups"]["type"]["count"] <= facts["signatures"]
    True
    """
    numbers = database.occurrences
    total = int(numbers.sum())
    types, angles = database.type_sequences, database.angle_sequences
    pairs = types.inverse.astype(np.int64) * len(angles) + angles.inverse
    both = np.unique(pairs, return_counts=True)[1]
    largest = int(np.argmax(types.counts))
    codes = types.values[types.offsets[largest] : types.offsets[largest + 1]]
    return {
        "signatures": len(database),
        "mean_length": float(database.lengths.mean()),
        "covered_km2": len(database) * database.grid.step**2 / 1e6,
        "radius_m": float(database.spec.radius),
        "step_m": float(database.grid.step),
        "levels": int(database.spec.levels),
        "crs": database.crs.to_string(),
        "file_mb": None if file_bytes is None else file_bytes / 1e6,
        "version": database.version,
        "licenses": list(database.licenses),
        "occurrences": [
            {
                "code": item.code,
                "symbol": item.symbol,
                "name": item.name,
                "title": item.title,
                "number": int(numbers[item.code]),
                "share": int(numbers[item.code]) / total,
            }
            for item in sorted(database.taxonomy.classes, key=lambda item: item.code)
        ],
        "groups": {
            "type": _group_statistics(types.counts),
            "angle": _group_statistics(angles.counts),
            "both": _group_statistics(both),
        },
        "largest_type_group": {
            "types": database.taxonomy.decode(codes),
            "cells": int(types.counts[largest]),
        },
    }


def database_tables(
    database: SignatureDatabase, *, file_bytes: int | None = None
) -> tuple[Table, Table, Table]:
    """Return the paper's Tables 1, 2a and 2b for a database, the paper's figures beside them.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    file_bytes : int, optional
        Size of its file in bytes, where it has one.

    Returns
    -------
    tuple of Table
        Occurrences by class, basic properties, and sizes of the signature groups.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> [table.title for table in database_tables(build_database(objects))]
    ['Occurrences by class', 'Database', 'Sizes of the signature groups, in cells']
    """
    facts = database_summary(database, file_bytes=file_bytes)
    return _occurrence_table(facts), _property_table(facts), _group_table(facts)


def database_markdown(database: SignatureDatabase, *, file_bytes: int | None = None) -> str:
    """Return the tables of a database and its sources as Markdown.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    file_bytes : int, optional
        Size of its file in bytes, where it has one.

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
    >>> database_markdown(build_database(objects)).splitlines()[0]
    '## Signature database'
    """
    sections = [table.markdown() for table in database_tables(database, file_bytes=file_bytes)]
    if database.licenses:
        lines = "\n".join(f"- {_escaped(line)}" for line in database.licenses)
        sections.append(f"### Sources\n\n{lines}\n")
    return "\n".join(["## Signature database\n", *sections])


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


def _group_statistics(sizes: NDArray[np.int64]) -> dict[str, float | int | None]:
    """Return the statistics of group sizes and the share of cells alone in their group."""
    described = pd.Series(sizes).describe()
    statistics: dict[str, float | int | None] = {
        name: int(described[name]) for name in ("count", "min", "max")
    }
    for name in ("mean", "std", "25%", "50%", "75%"):
        value = float(described[name])
        statistics[name] = None if np.isnan(value) else value
    statistics["alone"] = int(np.count_nonzero(sizes == 1)) / int(sizes.sum())
    return statistics


def _occurrence_table(facts: Mapping[str, Any]) -> Table:
    total = sum(_PARIS_OCCURRENCES.values())
    rows = []
    for item in facts["occurrences"]:
        paris = _PARIS_OCCURRENCES.get(item["name"])
        rows.append(
            (
                f"{item['title']} ({item['symbol']})",
                f"{item['number']:,}",
                _percent(item["share"]),
                "" if paris is None else f"{paris:,}",
                "" if paris is None else _percent(paris / total),
            )
        )
    return Table(
        title="Occurrences by class",
        columns=("Class (symbol)", "Number", "Share", _PARIS, "Share"),
        rows=tuple(rows),
        note="An object counts once in every signature that holds it.",
    )


def _property_table(facts: Mapping[str, Any]) -> Table:
    size = facts["file_mb"]
    largest = facts["largest_type_group"]
    rows = (
        ("Visibility range", f"{facts['radius_m']:g} m", "30 m"),
        ("Grid step", f"{facts['step_m']:g} m", "10 m"),
        ("Angle levels", str(facts["levels"]), "16"),
        ("Signatures", f"{facts['signatures']:,}", "312,134"),
        ("Mean length", f"{facts['mean_length']:.3f} objects", "14 objects"),
        ("Covered area", f"{facts['covered_km2']:.1f} km²", "79 km²"),
        ("File", "" if size is None else f"{size:.1f} MB", "38.7 MB"),
        (
            "Largest group by type",
            f"{_shortened(largest['types'])}, {largest['cells']:,} cells",
            "DDD, 29,958 cells",
        ),
    )
    return Table(
        title="Database",
        columns=("Property", "Ours", _PARIS),
        rows=rows,
        note=(
            "Our covered area is cells times the area of a cell; by that count "
            "the paper's signatures cover 31.2 km², not 79."
        ),
    )


def _group_table(facts: Mapping[str, Any]) -> Table:
    groups = facts["groups"]
    kinds = ("type", "angle", "both")
    rows = []
    for name, paris in _PARIS_GROUPS.items():
        label = "cells alone in their group" if name == "alone" else name
        rows.append((label, *(_statistic(name, groups[kind][name]) for kind in kinds), *paris))
    return Table(
        title="Sizes of the signature groups, in cells",
        columns=("", "By type", "By angle", "By both", f"{_PARIS}, by type", "by angle"),
        rows=tuple(rows),
        note="The paper counts distinct patterns over its 10,000 queries, not over all cells.",
    )


def _statistic(name: str, value: float | None) -> str:
    """Return one statistic of group sizes as text."""
    if value is None:
        return ""
    if name == "alone":
        return _percent(value)
    return f"{value:,.1f}" if name in {"mean", "std"} else f"{value:,g}"


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
    ties = (
        "Ties are scored by expectation. A query is successful when its error is at most 50 m "
        "with probability 0.5 or more."
    )
    paris = "" if p50 is None else " The paper's figures are for another city, Paris."
    return Table(
        title="Figures",
        columns=("Figure", "Ours", _PARIS) if p50 is not None else ("Figure", "Ours"),
        rows=tuple(row if p50 is not None else row[:2] for row in rows),
        note=ties + paris,
    )


def _length_table(evaluation: Evaluation) -> Table:
    figures = ("p10", "p25", "p50", "p100", "recall1", "recall10")
    rows = tuple(
        (
            row["length"],
            f"{row['n']:,}",
            *("" if np.isnan(row[name]) else f"{row[name]:.4f}" for name in figures),
        )
        for row in evaluation.by_length().to_dict("records")
    )
    columns = ("Objects", "Queries", "P(≤ 10 m)", "P(≤ 25 m)", "P(≤ 50 m)", "P(≤ 100 m)")
    return Table(
        title="By length of the true signature",
        columns=(*columns, "recall@1 %", "recall@10 %"),
        rows=rows,
    )


def _paris_accuracy(evaluation: Evaluation) -> tuple[float | None, float | None]:
    """Return the paper's P(error <= 50 m) and recall@10 % if it ran these settings."""
    method, distortion, database = evaluation.method, evaluation.distortion, evaluation.database
    # The paper does not say whether it normalised, sorted again or drew classes by frequency.
    same_method = (
        (method.types, method.angles, method.alpha, method.keep) == ("edit", "edit", 0.5, 5.0)
        and method.weights.as_tuple() == (1, 1, 1)
        and evaluation.top == 1
    )
    same_noise = (
        distortion.occurrences,
        distortion.bearing_sigma,
        distortion.bearing_clip,
    ) == (7, 5.0, 30.0)
    if not (same_method and same_noise and database["step_m"] == _PARIS_STEP_M):
        return None, None
    key = (database["radius_m"], database["levels"])
    return _PARIS_ACCURACY.get(key, (None, None))


def _percent(share: float) -> str:
    """Return a share as text."""
    return f"{100 * share:.1f} %"


def _shortened(symbols: str, limit: int = 20) -> str:
    """Return a type sequence that fits a table."""
    return symbols if len(symbols) <= limit else f"{symbols[:limit]}… ({len(symbols)} objects)"


def _escaped(text: str) -> str:
    """Return text from data so that it cannot break a Markdown table or become HTML."""
    plain = " ".join(text.split())
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")
