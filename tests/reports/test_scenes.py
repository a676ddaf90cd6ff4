from __future__ import annotations

import dataclasses
import functools
import math
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reports import HARM, LONG, hostile_report, scene, texts
from sentences import refused
from worlds import random_town

from semsig_gis.core import InputError, class_signs
from semsig_gis.evaluation import evaluate
from semsig_gis.reports import (
    SceneObject,
    cell_scene,
    draw_scene,
    draw_scenes,
    example_scenes,
    failure_pairs,
)
from semsig_gis.reports.scenes import _round_length
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from semsig_gis.evaluation import Evaluation

CLASSES = paper_taxonomy()
TOWN = random_town()
CITY = TOWN.database


@functools.cache
def evaluation() -> Evaluation:
    return evaluate(CITY, queries=40, distortion="strong")


@pytest.mark.parametrize("successful", [True, False])
def test_scenes_show_what_is_there(successful: bool) -> None:  # noqa: FBT001
    scenes = example_scenes(evaluation(), CITY, successful=successful, count=3)
    chosen = evaluation().queries[evaluation().successful == successful].head(3)
    assert len(scenes) == len(chosen) == 3
    for shown, row in zip(scenes, chosen.to_dict("records"), strict=True):
        x, y = CITY.xy[row["cell"]]
        assert shown.types == row["types"]
        assert shown.error_m == row["error_m"]
        codes = [CITY.taxonomy.by_code(one.code).symbol for one in shown.objects]
        assert "".join(codes) == row["types"]
        kind = "successful" if successful else "failed"
        assert (shown.radius, shown.name.split("-")[0]) == (30.0, kind)
        assert shown.title == f"{kind.capitalize()}: query {row['number'] + 1}"
        for one in shown.objects:
            assert math.hypot(one.east, one.north) <= 30.1
        # Bearings are kept to 1/20 degree and distances to 1/8 metre: all is within 20 cm.
        for one in (*shown.objects, *shown.others):
            assert nearest(x + one.east, y + one.north, one.code) < 0.2
        there = {
            (code, round(math.hypot(a - x, b - y) * 4))
            for a, b, code in TOWN.objects
            if 30 < math.hypot(a - x, b - y) < 36
        }
        assert len(shown.others) >= len(there)
        if shown.answer is not None:
            east, north = shown.answer
            assert (x + east, y + north) == pytest.approx((row["best_x"], row["best_y"]))


def test_the_worst_failures_are_shown_in_pairs() -> None:
    pairs = failure_pairs(evaluation(), CITY, count=3)
    queries = evaluation().queries
    told = queries[~evaluation().successful & np.isfinite(queries["error_m"])]
    worst = told.sort_values("error_m", ascending=False, kind="stable").head(3)
    assert len({scene.name for pair in pairs for scene in pair.scenes}) == 6
    for pair, (number, row) in zip(pairs, worst.iterrows(), strict=True):
        true, taken = pair.scenes
        assert pair.title.startswith(f"Query {number + 1:,}: off by ")
        assert true.types == row["types"]
        best = int(np.flatnonzero(CITY.cell_ids == row["best_cell_id"])[0])
        assert taken.types == CITY.types(best)
        assert true.asked == taken.asked
        assert CITY.taxonomy.decode([code for code, _ in true.asked]) == row["query_types"]
        bearings = [f"{bearing:.6g}" for _, bearing in true.asked]
        assert bearings == [f"{float(one):.6g}" for one in row["query_bearings"].split(",")]
        assert ("fit it as well" in pair.text) == (row["tied"] > 1)
        for symbol in row["query_types"]:
            assert CITY.taxonomy.by_symbol(symbol).title in pair.text


def test_what_a_query_told_stands_around_the_circle() -> None:
    made = draw_scene(scene(objects=0, asked=((3, 90.0), (3, 180.0), (1, 0.0))))
    shown = texts(made.svg)
    assert (shown.count("D"), shown.count("B")) == (2, 1)
    assert "around the circle: the query" in shown
    assert "The query had DDB." in made.description


def test_a_scene_of_a_cell() -> None:
    shown = cell_scene(CITY, 3)
    assert shown.types == CITY.types(3)
    assert shown.title == f"Cell {CITY.cell_ids[3]}"
    assert (shown.answer, shown.error_m) == (None, None)
    assert cell_scene(CITY, 3, title="A corner").title == "A corner"
    assert (shown.lon, shown.lat) == pytest.approx((3.8, 43.57), abs=0.1)  # Montpellier


