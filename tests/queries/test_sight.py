from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database
from sights import CITY, REACH, rows, seeds, sight, sights

from semsig_gis.core.signature import BEARING_UNITS
from semsig_gis.queries.sight import CitySights, Sight


@given(one=sights, turn=st.floats(-400, 400))
def test_a_turn_moves_all_bearings_and_is_remembered(one: Sight, turn: float) -> None:
    there = one.turned(turn)
    assert (np.diff(there.bearings) >= 0).all()
    assert ((there.bearings >= 0) & (there.bearings < 360)).all()
    expected = sorted(((code, distance) for code, _, distance in rows(one)))
    assert sorted((code, distance) for code, _, distance in rows(there)) == expected
    true = (there.bearings + there.heading) % 360.0
    found = np.sort(np.exp(1j * np.radians(true)))
    assert np.allclose(found, np.sort(np.exp(1j * np.radians(one.bearings))), atol=1e-6)


def test_objects_on_one_bearing_stay_in_order() -> None:
    one = sight([(3, 7.0, 1.0), (1, 7.0, 2.0), (5, 2.0, 3.0)])
    assert one.clockwise().codes.tolist() == [5, 3, 1]
    assert one.signature.codes is not None
    assert one.signature.codes.tolist() == [3, 1, 5]


@given(one=sights)
def test_some_objects_keep_what_they_are(one: Sight) -> None:
    near = one.only(one.distances < 10.0)
    assert rows(near) == [row for row in rows(one) if row[2] < 10.0]
    assert rows(one.only(np.arange(len(one))[::-1])) == rows(one)[::-1]


def test_what_there_is_to_see_in_a_database() -> None:
    database = random_database(3)
    city = CitySights.of(database)
    assert city.codes.tolist() == sorted(set(database.codes.tolist()))
    counts = [(database.codes == code).sum() for code in city.codes]
    assert city.frequencies.tolist() == counts
    assert (city.reach, city.taxonomy) == (database.reach, database.taxonomy)


@given(seed=seeds)
def test_false_things_are_anywhere_in_the_circle(seed: int) -> None:
    distances = CITY.false_distances(4000, np.random.default_rng(seed))
    assert ((distances >= 0) & (distances <= REACH)).all()
    # A uniform place in a circle has d^2 / R^2 uniform on [0, 1].
    shares = (distances / REACH) ** 2
    assert abs(shares.mean() - 0.5) < 6 / np.sqrt(12 * 4000)
    assert abs((shares < 0.25).mean() - 0.25) < 6 * np.sqrt(0.25 * 0.75 / 4000)


@given(seed=st.integers(0, 50), cell=st.integers(0, 39))
def test_what_is_seen_from_a_cell_is_its_signature(seed: int, cell: int) -> None:
    database = random_database(seed)
    seen, signature = Sight.of_cell(database, cell), database.signature(cell)
    assert signature.codes is not None
    assert signature.bearings is not None
    assert seen.codes.tolist() == signature.codes.tolist()
    assert np.allclose(seen.bearings, signature.bearings, atol=360.0 / BEARING_UNITS)
    units = database.distance_units[database.offsets[cell] : database.offsets[cell + 1]]
    assert np.allclose(seen.distances, database.reach * units / 255.0)
