"""Tables of a quality report and of an update."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING

from semsig_gis.core import Table, percent
from semsig_gis.objects import SQUARE_M
from semsig_gis.output.tables.tables import brief_notes, distortion_rows, note_tables
from semsig_gis.sources import RowCounts

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.database import UpdateReport
    from semsig_gis.objects import QualityReport


ROW_COUNTS = tuple(field.name for field in fields(RowCounts))
FREQUENT = 3  # classes in the sentence of a load
NOTES_SHOWN = 4  # per layer; one with many unreadable rows would have too many
# Tables that are omitted when they have no rows.
MAY_BE_EMPTY = frozenset(
    {"Objects by family", "Notes by layer", "Texts", "Conflated", "Layers not read"}
)
EMPTY_NAMED = 12  # layers without rows that are named
# Rows that a load loses though the catalogue asks for them.
LOST = {
    "unreadable": "unreadable",
    "missing": "without a position",
    "outside": "outside the area",
    "misplaced": "off the Earth or far from all others",
    "duplicates": "with the id of another row",
}


def quality_tables(report: QualityReport) -> tuple[Table, ...]:
    """Return the tables of a quality report: classes, layers, conflation, place and licences.

    Parameters
    ----------
    report : QualityReport
        Result of `quality_report`.

    Returns
    -------
    tuple of Table
        Four tables; if there are any, also a table of families, of notes by layer, of texts, of
        layers that were not read, of conflated objects and of notes.

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
        _family_table(report),
        _class_table(report),
        _layer_table(report),
        Table("Notes by layer", ("layer", "note"), tuple(_layer_notes(report)), labels=2),
        Table(
            "Layers not read",
            ("layer", "class", "objects"),
            tuple(
                (
                    item.name,
                    ", ".join(item.classes),
                    "not counted" if item.objects is None else f"{item.objects:,}",
                )
                for item in report.unread
            ),
            note=(
                "Add one with --layer +NAME, or all with --all-layers. The counts are rows "
                "that would be kept, before objects at one place are collapsed."
            ),
            labels=2,
        ),
        Table(
            "Texts",
            ("column", "objects", "bytes"),
            tuple((item.name, f"{item.objects:,}", f"{item.bytes:,}") for item in report.texts),
            note="What is written on objects, and about what it adds to the file.",
        ),
        Table(
            "Conflated",
            ("class", "from", "into", "objects", "radius, m", "median, m", "largest, m"),
            tuple(
                (
                    *(item.class_name, item.merged, item.kept, f"{item.count:,}"),
                    *map(_decimal_text, (item.radius, item.median_m, item.largest_m)),
                )
                for item in report.conflated
            ),
            minor=("radius, m",),
        ),
        Table(
            "Place",
            ("what", "value"),
            (
                ("where", str(report.town)),
                ("coordinate system", report.crs),
                (f"{sides}, m", ", ".join(f"{edge:.0f}" for edge in report.extent)),
                (f"{sides}, degrees", ", ".join(f"{edge:.5f}" for edge in report.extent_degrees)),
                *distortion_rows(report.distortion.to_dict()),
            ),
        ),
        Table("Licences", ("licence",), tuple((line,) for line in report.licenses)),
        *note_tables(report.notes),
    )
    return tuple(table for table in tables if table.rows or table.title not in MAY_BE_EMPTY)


def _family_table(report: QualityReport) -> Table:
    """Return the objects of families, if there are several."""
    families = dict.fromkeys(item.family for item in report.classes)
    members = {
        family: [item for item in report.classes if item.family == family]
        for family in (families if len(families) > 1 else ())
    }
    points = any(item.points for item in report.classes)
    return Table(
        "Objects by family",
        ("family", "classes", "objects", *(["points"] if points else []), "per km² occupied"),
        tuple(
            (
                family or "none",
                f"{len(items):,}",
                f"{sum(item.objects for item in items):,}",
                *([_points_text(sum(item.points for item in items))] if points else []),
                _decimal_text(sum(item.per_km2_occupied for item in items)),
            )
            for family, items in members.items()
        ),
    )


def _points_text(number: int) -> str:
    return f"{number:,}" if number else ""


def _class_table(report: QualityReport) -> Table:
    absent = f" No objects of: {', '.join(report.absent)}." if report.absent else ""
    points = any(item.points for item in report.classes)
    return Table(
        "Objects by class",
        (
            *("class", "objects", *(["points"] if points else []), "rows"),
            *("per km² of hull", "per km² occupied", "nearest, m"),
        ),
        tuple(
            (
                *(item.title.lower(), f"{item.objects:,}"),
                *([_points_text(item.points)] if points else []),
                f"{item.rows:,}",
                *map(_decimal_text, (item.per_km2_hull, item.per_km2_occupied, item.nearest_m)),
            )
            for item in report.classes
        ),
        note=(
            f"The convex hull of all objects is {report.hull_km2:,.2f} km², ground without objects "
            f"included; the squares of {SQUARE_M:.0f} m that contain an object are "
            f"{report.occupied_km2:,.2f} km². Nearest: the median distance to the nearest other "
            f"object of the class.{absent}"
        ),
        minor=("per km² of hull", "rows") if points else (),
    )


