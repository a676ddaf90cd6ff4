"""The synthetic city: the same for a seed, built to its rules, and as full as the paper's Paris."""

from __future__ import annotations

import itertools
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.database import Footprints, ViewpointSpec, build_database
from semsig_gis.evaluation import DATABASE, OCCURRENCES
from semsig_gis.objects import build_objects
from semsig_gis.sources import (
    PARIS_LIKE,
    CitySpec,
    paper_taxonomy,
    synthetic_city,
    synthetic_streets,
    synthetic_surroundings,
)
from semsig_gis.sources.synthetic import city as synthetic
from semsig_gis.sources.synthetic import streets as _city_streets

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.sources import Network, RawLayer

    City = tuple[RawLayer, ...]


cities = st.builds(
    CitySpec,
    size=st.floats(100, 700),
    seed=st.integers(0, 10**18),
    centre=st.tuples(st.floats(2e5, 8e5), st.floats(1e6, 9e6)),
)


def of_class(layers: City, name: str) -> RawLayer:
    return next(layer for layer in layers if layer.spec.class_name == name)


def places(layer: RawLayer) -> NDArray[np.float64]:
    return shapely.get_coordinates(layer.table.geometry.array)


SPEC = CitySpec()


def along_streets(layer: RawLayer, network: Network) -> pd.DataFrame:
    """Return edge, side, number, metres along and metres from the centre line of every object.

    Objects on open ground are left out.
    """
    parts = [re.fullmatch(r"(\d+)([LR]+)(\d+)", text) for text in layer.table["source_id"]]
    frame = pd.DataFrame(
        [part.groups() for part in parts if part], columns=["edge", "side", "number"]
    ).astype({"edge": int, "number": int})
    edge = frame["edge"].to_numpy()
    present = np.array([part is not None for part in parts], bool)
    away = places(layer)[present] - SPEC.centre - network.start[edge]
    along = network.along[edge]
    across = away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]
    assert ((across > 0) == frame["side"].str.startswith("R")).all()
    return frame.assign(t=(away * along).sum(axis=1), across=np.abs(across))


