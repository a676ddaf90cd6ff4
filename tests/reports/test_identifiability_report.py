"""Tables of identifiability say what is known, row by row."""

from __future__ import annotations

import math

from cells_told import told_of
from noisy_cells import random_database

from semsig_gis.evaluation.identify.check import ChanceBin, IdentifiabilityCheck
from semsig_gis.reports.identifiability import SCORES, check_tables, identifiability_tables

TOLD = told_of(random_database(3, cells=40, classes=3))


def test_the_whole_and_its_bands() -> None:
    facts = TOLD.summary()
    whole, _ = identifiability_tables(TOLD)
    rows = {row[0]: row[1] for row in whole.rows}
    assert whole.title == "Identifiability, medium noise"
    assert rows["chance that the answer is within 30 m"] == f"{facts['chance_found']:.1%}".replace(
        "%", " %"
    )
    assert rows["bits left"] == f"{facts['bits_left']:.2f} of {math.log2(40):.2f}"
    bands = [name for name in rows if name.startswith("cells found")]
    assert bands[0].endswith("0.9 to 1")
    assert bands[-1].endswith("0 to 0.1")


def test_classes_with_and_without_their_objects() -> None:
    _, plain = identifiability_tables(TOLD)
    assert len(plain.columns) == 3
    _, counted = identifiability_tables(TOLD, object_counts={1: 2000, 3: 10})
    assert len(counted.columns) == 5
    assert [row[:3] for row in counted.rows] == list(plain.rows)
    gains = {item.code: item.near for item in TOLD.classes}
    lights = next(row for row in counted.rows if row[0].startswith("Street light"))
    assert lights[3:] == ("10", f"{1e5 * gains[3] / 10:+.3f} %")
    fountains = next(row for row in counted.rows if "ountain" in row[0])
    assert fountains[3:] == ("0", "")


def test_a_check() -> None:
    tenth = ChanceBin(
        low=0.2, high=0.3, queries=1234, stated=0.25, true=0.3, true_low=0.2, true_high=0.4
    )
    check = IdentifiabilityCheck(
        queries=2000, seed=1, found=0.4, attainable=0.61, bins=(tenth,),
        correlations={"found": 0.5, "near": 0.4, "length": -0.3, "type_group": math.nan},
    )  # fmt: skip
    calibration, ranks = check_tables(check)
    assert calibration.rows == (("0.2 to 0.3", "1,234", "25.0 %", "30.0 %", "20.0 % to 40.0 %"),)
    assert "2,000" in calibration.note
    assert [row[0] for row in ranks.rows] == list(SCORES.values())
    assert [row[1] for row in ranks.rows] == ["+0.500", "+0.400", "-0.300", ""]
    assert "0.610" in ranks.note
