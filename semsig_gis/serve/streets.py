"""Streets and buildings of a city for the page of the workbench, and the area for its search."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.core import EmptyResultError
from semsig_gis.output import packed_ground, search_area

if TYPE_CHECKING:
    from semsig_gis.database import ObjectStore, SignatureDatabase


def city_streets(database: SignatureDatabase, store: ObjectStore | None) -> dict[str, Any]:
    """Return the area for the search, and packed streets and buildings, None if there are none."""
    area = search_area(database)
    ground = {} if store is None else store.ground_around(database.xy)
    if not ground:
        return {"area": area, "ground": None}
    box = ground.pop("box")
    try:
        arrays, about, _ = packed_ground(ground, box)
    except EmptyResultError:
        return {"area": area, "ground": None}
    return {"area": area, "ground": [arrays, about]}
