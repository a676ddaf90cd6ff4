"""The small map of successful and failed queries."""

from __future__ import annotations

import numpy as np
import pytest
from reports import HARM, LONG, outcome_map, texts
from worlds import random_town

from semsig_gis.core import OUTCOMES
from semsig_gis.evaluation import evaluate
from semsig_gis.output import draw_map
from semsig_gis.output.figures import outcomes

CITY = random_town().database


@pytest.mark.parametrize("most", [400, 3])
def test_map_has_the_places_of_cells_and_queries(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outcomes, "MOST_SQUARES", most)
    evaluation = evaluate(CITY, queries=40, distortion="strong")
    result = outcomes.outcome_map(evaluation, CITY, name="a", title="A")
    assert max(result.ground.shape) <= most
    corner = CITY.xy.min(axis=0) - CITY.grid.step / 2
    columns, rows = np.floor((CITY.xy - corner) / result.step).astype(int).T
    ground = np.zeros_like(result.ground)
    ground[rows, columns] = True
    assert np.array_equal(result.ground, ground)
    points = evaluation.queries.geometry
    assert result.places + corner == pytest.approx(np.column_stack([points.x, points.y]))
    assert result.successful.tolist() == evaluation.successful.tolist()


@pytest.mark.parametrize("places", [0, 5, 600, 2500])
def test_outcomes_differ_in_colour_and_shape(places: int) -> None:
    result = draw_map(outcome_map(places=places))
    assert draw_map(outcome_map(places=places)) == result  # to the byte
    failed, successful = places // 2, places - places // 2
    counts = {f"successful: {successful:,}", f"failed: {failed:,}"}
    assert {*counts, "N", "5 m"} <= set(texts(result.svg))
    assert f"Queries successful: {successful:,}, failed: {failed:,}." in result.description
    svg = result.svg.decode()
    assert all(f"fill: {mark.colour}" in svg for mark in OUTCOMES.values())
    # Many places are drawn as pixels.
    assert svg.count("<use") < 2000


@pytest.mark.parametrize("shape", [(1, 300), (300, 1), (1, 1)])
def test_maps_of_narrow_cities_are_drawn(shape: tuple[int, int]) -> None:
    result = draw_map(outcome_map(ground=np.ones(shape, np.bool_)))
    assert "Places" in texts(result.svg)


@pytest.mark.parametrize("text", [HARM, LONG, "$", ""])
def test_text_from_data_is_escaped_and_truncated(text: str) -> None:
    result = draw_map(outcome_map(title=text))
    assert b"<script>" not in result.svg
    assert max(map(len, texts(result.svg))) < 80
