"""Metrics: distances between the sequence of a query and each distinct sequence of a database.

Each module of this package is a metric: its name, and a function ``distances(queries, table, *,
normalized, only)``. To add one, add its module. `METRICS`, the help of the commands and the general
tests in ``tests/localization/distance/test_metrics.py`` find it.
"""

from __future__ import annotations

import importlib
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

from semsig_gis.core import InputError, UnknownNameError, nearest_name
from semsig_gis.localization.distance.metric_names import METRIC_NAMES
from semsig_gis.localization.distance.metrics import edit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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


METRICS: Mapping[str, Distances] = MappingProxyType(
    {name: importlib.import_module(f"{__name__}.{name}").distances for name in METRIC_NAMES}
)
"""Every metric, by name."""


def metric(
    name: str, *, weights: EditWeights | None = None, wildcard: int | None = None
) -> Distances:
    """Return the metric of a name in `METRICS`, with the edit weights bound to it.

    Metrics other than the edit distance ignore weights. They raise InputError for a wildcard, which
    is a value of the query that equals any other.
    """
    if name not in METRICS:
        raise UnknownNameError(
            f"metric {name!r} is unknown{nearest_name(name, METRICS)}; "
            f"the metrics are {', '.join(METRICS)}."
        )
    if name == "edit" and (weights is not None or wildcard is not None):
        return partial(edit.distances, weights=weights, wildcard=wildcard)
    if wildcard is not None:
        raise InputError(
            f"the query has objects of unknown class (?), which measure {name!r} cannot compare; "
            "use 'edit', or leave them out."
        )
    return METRICS[name]
