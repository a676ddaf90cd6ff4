"""Tasks done one after the other, or side by side by processes of dask, here or elsewhere."""

from __future__ import annotations

import contextlib
import gc
import logging
import signal
import tempfile
import threading
import time
import warnings
from concurrent.futures import CancelledError
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from semsig_gis import __version__
from semsig_gis.core.checks import MOST_WORKERS, require_number
from semsig_gis.core.errors import InputError, SemsigError, extra
from semsig_gis.core.temporary import own_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence
    from contextlib import ExitStack

    from distributed import Client, LocalCluster

_Task = TypeVar("_Task")
_Value = TypeVar("_Value")

ATTEMPTS = 3
MOST_FAILED = 10  # when so many tasks have failed, the rest would too
# For a scheduler to answer, in seconds.
PATIENCE_S = 10


@dataclass(frozen=True, slots=True)
class Outcome(Generic[_Task, _Value]):
    """What a task gave, or why it failed, without a full stop; then its value is None."""

    task: _Task
    value: _Value | None = None
    reason: str | None = None


def check_workers(workers: int, scheduler: str | None) -> None:
    """Refuse a number of workers out of range, an empty scheduler address, or both at once."""
    if workers < 0 or (workers and scheduler is not None) or scheduler == "":
        raise InputError(
            f"{workers} workers and the scheduler {scheduler!r} were given; give a number of "
            "workers from 0 up, or the address of a scheduler."
        )
    require_number("number of workers", workers, least=0, most=MOST_WORKERS)


def run_tasks(
    work: Callable[[_Task], _Value],
    tasks: Sequence[_Task],
    *,
    workers: int = 0,
    scheduler: str | None = None,
    files: Sequence[Path] = (),
) -> Generator[Outcome[_Task, _Value]]:
    """Do tasks, and yield the outcome of each when it is done or has failed three times.

    `workers` is the number of processes of this machine, 0 to work here, in the order of the tasks
    and without dask; `scheduler` is the address of a dask scheduler instead. Workers import `work`
    (a `functools.partial` will do), so a script that gives them needs the guard ``if __name__ ==
    "__main__":``, and they must see `files` under the same paths. Tasks are distinct, and all
    hashable or none. InputError if no worker can be used.
    """
    check_workers(workers, scheduler)
    if not tasks:
        return
    if not workers and scheduler is None:
        for task in tasks:
            yield _attempt(work, task)
        return
    with extra("cluster", "work in several processes"):
        from distributed import KilledWorker, as_completed  # noqa: PLC0415 - only where it is used

    with _answering(scheduler), _client(workers, scheduler) as client:
        _require_same_view(client, files)
        futures = client.map(partial(_attempt, work), tasks, pure=False)
        task_of = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        for future in as_completed(futures, loop=client.loop):
            task = task_of[future.key]
            try:
                yield future.result()
            except KilledWorker:
                yield Outcome(task, reason=f"{ATTEMPTS} processes died while they worked on it")
            except CancelledError:
                yield Outcome(task, reason="the connection to the scheduler was lost")


def finish_tasks(
    work: Callable[[_Task], _Value],
    tasks: Sequence[_Task],
    *,
    done: Callable[[_Task, _Value | None], None],
    workers: int = 0,
    scheduler: str | None = None,
    files: Sequence[Path] = (),
) -> dict[_Task, str]:
    """Do tasks as `run_tasks` does until ten have failed; return why, in the order of failing.

    `done` is called with each task that was done and its value.
    """
    failed: dict[_Task, str] = {}
    outcomes = run_tasks(work, tasks, workers=workers, scheduler=scheduler, files=files)
    with contextlib.closing(outcomes):
        for outcome in outcomes:
            if outcome.reason is None:
                done(outcome.task, outcome.value)
            else:
                failed[outcome.task] = outcome.reason
            if len(failed) == MOST_FAILED:
                break
    return failed


def _attempt(work: Callable[[_Task], _Value], task: _Task) -> Outcome[_Task, _Value]:
    """Do a task, again where it fails; what went wrong is returned as words, not raised."""
    reason = ""
    for _ in range(ATTEMPTS):
        try:
            return Outcome(task, value=work(task))
        except SemsigError as error:
            reason = str(error).removesuffix(".")
        except Exception as error:  # noqa: BLE001 - one task must not end the run
            reason = f"{type(error).__name__}: {error}"
    return Outcome(task, reason=reason)


