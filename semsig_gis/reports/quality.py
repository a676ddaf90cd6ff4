"""What a load of street objects is worth, and what an update changed, as figures and tables.

A density needs an area, and nothing in the data says which. Two are given, and both are named
wherever they are used: the convex hull of all objects, which takes in whatever lies between them
(a river, a park, the sea), and the squares of 100 m on the metric grid that hold an object of any
class, which leave out empty ground but grow with every object. The truth mostly lies between.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from semsig_gis.core import COUNT, Displayed, degree_bounds, percent, plane_distortion
from semsig_gis.reports.tables import Table, brief_notes, distortion_rows, note_tables
from semsig_gis.sources import RowCounts

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Distortion, ObjectClass
    from semsig_gis.database import UpdateReport
    from semsig_gis.objects import (
        ConflatedPair,
        ConflationReport,
        LayerReport,
        LoadReport,
        StreetObjects,
        UnreadLayer,
    )


SQUARE_M = 100.0
M2_PER_KM2 = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassQuality:
    """The objects of one class, after collapsing and conflation, and their density.

    `rows` of the sources stand behind them. `per_km2_hull` is None where the hull has no area;
    `nearest_m` is the median distance to the nearest other object of the class, None for one alone.
    """

    class_name: str
    objects: int
    rows: int
    per_km2_hull: float | None
    per_km2_occupied: float
    nearest_m: float | None


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class QualityReport(Displayed):
    """The quality report of a load.

    `classes` are those with objects in the order of the taxonomy, `absent` those without; `sources`
    stand in the order they were loaded. `crs` is a code, or a name where there is none. Extents are
    west, south, east and north, in metres and in degrees of WGS 84. `hull_km2` is the area of the
    convex hull of all objects, `occupied_km2` that of the squares of 100 m that hold one. `notes`
    are warnings about all of the load; those about a layer stand in `sources`. `absent` are classes
    that were looked for; those of layers in `unread` were not.
    """

    classes: tuple[ClassQuality, ...]
    absent: tuple[str, ...]
    sources: tuple[LayerReport, ...]
    conflated: tuple[ConflatedPair, ...]
    crs: str
    extent: tuple[float, float, float, float]
    extent_degrees: tuple[float, float, float, float]
    distortion: Distortion
    hull_km2: float
    occupied_km2: float
    licenses: tuple[str, ...]
    unread: tuple[UnreadLayer, ...] = ()
    notes: tuple[str, ...] = ()

    def _facts(self) -> dict[str, object]:
        return {
            "objects": self.objects,
            "classes": len(self.classes),
            "absent": len(self.absent),
            "sources": len(self.sources),
            "hull": f"{self.hull_km2:.2f} km²",
            "CRS": self.crs,
            "notes": len(self.notes),
        }

    @property
    def objects(self) -> int:
        """Number of objects of all classes."""
        return sum(item.objects for item in self.classes)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and ``objects``, their number, as plain values for JSON."""
        sources = [
            {"name": item.name}
            | asdict(item.counts)
            | {"kept": item.counts.kept, "role": item.role, "notes": item.notes}
            for item in self.sources
        ]
        distortion = self.distortion.to_dict()
        plain = {**asdict(self), "sources": sources, "distortion": distortion}
        return {"objects": self.objects, **plain}


def quality_report(
    objects: StreetObjects,
    load: LoadReport,
    conflation: ConflationReport | None = None,
    *,
    notes: Sequence[str] = (),
) -> QualityReport:
    """Report on the quality of a load.

    Parameters
    ----------
    objects : StreetObjects
        What was loaded, after conflation if there was one.
    load : LoadReport
        What `build_objects` says of the layers.
    conflation : ConflationReport, optional
        What `conflate` says, if it was used.
    notes : sequence of str
        Warnings about all of the load.

    Returns
    -------
    QualityReport
        The report.

    Examples
    --------
    >>> from semsig_gis import CitySpec, assemble, load_catalog, quality_report, synthetic_city
    >>> loaded = assemble(synthetic_city(CitySpec(size=300.0)), load_catalog("openstreetmap"))
    >>> quality_report(loaded.objects, loaded.report).classes[0].class_name
    'alignment_tree'
    """
    xy = objects.xy
    hull_km2 = float(shapely.area(shapely.convex_hull(shapely.multipoints(xy)))) / M2_PER_KM2
    squares = np.unique(np.floor(xy / SQUARE_M), axis=0)
    occupied_km2 = len(squares) * SQUARE_M**2 / M2_PER_KM2
    west, south = xy.min(axis=0).tolist()
    east, north = xy.max(axis=0).tolist()
    pairs = conflation.pairs if conflation is not None else ()
    present = set(np.unique(objects.codes).tolist())
    looked_for = {name for layer in load.layers for name in layer.classes}
    return QualityReport(
        classes=tuple(
            _class_quality(objects, item, hull_km2=hull_km2, occupied_km2=occupied_km2)
            for item in objects.taxonomy.classes
            if item.code in present
        ),
        absent=tuple(
            item.name
            for item in objects.taxonomy.classes
            if item.name in looked_for and item.code not in present
        ),
        sources=tuple(_sources(load.layers, pairs)),
        conflated=pairs,
        crs=f"EPSG:{code}" if (code := objects.crs.to_epsg()) else objects.crs.name,
        extent=(west, south, east, north),
        extent_degrees=degree_bounds(objects.crs, (west, south, east, north)),
        distortion=plane_distortion(objects.crs, (west, south, east, north)),
        hull_km2=hull_km2,
        occupied_km2=occupied_km2,
        licenses=tuple(map(str, objects.licenses)),
        unread=load.unread,
        notes=tuple(notes),
    )


