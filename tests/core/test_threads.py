"""Threads for rows and for tasks."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from semsig_gis.core import InputError, WorkCancelledError, cancellable, each_in_order, share_rows

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_each_row_is_processed_once_also_in_nested_calls(
    cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig_gis.core.threads.cores", lambda: cores)
    outer, inner = np.zeros(1000, int), np.zeros(1000, int)

    def work(part: np.ndarray) -> None:
        first, last = part.tolist()
        outer[first:last] += 1
        own = threading.current_thread()

        def nested_work(rows: np.ndarray) -> None:
            assert cores == 1 or threading.current_thread() is own
            inner[first + rows[0] : first + rows[1]] += 1

        share_rows(nested_work, last - first, least=1)

    for _ in range(3):  # more parts than there are threads
        share_rows(work, 1000, least=10)
    assert (outer == 3).all()
    assert (inner == 3).all()


def test_cancelled_work_stops_at_the_next_loop() -> None:
    sizes: list[int] = []

    def work(part: np.ndarray) -> None:
        sizes.append(len(part))

    with cancellable(lambda: not sizes):
        share_rows(work, 1)
        with pytest.raises(WorkCancelledError):
            share_rows(work, 1)
    share_rows(work, 1)
    with pytest.raises(WorkCancelledError), cancellable(lambda: False):
        share_rows(work, 1)
    assert len(sizes) == 2


@pytest.mark.parametrize("cores", [1, 3])
def test_items_are_processed_in_parallel_and_returned_in_order(
    cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig_gis.core.threads.cores", lambda: cores)
    barrier = threading.Barrier(cores)
    requested: list[int] = []

    def items() -> Iterator[int]:
        for number in range(1 + 4 * cores):
            requested.append(number)
            yield number

    def square(number: int) -> int:
        if number:
            barrier.wait(60.0)
        return number**2

    squares = []
    for number, result in enumerate(each_in_order(square, items())):
        assert len(requested) <= number + 2 * cores + 1
        squares.append(result)
    assert squares == [number**2 for number in range(1 + 4 * cores)]


def test_error_of_the_items_is_raised_after_the_results_before_it() -> None:
    def items() -> Iterator[int]:
        yield from range(3)
        raise InputError("no more")

    results: list[int] = []
    with pytest.raises(InputError, match="no more"):
        results.extend(each_in_order(abs, items()))
    assert results == [0, 1, 2]


def test_error_of_the_work_is_raised() -> None:
    def work(number: int) -> float:
        return 1 / number

    with pytest.raises(ZeroDivisionError):
        list(each_in_order(work, [2, 1, 0, 1]))
