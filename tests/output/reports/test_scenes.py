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
from semsig_gis.output import (
    SceneObject,
    cell_scene,
    draw_scene,
    draw_scenes,
    example_scenes,
    failure_pairs,
)
from semsig_gis.output.figures.scenes import _round_length
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
def test_example_scenes_have_the_objects_of_the_city(successful: bool) -> None:  # noqa: FBT001
    scenes = example_scenes(evaluation(), CITY, successful=successful, count=3)
    queries = evaluation().queries[evaluation().successful == successful].head(3)
    assert len(scenes) == len(queries) == 3
    for shown, row in zip(scenes, queries.to_dict("records"), strict=True):
        x, y = CITY.xy[row["cell"]]
        assert shown.types == row["types"]
        assert shown.error_m == row["error_m"]
        assert CITY.taxonomy.decode([item.code for item in shown.objects]) == row["types"]
        kind = "successful" if successful else "failed"
        assert (shown.radius, shown.name.split("-")[0]) == (30.0, kind)
        assert shown.title == f"{kind.capitalize()}: query {row['number'] + 1}"
        assert all(math.hypot(item.east, item.north) <= 30.1 for item in shown.objects)
        # Bearings are stored to 1/20 degree and distances to 1/8 metre: errors are below 20 cm.
        for item in (*shown.objects, *shown.others):
            assert nearest(x + item.east, y + item.north, item.code) < 0.2
        around = {
            (code, round(math.hypot(a - x, b - y) * 4))
            for a, b, code in TOWN.objects
            if 30 < math.hypot(a - x, b - y) < 36
        }
        assert len(shown.others) >= len(around)
        if shown.answer is not None:
            east, north = shown.answer
            assert (x + east, y + north) == pytest.approx((row["best_x"], row["best_y"]))


def test_worst_failures_are_pairs_of_true_and_best_cell() -> None:
    pairs = failure_pairs(evaluation(), CITY, count=3)
    queries = evaluation().queries
    failed = queries[~evaluation().successful & np.isfinite(queries["error_m"])]
    worst = failed.sort_values("error_m", ascending=False, kind="stable").head(3)
    assert len({scene.name for pair in pairs for scene in pair.scenes}) == 6
    for pair, (number, row) in zip(pairs, worst.iterrows(), strict=True):
        true, other = pair.scenes
        assert pair.title.startswith(f"Query {number + 1:,}: off by ")
        assert true.types == row["types"]
        best = int(np.flatnonzero(CITY.cell_ids == row["best_cell_id"])[0])
        assert other.types == CITY.types(best)
        assert true.asked == other.asked
        assert CITY.taxonomy.decode([code for code, _ in true.asked]) == row["query_types"]
        bearings = [f"{bearing:.6g}" for _, bearing in true.asked]
        assert bearings == [f"{float(text):.6g}" for text in row["query_bearings"].split(",")]
        assert ("fit it as well" in pair.text) == (row["tied"] > 1)
        for symbol in row["query_types"]:
            assert CITY.taxonomy.by_symbol(symbol).title.lower() in pair.text


def test_query_is_drawn_around_the_circle() -> None:
    picture = draw_scene(scene(objects=0, asked=((3, 90.0), (3, 180.0), (1, 0.0))))
    shown = texts(picture.svg)
    assert (shown.count("D"), shown.count("B")) == (2, 1)
    assert "around the circle: the query" in shown
    words = CLASSES.words([3, 3, 1])
    assert f"The query had {words}." in picture.description


def test_scene_of_a_cell_has_its_types_and_place() -> None:
    shown = cell_scene(CITY, 3)
    assert shown.types == CITY.types(3)
    assert shown.title == f"Cell {CITY.cell_ids[3]}"
    assert (shown.answer, shown.error_m) == (None, None)
    assert cell_scene(CITY, 3, title="A corner").title == "A corner"
    assert (shown.lon, shown.lat) == pytest.approx((3.8, 43.57), abs=0.1)  # Montpellier


def test_evaluation_without_failures_has_no_scenes() -> None:
    perfect = evaluate(CITY, queries=3, distortion="none", top=len(CITY))
    assert example_scenes(perfect, CITY, successful=False) == ()
    assert failure_pairs(perfect, CITY) == ()


