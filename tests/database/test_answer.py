"""Tests of semsig_gis.database.answer."""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database.answer import DistanceMemo

if TYPE_CHECKING:
    from numpy.typing import NDArray


def test_distances_are_measured_once_and_the_time_is_told() -> None:
    asked: list[str] = []

    def measure(name: str) -> NDArray[np.float32]:
        asked.append(name)
        time.sleep(0.01)
        return np.array([len(asked)], np.float32)

    memo = DistanceMemo()
    found = [float(memo.get(name, partial(measure, name))[0]) for name in "abaab"]
    assert found == [1.0, 2.0, 1.0, 1.0, 2.0]
    assert asked == ["a", "b"]
    # Three times a distance was known that takes a hundredth of a second to measure.
    assert memo.spared >= 0.03
