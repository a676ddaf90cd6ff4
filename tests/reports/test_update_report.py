from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from semsig_gis.database.update import UpdateReport
from semsig_gis.objects.changes import ClassChange
from semsig_gis.reports.quality import update_tables

if TYPE_CHECKING:
    from collections.abc import Callable

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


def test_tables(snapshot: Callable[[str, str], None]) -> None:
    snapshot("update.md", "\n".join(table.markdown() for table in update_tables(REPORT)))


def test_layers_that_stay_are_named_and_no_class_is_enough() -> None:
    objects, _ = update_tables(replace(REPORT, kept=("signs",), replaced=("trees",), classes=()))
    assert objects.note == "Layers replaced: trees. Layers that stay as they were: signs."
    assert objects.rows == (("all", *["0"] * 7, ""),)
