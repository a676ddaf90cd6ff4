"""What is known of the cells, as columns and in sum."""

from __future__ import annotations

import numpy as np
import pytest
from noisy_cells import random_database

from semsig_gis.identifiability import BANDS, ClassGain, Identifiability
from semsig_gis.noise import named_noise

CELLS, CLASSES = 40, 3


def known(seed: int = 3) -> Identifiability:
    """Return numbers out of nowhere."""
    rng = np.random.default_rng(seed)
    lookalikes = rng.integers(0, CELLS, (CELLS, 2))
    lookalikes[5:9, 1] = -1
    database = random_database(seed, cells=CELLS, classes=CLASSES)
    return Identifiability(
        database=database,
        noise=named_noise("medium"),
        radius=30.0,
        itself=rng.random(CELLS).round(3),
        near=rng.random(CELLS).round(3),
        found=rng.choice([*BANDS, 0.95, 1.0], CELLS),
        bits=rng.uniform(0, 5, CELLS).round(3),
        lookalikes=lookalikes,
        lookalike_chances=rng.random((CELLS, 2)).round(3),
        gains=rng.random((CELLS, CLASSES)).round(3),
        classes=tuple(
            ClassGain(code=int(code), near=float(gain), bits=1.0)
            for code, gain in zip(database.present_codes, (0.2, 0.1, 0.3), strict=True)
        ),
        trials=60,
        seed=4,
    )


@pytest.mark.parametrize("rows", [slice(None), slice(3, 11), slice(0, 0)])
def test_columns_hold_what_is_known_cell_by_cell(rows: slice) -> None:
    told = known()
    table = told.table(rows)
    cells = np.arange(CELLS)[rows]
    assert len(table) == len(cells)
    ids = told.database.cell_ids
    for line, cell in zip(table.to_pylist(), cells.tolist(), strict=True):
        assert line["chance_itself"] == told.itself[cell]
        assert line["chance_near"] == told.near[cell]
        assert line["chance_found"] == told.found[cell]
        assert line["bits_left"] == told.bits[cell]
        for place, other in enumerate(told.lookalikes[cell].tolist()):
            assert line[f"lookalike_{place + 1}"] == (ids[other] if other >= 0 else None)
            assert line[f"lookalike_{place + 1}_chance"] == told.lookalike_chances[cell, place]
        names = ["alignment_tree", "water_fountain", "street_light"]
        assert [line[f"gain_{name}"] for name in names] == told.gains[cell].tolist()


def test_the_summary_adds_up() -> None:
    told = known()
    facts = told.summary(object_counts={1: 50, 2: 10})
    assert sum(band["cells"] for band in facts["bands"]) == facts["cells"] == CELLS
    assert sum(band["share"] for band in facts["bands"]) == pytest.approx(1.0)
    for band in facts["bands"]:
        top = np.inf if band["to"] == 1 else band["to"]
        inside = (told.found >= band["from"]) & (told.found < top)
        assert band["cells"] == int(inside.sum())
    assert facts["noise"] == "medium"
    assert facts["chance_found"] == pytest.approx(told.found.mean())
    assert [item["code"] for item in facts["classes"]] == [3, 1, 2]
    by_code = {item["code"]: item for item in facts["classes"]}
    assert by_code[1]["chance_near_per_1000"] == 20.0 * by_code[1]["chance_near"]
    assert by_code[3]["objects"] == 0
    assert by_code[3]["chance_near_per_1000"] is None
    assert told.summary()["classes"][0]["objects"] is None
