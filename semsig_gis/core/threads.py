"""Work that the cores of this machine share: loops over rows in kernels, and whole tasks."""

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
"""Rows that are worth a thread, where each takes some hundred nanoseconds."""


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores())


if hasattr(os, "register_at_fork"):  # the threads stay behind
    os.register_at_fork(after_in_child=_pool.cache_clear)


_here = threading.local()


class NotWantedError(Exception):
    """What was worked on is not wanted any more."""


@contextlib.contextmanager
def while_wanted(check: Callable[[], bool]) -> Iterator[None]:
    """Raise `NotWantedError` here, and in `share_rows` of this thread, once the `check` fails."""
    _here.check = check
    try:
        _go_on()
        yield
    finally:
        del _here.check


def _go_on() -> None:
    check = getattr(_here, "check", None)
    if check is not None and not check():
        raise NotWantedError


def work_alone() -> None:
    """Let this thread share nothing from now on, as the others have work of their own."""
    _here.sharing = True


def each_in_order(
    work: Callable[[_Item], _Result], items: Iterable[_Item], *, threads: int | None = None
) -> Iterator[_Result]:
    """Yield what `work` returns for each of the items, which it is called with side by side.

    Each thread, one a core by default, has an item of its own, and only a few are taken before what
    they give is. The first one is worked on by all, so that what is kept for later ones is made
    once. An error of the items is raised when all before have been yielded.
    """
    rest = iter(items)
    for first in rest:
        yield work(first)
        break
    waiting: deque[Future[_Result]] = deque()
    threads = cores() if threads is None else threads
    pool = ThreadPoolExecutor(threads, initializer=work_alone)
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
    """Call `work` with the first row of each part and the one after its last, all parts at once.

    A part has at least so many rows. What is shared within a part is done by its own thread.
    """
    _go_on()
    parts = min(2 * cores(), rows // least)
    if parts <= 1 or cores() == 1 or getattr(_here, "sharing", False):
        work(np.array([0, rows]))
        return

    def do(part: NDArray[np.int64]) -> None:
        _here.sharing = True
        try:
            work(part)
        finally:
            _here.sharing = False

    ends = np.linspace(0, rows, parts + 1).astype(np.int64)
    for done in [_pool().submit(do, ends[part : part + 2]) for part in range(parts)]:
        done.result()
