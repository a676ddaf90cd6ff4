"""Distances that are shared by several methods of an experiment."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from numpy.typing import NDArray


@dataclass(eq=False, slots=True)
class DistanceMemo:
    """Distances between a batch of queries and a database, and the time to compute each.

    Most methods of an experiment combine the same distances in different ways. Use a new memo for
    each batch.
    """

    _entries: dict[Hashable, tuple[NDArray[Any], float]] = field(default_factory=dict)
    spared: float = field(default=0.0, init=False)
    """Seconds saved: the time to compute the returned distances again."""

    def get(self, key: Hashable, measure: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """Return the distances under a key; call `measure` only if there are none yet.

        The key must identify everything that they depend on. Do not write to the result.
        """
        if key in self._entries:
            distances, seconds = self._entries[key]
            self.spared += seconds
            return distances
        start = time.perf_counter()
        distances = measure()
        self._entries[key] = distances, time.perf_counter() - start
        return distances
