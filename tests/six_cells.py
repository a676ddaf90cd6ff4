"""A database of six cells, of which every property can be counted by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from noisy_cells import TAXONOMY, database_of

from semsig_gis.core.geometry import GridSpec
from semsig_gis.core.taxonomy import ObjectClass

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.reports.tables import Table

# Six cells: by type three DD, one DB, two B; by angle (levels) four alike, two alike.
CELLS = [
    ("DD", [10, 100]),
    ("DD", [10, 100]),
    ("DD", [10, 200]),
    ("DB", [10, 100]),
    ("B", [300]),
    ("B", [300]),
]


def six_cells() -> SignatureDatabase:
    crossing = ObjectClass(code=40, symbol="z", name="crossing", title="Crossing | zebra")
    return replace(
        database_of(CELLS, height=6),
        distance_units=np.full(10, 50, np.uint8),
        grid=GridSpec(),
        taxonomy=TAXONOMY.extended([crossing]),
        licenses=("trees: City <of> Paris (ODbL)",),
        version="0.1.0",
    )


def cells_at(
    columns: NDArray[np.int64],
    rows: NDArray[np.int64],
    *,
    longest: int = 1,
    **facts: Any,  # noqa: ANN401
) -> SignatureDatabase:
    """Return cells at places, each of which sees one object, or random numbers of them."""
    order = np.lexsort((rows, columns))
    lengths = np.random.default_rng(0).integers(1, longest + 1, len(order))
    objects = int(lengths.sum())
    return replace(
        six_cells(),
        columns=columns[order].astype(np.int32),
        rows=rows[order].astype(np.int32),
        offsets=np.append(0, np.cumsum(lengths)),
        codes=np.ones(objects, np.uint8),
        bearing_units=np.zeros(objects, np.uint16),
        distance_units=np.zeros(objects, np.uint8),
        **facts,
    )


def rows(table: Table) -> Mapping[str, tuple[str, ...]]:
    """Return the rows of a table by their first cell."""
    return {row[0]: row[1:] for row in table.rows}
