"""Rows that the cores of a machine share."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from semsig_gis.core.threads import NotWantedError, share_rows, while_wanted


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
