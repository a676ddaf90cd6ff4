"""Photographs of one place, which miss the same objects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from noisy_cells import random_database, random_query

from semsig_gis.localization import NoiseSpec, build_index, cell_noise, locate, usual_noise
from semsig_gis.observation import Photo, View

if TYPE_CHECKING:
    from semsig_gis.localization import Noise

DATABASE = random_database(4, cells=80)


def noise(repeat: float = 1.0) -> Noise:
    return cell_noise(NoiseSpec(detection=0.6, repeat=repeat), DATABASE.grid.step)


def view_of(photos: int) -> View:
    """Return a view of several equal photos."""
    query = random_query(DATABASE, 3, size=4)
    return View.joined([replace(View.of(query), photos=(Photo(),))] * photos)


def test_repeated_photos_count_as_one_without_repeat() -> None:
    index = build_index(DATABASE, noise(0.0))
    once, thrice = (locate(index, view_of(count)).chances for count in (1, 3))
    np.testing.assert_allclose(once, thrice, rtol=1e-4, atol=1e-9)


def test_photos_are_independent_by_default() -> None:
    single = build_index(DATABASE, noise()).scores(view_of(1)).loglik
    pair = build_index(DATABASE, noise()).scores(view_of(2)).loglik
    np.testing.assert_allclose(2.0 * single, pair, rtol=1e-5)


@pytest.mark.parametrize("repeat", [0.25, 0.5, 0.75])
def test_n_photos_count_as_a_power_of_n(repeat: float) -> None:
    index = build_index(DATABASE, noise(repeat))
    np.testing.assert_allclose(
        index.scores(view_of(4)).loglik,
        4.0**repeat * index.scores(view_of(1)).loglik,
        rtol=1e-5,
    )


@pytest.mark.parametrize(
    ("photo", "scores", "name"),
    [
        (Photo(), False, "generic"),
        (Photo(sectors=((10.0, 80.0),)), False, "photo"),
        (Photo(sectors=((10.0, 80.0),)), True, "photo"),
        (Photo(), True, "panorama"),
    ],
)
def test_usual_noise_depends_on_the_view(photo: Photo, scores: bool, name: str) -> None:  # noqa: FBT001
    view = View(np.array([3], np.uint8), np.array([40.0]), photos=(photo,))
    if scores:
        view = View(None, view.bearings, photos=(photo,), scores=view.class_scores())
    assert usual_noise(view) == name
    assert usual_noise(view, in_words=True) == "by-hand"
