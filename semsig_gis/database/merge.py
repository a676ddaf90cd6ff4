"""Merging the databases of two places into one, so that a region grows city by city."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis import __version__
from semsig_gis.core import (
    CLASS_CODE,
    HALF_WIDTH,
    LICENSES,
    MERGED,
    DatabaseError,
    Displayed,
    cells_near,
)
from semsig_gis.database.build import build_cells
from semsig_gis.database.city import open_city
from semsig_gis.database.database import join_databases, require_same
from semsig_gis.database.store import ObjectStore, save_with_store
from semsig_gis.database.tiles import MARGIN_M
from semsig_gis.objects import StreetObjects, compare_objects, join_licences, licenses_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class MergeReport(Displayed):
    """What two databases came to.

    `cells` and `objects` are those of the result. `shared_cells` and `shared_objects` were in both
    databases; `recomputed` cells lie where both have something near.
    """

    cells: int
    objects: int
    shared_cells: int
    shared_objects: int
    recomputed: int

    def _facts(self) -> dict[str, object]:
        return {**self.to_dict()}

    def to_dict(self) -> dict[str, int]:
        """Return the fields as plain values, ready for JSON."""
        return asdict(self)


def merge_databases(
    first: str | Path,
    second: str | Path,
    *,
    out: str | Path,
    progress: Callable[[int, int], None] | None = None,
) -> MergeReport:
    """Merge two databases, in one file or in tiles, and their object stores.

    Parameters
    ----------
    first, second : str or Path
        Files of the databases, or folders of their tiles: of one CRS, grid, range, viewpoints and
        classes, and both with buildings or both without.
    out : str or Path
        File to write; its object store is put beside it.
    progress : callable, optional
        Called with the number of cells done and in all, of those that are computed again.

    Returns
    -------
    MergeReport
        What they came to.

    Raises
    ------
    DatabaseError
        If the databases were made in different ways, or one has no object store; nothing is
        written then.

    Notes
    -----
    Objects of one class at exactly the same place in both, and the same buildings and streets, are
    taken once, as the first database has them. Cells where both have something near, those that
    both hold among them, are computed again from all of it; the others stay as they are. So the
    result is what `build_database` makes of the objects, buildings and streets of both.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_with_store
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     city, region = f"{folder}/city.parquet", f"{folder}/region.parquet"
    ...     save_with_store(demo_database, ObjectStore.of(demo_objects), city)
    ...     report = merge_databases(city, city, out=region)
    >>> report.shared_objects == report.objects == len(demo_objects)
    True
    """
    cities = open_city(first), open_city(second)
    databases = [city.database for city in cities]
    require_same(*databases)
    stores = [city.store for city in cities]
    one = databases[0]
    along = one.viewpoints.mode == "streets"
    for city, store in zip(cities, stores, strict=True):
        if (store.footprints is None and one.occlusion is not None) or (
            store.streets is None and along
        ):
            raise DatabaseError(
                f"{city.path} lacks the buildings or streets that it was built with; build the "
                "database again."
            )
    store, shared = _merged_store(*stores)
    facts: dict[str, Any] = {
        "licenses": (
            *map(str, store.objects.licenses),
            *licenses_of(store.footprints, store.streets if along else None),
        ),
        "notes": store.objects.notes,
        "version": __version__,
    }
    # Outside of this box, all that decides about a cell is of one database.
    widest = _widest(store, one) if along else 0.0
    boxes = [_bounds(part) for part in stores]
    around = max(one.reach, widest) + MARGIN_M
    low = np.maximum(*(box[:2] for box in boxes)) - around
    high = np.minimum(*(box[2:] for box in boxes)) + around
    fresh = _built(one, store, low, high, progress=progress)
    parts = [part.select(~_within(part.xy, low, high)) for part in databases]
    merged = replace(join_databases([*parts, fresh]), **facts)
    save_with_store(merged, store, out)
    return MergeReport(
        cells=len(merged),
        objects=len(store.objects),
        shared_cells=int(np.isin(one.cell_ids, databases[1].cell_ids).sum()),
        shared_objects=shared,
        recomputed=len(fresh),
    )


def _merged_store(first: ObjectStore, second: ObjectStore) -> tuple[ObjectStore, int]:
    """Return what both stores hold, once, and how many objects were in both."""
    twins = compare_objects(first.objects, second.objects).same[:, 1]
    others = second.objects.table.drop(index=second.objects.table.index[twins])
    table = pd.concat([first.objects.table, others], ignore_index=True)
    if MERGED in table:
        table[MERGED] = table[MERGED].fillna("")
    objects = StreetObjects(
        table.astype({CLASS_CODE: np.uint8}),
        first.objects.taxonomy,
        join_licences([*first.objects.licenses, *second.objects.licenses]),
        tuple(dict.fromkeys([*first.objects.notes, *second.objects.notes])),
    )
    store = ObjectStore(
        objects=objects,
        footprints=_joined(first.footprints, second.footprints),
        streets=_joined(first.streets, second.streets),
    )
    return store, len(twins)


def _joined(
    first: gpd.GeoDataFrame | None, second: gpd.GeoDataFrame | None
) -> gpd.GeoDataFrame | None:
    """Return the shapes of both tables, those that both have once."""
    if first is None or second is None:
        return first if second is None else second
    known = pd.Index(first.geometry.to_wkb())
    others = second[~pd.Index(second.geometry.to_wkb()).isin(known)]
    joined = gpd.GeoDataFrame(pd.concat([first, others], ignore_index=True), crs=first.crs)
    joined.attrs[LICENSES] = list(licenses_of(first, second))
    return joined


def _widest(store: ObjectStore, database: SignatureDatabase) -> float:
    """Return the largest half-width of any street in metres."""
    streets = store.streets
    widths = np.empty(0) if streets is None else streets.get(HALF_WIDTH, np.empty(0))
    return float(np.nanmax(np.append(widths, database.viewpoints.width)))


def _bounds(store: ObjectStore) -> NDArray[np.float64]:
    """Return ``xmin, ymin, xmax, ymax`` in metres of all that a store holds."""
    tables = (store.objects.table, store.footprints, store.streets)
    bounds = np.stack([table.total_bounds for table in tables if table is not None])
    return np.append(np.nanmin(bounds[:, :2], axis=0), np.nanmax(bounds[:, 2:], axis=0))


def _within(
    xy: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.logical_and.reduce((xy >= low) & (xy <= high), axis=1)
    return inside


def _built(
    database: SignatureDatabase,
    store: ObjectStore,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    *,
    progress: Callable[[int, int], None] | None,
) -> SignatureDatabase:
    """Return the cells in a box, computed from all that a store holds."""
    reach, grid = database.reach, database.grid
    near = _within(store.objects.xy, low - reach, high + reach)
    if not near.any():
        return database.select(slice(0))
    objects = replace(store.objects, table=store.objects.table[near])
    columns, rows = cells_near(objects.xy, grid=grid, radius=reach)
    inside = _within(grid.viewpoints(columns, rows), low, high)
    return build_cells(
        objects,
        columns[inside],
        rows[inside],
        grid=grid,
        spec=database.spec,
        viewpoints=database.viewpoints,
        footprints=None
        if store.footprints is None
        else _near(store.footprints, np.append(low - reach, high + reach)),
        streets=store.streets,
        partial=True,
        progress=progress,
    )


def _near(footprints: gpd.GeoDataFrame, box: NDArray[np.float64]) -> gpd.GeoDataFrame:
    """Return the footprints that meet a box, and all neighbours of those that do."""
    bounds = footprints.bounds.to_numpy()
    chosen = shapely.box(*bounds.T)
    near = shapely.intersects(chosen, shapely.box(*box))
    if near.any():
        low, high = bounds[near, :2].min(axis=0), bounds[near, 2:].max(axis=0)
        near = shapely.intersects(chosen, shapely.box(*(low - MARGIN_M), *(high + MARGIN_M)))
        # Flat ones are left out there too, but there may be no others.
        near[near] = shapely.area(shapely.make_valid(footprints.geometry.to_numpy()[near])) > 0
    return footprints[near]
