"""Tables of an update: what changed in a city, and how much of the database with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.reports.tables import Table

if TYPE_CHECKING:
    from semsig_gis.database.update import UpdateReport

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