def rows_of(frame: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the objects of each row, in order, where there are at least two."""
    ordered = frame.sort_values(["edge", "side", "number"])
    return [part for _, part in ordered.groupby(["edge", "side"]) if len(part) > 1]


@pytest.fixture(scope="module")
def network() -> Network:
    return _city_streets.lay_streets(SPEC.size, synthetic._random(SPEC, "streets"))


@pytest.fixture(scope="module")
def city() -> City:
    return synthetic_city(SPEC)


@pytest.fixture(scope="module")
def surroundings() -> tuple[RawLayer, RawLayer]:
    return synthetic_surroundings(SPEC)


@settings(max_examples=20, deadline=None)
@given(spec=cities)
def test_seed_determines_the_city_inside_its_square(spec: CitySpec) -> None:
    layers = (*synthetic_city(spec), *synthetic_surroundings(spec))
    again = (*synthetic_city(spec), *synthetic_surroundings(spec))
    for layer, twin in zip(layers, again, strict=True):
        pd.testing.assert_frame_equal(layer.table, twin.table)
        assert layer.counts.read == len(layer.table)
        assert (layer.counts.filtered, layer.counts.unreadable, layer.notes) == (0, 0, ())
        assert list(layer.table.columns)[:3] == ["class_name", "source_id", "geometry"]
        assert (layer.table["class_name"] == layer.spec.class_name).all()
        assert layer.table["source_id"].is_unique
        assert layer.table.crs == layer.spec.crs == "EPSG:32631"
        assert layer.table.geometry.is_valid.all()
        assert (np.abs(places(layer) - spec.centre) <= spec.size / 2 + 0.006).all()
    assert layers[-1].table["half_width"].between(5.0, 21.0).all()


@settings(max_examples=20, deadline=None)
@given(spec=cities)
def test_houses_do_not_overlap_streets(spec: CitySpec) -> None:
    buildings, streets = synthetic_surroundings(spec)
    houses = Footprints(buildings.table.geometry.to_numpy())
    for layer in synthetic_city(spec):
        assert not houses.cover(places(layer)).any()
    rng = np.random.default_rng(0)
    anywhere = rng.uniform(-spec.size / 2, spec.size / 2, size=(4000, 2)) + spec.centre
    points = np.asarray(shapely.points(anywhere))
    lines = streets.table.geometry.to_numpy()
    point, street = shapely.STRtree(lines).query(points, predicate="dwithin", distance=25.0)
    near = shapely.distance(points[point], lines[street])
    within = near <= streets.table["half_width"].to_numpy()[street] - 0.02
    assert not houses.cover(anywhere[np.unique(point[within])]).any()


def test_layers_are_the_classes_of_the_paper() -> None:
    spec = CitySpec(size=200.0, seed=7)
    layers, (buildings, streets) = synthetic_city(spec), synthetic_surroundings(spec)
    names = [item.name for item in paper_taxonomy().classes]
    assert [layer.spec.class_name for layer in layers] == names
    assert [layer.spec.name for layer in layers] == [f"synthetic_{name}" for name in names]
    assert {(layer.spec.role, layer.spec.geometry) for layer in layers} == {("objects", "point")}
    for layer in (*layers, buildings, streets):
        assert layer.spec.license == "CC0-1.0"
        assert layer.spec.attribution == "synthetic city of semsig_gis, seed 7: no real place"
        assert layer.spec.name.startswith("synthetic_")
    assert (buildings.spec.role, buildings.spec.geometry) == ("buildings", "polygon")
    assert (streets.spec.role, streets.spec.geometry) == ("streets", "line")
    assert set(buildings.table.geometry.geom_type) == {"Polygon"}
    assert set(streets.table.geometry.geom_type) == {"LineString"}
    columns = ["class_name", "source_id", "geometry", "half_width", "name"]
    assert list(streets.table.columns) == columns
    assert streets.table["half_width"].dtype == np.float64


def test_other_seed_gives_another_city() -> None:
    cities = [synthetic_city(CitySpec(size=500.0, seed=seed)) for seed in range(4)]
    lights = [of_class(city, "street_light").table.geometry.to_wkb() for city in cities]
    assert all(not np.intersect1d(*pair).size for pair in itertools.combinations(lights, 2))


def test_centre_only_moves_the_city() -> None:
    here, there = CitySpec(size=400.0), CitySpec(size=400.0, centre=(300_000.0, 5_000_000.0))
    layers = (*synthetic_city(here), *synthetic_surroundings(here))
    other = (*synthetic_city(there), *synthetic_surroundings(there))
    for layer, shifted in zip(layers, other, strict=True):
        assert layer.table["source_id"].equals(shifted.table["source_id"])
        shift = places(shifted) - places(layer)
        np.testing.assert_allclose(shift, np.full_like(shift, (-200_000.0, -400_000.0)), atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_small_city_has_about_the_shares_of_paris(seed: int) -> None:
    layers = synthetic_city(CitySpec(seed=seed))
    counts = {layer.spec.class_name: layer.counts.read for layer in layers}
    total = sum(counts.values())
    assert 9_000 < total < 15_000
    for name, occurrences in OCCURRENCES.items():
        expected = total * occurrences / sum(OCCURRENCES.values())
        # A third more or less, and the chance of a small number.
        assert abs(counts[name] - expected) < expected / 3 + 3 * math.sqrt(expected), name


def test_edges_enclose_the_faces(network: Network) -> None:
    lines = shapely.union_all(shapely.buffer(network.lines, 0.01))
    whole = network.faces[shapely.within(network.faces, shapely.box(-1000, -1000, 1000, 1000))]
    assert len(whole) > 200
    assert shapely.covers(lines, shapely.boundary(whole)).all()
    assert not shapely.intersects(shapely.point_on_surface(whole), lines).any()


def test_avenues_are_connected(network: Network) -> None:
    avenue = network.avenue
    assert 0.3 < network.length[avenue].sum() / network.length.sum() < 0.45
    assert network.half_width[avenue].min() > network.half_width[~avenue].max()
    ends = network.start[avenue] + network.along[avenue] * network.length[avenue, None]
    inside = (np.abs(np.concatenate([network.start[avenue], ends])) < 1000).all(axis=1)
    at = np.concatenate([network.junction[avenue, 0], network.junction[avenue, 1]])
    meeting = np.bincount(at)
    assert (meeting[at[inside]] >= 2).all()
    for values in (network.half_width, network.avenue):
        of_street = pd.Series(values).groupby(network.street)
        assert (of_street.min() == of_street.max()).all()


def test_lights_are_regularly_spaced(city: City, network: Network) -> None:
    rows = rows_of(along_streets(of_class(city, "street_light"), network))
    assert len(rows) > 400
    rhythms = []
    for row in rows:
        gaps = (row["t"].diff() / row["number"].diff()).dropna().to_numpy()
        assert np.ptp(gaps) < 4 * 0.3 + 0.05  # with an offset of up to 0.3 m
        rhythms.append(gaps.mean())
    assert min(rhythms) > 5.3
    assert max(rhythms) < 32.7
    assert np.std(rhythms) > 3.0  # each street has its own


def test_trees_are_in_rows_with_gaps(city: City, network: Network) -> None:
    trees = along_streets(of_class(city, "alignment_tree"), network)
    assert network.avenue[trees["edge"]].mean() > 0.9
    rows = rows_of(trees)
    steps = pd.concat([row["number"].diff().dropna() for row in rows])
    assert 0.08 < (steps > 1).mean() < 0.25  # one in seven is missing
    gaps = pd.concat([(row["t"].diff() / row["number"].diff()).dropna() for row in rows])
    assert gaps.between(3.4, 8.1).all()
    assert {"R", "L", "RR", "LL"} == set(trees["side"])


def test_objects_are_on_the_pavement(city: City, network: Network) -> None:
    for layer in city:
        frame = along_streets(layer, network)
        edge = frame["edge"].to_numpy()
        assert (frame["across"] > network.kerb[edge]).all()
        assert (frame["across"] < network.half_width[edge]).all()
        clear = network.clear[edge] - 0.6  # rows are not quite even
        assert (frame["t"] > clear[:, 0]).all()
        assert (frame["t"] < network.length[edge] - clear[:, 1]).all()


def test_ids_of_objects_name_their_street(
    city: City, surroundings: tuple[RawLayer, RawLayer]
) -> None:
    streets = surroundings[1].table.set_index("source_id")
    for layer in city:
        edges = layer.table["source_id"].str.extract(r"^(\d+)[LR]")[0]
        inside = edges.isin(streets.index)  # the others are at the edge of the square
        assert len(edges) < 20 or inside.sum() > 0.95 * edges.notna().sum()
        own = streets.loc[edges[inside]]
        points = layer.table.geometry[inside].to_numpy()
        away = shapely.distance(points, own.geometry.to_numpy())
        inside = away <= own["half_width"].to_numpy()
        assert inside.mean() > 0.99 or len(inside) == 0


def test_signals_are_at_corners_of_avenues(city: City, network: Network) -> None:
    signals = along_streets(of_class(city, "traffic_light"), network)
    meeting = np.bincount(network.junction[network.avenue].ravel())
    corner = network.junction[signals["edge"], signals["number"]]
    assert (meeting[corner] >= 2).all()
    assert {2, 3} <= set(meeting[corner])
    assert not signals.duplicated(["edge", "number"]).any()


def test_other_classes_are_ten_times_as_frequent_on_avenues(city: City, network: Network) -> None:
    scattered = set(OCCURRENCES) - {"alignment_tree", "street_light", "traffic_light"}
    frames = [along_streets(of_class(city, name), network) for name in scattered]
    on_avenue = network.avenue[pd.concat(frames)["edge"]]
    free = np.maximum(network.length - network.clear.sum(axis=1), 0.0)
    avenues, others = free[network.avenue].sum(), free[~network.avenue].sum()
    ratio = (on_avenue.sum() / avenues) / ((~on_avenue).sum() / others)
    assert 6 < ratio < 16


def test_parks_have_trees_and_squares_lights_but_no_houses(
    city: City, surroundings: tuple[RawLayer, RawLayer]
) -> None:
    houses = surroundings[0].table.geometry.to_numpy()
    for name in ("alignment_tree", "street_light"):
        table = of_class(city, name).table
        on_ground = table[table["source_id"].str.startswith("p")]
        assert 20 < len(on_ground) < 0.15 * len(table)
        ground = on_ground["source_id"].str.split("-").str[0]
        for _, part in on_ground.groupby(ground):
            hull = part.geometry.union_all().convex_hull
            assert not shapely.intersects(houses, hull).any()


def test_houses_do_not_overlap(surroundings: tuple[RawLayer, RawLayer]) -> None:
    houses = surroundings[0].table.geometry.to_numpy()
    assert len(houses) > 4000
    together = shapely.area(shapely.union_all(houses))
    assert together == pytest.approx(shapely.area(houses).sum(), rel=0.002)
    assert 0.25 < together / 2000.0**2 < 0.6
    assert np.quantile(shapely.area(houses), 0.99) < 700


@pytest.mark.parametrize("seed", range(30))
def test_smallest_city_has_objects(seed: int) -> None:
    spec = CitySpec(size=100.0, seed=seed)
    assert of_class(synthetic_city(spec), "street_light").counts.read > 0
    assert synthetic_surroundings(spec)[1].counts.read > 0


def test_paris_like_city_has_the_counts_of_the_paper() -> None:
    layers = synthetic_city(PARIS_LIKE)
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    streets = synthetic_streets(PARIS_LIKE).table
    database = build_database(objects, viewpoints=ViewpointSpec(mode="streets"), streets=streets)
    assert len(database) == pytest.approx(DATABASE["signatures"], rel=0.02)
    assert database.lengths.mean() == pytest.approx(14.0, abs=0.5)
    for item in paper_taxonomy().classes:
        slack = 0.05 if OCCURRENCES[item.name] > 30_000 else 0.15
        occurrences = database.occurrences[item.code]
        assert occurrences == pytest.approx(OCCURRENCES[item.name], rel=slack), item.name
    types, angles = database.type_sequences, database.angle_sequences
    assert len(types) / len(database) == pytest.approx(0.45, abs=0.04)
    assert len(angles) / len(database) == pytest.approx(0.656, abs=0.04)
    largest = int(np.argmax(types.counts))
    assert database.taxonomy.decode(np.frombuffer(types.strings[largest].encode(), "u1")) == "DDD"
    assert 29_958 / 2 < types.counts[largest] < 29_958 * 2


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        *(
            ({"size": size}, f"size of the city is {size}; give a number from 100 to 20,000")
            for size in (0.0, -5.0, 99.0, 20_001.0, math.nan, math.inf)
        ),
        ({"seed": -1}, "seed of the city is -1; give a number from 0"),
        ({"centre": (0.0, math.nan)}, "; give x and y in metres"),
        ({"centre": (math.inf, 0.0)}, "centre of the city is"),
    ],
)
def test_invalid_city_is_refused(wrong: dict[str, Any], words: str) -> None:
    with refused(InputError, words):
        CitySpec(**wrong)
