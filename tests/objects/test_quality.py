from __future__ import annotations

import json
import math
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from raw_layers import raw_layer

from semsig_gis.objects.conflate import conflate
from semsig_gis.objects.load import build_objects, choose_layers
from semsig_gis.objects.table import StreetObjects
from semsig_gis.reports.quality import quality_report
from semsig_gis.sources import RowCounts, find_files
from semsig_gis.sources.catalog import load_catalog, paper_taxonomy
from semsig_gis.sources.vector import read_layer

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from semsig_gis.objects.load import LoadReport
    from semsig_gis.reports.quality import QualityReport
    from semsig_gis.sources import RawLayer

TAXONOMY = paper_taxonomy()
# Montpellier, in the plane of France.
X, Y = 770_000.0, 6_280_000.0


def layer(
    places: Sequence[tuple[float, float] | None],
    *,
    name: str = "city",
    class_name: str = "bench",
    notes: tuple[str, ...] = (),
) -> RawLayer:
    geometry = [None if place is None else shapely.Point(*place) for place in places]
    return raw_layer(geometry, name=name, classes=class_name, filtered=2, unreadable=1, notes=notes)


def built(*layers: RawLayer) -> tuple[StreetObjects, LoadReport]:
    return build_objects(layers, taxonomy=TAXONOMY, crs="EPSG:2154")


def report_on(*layers: RawLayer, **radii: float) -> QualityReport:
    objects, load = built(*layers)
    merged, conflation = conflate(objects, radii)
    return quality_report(merged, load, conflation)


def test_the_objects_of_a_class_are_counted() -> None:
    square = [(X, Y), (X + 1000, Y), (X + 1000, Y + 1000), (X, Y + 1000), (X, Y)]
    report = report_on(
        layer(square, name="benches"),
        layer([(X + 500, Y + 500)], name="stops", class_name="bus_stop"),
    )
    benches, stops = report.classes
    assert (benches.class_name, benches.objects, benches.rows) == ("bench", 4, 5)
    assert (stops.class_name, stops.objects, stops.rows) == ("bus_stop", 1, 1)
    assert report.objects == 5
    assert report.hull_km2 == pytest.approx(1.0)
    assert (benches.per_km2_hull, benches.nearest_m) == pytest.approx((4.0, 1000.0))
    assert stops.nearest_m is None
    # Five squares of a hectare each, whatever their classes.
    assert report.occupied_km2 == pytest.approx(0.05)
    assert benches.per_km2_occupied == pytest.approx(80.0)
    assert stops.per_km2_occupied == pytest.approx(20.0)
    assert set(report.absent) == {item.name for item in TAXONOMY.classes} - {"bench", "bus_stop"}


def test_a_line_of_objects_has_no_area_of_its_own() -> None:
    for places in ([(X, Y)], [(X, Y), (X + 50, Y), (X + 99, Y)]):
        report = report_on(layer(places))
        assert report.hull_km2 == 0
        assert report.classes[0].per_km2_hull is None
        assert report.classes[0].per_km2_occupied == pytest.approx(100 * len(places))


def test_squares_are_counted_on_both_sides_of_zero() -> None:
    objects, load = built(layer([(X, Y), (X + 1, Y)]))
    moved = objects.table.set_geometry(shapely.points([[-1.0, 5.0], [1.0, 5.0]]), crs=objects.crs)
    report = quality_report(StreetObjects(moved, TAXONOMY, ()), load)
    assert report.occupied_km2 == pytest.approx(0.02)


def test_what_was_dropped_is_told_by_layer() -> None:
    city = layer([(X, Y), (X, Y), None, (math.inf, Y), (X + 50, Y)], notes=("odd",))
    osm = layer([(X + 2, Y), (X + 90, Y)], name="osm")
    report = report_on(city, osm, bench=5.0)
    first, second = report.sources
    assert (first.name, first.counts.kept) == ("city", 2)
    assert first.counts == RowCounts(
        read=8, unreadable=1, filtered=2, missing=1, misplaced=1, collapsed=1
    )
    assert first.notes == ("odd", "row 0: broken")
    assert (second.counts.read, second.counts.conflated, second.counts.kept) == (5, 1, 1)
    (pair,) = report.conflated
    assert (pair.kept, pair.merged, pair.count) == ("city", "osm", 1)
    assert report.licenses == ("Town (CC0): city, osm",)


