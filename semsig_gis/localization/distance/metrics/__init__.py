"""Pick a measure: how far a query's sequence is from every distinct sequence of a database.

Each measure is a module with one function ``distances(queries, table, *, normalized, only)``.
A new one is added to `METRICS`; the laws in ``tests/localization/distance/test_metrics.py`` then
hold it too.
"""

from __future__ import annotations

from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from semsig_gis.core import InputError, UnknownNameError, nearest_name
from semsig_gis.localization.distance.metrics import edit, histogram, jaccard

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.database.sequences import SequenceTable
    from semsig_gis.localization.distance.metrics.edit import EditWeights


class Distances(Protocol):
    """Distances of some queries to the distinct sequences of a table, lower for more alike."""

    def __call__(
        self,
        queries: Sequence[NDArray[np.uint8]],
        table: SequenceTable,
        /,
        *,
        normalized: bool = True,
        only: NDArray[np.int64] | None = None,
    ) -> NDArray[np.float32]:
        """Return float32 distances of shape (queries, d), or (queries, len(only))."""


METRICS: Mapping[str, Distances] = MappingProxyType(
    {"jaccard": jaccard.distances, "histogram": histogram.distances, "edit": edit.distances}
)
"""Every measure, by name."""


def metric(
    name: str, *, weights: EditWeights | None = None, wildcard: int | None = None
) -> Distances:
    """Return the measure of a name in `METRICS`, with the edit weights bound to it.

    Measures other than the edit distance ignore weights and refuse a wildcard (a value of the query
    that stands for any other) with an `InputError`.
    """
    if name not in METRICS:
        raise UnknownNameError(
            f"measure {name!r} is unknown{nearest_name(name, METRICS)}; "
            f"the measures are {', '.join(METRICS)}."
        )
    if name == "edit" and (weights is not None or wildcard is not None):
        return partial(edit.distances, weights=weights, wildcard=wildcard)
    if wildcard is not None:
        raise InputError(
            f"the query has objects of unknown class (?), which measure {name!r} cannot compare; "
            "use 'edit', or leave them out."
        )
    return METRICS[name]