def nearest(x: float, y: float, code: int) -> float:
    """Return the distance to the nearest object of a class."""
    return min(math.hypot(a - x, b - y) for a, b, kind in TOWN.objects if kind == code)


@pytest.mark.parametrize("objects", [0, 2, 60])
def test_scene_is_drawn_with_its_objects_and_legend(objects: int) -> None:
    example = scene(objects=objects)
    picture = draw_scene(example)
    assert draw_scene(example) == picture  # the same bytes
    shown = texts(picture.svg)
    for symbol in set(example.types):
        count = example.types.count(symbol)
        assert shown.count(symbol) == count
        assert f"{symbol} {CLASSES.by_symbol(symbol).title} ({count})" in shown
    assert {"N", "10 m", "A place", "48.800000°, 2.300000° · error 12.0 m"} <= set(shown)
    assert CLASSES.words(CLASSES.encode(example.types)) in picture.description
    # The object that is not visible is in the legend, without a count.
    assert ("D Street light" in shown) == ("D" not in example.types)


def test_answer_is_a_cross_or_an_arrow_with_its_distance() -> None:
    assert "answer" not in texts(draw_scene(scene()).svg)
    near = texts(draw_scene(scene(answer=(40.0, -30.0))).svg)
    assert "answer" in near
    assert "50 m" not in near
    assert {"answer", "5,000 m"} <= set(texts(draw_scene(scene(answer=(4e3, 3e3))).svg))


def test_error_text_of_unlocalized_queries_and_of_scenes_without_query() -> None:
    unlocalized = draw_scene(scene(error_m=float("inf")))
    assert "48.800000°, 2.300000° · not localized" in texts(unlocalized.svg)
    assert unlocalized.description.endswith("Not localized.")
    picture = draw_scene(scene(error_m=None))
    assert "48.800000°, 2.300000°" in texts(picture.svg)
    assert "rror" not in picture.description


def test_objects_have_the_signs_of_their_classes() -> None:
    svg = draw_scene(scene(objects=11)).svg.decode("utf-8")
    for sign in class_signs(CLASSES).values():
        assert f"fill: {sign.colour}" in svg
        (style,) = re.findall(rf'<text style="([^"]*)"[^>]*>{sign.symbol}</text>', svg)
        # Black is the default colour of an SVG and is not written.
        assert ("fill: #ffffff" in style) == (sign.ink == "#ffffff")


def test_several_scenes_are_drawn_in_one_picture() -> None:
    scenes = [scene(title="Here"), scene(title="There", objects=11, answer=(9.0, 2.0))]
    picture, single = draw_scenes(scenes), [draw_scene(example) for example in scenes]
    for drawing in single:
        assert {*texts(drawing.svg)} <= {*texts(picture.svg)}
        assert drawing.description in picture.description
    widths = [
        float(re.findall(rb' width="([.\d]+)pt"', drawing.svg)[0])
        for drawing in (picture, single[0])
    ]
    assert widths[0] == pytest.approx(2 * widths[1])
    assert draw_scenes(scenes[:1]) == single[0]
    with refused(InputError, "no scene"):
        draw_scenes([])


def test_object_of_an_unknown_class_is_drawn() -> None:
    odd = dataclasses.replace(scene(), objects=(SceneObject(code=0, east=1.0, north=2.0),))
    assert "? unknown class (1)" in texts(draw_scene(odd).svg)


@pytest.mark.parametrize("text", [HARM, LONG, "$", ""])
def test_text_from_data_is_escaped_and_truncated(text: str) -> None:
    taxonomy = hostile_report(text).taxonomy
    svg = draw_scene(scene(title=text, types=text, objects=11, taxonomy=taxonomy)).svg
    assert b"<script>" not in svg
    assert max(map(len, texts(svg))) < 80


@given(st.floats(0.01, 1e6))
def test_scale_bar_is_round_and_fits(longest: float) -> None:
    metres = _round_length(longest)
    assert longest / 2.6 < metres <= longest
    assert f"{metres:.0e}"[0] in "125"
