"""Building a signature database in tiles, one after the other or on the workers of dask.

Only paths and specs travel to a worker, and a tile is built from what lies near it. So memory
depends on the size of a tile, not on their number, and the files do not depend on who wrote them.
"""

from __future__ import annotations

import contextlib
import shutil
from functools import partial
from typing import TYPE_CHECKING

from semsig_gis.errors import DatabaseError, EmptyResultError
from semsig_gis.grid import GridSpec
from semsig_gis.manifest import part_name
from semsig_gis.signatures import SignatureSpec
from semsig_gis.tile_inputs import plan_tiles
from semsig_gis.tiles import TileSpec, build_tile, touched_tiles
from semsig_gis.unfinished import abandon, finished_tiles, publish
from semsig_gis.viewpoints import ViewpointSpec
from semsig_gis.workers import check_workers, run_tasks

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.manifest import Manifest, Part
    from semsig_gis.tiles import TilePlan

    Tile = tuple[int, int]

__all__ = ["build_tiles"]

# When so many have failed, the rest would too.
MOST_FAILED = 10


def build_tiles(
    objects: str | Path,
    out: str | Path,
    *,
    tile: TileSpec | None = None,
    grid: GridSpec | None = None,
    spec: SignatureSpec | None = None,
    viewpoints: ViewpointSpec | None = None,
    buildings: str | Path | None = None,
    streets: str | Path | None = None,
    workers: int = 0,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Manifest:
    """Build a signature database in tiles: a folder that is opened like a single file.

    Parameters
    ----------
    objects : str or Path
        Street objects that `semsig_gis.objects.save_objects` wrote.
    out : str or Path
        Folder to write. It appears whole, by rename; a database that is there is replaced.
    tile : TileSpec, optional
        Size of a tile; 2000 m by default.
    grid : GridSpec, optional
        The cells; 10 m by default.
    spec : SignatureSpec, optional
        Visibility range and angle levels; 30 m and 16 by default.
    viewpoints : ViewpointSpec, optional
        Which cells are looked from; all by default.
    buildings, streets : str or Path, optional
        Files that `semsig_gis.surroundings.read_surroundings` reads. Those that cannot be read by
        box are copied into such a file first.
    workers : int, default 0
        How many processes of this machine build tiles; 0 builds them here, without dask.
    scheduler : str, optional
        Address of a dask scheduler, such as ``tcp://10.0.0.5:8786``, whose workers see the same
        files under the same paths; then `workers` stays 0.
    progress : callable, optional
        Called with the number of tiles done and in all.
    tell : callable, optional
        Called with a remark for the user, as about a run that is taken up again.

    Returns
    -------
    Manifest
        What the database consists of.

    Raises
    ------
    InputError
        If an option cannot be used, the scheduler cannot be reached, or `out` holds something
        else or an unfinished run with other inputs or specs.
    DatabaseError
        If the street objects cannot be read, or a tile cannot be built; the other tiles are kept
        for the next run.
    EmptyResultError
        If no cell sees an object.

    Notes
    -----
    The files are the same byte for byte whatever the number of workers. An interrupted run leaves
    its tiles in ``OUT.partial``, and the same command goes on from there, if the specs are the same
    and the input files have the same content (by SHA-256). A script that gives `workers` needs the
    guard ``if __name__ == "__main__":``, because the workers import it.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.database_file import open_database
    >>> from semsig_gis.objects import build_objects, save_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> town, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(town, f"{folder}/objects.parquet")
    ...     parts = build_tiles(f"{folder}/objects.parquet", f"{folder}/town")
    ...     len(open_database(f"{folder}/town")) == parts.cells
    True
    """
    check_workers(workers, scheduler)
    plan = plan_tiles(
        objects,
        out,
        tile=tile or TileSpec(),
        grid=grid or GridSpec(),
        spec=spec or SignatureSpec(),
        viewpoints=viewpoints or ViewpointSpec(),
        buildings=buildings,
        streets=streets,
    )
    try:
        parts = _run(plan, workers, scheduler, progress, tell)
    finally:
        abandon(plan.folder)
    if not parts:
        shutil.rmtree(plan.folder, ignore_errors=True)
        msg = (
            f"no cell sees an object of {objects}; make the step ({plan.grid.step:g} m) smaller or "
            f"the visibility range ({plan.spec.radius:g} m) larger, or look at the area, the "
            "streets and the buildings."
        )
        raise EmptyResultError(msg)
    return publish(plan.folder, parts)


def _run(
    plan: TilePlan,
    workers: int,
    scheduler: str | None,
    progress: Callable[[int, int], None] | None,
    tell: Callable[[str], None] | None,
) -> list[Part]:
    """Build the tiles that are not done yet, and return the parts of all."""
    tiles = touched_tiles(plan.objects, grid=plan.grid, side=plan.side, reach=plan.reach)
    done = finished_tiles(plan.folder, tiles)
    if done and tell is not None:
        tell(f"an unfinished run has left {len(done):,} of {len(tiles):,} tiles; it goes on")
    todo = [one for one in tiles if one not in done]
    failed: dict[Tile, str] = {}
    paths = [plan.folder, plan.objects, plan.buildings, plan.streets]
    running = run_tasks(
        partial(build_tile, plan),
        todo,
        workers=workers,
        scheduler=scheduler,
        files=[path for path in paths if path is not None],
    )
    with contextlib.closing(running) as outcomes:
        for outcome in outcomes:
            if outcome.reason is None:
                done[outcome.task] = outcome.value
            else:
                failed[outcome.task] = outcome.reason
            if len(failed) == MOST_FAILED:
                break
            if progress is not None:
                progress(len(done), len(tiles))
    if failed:
        first = min(failed)
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        msg = (
            f"{part_name(first)}{others} could not be built ({failed[first]}); the {len(done):,} "
            f"tiles that are done are kept in {plan.folder}, so mend that and run the same command "
            "again."
        )
        raise DatabaseError(msg)
    return sorted(part for part in done.values() if part is not None)
