from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from six_cells import rows, six_cells

from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.reports.database import database_tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.database.database import SignatureDatabase

DATABASE = six_cells()
LONG = replace(
    DATABASE,
    columns=DATABASE.columns[:1],
    rows=DATABASE.rows[:1],
    offsets=np.array([0, 30]),
    codes=np.full(30, 3, np.uint8),
    bearing_units=np.arange(30, dtype=np.uint16),
    distance_units=np.zeros(30, np.uint8),
)
STREETS = replace(
    DATABASE,
    occlusion=0.25,
    viewpoints=ViewpointSpec(mode="streets", width=6.0, area=shapely.box(0, 0, 2000, 1000)),
    taxonomy=DATABASE.taxonomy.with_ranges({"street_light": 50, "alignment_tree": 20, "bench": 9}),
)


@pytest.mark.parametrize(
    ("name", "database", "options"),
    [
        ("cells", DATABASE, {"file_bytes": 1_500_000}),
        # An object that no cell sees is there all the same.
        ("objects", DATABASE, {"object_counts": {3: 2, 1: 1, 11: 1}}),
        ("streets", STREETS, {}),
        ("long", LONG, {}),
        ("one", DATABASE.select(slice(1)), {}),
    ],
)
def test_tables_of_a_database(
    name: str,
    database: SignatureDatabase,
    options: dict[str, Any],
    snapshot: Callable[[str, str], None],
) -> None:
    tables = database_tables(database, **options)
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    snapshot(f"database-{name}.md", "\n".join(table.markdown() for table in tables))


def test_markdown_of_a_database_escapes_text_from_data() -> None:
    texts = [table.markdown() for table in database_tables(DATABASE)]
    assert "Crossing \\| zebra (z)" in texts[0]
    for table in texts:
        lines = [line for line in table.splitlines() if line.startswith("|")]
        assert len({line.replace("\\|", "").count("|") for line in lines}) == 1


def test_numbers_that_can_be_counted_by_hand() -> None:
    _, properties, groups, classes = map(rows, database_tables(DATABASE, file_bytes=1_500_000))
    assert properties["Signatures"] == ("6", "312,134")
    assert properties["Largest group by type"] == ("DD, 3 cells", "DDD, 29,958 cells")
    assert groups["count"] == ("3", "3", "4", "140,296", "204,891")
    assert groups["cells alone in their group"][:3] == ("16.7 %", "16.7 %", "33.3 %")
    # Seven in six cells, each of which looks at 2,827 m2.
    assert classes["Street light (D)"] == ("30", "412.6", "1.459")


def test_where_it_was_looked_from() -> None:
    outdoor = replace(DATABASE, viewpoints=ViewpointSpec(mode="outdoor"))
    assert rows(database_tables(outdoor)[1])["Viewpoints"][0] == "cells outside buildings"
