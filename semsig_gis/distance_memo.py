"""Distances that several methods need of the same queries, each measured once."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from numpy.typing import NDArray

__all__ = ["DistanceMemo"]


@dataclass(eq=False, slots=True)
class DistanceMemo:
    """Distances that have been measured, and how long that took.

    Most of the methods of an experiment differ in how they join the same distances. A memo holds
    those of one batch of queries to one database; make another for the next batch.

    Examples
    --------
    >>> import numpy as np
    >>> memo = DistanceMemo()
    >>> first = memo.get("edit", lambda: np.float32([1.0]))
    >>> memo.get("edit", lambda: np.float32([2.0])) is first, memo.spared > 0
    (True, True)
    """

    _known: dict[Hashable, tuple[NDArray[Any], float]] = field(default_factory=dict)
    _spared: float = 0.0

    @property
    def spared(self) -> float:
        """Seconds that it would have taken to measure again what was known."""
        return self._spared

    def get(self, key: Hashable, measure: Callable[[], NDArray[Any]]) -> NDArray[Any]:
        """Return distances, measured now unless they are known.

        Parameters
        ----------
        key : hashable
            All that they depend on.
        measure : callable
            Gives them.

        Returns
        -------
        ndarray
            The distances, not to be written to.
        """
        if key in self._known:
            found, seconds = self._known[key]
            self._spared += seconds
            return found
        start = time.perf_counter()
        found = measure()
        self._known[key] = found, time.perf_counter() - start
        return found
