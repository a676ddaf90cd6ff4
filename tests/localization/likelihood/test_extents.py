"""Extended things, seen in any direction of their extent."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import random_database

from semsig_gis.localization import (
    NoiseSpec,
    build_index,
    explain_cell,
    goodness_of_fit,
    locate,
    named_noise,
    score_associations,
)
from semsig_gis.observation import View

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase


def extended(database: SignatureDatabase, degrees: float) -> SignatureDatabase:
    """Return a database with the objects of class 2 as wide as an angle in degrees."""
    widths = np.where(database.codes == 2, round(degrees * 255 / 360), 0).astype(np.uint8)
    return replace(database, extent_units=widths)


@given(st.integers(0, 99))
@settings(max_examples=5)
def test_extents_of_points_change_no_bit(seed: int) -> None:
    database = random_database(seed)
    view, noise = database.signature(0), named_noise("generic")
    plain, wide = build_index(database, noise), build_index(extended(database, 0.0), noise)
    assert (plain.scores(view).loglik == wide.scores(view).loglik).all()
    cells = np.arange(len(database))
    first, second = (
        score_associations(part, view, noise, cells) for part in (database, wide.database)
    )
    assert (first == second).all()
    assert goodness_of_fit(plain, view, 0, [0.0]) == goodness_of_fit(wide, view, 0, [0.0])


@given(st.integers(0, 99), st.floats(25.0, 300.0))
@settings(max_examples=5)
def test_an_extent_is_an_error_of_bearings_of_its_class(seed: int, degrees: float) -> None:
    # All of one class are equally wide, and the place is known: a class with a larger error.
    database = extended(random_database(seed), degrees)
    noise = NoiseSpec(bearing_sigma=4.0)
    width = round(degrees * 255 / 360) * 360 / 255
    error = min(math.hypot(4.0, width / math.sqrt(12.0)), 180.0)
    name = database.taxonomy.by_code(2).name
    same = replace(noise, bearing_sigma_by_class={name: error})
    points = replace(database, extent_units=None)
    view = database.signature(1)
    first = build_index(database, noise).scores(view).loglik
    assert first == pytest.approx(build_index(points, same).scores(view).loglik, abs=1e-3)
    cells = np.arange(len(database))
    exact = score_associations(database, view, noise, cells)
    assert exact == pytest.approx(score_associations(points, view, same, cells), abs=1e-6)
    explanation = explain_cell(view, 1, noise, database=database)
    assert explanation.loglik == pytest.approx(
        explain_cell(view, 1, same, database=points).loglik, abs=1e-6
    )


def test_a_view_to_the_end_of_a_wide_thing_is_placed_where_it_is() -> None:
    database = extended(random_database(4, cells=60), 90.0)
    cell = int(
        np.bincount(np.repeat(np.arange(60), database.lengths), database.codes == 2).argmax()
    )
    view = View.of(database.signature(cell))
    away = np.where(view.class_scores().argmax(axis=1) == 2, 30.0, 0.0)
    turned = replace(view, bearings=(view.bearings + away) % 360.0)
    index = build_index(database, named_noise("light"))
    points = build_index(replace(database, extent_units=None), named_noise("light"))
    assert locate(index, turned).answer.cell == cell
    wide, narrow = (goodness_of_fit(part, turned, cell, [0.0]) for part in (index, points))
    assert wide is not None
    assert narrow is not None
    assert wide > narrow
