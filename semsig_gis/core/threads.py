"""Threads for loops over rows in kernels, and for whole tasks."""

from __future__ import annotations

import contextlib
import functools
import os
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from concurrent.futures import Future

    from numpy.typing import NDArray

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

ROWS_A_PART = 8192
"""Minimum number of rows for a thread, where a row takes some hundred nanoseconds."""


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores())


if hasattr(os, "register_at_fork"):  # a child process does not inherit the threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


_thread_state = threading.local()


class WorkCancelledError(Exception):
    """The result of the work is not needed any more."""


@contextlib.contextmanager
def cancellable(is_needed: Callable[[], bool]) -> Iterator[None]:
    """Raise `WorkCancelledError` at the start of the block if `is_needed()` is false.

    `share_rows`, called in the block by this thread, raises it as well.
    """
    _thread_state.is_needed = is_needed
    try:
        _raise_if_cancelled()
        yield
    finally:
        del _thread_state.is_needed


def _raise_if_cancelled() -> None:
    is_needed = getattr(_thread_state, "is_needed", None)
    if is_needed is not None and not is_needed():
        raise WorkCancelledError


def each_in_order(
    work: Callable[[_Item], _Result], items: Iterable[_Item], *, threads: int | None = None
) -> Iterator[_Result]:
    """Yield ``work(item)`` for each item, in order, computed in parallel threads.

    By default, there is a thread for each core. At most two items per thread are taken in advance.
    The first item is computed before the others start, so that caches are filled only once. If
    `items` raises an error, it is raised after the results of the items before it.
    """
    rest = iter(items)
    for first in rest:
        yield work(first)
        break
    waiting: deque[Future[_Result]] = deque()
    threads = cores() if threads is None else threads
    # `share_rows` in these threads uses no further threads, because they are all busy.
    sharing = (_thread_state, "sharing", True)
    pool = ThreadPoolExecutor(threads, initializer=setattr, initargs=sharing)
    try:
        try:
            for item in rest:
                waiting.append(pool.submit(work, item))
                if len(waiting) > 2 * threads:
                    yield waiting.popleft().result()
        except Exception:
            while waiting:
                yield waiting.popleft().result()
            raise
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def share_rows(
    work: Callable[[NDArray[np.int64]], object], rows: int, *, least: int = ROWS_A_PART
) -> None:
    """Divide rows into parts of at least `least` rows, and call `work` for each in parallel.

    `work` gets the first row of its part and the one after the last. Calls of this function by
    `work` use no further threads.
    """
    _raise_if_cancelled()
    parts = min(2 * cores(), rows // least)
    if parts <= 1 or cores() == 1 or getattr(_thread_state, "sharing", False):
        work(np.array([0, rows]))
        return

    def work_without_sharing(part: NDArray[np.int64]) -> None:
        _thread_state.sharing = True
        try:
            work(part)
        finally:
            _thread_state.sharing = False

    ends = np.linspace(0, rows, parts + 1).astype(np.int64)
    for future in [
        _pool().submit(work_without_sharing, ends[part : part + 2]) for part in range(parts)
    ]:
        future.result()
