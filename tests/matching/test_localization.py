from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from worlds import World, random_town

from semsig_gis.matching.search import Shortlist, localize

if TYPE_CHECKING:
    from numpy.typing import NDArray

CITY = random_town().database


def plain_ranking(scores: NDArray[np.float32], top: int) -> list[tuple[int, int, int, float]]:
    """Return cell, lowest rank, highest rank and score of the best, by sorting everything."""
    rows = sorted(range(len(scores)), key=lambda row: (scores[row], row))[:top]
    return [
        (
            row,
            1 + int((scores < scores[row]).sum()),
            int((scores <= scores[row]).sum()),
            float(scores[row]),
        )
        for row in rows
    ]


@given(st.data())
def test_parts_give_the_shortlist_of_the_whole(data: st.DataObject) -> None:
    size = min(len(CITY), 60)
    levels = data.draw(st.lists(st.integers(0, 6), min_size=size, max_size=size))
    scores = (np.array(levels) / 8).astype(np.float32)
    top = data.draw(st.integers(1, 70))
    owner = np.array(data.draw(st.lists(st.integers(0, 2), min_size=size, max_size=size)))
    city = CITY.select(slice(size))
    shortlist = Shortlist(top)
    for part in range(3):
        mine = np.flatnonzero(owner == part)
        if len(mine):
            shortlist.add(city.select(mine), scores[mine])
    candidates, beyond = shortlist.ranked()
    expected = plain_ranking(scores, top)
    assert candidates["cell_id"].tolist() == city.cell_ids[[row for row, *_ in expected]].tolist()
    assert candidates["rank_low"].tolist() == [low for _, low, _, _ in expected]
    assert candidates["rank_high"].tolist() == [high for _, _, high, _ in expected]
    assert candidates["distance"].tolist() == [score for *_, score in expected]
    assert beyond == expected[-1][2] - len(expected)
    assert shortlist.cells == size


def test_an_answer_as_points_and_as_plain_values() -> None:
    answer = localize(CITY, CITY.signature(3), top=4)
    points = answer.to_geodataframe()
    assert points.crs == CITY.crs
    assert points.geometry.x.tolist() == answer.candidates["x"].tolist()
    plain = answer.to_dict()
    assert plain["cells"] == len(CITY)
    assert [row["cell_id"] for row in plain["candidates"]] == points["cell_id"].tolist()
    best = plain["candidates"][0]
    assert 3.0 < best["lon"] < 5.0
    assert 42.0 < best["lat"] < 45.0


def test_a_shortlist_of_one_world_counts_its_classes() -> None:
    lamp = World(((765_205.0, 6_275_005.0, 3),)).database
    shortlist = Shortlist(5)
    shortlist.add(lamp, np.zeros(len(lamp), np.float32))
    assert shortlist.present == {3}
    assert shortlist.ranked()[1] == len(lamp) - 5
