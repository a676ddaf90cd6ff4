from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from pyproj import CRS, Geod, Proj, Transformer
from raw_layers import catalog_of, raw_layer
from sentences import refused

from semsig_gis.core import (
    CrsError,
    EmptyResultError,
    InputError,
    angular_distance,
    grid_convergence,
    wrap_degrees,
)
from semsig_gis.database import build_database
from semsig_gis.objects import assemble, settle_extent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.objects import Loaded
    from semsig_gis.sources import RawLayer

HELSINKI, PARIS, BERLIN, LYON = (24.94, 60.17), (2.35, 48.86), (13.4, 52.52), (4.83, 45.76)
SYDNEY, TAVEUNI, ACCRA = (151.2, -33.87), (180.0, -16.8), (-0.19, 5.6)
MONTPELLIER = (3.88, 43.61)
LAMBERT = Transformer.from_crs(4326, 2154, always_xy=True)
# What a shapefile states that was made by ESRI's software: no code, no area.
ESRI = CRS.from_user_input(CRS(2154).to_wkt("WKT1_ESRI").replace("RGF_1993", "RGF93_of_ours"))


def town(
    centre: tuple[float, float], *, size: int = 40, km: float = 2.0, seed: int = 1
) -> NDArray[np.float64]:
    """Return places around a centre, longitude and latitude, shape (size, 2)."""
    longitude, latitude = centre
    offsets = np.random.default_rng(seed).uniform(-0.5, 0.5, (size, 2)) * km / 111.2
    offsets[:, 0] /= np.cos(np.radians(latitude))
    turned = (longitude + offsets[:, 0] + 180.0) % 360.0 - 180.0
    return np.column_stack([turned, latitude + offsets[:, 1]])


def layer(
    *places: NDArray[np.float64] | Sequence[tuple[float, float]],
    name: str = "a",
    crs: object = "EPSG:4326",
) -> RawLayer:
    points = shapely.points(np.concatenate([np.reshape(part, (-1, 2)) for part in places]))
    return raw_layer(list(points), name=name, classes="bench", crs=crs)  # type: ignore[arg-type]


