"""Detections that are drawn follow the noise model."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from noisy_cells import mixtures, random_database

from semsig_gis.detector import draw_detections
from semsig_gis.noise import NoiseSpec
from semsig_gis.noise_table import database_tables

if TYPE_CHECKING:
    from semsig_gis.noise import Noise

DATABASE = random_database(1, cells=20, longest=8, classes=3)


@settings(max_examples=30, deadline=None)
@given(mixtures(), st.integers(0, 100), st.integers(0, 19))
def test_a_query_is_in_order_and_does_not_depend_on_the_others(
    noise: Noise, seed: int, cell: int
) -> None:
    cells = [3, 7, cell, 5]
    queries = list(draw_detections(DATABASE, cells, noise, seed=seed))
    again = list(islice(draw_detections(DATABASE, [0, 0, cell], noise, seed=seed), 2, 3))
    for query in queries:
        assert query.codes is not None
        assert query.bearings is not None
        assert set(query.codes.tolist()) <= set(DATABASE.present_codes.tolist())
        assert ((query.bearings >= 0) & (query.bearings < 360)).all()
        assert (np.diff(query.bearings) >= 0).all()
    assert again[0].codes.tolist() == queries[2].codes.tolist()  # type: ignore[union-attr]
    assert again[0].bearings.tolist() == queries[2].bearings.tolist()  # type: ignore[union-attr]


def test_a_careful_detector_gives_the_signature() -> None:
    noise = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=1e-6)
    cells = range(len(DATABASE))
    # No chance is quite nought: one object in a thousand is missed or misnamed all the same.
    same = [
        query.codes.tolist() == DATABASE.signature(cell).codes.tolist()  # type: ignore[union-attr]
        for cell, query in zip(cells, draw_detections(DATABASE, cells, noise), strict=True)
    ]
    assert np.mean(same) > 0.9


def test_rates_are_those_of_the_model() -> None:
    noise = NoiseSpec(
        detection=0.8,
        misnamed=0.1,
        clutter=1.5,
        clutter_shares={"street_light": 0.5, "alignment_tree": 0.5},
        bearing_sigma=4.0,
        misnamed_each=0.3,
    )
    (table,), _ = database_tables(DATABASE, noise)
    cell, draws = int(DATABASE.lengths.argmax()), 4000
    true = DATABASE.signature(cell)
    assert true.codes is not None
    assert true.bearings is not None
    kinds = table.row_of[true.codes]
    length = len(kinds)
    counts = np.zeros(len(table.codes))
    close = 0
    for query in draw_detections(DATABASE, [cell] * draws, noise):
        assert query.codes is not None
        assert query.bearings is not None
        counts += np.bincount(table.row_of[query.codes], minlength=len(table.codes))
        away = (query.bearings - true.bearings[0] + 180.0) % 360.0 - 180.0
        close += int(((np.abs(away) <= 4.0) & (query.codes == true.codes[0])).sum())
    detected = 1.0 - table.missed[length, kinds]
    expected = (detected[:, None] * table.named[length, kinds]).sum(axis=0) + table.clutter
    assert np.allclose(counts / draws, expected, atol=5 * np.sqrt(expected / draws))
    # By the density of each object and of clutter, four degrees around the first object.
    steps = np.linspace(-4.0, 4.0, 81)[:-1] + 0.05
    away = (true.bearings[0] + steps[:, None] - true.bearings - 0.025 + 180.0) % 360.0 - 180.0
    density = np.exp(-0.5 * (away / 4.0) ** 2) / (4.0 * np.sqrt(2 * np.pi))
    named = detected * table.named[length, kinds, kinds[0]]
    mean = float((density @ named).sum() * 0.1) + 8.0 * table.density[kinds[0]]
    assert abs(close / draws - mean) < 5 * np.sqrt(mean / draws)
