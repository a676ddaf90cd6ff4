"""What is known of the cells, as columns and in sum."""

from __future__ import annotations

import numpy as np
import pytest
from cells_told import told_of
from noisy_cells import random_database

DATABASE = random_database(3, cells=40, classes=3)
NAMES = ["alignment_tree", "water_fountain", "street_light"]


@pytest.mark.parametrize("rows", [slice(None), slice(3, 11), slice(0, 0)])
def test_columns_hold_what_is_known_cell_by_cell(rows: slice) -> None:
    told = told_of(DATABASE)
    table = told.table(rows)
    cells = np.arange(len(DATABASE))[rows]
    ids = DATABASE.cell_ids
    for line, cell in zip(table.to_pylist(), cells.tolist(), strict=True):
        assert line["chance_itself"] == told.itself[cell]
        assert line["chance_near"] == told.near[cell]
        assert line["chance_found"] == told.found[cell]
        assert line["bits_left"] == told.bits[cell]
        for place, other in enumerate(told.lookalikes[cell].tolist()):
            assert line[f"lookalike_{place + 1}"] == (ids[other] if other >= 0 else None)
            assert line[f"lookalike_{place + 1}_chance"] == told.lookalike_chances[cell, place]
        assert [line[f"gain_{name}"] for name in NAMES] == told.gains[cell].tolist()


def test_the_summary_adds_up() -> None:
    told = told_of(DATABASE)
    facts = told.summary(object_counts={1: 50, 2: 10})
    assert sum(band["cells"] for band in facts["bands"]) == facts["cells"] == 40
    assert sum(band["share"] for band in facts["bands"]) == pytest.approx(1.0)
    for band in facts["bands"]:
        top = np.inf if band["to"] == 1 else band["to"]
        inside = (told.found >= band["from"]) & (told.found < top)
        assert band["cells"] == int(inside.sum())
    assert facts["noise"] == "medium"
    assert facts["chance_found"] == pytest.approx(told.found.mean())
    gains = [item["chance_near"] for item in facts["classes"]]
    assert gains == sorted(gains, reverse=True)
    by_code = {item["code"]: item for item in facts["classes"]}
    assert by_code[1]["chance_near_per_1000"] == 20.0 * by_code[1]["chance_near"]
    assert by_code[3]["objects"] == 0
    assert by_code[3]["chance_near_per_1000"] is None
    assert told.summary()["classes"][0]["objects"] is None