def _class_quality(
    objects: StreetObjects, item: ObjectClass, *, hull_km2: float, occupied_km2: float
) -> ClassQuality:
    members = objects.codes == item.code
    number = int(members.sum())
    return ClassQuality(
        class_name=item.name,
        objects=number,
        rows=int(objects.table[COUNT].to_numpy(np.int64)[members].sum()),
        per_km2_hull=number / hull_km2 if hull_km2 > 0 else None,
        per_km2_occupied=number / occupied_km2,
        nearest_m=_nearest(objects.xy[members]),
    )


def _nearest(xy: NDArray[np.float64]) -> float | None:
    """Return the median distance to the nearest other point."""
    if len(xy) == 1:
        return None
    places, counts = np.unique(xy, axis=0, return_counts=True)
    alone = counts == 1
    # Points that share their place are at no distance; the tree passes over equal points.
    distances = np.zeros(len(xy))
    if alone.any():
        points = np.asarray(shapely.points(places))
        _, nearest = shapely.STRtree(points).query_nearest(
            points[alone], exclusive=True, all_matches=False, return_distance=True
        )
        distances[: len(nearest)] = nearest
    return float(np.median(distances))


def _sources(
    layers: Sequence[LayerReport], pairs: Iterable[ConflatedPair]
) -> Iterator[LayerReport]:
    """Yield what became of the rows of every layer, with those that were merged into others."""
    merged: Counter[str] = Counter()
    for pair in pairs:
        merged[pair.merged] += pair.count
    for layer in layers:
        # Layers of one name are one source to conflation: the first has given what it can.
        conflated = min(layer.counts.kept, merged[layer.name])
        merged[layer.name] -= conflated
        yield replace(layer, counts=replace(layer.counts, conflated=conflated))


ROW_COUNTS = tuple(field.name for field in fields(RowCounts))
# A table has no room for all that is said of a layer with many unreadable rows.
NOTES_SHOWN = 4
# Tables that are left out where they have nothing to say.
MAY_BE_EMPTY = frozenset({"Conflated", "Layers not read"})


def quality_tables(report: QualityReport) -> tuple[Table, ...]:
    """Return objects by class, rows by layer, what was not read or conflated, place and licences.

    Parameters
    ----------
    report : QualityReport
        What `quality_report` gives.

    Returns
    -------
    tuple of Table
        Four tables, and one more with layers that were not read, with conflated objects and with
        notes about all of the load.

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
        _layer_table(report),
        Table(
            "Layers not read",
            ("layer", "class", "objects"),
            tuple(
                (item.name, ", ".join(item.classes), _count_text(item.objects))
                for item in report.unread
            ),
            note=(
                "Add one with --layer +NAME, or all with --all-layers. The counts are rows "
                "that would be kept, before objects at one place are collapsed."
            ),
            labels=2,
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
                *distortion_rows(report.distortion.to_dict()),
            ),
        ),
        Table("Licences", ("licence",), tuple((line,) for line in report.licenses)),
        *note_tables(report.notes),
    )
    return tuple(table for table in tables if table.rows or table.title not in MAY_BE_EMPTY)


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
            f"included; the squares of {SQUARE_M:.0f} m that contain an object are "
            f"{report.occupied_km2:,.2f} km². Nearest: the median distance to the nearest other "
            f"object of the class.{absent}"
        ),
    )


def _layer_table(report: QualityReport) -> Table:
    counts = [asdict(item.counts) for item in report.sources]
    # Most loads have a few reasons only; a terminal has no room for columns of zeros.
    none = [name for name in ROW_COUNTS[1:] if not any(count[name] for count in counts)]
    shown = [name for name in ROW_COUNTS if name not in none]
    return Table(
        "Rows by layer",
        ("layer", *shown, "kept", "notes"),
        tuple(
            (
                item.name,
                *(f"{count[name]:,}" for name in shown),
                *(f"{item.counts.kept:,}", _notes_text(item.notes)),
            )
            for item, count in zip(report.sources, counts, strict=True)
        ),
        note=f"0 in all layers: {', '.join(none)}." if none else "",
    )


def _text(number: float | None) -> str:
    return "" if number is None else f"{number:,.1f}"


def _count_text(number: int | None) -> str:
    return "not counted" if number is None else f"{number:,}"


def _notes_text(all_notes: Sequence[str]) -> str:
    notes = list(brief_notes(all_notes))
    more = len(notes) - NOTES_SHOWN
    return "; ".join([*notes[:NOTES_SHOWN], *([f"and {more} more (--json)"] if more > 0 else [])])


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
            note=f"The city has drifted by {percent(report.share, 2)} of its cells.",
        ),
    )
