"""The ground of the city for the page of the workbench: its streets, and what its search needs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import EmptyResultError
from semsig_gis.maps import packed_ground, search_area

if TYPE_CHECKING:
    from semsig_gis.database import ObjectStore, SignatureDatabase

BESIDE_M = 100.0  # from the outermost cells, how far streets are drawn


def city_ground(database: SignatureDatabase, store: ObjectStore | None) -> dict[str, Any]:
    """Return what the search needs, and the streets around the cells where they are known."""
    area = search_area(database)
    if store is None or store.streets is None:
        return {"area": area, "ground": None}
    west, south, east, north = area["box"]
    box = west - BESIDE_M, south - BESIDE_M, east + BESIDE_M, north + BESIDE_M
    try:
        arrays, about, _ = packed_ground({"streets": store.streets}, box)
    except EmptyResultError:
        return {"area": area, "ground": None}
    return {"area": area, "ground": [arrays, about]}
