"""Distances that several methods need of the same queries, each measured once."""

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
    _spared: float = 0.0

    @property
    def spared(self) -> float:
        """Seconds that it would have taken to measure again what was known."""
        return self._spared

    def get(self, key: Hashable, measure: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """Return the distances under a key, calling `measure` only if they are not known yet.

        The key must name all that they depend on. Do not write to the result.
        """
        if key in self._known:
            found, seconds = self._known[key]
            self._spared += seconds
            return found
        start = time.perf_counter()
        found = measure()
        self._known[key] = found, time.perf_counter() - start
        return found