def lambert(places: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack(LAMBERT.transform(*places.T))


def loaded(*layers: RawLayer, **options: object) -> Loaded:
    return assemble(layers, catalog_of(), collapse=False, **options)  # type: ignore[arg-type]


ZERO = [(0.0, 0.0)]
STRAYS = {  # rows with the strays last; number of strays; text about their places
    "null island": ((town(HELSINKI), ZERO), 1, "latitude 0, longitude 0"),
    "in the same zone": ((town(ACCRA), ZERO * 3), 3, "latitude 0, longitude 0"),
    "in a small table": ((town(HELSINKI, size=3), ZERO), 1, "latitude 0"),
    "more rows than the city": ((town(HELSINKI), ZERO * 90), 90, "latitude 0"),
    "here and there": ((town(PARIS), [(99, 0), (1, 1), (50, 8), (9, 9)]), 4, "and 1 more places"),
    "from across 180 degrees": ((town(TAVEUNI), ZERO), 1, "longitude 0"),
    "two of a large city": ((town(PARIS, size=900), [(9, 9), (9.1, 9)]), 2, "longitude 9"),
}


@pytest.mark.parametrize(("parts", "strays", "words"), STRAYS.values(), ids=STRAYS)
@pytest.mark.parametrize("metric", [None, "own"])
def test_rows_far_from_all_others_are_misplaced(
    parts: tuple[NDArray[np.float64], ...], strays: int, words: str, metric: str | None
) -> None:
    """They change neither the metric CRS nor where anything else lies."""
    clean = loaded(layer(parts[0])).objects
    whole = loaded(layer(*parts), metric_crs=metric and clean.crs.to_string())
    np.testing.assert_array_equal(whole.objects.xy, clean.xy)
    assert whole.objects.crs == clean.crs
    (report,) = whole.report.layers
    assert (report.counts.misplaced, report.counts.kept) == (strays, len(parts[0]))
    assert f"{strays} row" in report.notes[0]
    assert "far from all others" in report.notes[0]
    assert words in report.notes[0]
    assert whole.objects.notes == (f"a: {report.notes[0]}",)


FITTING = {  # layers, the CRS to work in, and the CRS that it is in the end
    "a border between zones": ([layer(town((6.0, 60.2)))], None, 32632),
    "a region of 200 km": ([layer(town((5.9, 60.2), size=900, km=200.0))], None, 32631),
    "the same further north": ([layer(town((17.9, 69.7), size=900, km=200.0))], None, 32633),
    "two rows": ([layer([(9, 45.0), (9.1, 45.0)])], None, 32632),
    "a town in the next zone": ([layer(town((6.2, 48.9)))], 32631, 32631),
    "latitude first, as EPSG has it": ([layer(town(PARIS), crs="EPSG:4326")], None, 32631),
    "no code, no area": ([layer(lambert(town(PARIS)), crs=ESRI)], 2154, 2154),
    "Fiji's own": ([layer(town(TAVEUNI), crs="EPSG:4326")], 3460, 3460),
    "a row in a layer of its own": ([layer(town(PARIS)), layer(ZERO, name="b")], None, 32631),
}


@pytest.mark.parametrize(("layers", "metric", "code"), FITTING.values(), ids=FITTING)
def test_plausible_layers_do_not_change(
    layers: list[RawLayer], metric: int | None, code: int
) -> None:
    settled, crs, notes = settle_extent(layers, crs=None if metric is None else f"EPSG:{metric}")
    assert (crs.to_epsg(), notes) == (code, ())
    assert len(settled[0].table) == len(layers[0].table)


def swapped(places: NDArray[np.float64]) -> NDArray[np.float64]:
    return places[:, ::-1]


REFUSED = {  # layers, the metric CRS, words
    "x and y of degrees": (
        [layer(swapped(town(HELSINKI)))],
        "EPSG:3067",
        ["longitude 60.1", "EPSG:3067", "with x and y exchanged", "longitude 24.9", "x_field"],
    ),
    "x and y of one layer": (
        [layer(town(PARIS, size=50)), layer(swapped(town(PARIS)), name="b")],
        None,
        ["'b'", "far from most", "with x and y exchanged", "x_field"],
    ),
    "x and y of metres": (
        [layer(swapped(lambert(town(PARIS))), crs="EPSG:2154")],
        None,
        ["EPSG:2154", "-9.86,41.15,10.38,51.56", "with x and y exchanged", "latitude 48.8"],
    ),
    "another CRS": (
        [layer(lambert(town(MONTPELLIER)), crs="EPSG:25833")],
        None,
        ["'a'", "its CRS, EPSG:25833", "state the crs"],
    ),
    "degrees as metres": ([layer(town(PARIS), crs="EPSG:2154")], None, ["'EPSG:4326'"]),
    "another metric CRS": (
        [layer(town(HELSINKI))],
        "EPSG:2154",
        ["the metric CRS, EPSG:2154", "such as EPSG:32635"],
    ),
    "nowhere on the Earth": (
        [layer(lambert(town(PARIS)), crs="EPSG:4326")],
        None,
        ["nowhere on the Earth", "state the crs"],
    ),
    "a layer of another city": (
        [layer(town(PARIS, size=50)), layer(town(LYON), name="b")],
        None,
        ["'b'", "4.8", "Lyon, France", "far from most of the data at 2.3", "--clip none"],
    ),
    "two cities": (
        [layer(town(PARIS), town(SYDNEY))],
        None,
        ["2 places far apart", "2.33", "151.1", "bearings differ by", "--max-distortion"],
    ),
    "two cities of neighbours": ([layer(town(PARIS), town(BERLIN))], None, ["8.8", "at most 6"]),
    "two cities in a given plane": ([layer(town(PARIS), town(BERLIN))], "EPSG:3035", ["EPSG:3035"]),
    "a continent": (
        [layer(town((10.0, 50.0), size=3000, km=2000.0))],
        None,
        ["is too wide", "bearings differ"],
    ),
    "all over the Earth": (
        [layer(np.random.default_rng(1).uniform(-80.0, 80.0, (99, 2)))],
        None,
        ["and 9", "mean nothing"],
    ),
    "beyond the zones": ([layer(town((10.0, 86.0)))], None, ["no UTM zone"]),
}


@pytest.mark.parametrize(("layers", "metric", "words"), REFUSED.values(), ids=REFUSED)
def test_implausible_positions_are_refused(
    layers: list[RawLayer], metric: str | None, words: list[str]
) -> None:
    with refused(CrsError, *words):
        settle_extent(layers, crs=metric)


def test_what_is_far_can_be_kept() -> None:
    """A layer of another town, and a row of a village that the others are far from."""
    village = np.array([(4.8, 48.6)])
    layers = [layer(town(PARIS, size=50), village), layer(town(LYON), name="b")]
    settled, _, (note,) = settle_extent(layers, keep_far=True)
    assert [len(item) for item in settled] == [51, 40]
    assert "3 places far apart" in note
    (single,), _, _ = settle_extent(layers[:1])
    assert (len(single), single.counts.misplaced) == (50, 1)
    assert "--clip none" in single.notes[-1]


def test_larger_distortion_can_be_allowed() -> None:
    layers = [layer(town(PARIS), town(BERLIN))]
    _, _, (note,) = settle_extent(layers, max_distortion=9.0)
    assert "2 places far apart" in note
    for most in (0.0, -1.0, float("nan")):
        with refused(InputError, "above 0", "degrees"):
            settle_extent(layers, max_distortion=most)


def test_large_convergence_is_noted() -> None:
    _, _, (note,) = settle_extent([layer(town((-9.1, 38.7)))], crs="EPSG:3035")
    assert "grid north of EPSG:3035 is up to 13" in note


def test_crs_without_a_code_has_the_area_of_the_equivalent_one() -> None:
    equivalent = CRS.from_user_input(CRS(2154).to_wkt("WKT1_ESRI"))
    assert equivalent.area_of_use is None
    with refused(CrsError, "-9.86,41.15,10.38,51.56", "with x and y exchanged"):
        settle_extent([layer(swapped(lambert(town(PARIS))), crs=equivalent)])


def test_distant_towns_in_one_zone_are_noted() -> None:
    settled, crs, notes = settle_extent([layer(town(PARIS), town(LYON))])
    assert (len(settled[0].table), crs.to_epsg(), len(notes)) == (80, 32631, 1)


def test_layers_without_positions_are_accepted_with_a_crs() -> None:
    with refused(CrsError, "'b'", "state its crs"):
        settle_extent([layer(town(PARIS)), layer(ZERO, name="b", crs=None)])
    empty = raw_layer([None, shapely.Point()], classes="bench")
    with refused(EmptyResultError, "no layer"):
        settle_extent([empty])
    assert settle_extent([empty], crs="EPSG:2154")[1].to_epsg() == 2154


def test_layers_may_cross_180_degrees() -> None:
    """What cells see, against geodesics on the ellipsoid."""
    places = town(TAVEUNI, size=400, km=1.0)
    assert np.ptp(places[:, 0]) > 359.0
    objects = loaded(layer(places)).objects
    assert objects.crs.to_epsg() in {32701, 32760}
    database = build_database(objects)
    cells = np.flatnonzero(database.lengths > 1)[::20]
    xy = database.xy[cells]
    here = np.column_stack(Proj(objects.crs)(xy[:, 0], xy[:, 1], inverse=True))
    assert np.ptp(here[:, 0]) > 359.0
    ellipsoid, turned = Geod(ellps="WGS84"), grid_convergence(objects.crs, xy)
    for cell, start, turn in zip(cells.tolist(), here, turned, strict=True):
        azimuth, _, metres = ellipsoid.inv(*np.broadcast_to(start, places.shape).T, *places.T)
        part = slice(database.offsets[cell], database.offsets[cell + 1])
        nearest = np.argsort(metres)[: database.lengths[cell]]
        assert np.sort(metres)[len(nearest)] > 29.9  # all others are out of sight
        expected = np.argsort(wrap_degrees(azimuth[nearest] - turn))
        bearings = wrap_degrees(azimuth[nearest] - turn)[expected]
        assert angular_distance(database.bearings[part], bearings).max() < 0.06
        np.testing.assert_allclose(database.distances[part], metres[nearest][expected], atol=0.1)
