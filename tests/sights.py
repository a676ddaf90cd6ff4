"""Sights for the tests of distortions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import strategies as st
from scipy.stats import binom

from semsig_gis.evaluation import CitySights, Distortion, Sight
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from numpy.typing import NDArray

CLASSES = [1, 3, 5, 10]
REACH = 30.0
CITY = CitySights(
    taxonomy=paper_taxonomy(),
    codes=np.array(CLASSES, np.uint8),
    frequencies=np.array([40, 30, 20, 10]),
    reach=REACH,
)
seeds = st.integers(0, 2**32)
paper_errors = st.builds(
    Distortion,
    occurrences=st.integers(0, 20),
    bearing_sigma=st.floats(0, 90),
    bearing_clip=st.floats(0, 200),
    resort=st.booleans(),
    false_class=st.sampled_from(["uniform", "frequency"]),
)


def sight(objects: list[tuple[int, float, float]]) -> Sight:
    """Return objects given as (class code, bearing, distance)."""
    codes, bearings, distances = zip(*objects, strict=True) if objects else ((), (), ())
    return Sight(
        codes=np.array(codes, np.uint8),
        bearings=np.array(bearings, np.float64),
        distances=np.array(distances, np.float64),
    )


sights = st.lists(
    st.tuples(st.sampled_from(CLASSES), st.floats(0, 359.99), st.floats(0, REACH)), max_size=12
).map(lambda objects: sight(sorted(objects, key=lambda item: item[1])))


def many(count: int, *, code: int = 3, distance: float = 10.0, bearing: float = 90.0) -> Sight:
    """Return equal objects."""
    return sight([(code, bearing, distance)] * count)


def all_round(count: int) -> Sight:
    """Return objects in all directions, evenly spaced."""
    angles = np.linspace(0.0, 360.0, count, endpoint=False)
    return sight([(3, angle, 10.0) for angle in angles.tolist()])


def rows(sight: Sight) -> list[tuple[int, float, float]]:
    """Return the objects as (class code, bearing, distance)."""
    columns = (sight.codes.tolist(), sight.bearings.tolist(), sight.distances.tolist())
    return list(zip(*columns, strict=True))


def away(bearings: NDArray[np.float64], middle: float) -> NDArray[np.float64]:
    """Return signed angles from a direction."""
    return np.asarray((bearings - middle + 180.0) % 360.0 - 180.0)


def assert_rate(hits: float, trials: int, chance: float) -> None:
    """Check a rate: neither tail of the binomial distribution is extremely unlikely."""
    low, high = binom.cdf(hits, trials, chance), binom.sf(hits - 1, trials, chance)
    assert min(low, high) > 1e-9, (hits / trials, chance)
