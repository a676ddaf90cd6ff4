"""Photos of which more and more is told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from small_city import small_city

from semsig_gis import build_index, named_noise
from semsig_gis.localization import IncrementalIndex
from semsig_gis.localization.likelihood import incremental
from semsig_gis.observation import Photo, View


@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("sectors", [(), ((10.0, 130.0),)])
def test_what_is_gone_on_from_gives_the_same_scores(
    sectors: tuple[tuple[float, float], ...],
    monkeypatch: pytest.MonkeyPatch,
    *,
    kept: bool,
) -> None:
    if not kept:
        monkeypatch.setattr(incremental, "MOST_BYTES", 0)
    database, _ = small_city()
    index = build_index(database, named_noise("generic"))
    growing = IncrementalIndex(index)
    seen = View.of(
        database.signature(int(database.lengths.argmax())),
        photos=(Photo(sectors=sectors, north_sigma=math.inf),),
    )
    near = np.where(np.arange(len(seen)) % 2, np.nan, 12.0)
    steps = [[0], [0, 1], [0, 2], [0, 1, 2], [0, 1, 2, 2], [1, 2], [], [0, 1, 2, 3, 4]]
    for rows in [*steps, *steps[::-1]]:
        for view in (seen, View.of(seen, ranges=near)):
            told = view.select(np.array(rows, np.int64))
            one, other = index.scores(told), growing.scores(told)
            assert other.loglik == pytest.approx(one.loglik, abs=1e-4)
            assert one.heading is not None
            assert other.heading is not None
            assert (one.heading == other.heading).mean() > 0.99
    assert (len(growing._photos) == 2) == kept
