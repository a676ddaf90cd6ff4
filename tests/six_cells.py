"""A database of six cells, of which every property can be counted by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pyproj import CRS

from semsig_gis.core.grid import GridSpec
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.core.taxonomy import ObjectClass
from semsig_gis.database.database import SignatureDatabase
from semsig_gis.sources.catalog import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Mapping

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
    bearings = np.array([angle for _, angles in CELLS for angle in angles])
    taxonomy = paper_taxonomy().extended([crossing])
    return SignatureDatabase(
        columns=np.zeros(6, np.int32),
        rows=np.arange(6, dtype=np.int32),
        offsets=np.array([0, 2, 4, 6, 8, 9, 10]),
        codes=taxonomy.encode("".join(types for types, _ in CELLS)),
        bearing_units=(bearings * 20).astype(np.uint16),
        distance_units=np.full(10, 50, np.uint8),
        grid=GridSpec(step=10.0),
        spec=SignatureSpec(radius=30.0, levels=16),
        taxonomy=taxonomy,
        crs=CRS(2154),
        licenses=("trees: City <of> Paris (ODbL)",),
        version="0.1.0",
    )


def rows(table: Table) -> Mapping[str, tuple[str, ...]]:
    """Return the rows of a table by their first cell."""
    return {row[0]: row[1:] for row in table.rows}
