"""The likelihood of a query at places anywhere, summed over one-to-one associations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import BEARING_UNITS, DISTANCE_UNITS
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.noise_table import NoiseTable
    from semsig_gis.signatures import Signature
    from semsig_gis.views import Views

__all__ = ["place_loglik"]


def place_loglik(
    query: Signature,
    views: Views,
    tables: Sequence[NoiseTable],
    weights: NDArray[np.float64],
    *,
    turns: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """Return the log-likelihood of a query by place and turn, shape (v, r).

    The query needs bearings; its types may be unknown. `weights` are the chances of the tables,
    `turns` the degrees to turn the query by at each place, and `reach` the largest visibility range
    of any class in metres. The sum is that of `semsig_gis.alignment`, on the scale of
    `semsig_gis.likelihood`.
    """
    from semsig_gis._alignment_kernel import align  # noqa: PLC0415 - numba loads slowly

    if query.bearings is None:
        msg = "the query has no bearings, which its place rests on; give them."
        raise InputError(msg)
    kinds = tables[0].query_rows(query)
    units = np.minimum(views.bearings * (BEARING_UNITS / 360.0), BEARING_UNITS - 1)
    far = np.rint(views.distances * (DISTANCE_UNITS / reach))
    found = np.empty((len(tables), *turns.shape))
    align(
        np.arange(len(views)),
        views.offsets,
        views.codes,
        units.astype(np.uint16),
        far.astype(np.uint8),
        tables[0].row_of,
        360.0 / BEARING_UNITS,
        kinds,
        query.bearings,
        turns,
        np.stack([table.odds for table in tables]),
        np.stack([table.naming for table in tables]),
        np.stack([table.sigmas(reach) for table in tables]),
        found,
    )
    owners = np.repeat(np.arange(len(views)), views.lengths)
    for one, (table, weight) in enumerate(zip(tables, weights.tolist(), strict=True)):
        rows = np.minimum(views.lengths, len(table.missed) - 1)[owners]
        missed = np.log(table.missed)[rows, table.row_of[views.codes]]
        found[one] += np.bincount(owners, missed, len(views))[:, None] - table.clutter.sum()
        found[one] += float(np.log(table.density[kinds]).sum()) + math.log(weight)
    return np.asarray(np.logaddexp.reduce(found, axis=0))
