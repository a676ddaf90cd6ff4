"""Metrics: distances between the sequence of a query and each distinct sequence of a database.

Each module of this package registers a metric: its function ``distances(queries, table, *,
normalized, only)``. To add one, add its module. `METRICS`, the help of the commands and the general
tests in ``tests/localization/distance/test_metrics.py`` find it.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from semsig_gis.core import InputError, Registry

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.database import SequenceTable
    from semsig_gis.localization.distance.metrics.edit import EditWeights


class Distances(Protocol):
    """Function that returns the distances of queries to sequences; lower is more similar."""

    def __call__(
        self,
        queries: Sequence[NDArray[np.uint8]],
        table: SequenceTable,
        /,
        *,
        normalized: bool = True,
        only: NDArray[np.int64] | None = None,
    ) -> NDArray[np.float32]:
        """Return float32 distances, shape (queries, d), or (queries, len(only)) for some rows."""


METRICS: Registry[Distances] = Registry("metric", __name__, __path__)
"""Every metric, by name."""


def metric(
    name: str, *, weights: EditWeights | None = None, wildcard: int | None = None
) -> Distances:
    """Return the metric of a name in `METRICS`, with the edit weights bound to it.

    Metrics other than the edit distance ignore weights. They raise InputError for a wildcard, which
    is a value of the query that equals any other.
    """
    distances = METRICS[name]
    if name == "edit" and (weights is not None or wildcard is not None):
        options: dict[str, Any] = {"weights": weights, "wildcard": wildcard}
        return partial(distances, **options)
    if wildcard is not None:
        raise InputError(
            f"the query has objects of unknown class (?), which measure {name!r} cannot compare; "
            "use 'edit', or leave them out."
        )
    return distances
