"""Tasks run in this process, or in parallel by dask workers on this machine or others."""

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
from semsig_gis.core.temporary import temporary_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence
    from contextlib import ExitStack

    from distributed import Client, LocalCluster

_Task = TypeVar("_Task")
_Value = TypeVar("_Value")

ATTEMPTS = 3
MOST_FAILED = 10  # failed tasks that end a run, because the others would probably fail too
TIMEOUT_S = 10  # for an answer of the scheduler


@dataclass(frozen=True, slots=True)
class Outcome(Generic[_Task, _Value]):
    """Value of a task, or None and the reason why it failed (without a full stop)."""

    task: _Task
    value: _Value | None = None
    reason: str | None = None


def check_workers(workers: int, scheduler: str | None) -> None:
    """Raise InputError for a number of workers out of range, an empty scheduler, or both given."""
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
    """Run tasks, and yield the outcome of each when it has succeeded or has failed three times.

    `workers` is the number of worker processes on this machine; with 0, tasks run in this process,
    in order and without dask. `scheduler` is the address of a dask scheduler instead. Workers
    import `work` (which may be a `functools.partial`), so a script that calls this with workers
    needs the guard ``if __name__ == "__main__":``. They need `files` under the same paths. Tasks
    are distinct, and all or none of them are hashable. InputError if no worker can be used.
    """
    check_workers(workers, scheduler)
    if not tasks:
        return
    if not workers and scheduler is None:
        for task in tasks:
            yield _attempt(work, task)
        return
    with extra("cluster", "work in several processes"):
        from distributed import KilledWorker, as_completed  # noqa: PLC0415 - optional, 0.4 s

    with _timeouts_explained(scheduler), _client(workers, scheduler) as client:
        _require_same_files(client, files)
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
    on_success: Callable[[_Task, _Value | None], None],
    workers: int = 0,
    scheduler: str | None = None,
    files: Sequence[Path] = (),
) -> dict[_Task, str]:
    """Run tasks like `run_tasks` until ten have failed; return the reasons by task.

    `on_success` is called with each successful task and its value.
    """
    failed: dict[_Task, str] = {}
    outcomes = run_tasks(work, tasks, workers=workers, scheduler=scheduler, files=files)
    with contextlib.closing(outcomes):
        for outcome in outcomes:
            if outcome.reason is None:
                on_success(outcome.task, outcome.value)
            else:
                failed[outcome.task] = outcome.reason
            if len(failed) == MOST_FAILED:
                break
    return failed


def _attempt(work: Callable[[_Task], _Value], task: _Task) -> Outcome[_Task, _Value]:
    """Run a task up to three times; return the error message as reason instead of raising."""
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
def _timeouts_explained(scheduler: str | None) -> Iterator[None]:
    """Raise InputError if processes do not answer in time, for example on a busy machine."""
    try:
        yield
    except (TimeoutError, OSError) as error:
        what = "the processes" if scheduler is None else f"the scheduler {scheduler}"
        raise InputError(
            f"{what} did not answer in time ({type(error).__name__}); run the same command again, "
            "with fewer workers or when the machine is less busy."
        ) from error


@contextlib.contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Give a client of the scheduler, or of worker processes that end with the block."""
    import dask  # noqa: PLC0415 - optional, 0.2 s

    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(temporary_folder(Path(tempfile.gettempdir())))
        settings = {
            "temporary-directory": str(folder),
            "distributed.scheduler.allowed-failures": ATTEMPTS - 1,
            # No tasks wait at a worker, because they would fail with a task that kills it.
            "distributed.scheduler.worker-saturation": 1.0,
            # Without dask's MALLOC_TRIM_THRESHOLD_: freeing all memory at once makes work take
            # twice as long.
            "distributed.nanny.pre-spawn-environ": {
                f"{name}_NUM_THREADS": 1 for name in ("MKL", "OMP", "OPENBLAS")
            },
        }
        stack.enter_context(dask.config.set(settings))
        with warnings.catch_warnings():
            # If dask cannot start, it leaves open resources, which are collected here silently.
            warnings.simplefilter("ignore", ResourceWarning)
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
                # dask cannot end workers that are being restarted, so wait for them.
                end = time.monotonic() + TIMEOUT_S
                with contextlib.suppress(OSError):
                    while len(client.nthreads()) < workers and time.monotonic() < end:
                        time.sleep(0.05)


def _connect(workers: int, scheduler: str | None, stack: ExitStack) -> Client | None:
    """Return a client of the scheduler, or of new processes that end with the stack.

    None if that fails: on a busy machine, dask raises many kinds of error.
    """
    from distributed import Client, LocalCluster  # noqa: PLC0415 - optional, 0.4 s

    try:
        if scheduler is not None:
            return Client(scheduler, timeout=TIMEOUT_S, set_as_default=False)
        with _interrupts_ignored():
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                memory_limit=0,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        stack.callback(_close, cluster)
        return Client(cluster, timeout=TIMEOUT_S, set_as_default=False)
    except Exception:  # noqa: BLE001 - no task has begun, whatever the error is
        return None


def _close(cluster: LocalCluster) -> None:
    """End worker processes; errors of dask are ignored, because the results are complete."""
    with contextlib.suppress(Exception):
        cluster.close(timeout=TIMEOUT_S)


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Ignore the interrupt key in processes started in the block; only this one handles it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


def _require_same_files(client: Client, files: Sequence[Path]) -> None:
    """Raise InputError if a worker has another version of the package, or other files."""
    version, sizes = _version_and_sizes(files)
    answers = client.run(_version_and_sizes, files, on_error="return")
    if not answers:
        raise InputError("the scheduler has no workers; start some with `dask worker ADDRESS`.")
    for worker, answer in answers.items():
        if isinstance(answer, BaseException):
            raise InputError(
                f"the worker {worker} cannot run semsig_gis ({answer}); install it there."
            ) from answer
        if answer[0] != version:
            raise InputError(
                f"the worker {worker} has semsig_gis {answer[0]}; install {version} there."
            )
        for path, size, worker_size in zip(files, sizes, answer[1], strict=True):
            if size != worker_size:
                raise InputError(
                    f"the worker {worker} does not see {path} as it is here; give paths on a file "
                    "system that all machines share."
                )


def _version_and_sizes(paths: Sequence[Path]) -> tuple[str, list[int | None]]:
    """Return the version of the package, and the sizes of files, None for a missing one."""
    return __version__, [path.stat().st_size if path.exists() else None for path in paths]
