"""Tests of semsig_gis.experiments.paper.timing."""

from __future__ import annotations

import pytest
from sentences import assert_sentence
from worlds import random_town

from semsig_gis.core.errors import InputError
from semsig_gis.experiments.paper.timing import time_queries
from semsig_gis.matching.method import Method
from semsig_gis.matching.scores import score_cells

TOWN = random_town().database


def test_every_method_is_asked_that_often(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths: list[int] = []

    def counted(database: object, queries: list[object], method: object) -> object:
        lengths.append(len(queries[0]))  # type: ignore[arg-type]
        return score_cells(database, queries, method)  # type: ignore[arg-type]

    monkeypatch.setattr("semsig_gis.experiments.paper.timing.score_cells", counted)
    methods = {"types": Method.parse("types:edit"), "both": Method()}
    told: list[tuple[int, int]] = []
    times = time_queries(
        TOWN, methods, length=5, repetitions=4, progress=lambda *done: told.append(done)
    )
    assert list(times) == ["types", "both"]
    assert min(times.values()) > 0
    assert lengths == [5] * 12  # twice before the four that count
    assert told == [(1, 2), (2, 2)]


def test_the_nearest_length_is_taken() -> None:
    longest = int(TOWN.lengths.max())
    assert time_queries(TOWN, {"a": Method()}, length=longest + 50, repetitions=1)["a"] > 0


def test_no_repetitions_are_refused() -> None:
    with pytest.raises(InputError) as caught:
        time_queries(TOWN, {}, repetitions=0)
    assert_sentence(caught.value, "0 repetitions", "from 1")
