"""Scores of photos that gain objects."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_city import small_city

from semsig_gis import build_index, named_noise
from semsig_gis.localization import IncrementalIndex
from semsig_gis.localization.likelihood import incremental
from semsig_gis.observation import Photo, View


@pytest.mark.parametrize("remembered", [True, False])
@pytest.mark.parametrize("sectors", [(), ((10.0, 130.0),)])
def test_incremental_scores_equal_scores_from_scratch(
    sectors: tuple[tuple[float, float], ...],
    monkeypatch: pytest.MonkeyPatch,
    *,
    remembered: bool,
) -> None:
    if not remembered:
        monkeypatch.setattr(incremental, "MOST_BYTES", 0)
    database, _ = small_city()
    index = build_index(database, named_noise("generic"))
    growing = IncrementalIndex(index)
    whole = View.of(
        database.signature(int(database.lengths.argmax())),
        photos=(Photo(sectors=sectors, north_sigma=math.inf),),
    )
    near = np.where(np.arange(len(whole)) % 2, np.nan, 12.0)
    steps = [[0], [0, 1], [0, 2], [0, 1, 2], [0, 1, 2, 2], [1, 2], [], [0, 1, 2, 3, 4]]
    for rows in [*steps, *steps[::-1]]:
        for view in (whole, View.of(whole, ranges=near)):
            part = view.select(np.array(rows, np.int64))
            expected, result = index.scores(part), growing.scores(part)
            assert result.loglik == pytest.approx(expected.loglik, abs=1e-4)
            assert expected.heading is not None
            assert result.heading is not None
            assert (expected.heading == result.heading).mean() > 0.99
    assert (len(growing._photos) == 2) == remembered
