"""Merge the databases of two areas into one, so that a region can grow city by city."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd

from semsig_gis import __version__
from semsig_gis.core import (
    HALF_WIDTH,
    LICENSES,
    DatabaseError,
    Displayed,
    cells_near,
)
from semsig_gis.database.cells import build_cells, cell_reach
from semsig_gis.database.city import open_city
from semsig_gis.database.database import join_databases, require_same
from semsig_gis.database.occlusion import MARGIN_M, footprints_around
from semsig_gis.database.store import ObjectStore, save_with_store
from semsig_gis.objects import (
    StreetObjects,
    compare_objects,
    join_licences,
    joined_tables,
    licenses_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database.database import SignatureDatabase


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class MergeReport(Displayed):
    """Counts of the cells and objects of a merged database.

    `shared_cells` and `shared_objects` were in both databases; `recomputed` cells are near objects,
    buildings or streets of both.
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
        File to write; its object store is written to the same folder.
    progress : callable, optional
        Called with the number of finished cells and of all cells that are recomputed.

    Returns
    -------
    MergeReport
        Counts of the result.

    Raises
    ------
    DatabaseError
        If the databases were built with different settings, or one has no object store; then
        nothing is written.

    Notes
    -----
    Objects of one class at exactly the same place in both, and equal buildings and streets, are
    taken once, from the first database. Cells near objects, buildings or streets of both databases
    are recomputed from all of them; the others are copied. So the result is what `build_database`
    makes of the objects, buildings and streets of both.

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
    template = databases[0]
    needs_streets = template.viewpoints.mode == "streets"
    for city, store in zip(cities, stores, strict=True):
        if (store.footprints is None and template.occlusion is not None) or (
            store.streets is None and needs_streets
        ):
            raise DatabaseError(
                f"{city.path} lacks the buildings or streets that it was built with; build the "
                "database again."
            )
    store, shared = _merged_store(*stores)
    # The buildings and streets that the cells depend on, not those that are only drawn.
    used, *used_parts = (
        replace(
            part,
            footprints=None if template.occlusion is None else part.footprints,
            streets=part.streets if needs_streets else None,
        )
        for part in (store, *stores)
    )
    facts: dict[str, Any] = {
        "licenses": (
            *map(str, store.objects.licenses),
            *licenses_of(used.footprints, used.streets),
        ),
        "notes": store.objects.notes,
        "version": __version__,
    }
    # Cells outside of this box depend on only one of the databases.
    widest = 0.0
    if used.streets is not None:
        widths = used.streets.get(HALF_WIDTH, np.empty(0))
        widest = float(np.nanmax(np.append(widths, template.viewpoints.width)))
    around = max(template.reach, widest) + MARGIN_M
    low = np.maximum(*(box[:2] for box in map(_bounds, used_parts))) - around
    high = np.minimum(*(box[2:] for box in map(_bounds, used_parts))) + around
    recomputed = _build_box(template, used, low, high, progress=progress)
    parts = [part.select(~_within(part.xy, low, high)) for part in databases]
    merged = replace(join_databases([*parts, recomputed]), **facts)
    save_with_store(merged, store, out)
    return MergeReport(
        cells=len(merged),
        objects=len(store.objects),
        shared_cells=int(np.isin(template.cell_ids, databases[1].cell_ids).sum()),
        shared_objects=shared,
        recomputed=len(recomputed),
    )


def _merged_store(first: ObjectStore, second: ObjectStore) -> tuple[ObjectStore, int]:
    """Return a store of the objects and shapes of both, and the number of shared objects."""
    twins = compare_objects(first.objects, second.objects).same[:, 1]
    others = second.objects.table.drop(index=second.objects.table.index[twins])
    objects = StreetObjects(
        joined_tables(first.objects.table, others),
        first.objects.taxonomy,
        join_licences([*first.objects.licenses, *second.objects.licenses]),
        tuple(dict.fromkeys([*first.objects.notes, *second.objects.notes])),
    )
    store = ObjectStore(
        objects=objects,
        footprints=_union(first.footprints, second.footprints),
        streets=_union(first.streets, second.streets),
    )
    return store, len(twins)


def _union(
    first: gpd.GeoDataFrame | None, second: gpd.GeoDataFrame | None
) -> gpd.GeoDataFrame | None:
    """Combine two tables of polygons or lines; of two rows with equal geometry, keep the first."""
    if first is None or second is None:
        return first if second is None else second
    shapes = pd.Index(first.geometry.to_wkb())
    others = second[~pd.Index(second.geometry.to_wkb()).isin(shapes)]
    union = gpd.GeoDataFrame(pd.concat([first, others], ignore_index=True), crs=first.crs)
    union.attrs[LICENSES] = list(licenses_of(first, second))
    return union


def _bounds(store: ObjectStore) -> NDArray[np.float64]:
    """Return ``xmin, ymin, xmax, ymax`` in metres of all shapes of a store."""
    tables = (store.objects.table, store.footprints, store.streets)
    bounds = np.stack([table.total_bounds for table in tables if table is not None])
    return np.append(np.nanmin(bounds[:, :2], axis=0), np.nanmax(bounds[:, 2:], axis=0))


def _within(
    xy: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.logical_and.reduce((xy >= low) & (xy <= high), axis=1)
    return inside


def _build_box(
    template: SignatureDatabase,
    store: ObjectStore,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    *,
    progress: Callable[[int, int], None] | None,
) -> SignatureDatabase:
    """Return the cells in a box, computed from a store with the settings of a database."""
    reach, grid = template.reach, template.grid
    has_landmarks = bool(len(template.taxonomy.tall_codes))
    objects, footprints = store.objects, store.footprints
    near = _within(objects.xy, low - reach, high + reach)
    if not has_landmarks:
        objects = replace(objects, table=objects.table[near])
    if not len(objects):
        return template.select(slice(0))
    furthest = cell_reach(objects.taxonomy, template.spec.radius)
    columns, rows = cells_near(objects.xy, grid=grid, radius=furthest)
    inside = _within(grid.viewpoints(columns, rows), low, high)
    if footprints is not None and not has_landmarks:
        around = [*(low - reach), *(high + reach)]
        footprints = footprints_around(partial(_meeting, footprints), around)
    return build_cells(
        objects,
        columns[inside],
        rows[inside],
        grid=grid,
        spec=template.spec,
        viewpoints=template.viewpoints,
        footprints=footprints,
        streets=store.streets,
        partial=True,
        progress=progress,
    )


def _meeting(footprints: gpd.GeoDataFrame, box: Sequence[float]) -> gpd.GeoDataFrame:
    """Return the footprints with bounds that meet a box."""
    west, south, east, north = footprints.bounds.to_numpy().T
    meets = (west <= box[2]) & (south <= box[3]) & (east >= box[0]) & (north >= box[1])
    return footprints[meets]
