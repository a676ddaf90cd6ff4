from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from semsig_gis.objects.clean import LayerReport
from semsig_gis.objects.conflate import ConflatedPair
from semsig_gis.objects.quality import ClassQuality, QualityReport
from semsig_gis.reports.quality import quality_tables

if TYPE_CHECKING:
    from collections.abc import Callable
from semsig_gis.sources import RowCounts

REPORT = QualityReport(
    classes=(
        ClassQuality(
            class_name="bench",
            objects=1300,
            rows=1400,
            per_km2_hull=None,
            per_km2_occupied=65.0,
            nearest_m=12.25,
        ),
    ),
    absent=("alignment_tree", "taxi_station"),
    sources=(
        LayerReport(
            name="city",
            counts=RowCounts(
                read=1405,
                unreadable=1,
                filtered=2,
                missing=1,
                misplaced=1,
                collapsed=50,
                conflated=50,
            ),
            notes=("row 9: broken", "old"),
        ),
    ),
    conflated=(
        ConflatedPair(
            class_name="bench",
            merged="osm",
            kept="city",
            radius=5.0,
            count=1,
            median_m=2.0,
            largest_m=2.5,
        ),
    ),
    crs="EPSG:2154",
    extent=(770000.4, 6280000.0, 771000.0, 6281000.0),
    extent_degrees=(3.87, 43.6, 3.88, 43.61),
    hull_km2=0.5,
    occupied_km2=20.0,
    licenses=("Town: CC0",),
)


def test_tables(snapshot: Callable[[str, str], None]) -> None:
    tables = quality_tables(REPORT)
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    snapshot("quality.md", "\n".join(table.markdown() for table in tables))


def test_what_there_is_nothing_of_is_left_out() -> None:
    tables = quality_tables(replace(REPORT, conflated=(), absent=()))
    titles = [table.title for table in tables]
    assert titles == ["Objects by class", "Rows by layer", "Place", "Licences"]
    assert tables[0].note.endswith("of the class.")
