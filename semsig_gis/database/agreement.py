"""Whether street objects can be those that a database was built from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import ObjectIndex

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects

MOST_CELLS = 500
NEAR_M = 100.0  # what is farther away has a rough distance
MARGIN_M, MARGIN_SHARE = 1.0, 0.02  # of a place in a signature, and of its distance


def share_seen(database: SignatureDatabase, objects: StreetObjects) -> float:
    """Return the share of what some cells see that is among street objects; 1 if they see nothing.

    It is 1 for the objects that a database was built from, and near 0 for those of another city.
    """
    rows = np.unique(np.linspace(0, len(database) - 1, MOST_CELLS).astype(np.int64))
    cells = database.select(rows)
    distances, angles = cells.distances, np.radians(cells.bearings)
    # An extended thing is seen at its nearest place, where it may have no point.
    used = distances <= NEAR_M
    if cells.extent_units is not None:
        used &= cells.extent_units == 0
    if not used.any():
        return 1.0
    steps = distances[:, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    places = (np.repeat(cells.xy, cells.lengths, axis=0) + steps)[used]
    margins = MARGIN_M + MARGIN_SHARE * distances[used]
    place, near = ObjectIndex(objects.xy).pairs_within(places, radius=float(margins.max()))
    apart = np.hypot(*(places[place] - objects.xy[near]).T)
    same = (objects.codes[near] == cells.codes[used][place]) & (apart <= margins[place])
    return len(np.unique(place[same])) / len(places)
