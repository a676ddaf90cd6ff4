from __future__ import annotations

from dataclasses import replace

from semsig_gis.objects.clean import LayerReport
from semsig_gis.objects.conflate import ConflatedPair
from semsig_gis.objects.quality import ClassQuality, QualityReport
from semsig_gis.reports.quality import quality_tables
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


def test_a_report_becomes_tables() -> None:
    classes, layers, conflated, place, licences = quality_tables(REPORT)
    for table in (classes, layers, conflated, place, licences):
        assert all(len(row) == len(table.columns) for row in table.rows), table.title
        assert table.markdown()
    assert classes.rows == (("bench", "1,300", "1,400", "", "65.0", "12.2"),)
    assert "convex hull of all objects is 0.50 km²" in classes.note
    assert "squares of 100 m that hold an object are 20.00 km²" in classes.note
    assert classes.note.endswith("class. No objects of: alignment_tree, taxi_station.")
    assert dict(zip(layers.columns, layers.rows[0], strict=True)) == {
        "layer": "city",
        "read": "1,405",
        "unreadable": "1",
        "filtered": "2",
        "missing": "1",
        "duplicates": "0",
        "misplaced": "1",
        "collapsed": "50",
        "conflated": "50",
        "objects": "1,300",
        "notes": "row 9: broken; old",
    }
    assert conflated.rows == (("bench", "osm", "city", "1", "5.0", "2.0", "2.5"),)
    assert [row[1] for row in place.rows] == [
        "EPSG:2154",
        "770000, 6280000, 771000, 6281000",
        "3.87000, 43.60000, 3.88000, 43.61000",
    ]
    assert licences.rows == (("Town: CC0",),)


def test_what_there_is_nothing_of_is_left_out() -> None:
    tables = quality_tables(replace(REPORT, conflated=(), absent=()))
    assert [table.title for table in tables] == [
        *("Objects by class", "Rows by layer", "Place", "Licences")
    ]
    assert tables[0].note.endswith("of the class.")
