"""Streets and buildings of a city for the page of the workbench, and the area for its search."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import EmptyResultError
from semsig_gis.output import packed_ground, search_area

if TYPE_CHECKING:
    from semsig_gis.database import ObjectStore, SignatureDatabase

MARGIN_M = 100.0  # width of the zone around the cells in which they are drawn


def city_streets(database: SignatureDatabase, store: ObjectStore | None) -> dict[str, Any]:
    """Return the area for the search, and packed streets and buildings, None if there are none."""
    area = search_area(database)
    ground = {} if store is None else {"streets": store.streets, "buildings": store.footprints}
    tables = {kind: table for kind, table in ground.items() if table is not None}
    if not tables:
        return {"area": area, "ground": None}
    west, south, east, north = area["box"]
    box = west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M
    try:
        arrays, about, _ = packed_ground(tables, box)
    except EmptyResultError:
        return {"area": area, "ground": None}
    return {"area": area, "ground": [arrays, about]}
