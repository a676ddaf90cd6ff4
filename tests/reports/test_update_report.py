from __future__ import annotations

from dataclasses import replace

from semsig_gis.database.update import UpdateReport
from semsig_gis.objects.changes import ClassChange
from semsig_gis.reports.update import update_tables

TREES = ClassChange(
    class_name="tree",
    before=1200,
    after=1290,
    added=100,
    removed=9,
    moved=2,
    moved_m=2.5,
    gained=0,
    lost=1,
)
LAMPS = ClassChange(
    class_name="lamp",
    before=8,
    after=9,
    added=0,
    removed=0,
    moved=0,
    moved_m=None,
    gained=1,
    lost=0,
)
REPORT = UpdateReport(
    classes=(TREES, LAMPS),
    replaced=("lamps", "trees"),
    kept=(),
    cells_before=9_000,
    cells=9_900,
    recomputed=3_000,
    changed=1_500,
    appeared=1_000,
    vanished=100,
)


def test_an_update_becomes_tables() -> None:
    objects, cells = update_tables(REPORT)
    assert objects.columns == (
        *("class", "before", "after", "added", "removed", "moved", "gained", "lost"),
        "moved by, m",
    )
    assert objects.rows == (
        ("tree", "1,200", "1,290", "100", "9", "2", "0", "1", "2.50"),
        ("lamp", "8", "9", "0", "0", "0", "1", "0", ""),
        ("all", "1,208", "1,299", "100", "9", "2", "1", "1", ""),
    )
    assert objects.note == "Layers replaced: lamps, trees."
    assert cells.rows == (
        ("before", "9,000"),
        ("after", "9,900"),
        ("computed again", "3,000"),
        ("changed", "1,500"),
        ("appeared", "1,000"),
        ("vanished", "100"),
    )
    assert "26.00%" in cells.note


def test_layers_that_stay_are_named_and_no_class_is_enough() -> None:
    objects, _ = update_tables(replace(REPORT, kept=("signs",), replaced=("trees",), classes=()))
    assert objects.note == "Layers replaced: trees. Layers that stay as they were: signs."
    assert objects.rows == (("all", *["0"] * 7, ""),)
