"""Commands that are killed on the way: what was there before stays, or the new is whole."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from kills import killed_at, operations

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("name", ["cells.gpkg", "cells.tif", "cells.csv"])
def test_an_export_is_the_old_file_or_the_new(town: Path, name: str) -> None:
    line = ["export", "city.parquet", "--out", name]
    steps = operations(line, cwd=town)
    whole = (town / name).stat().st_size
    for number in range(1, steps + 2):
        (town / name).write_text("old")
        outcome = killed_at(number, line, cwd=town)
        assert outcome.killed == (number <= steps)
        assert (town / name).stat().st_size in {3, whole}
    assert (town / name).stat().st_size == whole
