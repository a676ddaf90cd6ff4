"""Building a signature database in tiles, one after the other or on the workers of dask.

Only paths and specs travel to a worker, and a tile is built from what lies near it. So memory
depends on the size of a tile, not on their number, and the files do not depend on who wrote them.
"""

from __future__ import annotations

import contextlib
import logging
import shutil
import signal
import tempfile
import threading
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from semsig_gis import __version__
from semsig_gis.errors import DatabaseError, EmptyResultError, InputError, SemsigError
from semsig_gis.grid import GridSpec
from semsig_gis.manifest import part_name
from semsig_gis.signatures import SignatureSpec
from semsig_gis.tile_inputs import plan_tiles
from semsig_gis.tiles import TileSpec, build_tile, touched_tiles
from semsig_gis.unfinished import abandon, finished_tiles, publish
from semsig_gis.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence
    from pathlib import Path

    from distributed import Client

    from semsig_gis.manifest import Manifest, Part
    from semsig_gis.tiles import TilePlan

    Tile = tuple[int, int]

__all__ = ["build_tiles"]

ATTEMPTS = 3
# When so many have failed, the rest would too.
MOST_FAILED = 10
# For a scheduler to answer, in seconds.
PATIENCE_S = 10


@dataclass(frozen=True, slots=True)
class _Outcome:
    """What became of a tile: a part, nothing to see, or why it failed."""

    tile: Tile
    part: Part | None = None
    reason: str | None = None


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
    if workers < 0 or (workers and scheduler is not None) or scheduler == "":
        msg = (
            f"{workers} workers and the scheduler {scheduler!r} were given; give a number of "
            "workers from 0 up, or the address of a scheduler."
        )
        raise InputError(msg)
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
    with contextlib.closing(_outcomes(plan, todo, workers, scheduler)) as outcomes:
        for outcome in outcomes:
            if outcome.reason is None:
                done[outcome.tile] = outcome.part
            else:
                failed[outcome.tile] = outcome.reason
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


def _outcomes(
    plan: TilePlan, tiles: Sequence[Tile], workers: int, scheduler: str | None
) -> Generator[_Outcome]:
    """Build tiles, here or on workers, and yield each when it is done or has failed."""
    if not tiles:
        return
    if not workers and scheduler is None:
        for tile in tiles:
            yield _attempt(plan, tile)
        return
    from distributed import KilledWorker, as_completed  # noqa: PLC0415 - only where it is used

    with _client(workers, scheduler) as client:
        _require_same_view(client, plan)
        futures = client.map(partial(_attempt, plan), tiles, pure=False)
        tile_of = {future.key: tile for future, tile in zip(futures, tiles, strict=True)}
        for future in as_completed(futures, loop=client.loop):
            tile = tile_of[future.key]
            try:
                yield future.result()
            except KilledWorker:
                yield _Outcome(tile, reason=f"{ATTEMPTS} processes died while they built it")
            except CancelledError:
                yield _Outcome(tile, reason="the connection to the scheduler was lost")


def _attempt(plan: TilePlan, tile: Tile) -> _Outcome:
    """Build a tile, again where it fails; what went wrong is returned as words, not raised."""
    reason = ""
    for _ in range(ATTEMPTS):
        try:
            return _Outcome(tile, part=build_tile(plan, tile))
        except SemsigError as error:
            reason = str(error).removesuffix(".")
        except Exception as error:  # noqa: BLE001 - one tile must not end the run
            reason = f"{type(error).__name__}: {error}"
    return _Outcome(tile, reason=reason)


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Give a client of the scheduler, or of processes that end with the block."""
    import dask  # noqa: PLC0415 - only where it is used
    from distributed import Client, LocalCluster  # noqa: PLC0415

    with contextlib.ExitStack() as stack:
        scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="semsig-"))
        settings = {
            "temporary-directory": scratch,
            "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
            # A tile that kills its worker must not take the tiles down that wait there.
            "distributed.scheduler.worker-saturation": 1.0,
        }
        stack.enter_context(dask.config.set(settings))
        where: str | LocalCluster = scheduler or ""
        if scheduler is None:
            with _interrupts_ignored():
                where = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    memory_limit=0,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
            stack.enter_context(where)
        try:
            client = Client(where, timeout=PATIENCE_S, set_as_default=False)
        except (OSError, ValueError) as error:
            msg = (
                f"the scheduler {scheduler} cannot be reached; give the address that `dask "
                "scheduler` printed, such as tcp://10.0.0.5:8786."
            )
            raise InputError(msg) from error
        yield stack.enter_context(client)


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Start processes that leave it to this one to answer the interrupt key."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _require_same_view(client: Client, plan: TilePlan) -> None:
    """Refuse workers that have another version of the package, or other files."""
    paths = [plan.folder, plan.objects, plan.buildings, plan.streets]
    given = [path for path in paths if path is not None]
    ours = _view(given)
    views = client.run(_view, given, on_error="return")
    if not views:
        msg = "the scheduler has no workers; start some with `dask worker ADDRESS`."
        raise InputError(msg)
    for worker, view in views.items():
        if isinstance(view, BaseException):
            msg = f"the worker {worker} cannot run semsig_gis ({view}); install it there."
            raise InputError(msg) from view
        if view[0] != ours[0]:
            msg = f"the worker {worker} has semsig_gis {view[0]}; install {ours[0]} there."
            raise InputError(msg)
        for path, here, there in zip(given, ours[1:], view[1:], strict=True):
            if here != there:
                msg = (
                    f"the worker {worker} does not see {path} as it is here; give paths on a file "
                    "system that all machines share."
                )
                raise InputError(msg)


def _view(paths: Sequence[Path]) -> tuple[str | int | None, ...]:
    """Return what a process sees: its version of the package, and the sizes of files."""
    sizes = [path.stat().st_size if path.exists() else None for path in paths]
    return (__version__, *sizes)
