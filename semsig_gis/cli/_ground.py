"""Streets and buildings below the maps of the commands."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.errors import DatabaseError, EmptyResultError

if TYPE_CHECKING:
    import folium

    from semsig_gis.database import SignatureDatabase

AROUND_M = 100.0

Buildings = Annotated[
    Path | None,
    typer.Option(
        help="Footprints to draw below the map; those that the database was built with by default."
    ),
]
Streets = Annotated[
    Path | None,
    typer.Option(
        help="Centre lines to draw below the map; those that the database was built with by "
        "default."
    ),
]


def draw_ground(
    drawn: folium.Map,
    path: Path,
    opened: SignatureDatabase,
    *,
    buildings: Path | None = None,
    streets: Path | None = None,
) -> None:
    """Add streets and buildings to a map: those of files, else of the store of the database."""
    from semsig_gis.map_ground import ground_map
    from semsig_gis.store import open_store
    from semsig_gis.surroundings import read_surroundings

    houses = lines = None
    if buildings is not None:
        houses = read_surroundings(buildings, role="buildings", crs=opened.crs)
    if streets is not None:
        lines = read_surroundings(streets, role="streets", crs=opened.crs)
    if houses is None or lines is None:
        with contextlib.suppress(DatabaseError):  # a map may do without
            store = open_store(path)
            houses = store.footprints if houses is None else houses
            lines = store.streets if lines is None else lines
    if houses is None and lines is None:
        return
    low, high = opened.xy.min(axis=0) - AROUND_M, opened.xy.max(axis=0) + AROUND_M
    try:
        ground_map(
            buildings=houses,
            streets=lines,
            box=(*low.tolist(), *high.tolist()),
            map_=drawn,
        )
    except EmptyResultError:
        if buildings is not None or streets is not None:
            raise
