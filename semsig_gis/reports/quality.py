"""Tables of what became of loaded rows, and of what an update changed."""

from __future__ import annotations

from dataclasses import astuple, fields
from typing import TYPE_CHECKING

from semsig_gis.objects.quality import SQUARE_M
from semsig_gis.reports.tables import Table
from semsig_gis.sources import RowCounts

if TYPE_CHECKING:
    from semsig_gis.database.update import UpdateReport
    from semsig_gis.objects.quality import QualityReport


ROW_COUNTS = tuple(field.name for field in fields(RowCounts))


def quality_tables(report: QualityReport) -> tuple[Table, ...]:
    """Return objects by class, rows by layer, conflated objects if any, place and licences.

    Parameters
    ----------
    report : QualityReport
        What `quality_report` gives.

    Returns
    -------
    tuple of Table
        Four tables, or five with conflated objects.

    Examples
    --------
    >>> from semsig_gis import (
    ...     CitySpec, build_objects, paper_taxonomy, quality_report, synthetic_city
    ... )
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, load = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> [table.title for table in quality_tables(quality_report(objects, load))]
    ['Objects by class', 'Rows by layer', 'Place', 'Licences']
    """
    sides = "west, south, east, north"
    tables = (
        _class_table(report),
        Table(
            "Rows by layer",
            ("layer", *ROW_COUNTS, "objects", "notes"),
            tuple(
                (
                    item.name,
                    *(f"{number:,}" for number in (*astuple(item.counts), item.counts.kept)),
                    "; ".join(item.notes),
                )
                for item in report.sources
            ),
        ),
        Table(
            "Conflated",
            ("class", "from", "into", "objects", "radius, m", "median, m", "largest, m"),
            tuple(
                (
                    *(item.class_name, item.merged, item.kept, f"{item.count:,}"),
                    *map(_text, (item.radius, item.median_m, item.largest_m)),
                )
                for item in report.conflated
            ),
        ),
        Table(
            "Place",
            ("what", "value"),
            (
                ("coordinate system", report.crs),
                (f"{sides}, m", ", ".join(f"{edge:.0f}" for edge in report.extent)),
                (f"{sides}, degrees", ", ".join(f"{edge:.5f}" for edge in report.extent_degrees)),
            ),
        ),
        Table("Licences", ("licence",), tuple((line,) for line in report.licenses)),
    )
    return tuple(table for table in tables if table.title != "Conflated" or table.rows)


def _class_table(report: QualityReport) -> Table:
    absent = f" No objects of: {', '.join(report.absent)}." if report.absent else ""
    return Table(
        "Objects by class",
        ("class", "objects", "rows", "per km² of hull", "per km² occupied", "nearest, m"),
        tuple(
            (
                *(item.class_name, f"{item.objects:,}", f"{item.rows:,}"),
                *map(_text, (item.per_km2_hull, item.per_km2_occupied, item.nearest_m)),
            )
            for item in report.classes
        ),
        note=(
            f"The convex hull of all objects is {report.hull_km2:,.2f} km², ground without objects "
            f"included; the squares of {SQUARE_M:.0f} m that hold an object are "
            f"{report.occupied_km2:,.2f} km². Nearest: the median distance to the nearest other "
            f"object of the class.{absent}"
        ),
    )


def _text(number: float | None) -> str:
    return "" if number is None else f"{number:,.1f}"


CLASS_COUNTS = ("before", "after", "added", "removed", "moved", "gained", "lost")


def update_tables(report: UpdateReport) -> tuple[Table, Table]:
    """Return the objects by class, and the cells."""
    counts = [[getattr(item, count) for count in CLASS_COUNTS] for item in report.classes]
    moved = ["" if item.moved_m is None else f"{item.moved_m:,.2f}" for item in report.classes]
    names = [item.class_name for item in report.classes]
    totals = [sum(row[at] for row in counts) for at in range(len(CLASS_COUNTS))]
    layers = f"Layers replaced: {', '.join(report.replaced)}."
    if report.kept:
        layers += f" Layers that stay as they were: {', '.join(report.kept)}."
    cells = {
        "before": report.cells_before,
        "after": report.cells,
        "computed again": report.recomputed,
        "changed": report.changed,
        "appeared": report.appeared,
        "vanished": report.vanished,
    }
    return (
        Table(
            "Objects by class",
            ("class", *CLASS_COUNTS, "moved by, m"),
            tuple(
                (name, *(f"{number:,}" for number in row), metres)
                for name, row, metres in zip(
                    [*names, "all"], [*counts, totals], [*moved, ""], strict=True
                )
            ),
            note=layers,
        ),
        Table(
            "Cells",
            ("what", "cells"),
            tuple((name, f"{number:,}") for name, number in cells.items()),
            note=f"The city has drifted by {report.share:.2%} of its cells.",
        ),
    )