def test_layers_of_one_name_share_what_was_conflated() -> None:
    report = report_on(
        layer([(X, Y), (X + 20, Y), (X + 40, Y)]),
        layer([(X + 1, Y)], name="osm"),
        layer([(X + 21, Y), (X + 41, Y), (X + 60, Y)], name="osm"),
        bench=5.0,
    )
    counts = [item.counts for item in report.sources]
    assert [(item.conflated, item.kept) for item in counts] == [(0, 3), (1, 0), (2, 1)]


def test_the_place_is_told_in_metres_and_degrees() -> None:
    report = report_on(layer([(X, Y), (X + 100, Y + 200)]))
    assert report.crs == "EPSG:2154"
    assert report.extent == (X, Y, X + 100, Y + 200)
    west, south, east, north = report.extent_degrees
    assert 3.86 < west < east < 3.88
    assert 43.60 < south < north < 43.62


def test_a_system_without_a_code_is_told_by_name() -> None:
    own = CRS("+proj=tmerc +lat_0=43.6 +lon_0=3.9").to_wkt().replace("unknown", "Our town", 1)
    objects, load = build_objects([layer([(X, Y)])], taxonomy=TAXONOMY, crs=own)
    assert quality_report(objects, load).crs == "Our town"


@given(
    st.lists(
        st.tuples(st.integers(0, 9), st.integers(0, 9)).map(lambda at: (X + at[0], Y + at[1])),
        min_size=1,
        max_size=20,
    ),
    st.booleans(),
)
def test_the_nearest_neighbour_is_that_of_a_plain_loop(
    places: list[tuple[float, float]],
    collapse: bool,  # noqa: FBT001
) -> None:
    objects, load = build_objects(
        [layer(places)], taxonomy=TAXONOMY, crs="EPSG:2154", collapse=collapse
    )
    (benches,) = quality_report(objects, load).classes
    places_left = objects.xy.tolist()
    nearest = [
        min(math.dist(one, other) for j, other in enumerate(places_left) if j != i)
        for i, one in enumerate(places_left)
        if len(places_left) > 1
    ]
    assert benches.nearest_m == (pytest.approx(median(nearest)) if nearest else None)
    assert benches.rows == len(places)


def test_the_report_is_ready_for_json() -> None:
    report = report_on(
        layer([(X, Y), (X + 50, Y + 30), (X, Y + 70)]),
        layer([(X + 2, Y)], name="osm"),
        bench=5.0,
    )
    plain = json.loads(json.dumps(report.to_dict()))
    assert plain["objects"] == 3
    assert plain["classes"][0]["class_name"] == "bench"
    assert plain["conflated"][0]["count"] == 1


def test_montpellier(geodata: Path) -> None:
    catalog = load_catalog("montpellier")
    pairs, _ = find_files(choose_layers(catalog), [geodata / "montpellier"])
    layers = [read_layer(path, spec) for spec, path in pairs]
    objects, load = build_objects(layers, taxonomy=catalog.taxonomy, crs=catalog.metric_crs or "")
    report = quality_report(objects, load)
    assert sum(item.counts.kept for item in report.sources) == report.objects == len(objects)
    assert sum(item.objects for item in report.classes) == len(objects)
    by_name = {item.class_name: item for item in report.classes}
    assert by_name["alignment_tree"].objects == 23_972
    assert by_name["alignment_tree"].nearest_m == pytest.approx(6.5, abs=0.1)
    assert by_name["parking_meter"].rows == 823
    assert by_name["parking_meter"].objects == 701
    # The commune has 57 km2; the hull of its objects is of that size, what is lit is less.
    assert 40 < report.hull_km2 < 80
    squares = {(int(x // 100), int(y // 100)) for x, y in objects.xy.tolist()}
    assert report.occupied_km2 == pytest.approx(len(squares) / 100)
    assert report.occupied_km2 < report.hull_km2
    assert np.allclose(report.extent_degrees, (3.81, 43.57, 3.94, 43.65), atol=0.02)
