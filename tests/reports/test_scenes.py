"""Tests of semsig_gis.reports.scenes."""

from __future__ import annotations

import math

import pytest
from worlds import random_town

from semsig_gis.evaluation.evaluate import evaluate
from semsig_gis.reports.scenes import cell_scene, example_scenes

TOWN = random_town()
CITY = TOWN.database
FOUND = evaluate(CITY, queries=40, distortion="strong")


@pytest.mark.parametrize("successful", [True, False])
def test_scenes_show_what_is_there(successful: bool) -> None:  # noqa: FBT001
    scenes = example_scenes(FOUND, CITY, successful=successful, count=3)
    chosen = FOUND.queries[FOUND.successful == successful].head(3)
    assert len(scenes) == 3
    for scene, row in zip(scenes, chosen.to_dict("records"), strict=True):
        x, y = CITY.xy[row["cell"]]
        assert scene.types == row["types"]
        assert scene.error_m == row["error_m"]
        codes = [CITY.taxonomy.by_code(one.code).symbol for one in scene.objects]
        assert "".join(codes) == row["types"]
        assert (scene.radius, scene.name.split("-")[0]) == (30.0, "found" if successful else "lost")
        for one in scene.objects:
            assert math.hypot(one.east, one.north) <= 30.1
        # Bearings are kept to 1/20 degree and distances to 1/8 metre: all is within 20 cm.
        for one in (*scene.objects, *scene.others):
            assert nearest(x + one.east, y + one.north, one.code) < 0.2
        there = {
            (code, round(math.hypot(a - x, b - y) * 4))
            for a, b, code in TOWN.objects
            if 30 < math.hypot(a - x, b - y) < 36
        }
        assert len(scene.others) >= len(there)
        if scene.answer is not None:
            east, north = scene.answer
            assert (x + east, y + north) == pytest.approx((row["best_x"], row["best_y"]))


def test_a_scene_of_a_cell() -> None:
    scene = cell_scene(CITY, 3)
    assert scene.types == CITY.types(3)
    assert scene.title == f"Cell {CITY.cell_ids[3]}"
    assert (scene.answer, scene.error_m) == (None, None)
    assert cell_scene(CITY, 3, title="A corner").title == "A corner"


def nearest(x: float, y: float, code: int) -> float:
    """Return how far the nearest object of a class is."""
    return min(math.hypot(a - x, b - y) for a, b, kind in TOWN.objects if kind == code)


def test_degrees() -> None:
    scene, *_ = example_scenes(FOUND, CITY, successful=True, count=1)
    # Montpellier
    assert scene.lon == pytest.approx(3.8, abs=0.1)
    assert scene.lat == pytest.approx(43.57, abs=0.1)


def test_no_examples() -> None:
    perfect = evaluate(CITY, queries=3, distortion="none", top=len(CITY))
    assert example_scenes(perfect, CITY, successful=False) == ()