def _layer_table(report: QualityReport) -> Table:
    filled = [item for item in report.sources if item.counts.read]
    counts = [asdict(item.counts) for item in filled]
    # Columns that are 0 in all layers are listed below the table to save width.
    zero = [name for name in ROW_COUNTS[1:] if not any(count[name] for count in counts)]
    columns = [name for name in ROW_COUNTS if name not in zero]
    notes = [f"0 in all layers: {', '.join(zero)}."] if zero else []
    empty = [item.name for item in report.sources if not item.counts.read]
    if empty:
        more = f" and {len(empty) - EMPTY_NAMED} more" if len(empty) > EMPTY_NAMED else ""
        are = "1 layer is" if len(empty) == 1 else f"{len(empty)} layers are"
        notes.append(f"{are} empty: {', '.join(empty[:EMPTY_NAMED])}{more}.")
    return Table(
        "Rows by layer",
        ("layer", *columns, "kept"),
        tuple(
            (item.name, *(f"{count[name]:,}" for name in columns), f"{item.counts.kept:,}")
            for item, count in zip(filled, counts, strict=True)
        ),
        note=" ".join(notes),
        minor=tuple(columns[1:]),
    )


def _layer_notes(report: QualityReport) -> Iterator[tuple[str, str]]:
    """Yield each note with the layers that it is about."""
    layers: dict[str, list[str]] = {}
    for item in report.sources:
        if item.counts.read:
            for note in _shown_notes(item.notes):
                layers.setdefault(note, []).append(item.name)
    yield from ((", ".join(dict.fromkeys(names)), note) for note, names in layers.items())


def _decimal_text(number: float | None) -> str:
    return "" if number is None else f"{number:,.1f}"


def _shown_notes(layer_notes: Sequence[str]) -> list[str]:
    """Return the notes on a layer, at most `NOTES_SHOWN`, and no rows if their causes are noted."""
    notes = list(brief_notes(layer_notes))
    if any(note.startswith("unreadable: ") for note in notes):
        notes = [note for note in notes if not note.startswith("row ")]
    more = len(notes) - NOTES_SHOWN
    return [*notes[:NOTES_SHOWN], *([f"and {more} more (--json)"] if more > 0 else [])]


def quality_sentence(report: QualityReport) -> str:
    """Return the number of objects of a load, on how much ground, and the frequent classes."""
    frequent = sorted(report.classes, key=lambda item: -item.objects)[:FREQUENT]
    names = ", ".join(f"{item.title.lower()} ({item.objects:,})" for item in frequent)
    rest = len(report.classes) - len(frequent)
    more = f" and {rest:,} more class{'es' if rest > 1 else ''}" if rest else ""
    return (
        f"{_many(report.objects, 'street object')} of {_many(len(report.classes), 'class', 'es')} "
        f"on {report.hull_km2:,.2f} km² {report.town}: {names}{more}.{_origins(report)}"
    )


def lost_sentence(report: QualityReport) -> str:
    """Return how many rows of all layers are lost and why; empty if none is."""
    totals = {
        words: sum(getattr(item.counts, name) for item in report.sources)
        for name, words in LOST.items()
    }
    counts = [f"{number:,} {words}" for words, number in totals.items() if number]
    return f"Rows left out: {', '.join(counts)}; --tables lists them by layer." if counts else ""


def _origins(report: QualityReport) -> str:
    """Return a sentence on extended things, fronts and derived objects, if there are any."""
    extended = [item for item in report.classes if item.points]
    parts = []
    if extended:
        things = sum(item.objects for item in extended)
        points = sum(item.points for item in extended)
        parts.append(f"{_many(things, 'extended thing')} as {_many(points, 'point')}")
    if report.fronts:
        parts.append(f"{report.fronts:,} moved to the fronts of their buildings")
    if report.derived:
        parts.append(f"{report.derived:,} computed from streets and buildings")
    return f" Of these, {', '.join(parts)}." if parts else ""


def _many(number: int, noun: str, ending: str = "s") -> str:
    return f"{number:,} {noun}{'' if number == 1 else ending}"


def update_sentence(report: UpdateReport) -> str:
    """Return how many cells an update changed."""
    return (
        f"{report.changed:,} of {report.cells:,} cells changed, {report.appeared:,} appeared and "
        f"{report.vanished:,} vanished: the city has drifted by {percent(report.share, 2)}."
    )


CLASS_COUNTS = ("before", "after", "added", "removed", "moved", "gained", "lost")


def update_tables(report: UpdateReport) -> tuple[Table, Table]:
    """Return the tables of an update: objects by class, and cells."""
    counts = [[getattr(item, count) for count in CLASS_COUNTS] for item in report.classes]
    metres = ["" if item.moved_m is None else f"{item.moved_m:,.2f}" for item in report.classes]
    names = [item.class_name for item in report.classes]
    totals = [sum(row[column] for row in counts) for column in range(len(CLASS_COUNTS))]
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
                (name, *(f"{number:,}" for number in row), distance)
                for name, row, distance in zip(
                    [*names, "all"], [*counts, totals], [*metres, ""], strict=True
                )
            ),
            note=layers,
        ),
        Table(
            "Cells",
            ("what", "cells"),
            tuple((name, f"{number:,}") for name, number in cells.items()),
            note=f"The city has drifted by {percent(report.share, 2)} of its cells.",
        ),
    )
