"""Distances that several methods of an experiment share."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from numpy.typing import NDArray


@dataclass(eq=False, slots=True)
class DistanceMemo:
    """Distances between one batch of queries and one database, and how long each took to measure.

    Most methods of an experiment differ only in how they join the same distances. Make another memo
    for the next batch.
    """

    _known: dict[Hashable, tuple[NDArray[Any], float]] = field(default_factory=dict)
    spared: float = field(default=0.0, init=False)
    """Seconds that it would have taken to measure again what was known."""

    def get(self, key: Hashable, measure: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """Return the distances under a key, calling `measure` only if they are not known yet.

        The key must name all that they depend on. Do not write to the result.
        """
        if key in self._known:
            distances, seconds = self._known[key]
            self.spared += seconds
            return distances
        start = time.perf_counter()
        distances = measure()
        self._known[key] = distances, time.perf_counter() - start
        return distances