@contextlib.contextmanager
def _answering(scheduler: str | None) -> Iterator[None]:
    """Say in a sentence that processes do not answer in time, as on a loaded machine."""
    try:
        yield
    except (TimeoutError, OSError) as error:
        whose = "the processes" if scheduler is None else f"the scheduler {scheduler}"
        raise InputError(
            f"{whose} did not answer in time ({type(error).__name__}); run the same command again, "
            "with fewer workers or when the machine is less busy."
        ) from error


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Give a client of the scheduler, or of processes that end with the block."""
    import dask  # noqa: PLC0415 - only where it is used

    with contextlib.ExitStack() as stack:
        scratch = stack.enter_context(own_folder(Path(tempfile.gettempdir())))
        settings = {
            "temporary-directory": str(scratch),
            "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
            # A task that kills its worker must not take the tasks down that wait there.
            "distributed.scheduler.worker-saturation": 1.0,
            # Not with a MALLOC_TRIM_THRESHOLD_: giving all memory back at once takes twice the
            # time of the work.
            "distributed.nanny.pre-spawn-environ": {
                f"{name}_NUM_THREADS": 1 for name in ("MKL", "OMP", "OPENBLAS")
            },
        }
        stack.enter_context(dask.config.set(settings))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # of what dask leaves half made
            client = _connect(workers, scheduler, stack)
            if client is None:
                gc.collect()
        if client is None:
            raise InputError(
                f"{workers} processes could not be started; ask for fewer, or try again."
                if scheduler is None
                else f"the scheduler {scheduler} cannot be reached; give the address that `dask "
                "scheduler` printed, such as tcp://10.0.0.5:8786."
            )
        try:
            yield stack.enter_context(client)
        finally:
            if scheduler is None:
                _await_processes(client, workers)


def _connect(workers: int, scheduler: str | None, stack: ExitStack) -> Client | None:
    """Return a client of the scheduler, or of processes that end with the stack; else None.

    On a loaded machine, dask fails in ways of its own.
    """
    from distributed import Client, LocalCluster  # noqa: PLC0415 - only where it is used

    try:
        if scheduler is not None:
            return Client(scheduler, timeout=PATIENCE_S, set_as_default=False)
        with _interrupts_ignored():
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                memory_limit=0,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        stack.callback(_end, cluster)
        return Client(cluster, timeout=PATIENCE_S, set_as_default=False)
    except Exception:  # noqa: BLE001 - whatever it is, nothing was begun
        return None


def _end(cluster: LocalCluster) -> None:
    """End processes; where dask fails at it, what they did stands."""
    with contextlib.suppress(Exception):
        cluster.close(timeout=PATIENCE_S)


def _await_processes(client: Client, workers: int) -> None:
    """Wait for processes that are being started again: dask cannot end them before."""
    until = time.monotonic() + PATIENCE_S
    with contextlib.suppress(OSError):
        while len(client.nthreads()) < workers and time.monotonic() < until:
            time.sleep(0.05)


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


def _require_same_view(client: Client, files: Sequence[Path]) -> None:
    """Refuse workers that have another version of the package, or other files."""
    ours = _view(files)
    views = client.run(_view, files, on_error="return")
    if not views:
        raise InputError("the scheduler has no workers; start some with `dask worker ADDRESS`.")
    for worker, view in views.items():
        if isinstance(view, BaseException):
            raise InputError(
                f"the worker {worker} cannot run semsig_gis ({view}); install it there."
            ) from view
        if view[0] != ours[0]:
            raise InputError(
                f"the worker {worker} has semsig_gis {view[0]}; install {ours[0]} there."
            )
        for path, here, there in zip(files, ours[1:], view[1:], strict=True):
            if here != there:
                raise InputError(
                    f"the worker {worker} does not see {path} as it is here; give paths on a file "
                    "system that all machines share."
                )


def _view(paths: Sequence[Path]) -> tuple[str | int | None, ...]:
    """Return what a process sees: its version of the package, and the sizes of files."""
    sizes = [path.stat().st_size if path.exists() else None for path in paths]
    return (__version__, *sizes)
