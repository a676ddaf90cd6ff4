from __future__ import annotations

import dataclasses
import json
import math
from statistics import median
from typing import TYPE_CHECKING

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from raw_layers import raw_layer

from semsig_gis.objects import StreetObjects, build_objects, conflate, quality_report
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.objects import LoadReport, QualityReport
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


def built(*layers: RawLayer, collapse: bool = True) -> tuple[StreetObjects, LoadReport]:
    return build_objects(layers, taxonomy=TAXONOMY, crs="EPSG:2154", collapse=collapse)


def report_on(*layers: RawLayer, **radii: float) -> QualityReport:
    objects, load = built(*layers)
    merged, conflation = conflate(objects, radii)
    return quality_report(merged, load, conflation)


def test_objects_of_each_class_are_counted() -> None:
    square = [(X, Y), (X + 1000, Y), (X + 1000, Y + 1000), (X, Y + 1000), (X, Y)]
    report = report_on(
        layer(square, name="benches"),
        layer([(X + 500, Y + 500)], name="stops", class_name="bus_stop"),
    )
    # Five squares of a hectare each, whatever their classes.
    assert [dataclasses.astuple(item)[:-2] for item in report.classes] == [
        pytest.approx(("bench", "Bench", 4, 5, 4.0, 80.0, 1000.0)),
        pytest.approx(("bus_stop", "Bus stop", 1, 1, 1.0, 20.0, None)),
    ]
    assert report.objects == 5
    assert (report.hull_km2, report.occupied_km2) == pytest.approx((1.0, 0.05))
    # A class of a layer without objects is absent; a class of no layer is not.
    assert report.absent == ()
    assert report_on(layer(square), layer([])).absent == ("alignment_tree",)


def test_hull_of_objects_in_a_line_has_no_area() -> None:
    for places in ([(X, Y)], [(X, Y), (X + 50, Y), (X + 99, Y)]):
        report = report_on(layer(places))
        assert report.hull_km2 == 0
        assert report.classes[0].per_km2_hull is None
        assert report.classes[0].per_km2_occupied == pytest.approx(100 * len(places))


def test_occupied_squares_are_counted_for_negative_coordinates() -> None:
    objects, load = built(layer([(X, Y), (X + 1, Y)]))
    shifted = objects.table.set_geometry(shapely.points([[-1.0, 5.0], [1.0, 5.0]]), crs=objects.crs)
    report = quality_report(StreetObjects(shifted, TAXONOMY, ()), load)
    assert report.occupied_km2 == pytest.approx(0.02)


def test_report_equals_the_snapshot(snapshot: Callable[[str, str], None]) -> None:
    places = [(X, Y), (X, Y), None, (math.inf, Y), (X + 50, Y + 30), (X, Y + 70), (X + 80, Y)]
    plain = report_on(
        layer(places, notes=("odd",)),
        # Layers of one name share what was conflated.
        layer([(X + 1, Y)], name="osm"),
        layer([(X + 50, Y + 32), (X + 80, Y + 4), (X + 20, Y)], name="osm"),
        bench=5.0,
    ).to_dict()
    west, south, east, north = plain.pop("extent_degrees")
    assert 3.86 < west < east < 3.88
    assert 43.60 < south < north < 43.62
    assert plain.pop("distortion")["angle"] == pytest.approx(0.63, abs=0.01)
    town = plain.pop("town")
    assert (town["name"], town["country"]) == ("Montpellier", "France")
    assert town["distance_km"] < 5.0
    snapshot("quality.json", json.dumps(plain, indent=1) + "\n")


def test_crs_without_a_code_is_reported_by_name() -> None:
    own = CRS("+proj=tmerc +lat_0=43.6 +lon_0=3.9").to_wkt().replace("unknown", "Our town", 1)
    objects, load = build_objects([layer([(X, Y)])], taxonomy=TAXONOMY, crs=own)
    assert quality_report(objects, load).crs == "Our town"


PLACES = st.tuples(st.integers(0, 9), st.integers(0, 9)).map(lambda at: (X + at[0], Y + at[1]))


@given(places=st.lists(PLACES, min_size=1, max_size=20), collapse=st.booleans())
def test_nearest_distance_equals_a_simple_loop(
    *, places: list[tuple[float, float]], collapse: bool
) -> None:
    objects, load = built(layer(places), collapse=collapse)
    (benches,) = quality_report(objects, load).classes
    points = objects.xy.tolist()
    nearest = [
        min(math.dist(point, other) for other in points[:row] + points[row + 1 :])
        for row, point in enumerate(points)
        if len(points) > 1
    ]
    assert benches.nearest_m == (pytest.approx(median(nearest)) if nearest else None)
    assert benches.rows == len(places)
