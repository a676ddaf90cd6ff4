"""The procedural city: the same for a seed, and built to its rules."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from semsig_gis.catalog import paper_taxonomy
from semsig_gis.errors import InputError
from semsig_gis.sources import synthetic
from semsig_gis.sources.synthetic import CENTRE, CitySpec, synthetic_city

if TYPE_CHECKING:
    from semsig_gis.sources import RawLayer

# Share of each class among what the paper's signatures of Paris see, in per cent.
PARIS = {
    "alignment_tree": 39.9,
    "water_fountain": 0.15,
    "street_light": 52.3,
    "indicator": 0.83,
    "traffic_light": 2.3,
    "bike_station": 0.33,
    "automatic_wc": 0.18,
    "car_station": 0.10,
    "taxi_station": 0.06,
    "bench": 3.1,
    "bus_stop": 0.74,
}

cities = st.builds(
    CitySpec,
    size=st.floats(100, 1500),
    block=st.floats(60, 300),
    avenue_share=st.floats(0, 1),
    seed=st.integers(0, 2**64),
)


def of_class(layers: tuple[RawLayer, ...], name: str) -> RawLayer:
    return next(layer for layer in layers if layer.spec.class_name == name)


def rows_of(layer: RawLayer) -> pd.DataFrame:
    """Return x, y, edge, side and number of every object."""
    parts = [re.fullmatch(r"(\d+)([LR])(\d+)", text) for text in layer.table["source_id"]]
    xy = shapely.get_coordinates(layer.table.geometry.array)
    frame = pd.DataFrame(
        [part.groups() for part in parts if part], columns=["edge", "side", "number"]
    )
    return frame.astype({"edge": int, "number": int}).assign(x=xy[:, 0], y=xy[:, 1])


def spacings(rows: pd.DataFrame) -> list[list[float]]:
    """Return the distances per number between neighbours on one side, a list an edge."""
    rows = rows.sort_values(["edge", "side", "number"])
    same = (rows[["edge", "side"]] == rows[["edge", "side"]].shift()).all(axis=1)
    gaps = np.hypot(rows["x"].diff(), rows["y"].diff()) / rows["number"].diff()
    return [part.to_list() for _, part in gaps[same].groupby(rows["edge"])]


@settings(max_examples=25)
@given(spec=cities)
def test_same_seed_same_city_within_its_square(spec: CitySpec) -> None:
    layers = synthetic_city(spec)
    for layer, again in zip(layers, synthetic_city(spec), strict=True):
        pd.testing.assert_frame_equal(layer.table, again.table)
        assert layer.read == len(layer.table)
        assert (layer.filtered, layer.error_count, layer.notes) == (0, 0, ())
        assert list(layer.table.columns) == ["class_name", "source_id", "geometry"]
        assert (layer.table["class_name"] == layer.spec.class_name).all()
        assert layer.table["source_id"].is_unique
        assert layer.table.crs == layer.spec.crs == "EPSG:32631"
        xy = shapely.get_coordinates(layer.table.geometry.array)
        assert np.isfinite(xy).all()
        assert (np.abs(xy - CENTRE) <= spec.size / 2 + 0.005).all()


def test_layers_are_the_classes_of_the_paper() -> None:
    layers = synthetic_city(CitySpec(size=200.0))
    names = [item.name for item in paper_taxonomy().classes]
    assert [layer.spec.class_name for layer in layers] == names
    assert len({layer.spec.name for layer in layers}) == len(names)
    assert {layer.spec.license for layer in layers} == {"CC0-1.0"}
    assert all("synthetic" in layer.spec.attribution for layer in layers)


def test_other_seeds_are_other_cities() -> None:
    cities = [synthetic_city(CitySpec(size=500.0, seed=seed)) for seed in range(4)]
    lights = [of_class(city, "street_light").table.geometry for city in cities]
    for number, one in enumerate(lights):
        for other in lights[number + 1 :]:
            assert len(np.intersect1d(one.to_wkb(), other.to_wkb())) == 0


@pytest.fixture(scope="module")
def city() -> tuple[RawLayer, ...]:
    return synthetic_city()


@pytest.mark.parametrize("seed", range(4))
def test_shares_are_about_those_of_paris(seed: int) -> None:
    layers = synthetic_city(CitySpec(seed=seed))
    counts = {layer.spec.class_name: layer.read for layer in layers}
    total = sum(counts.values())
    assert 4000 < total < 10_000
    for name, share in PARIS.items():
        expected = total * share / 100
        # Twice or half the share, and the chance of a small number.
        slack = 4 * math.sqrt(expected)
        assert expected / 2 - slack < counts[name] < expected * 2 + slack, name


def test_lights_are_even_along_a_street(city: tuple[RawLayer, ...]) -> None:
    gaps = spacings(rows_of(of_class(city, "street_light")))
    assert len(gaps) > 400
    flat = np.concatenate(gaps)
    assert 13.95 < flat.min() < 16
    assert 28 < flat.max() < 30.05
    for row in gaps:  # positions are rounded to centimetres
        assert np.ptp(row) < 0.05


def test_trees_are_in_rows_with_gaps(city: tuple[RawLayer, ...]) -> None:
    rows = rows_of(of_class(city, "alignment_tree"))
    gaps = np.concatenate(spacings(rows))
    assert gaps.min() > 5.95
    assert gaps.max() < 10.05
    number = rows.sort_values(["edge", "side", "number"]).groupby(["edge", "side"])["number"]
    steps = number.diff().dropna()
    assert 0.06 < (steps > 1).mean() < 0.2  # one in eight trees is missing
    points = [shapely.Point(x, y) for x, y in rows[["x", "y"]].to_numpy()]
    nearest = shapely.STRtree(points).query_nearest(points, exclusive=True, return_distance=True)[1]
    assert 6 < np.median(nearest) < 10


def test_trees_and_most_signals_stand_on_avenues(city: tuple[RawLayer, ...]) -> None:
    spec = CitySpec()
    streets = synthetic._streets(spec, synthetic._random(spec, "streets"))
    avenue = streets.avenue
    assert 0.2 < streets.length[avenue].sum() / streets.length.sum() < 0.35
    trees = rows_of(of_class(city, "alignment_tree"))["edge"].to_numpy()
    assert avenue[trees].all()
    signals = rows_of(of_class(city, "traffic_light"))["edge"].to_numpy()
    assert avenue[signals].mean() > 0.5
    assert streets.signals[signals].any(axis=1).all()
    lights = rows_of(of_class(city, "street_light"))
    sides = lights.groupby("edge")["side"].nunique()
    lit = streets.length > 90  # shorter ones may have a single light
    assert (sides[avenue[sides.index] & lit[sides.index]] == 2).mean() > 0.9
    assert 0.1 < (sides[~avenue[sides.index]] == 2).mean() < 0.4  # the alternating ones
    benches = rows_of(of_class(city, "bench"))["edge"].to_numpy()
    per_metre = [
        avenue[benches].sum() / streets.length[avenue].sum(),
        (~avenue[benches]).sum() / streets.length[~avenue].sum(),
    ]
    assert 4 < per_metre[0] / per_metre[1] < 25  # ten times, but for chance


def test_objects_stand_beside_the_carriageway(city: tuple[RawLayer, ...]) -> None:
    spec = CitySpec()
    streets = synthetic._streets(spec, synthetic._random(spec, "streets"))
    for layer in city:
        rows = rows_of(layer)
        edge = rows["edge"].to_numpy()
        away = rows[["x", "y"]].to_numpy() - streets.start[edge]
        along = streets.along[edge]
        t = (away * along).sum(axis=1)
        across = away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]  # positive on the right
        assert (np.abs(across) > streets.width[edge] / 2).all()
        assert (np.abs(across) < streets.width[edge] / 2 + 3).all()
        assert ((across > 0) == (rows["side"] == "R")).all()
        assert (t > streets.clear[edge, 0] - 0.02).all()
        assert (t < streets.length[edge] - streets.clear[edge, 1] + 0.02).all()


def test_avenue_share_counts_lines() -> None:
    for share in (0.0, 0.1, 0.5, 1.0):
        spec = CitySpec(size=4000.0, avenue_share=share)
        streets = synthetic._streets(spec, synthetic._random(spec, "streets"))
        lines = pd.Series(streets.avenue).groupby(streets.line).first()
        assert abs(lines.mean() - share) < 0.04
    assert synthetic_city(CitySpec(avenue_share=0.0))[0].read == 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": 0.0}, "size of the city is 0.0; give a number from 100 to 20000"),
        ({"size": -5.0}, "size"),
        ({"size": math.nan}, "size"),
        ({"size": math.inf}, "size"),
        ({"block": 10.0}, "block of the city is 10.0; give a number from 60 to 1000"),
        ({"avenue_share": 1.5}, "avenue_share .* from 0 to 1"),
        ({"seed": -1}, "seed of the city is -1; give a whole number, 0 or more"),
    ],
)
def test_impossible_cities(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        CitySpec(**wrong)
