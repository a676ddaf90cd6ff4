"""Rows that the cores of a machine share."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from semsig_gis.core import InputError, NotWantedError, each_in_order, share_rows, while_wanted

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.mark.parametrize("cores", [1, 2, 5])
def test_each_row_is_worked_on_once_also_within_a_part(
    cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig_gis.core.threads.cores", lambda: cores)
    outer, inner = np.zeros(1000, int), np.zeros(1000, int)

    def work(part: np.ndarray) -> None:
        first, last = part.tolist()
        outer[first:last] += 1
        own = threading.current_thread()

        def within(some: np.ndarray) -> None:
            assert cores == 1 or threading.current_thread() is own
            inner[first + some[0] : first + some[1]] += 1

        share_rows(within, last - first, least=1)

    for _ in range(3):  # more parts than there are threads
        share_rows(work, 1000, least=10)
    assert (outer == 3).all()
    assert (inner == 3).all()


def test_what_is_not_wanted_any_more_goes_on_to_the_next_loop_alone() -> None:
    done: list[int] = []

    def work(part: np.ndarray) -> None:
        done.append(len(part))

    with while_wanted(lambda: not done):
        share_rows(work, 1)
        with pytest.raises(NotWantedError):
            share_rows(work, 1)
    share_rows(work, 1)
    with pytest.raises(NotWantedError), while_wanted(lambda: False):
        share_rows(work, 1)
    assert len(done) == 2


@pytest.mark.parametrize("cores", [1, 3])
def test_items_are_worked_on_side_by_side_and_come_in_their_order(
    cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig_gis.core.threads.cores", lambda: cores)
    meeting = threading.Barrier(cores)  # which nobody leaves before all are there
    taken: list[int] = []

    def items() -> Iterator[int]:
        for number in range(1 + 4 * cores):
            taken.append(number)
            yield number

    def square(number: int) -> int:
        if number:
            meeting.wait(60.0)
        return number**2

    squares = []
    for number, result in enumerate(each_in_order(square, items())):
        assert len(taken) <= number + 2 * cores + 1
        squares.append(result)
    assert squares == [number**2 for number in range(1 + 4 * cores)]


def test_an_error_of_the_items_comes_after_what_was_before_it() -> None:
    def items() -> Iterator[int]:
        yield from range(3)
        raise InputError("no more")

    results: list[int] = []
    with pytest.raises(InputError, match="no more"):
        results.extend(each_in_order(abs, items()))
    assert results == [0, 1, 2]


def test_an_error_of_the_work_ends_it() -> None:
    def work(number: int) -> float:
        return 1 / number

    with pytest.raises(ZeroDivisionError):
        list(each_in_order(work, [2, 1, 0, 1]))
