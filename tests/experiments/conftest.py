"""What the tests of experiments share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.experiments.paper.reproduce import Reproduction


@pytest.fixture(scope="session")
def reproduction(reproduced: Path) -> Reproduction:
    """Return the results of the experiments of the paper on a small town."""
    from reproductions import QUERIES

    from semsig_gis.experiments.paper.reproduce import reproduce

    return reproduce(reproduced, database=reproduced.parent / "city.parquet", queries=QUERIES)
