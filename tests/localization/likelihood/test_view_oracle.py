"""The oracle of views: it is a density, and a sum over associations, photos and turns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from noisy_cells import every_association, random_database
from view_oracle import (
    Glimpse,
    Scene,
    Thing,
    cell_loglik,
    exact_loglik,
    mass_inside,
    random_view,
    set_loglik,
)

from semsig_gis.localization import NoiseSpec
from semsig_gis.observation import FULL_VIEW, Photo

LAMP = Thing(
    chance=0.8,
    names=(0.9, 0.1),
    bearing=45.0,
    bearing_sigma=6.0,
    distance=12.0,
    range_sigma=0.25,
)
PHOTO = Photo(sectors=((0.0, 50.0), (350.0, 355.0)))


@pytest.mark.parametrize("ranged", [False, True])
@pytest.mark.parametrize("form", [exact_loglik, set_loglik])
def test_chances_of_no_and_one_detection_equal_the_process(form: type, *, ranged: bool) -> None:
    scene = Scene(things=(LAMP,), clutter=(0.5, 0.3), reach=30.0)
    inside = 0.8 * mass_inside(45.0, 6.0, PHOTO)
    false = 0.8 * 55.0 / 360.0
    assert math.exp(form(scene, [], PHOTO)) == pytest.approx((1 - inside) * math.exp(-false))
    steps = np.linspace(math.log(0.01), math.log(30.0), 400)
    ranges = np.exp(steps) if ranged else np.array([math.nan])
    each = [
        math.exp(form(scene, [Glimpse(bearing=bearing % 360.0, weights=row, range=metres)], PHOTO))
        for bearing in [*np.arange(-9.5, -5, 1.0), *np.arange(0.5, 50, 1.0)]
        for row in ((1.0, 0.0), (0.0, 1.0))
        for metres in ranges
    ]
    result = sum(each) * (steps[1] - steps[0] if ranged else 1.0)
    expected = math.exp(-false) * ((1 - inside) * false + inside)
    assert result == pytest.approx(expected, rel=2e-3)


def test_sums_over_associations_equal_an_independent_sum() -> None:
    rng = np.random.default_rng(3)
    thing = replace(LAMP, chance=0.7, names=(0.8, 0.2), bearing_sigma=20.0)
    things = [replace(thing, bearing=bearing) for bearing in (10.0, 30.0, 50.0)]
    scene = Scene(things=things, clutter=(1.0, 1.0), reach=30.0)
    glimpses = [Glimpse(bearing=float(a), weights=(1.0, 0.0)) for a in rng.uniform(0, 60, 3)]
    weights = np.array(
        [[set_loglik(Scene(things=[thing], clutter=(1.0, 1.0), reach=30.0), [glimpse], FULL_VIEW)
          for glimpse in glimpses] for thing in things]
    )  # fmt: skip
    empty = math.log(0.3) - 2.0 + math.log(1 / 360)
    pairs, _ = every_association(np.exp(weights - empty) - 1.0)
    expected = pairs + 3 * math.log(0.3) - 2.0 + 3 * math.log(1 / 360)
    assert exact_loglik(scene, glimpses, FULL_VIEW) == pytest.approx(expected)


def test_photos_multiply_and_turns_are_summed() -> None:
    database = random_database(1, cells=3, longest=4)
    noise = NoiseSpec(fading={"all": ((10.0, 1.0), (30.0, 0.2))}, position_sigma=1.0)
    photos = (Photo.looking(heading=20, fov=70), Photo.looking(heading=200, fov=50))
    view = random_view(database, np.random.default_rng(0), size=2, photos=photos)
    first, second = (cell_loglik(database, part, noise, 0) for part in view.split())
    assert cell_loglik(database, view, noise, 0) == pytest.approx(first + second)
    turns = [[(0.0, 0.5), (20.0, 0.5)], [(0.0, 1.0)]]
    turned = cell_loglik(database, view.split()[0].turned(20.0), noise, 0)
    expected = np.logaddexp(first, turned) - math.log(2.0) + second
    result = cell_loglik(database, view, noise, 0, headings=turns)
    assert result == pytest.approx(expected)
    assert result != pytest.approx(cell_loglik(database, view, noise, 0, form=set_loglik))