def test_no_examples() -> None:
    perfect = evaluate(CITY, queries=3, distortion="none", top=len(CITY))
    assert example_scenes(perfect, CITY, successful=False) == ()
    assert failure_pairs(perfect, CITY) == ()


def nearest(x: float, y: float, code: int) -> float:
    """Return how far the nearest object of a class is."""
    return min(math.hypot(a - x, b - y) for a, b, kind in TOWN.objects if kind == code)


@pytest.mark.parametrize("objects", [0, 2, 60])
def test_a_scene_shows_its_objects(objects: int) -> None:
    made = scene(objects=objects)
    picture = draw_scene(made)
    assert draw_scene(made) == picture  # to the byte
    shown = texts(picture.svg)
    for symbol in set(made.types):
        assert shown.count(symbol) == made.types.count(symbol)
        title = CLASSES.by_symbol(symbol).title
        assert f"{symbol} {title} ({made.types.count(symbol)})" in shown
    assert {"N", "10 m", "A place", "2.300000°, 48.800000° · error 12.0 m"} <= set(shown)
    assert (made.types or "Nothing is seen") in picture.description
    # The one around is in the legend, without a count.
    assert ("D Street light" in shown) == ("D" not in made.types)


def test_an_answer_is_drawn_or_pointed_to() -> None:
    assert "answer" not in texts(draw_scene(scene()).svg)
    near = texts(draw_scene(scene(answer=(40.0, -30.0))).svg)
    assert "answer" in near
    assert "50 m" not in near
    assert {"answer", "5,000 m"} <= set(texts(draw_scene(scene(answer=(4e3, 3e3))).svg))


def test_places_that_were_not_found_and_that_nobody_asked_for() -> None:
    lost = draw_scene(scene(error_m=float("inf")))
    assert "2.300000°, 48.800000° · not localized" in texts(lost.svg)
    assert lost.description.endswith("Not localized.")
    shown = draw_scene(scene(error_m=None))
    assert "2.300000°, 48.800000°" in texts(shown.svg)
    assert "rror" not in shown.description


def test_objects_have_the_signs_of_their_classes() -> None:
    made = draw_scene(scene(objects=11)).svg.decode("utf-8")
    for sign in class_signs(CLASSES).values():
        assert f"fill: {sign.colour}" in made
        (style,) = re.findall(rf'<text style="([^"]*)"[^>]*>{sign.symbol}</text>', made)
        # Black is what an SVG is drawn in unless told otherwise.
        assert ("fill: #ffffff" in style) == (sign.ink == "#ffffff")


def test_scenes_side_by_side() -> None:
    made = [scene(title="Here"), scene(title="There", objects=11, answer=(9.0, 2.0))]
    picture = draw_scenes(made)
    together = texts(picture.svg)
    for one in made:
        assert {*texts(draw_scene(one).svg)} <= {*together}
        assert draw_scene(one).description in picture.description
    sizes = [
        float(re.findall(rb' width="([.\d]+)pt"', one.svg)[0])
        for one in (picture, draw_scene(made[0]))
    ]
    assert sizes[0] == pytest.approx(2 * sizes[1])
    assert draw_scenes(made[:1]) == draw_scene(made[0])
    with refused(InputError, "no scene"):
        draw_scenes([])


def test_an_object_of_no_class() -> None:
    odd = dataclasses.replace(scene(), objects=(SceneObject(code=0, east=1.0, north=2.0),))
    assert "? unknown class (1)" in texts(draw_scene(odd).svg)


@pytest.mark.parametrize("text", [HARM, LONG, "$", ""])
def test_text_from_data_breaks_nothing(text: str) -> None:
    made = draw_scene(
        scene(title=text, types=text, objects=11, taxonomy=hostile_report(text).taxonomy)
    )
    assert b"<script>" not in made.svg
    assert max(map(len, texts(made.svg))) < 80


@given(st.floats(0.01, 1e6))
def test_a_scale_bar_is_round_and_fits(longest: float) -> None:
    metres = _round_length(longest)
    assert longest / 2.6 < metres <= longest
    assert f"{metres:.0e}"[0] in "125"
