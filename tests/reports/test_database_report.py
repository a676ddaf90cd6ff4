from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
import shapely
from six_cells import rows, six_cells

from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.reports.database import database_markdown, database_tables

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    return six_cells()


def test_the_figures_of_the_paper_stand_beside_ours(database: SignatureDatabase) -> None:
    occurrences, properties, groups, classes = database_tables(database, file_bytes=1_500_000)
    assert rows(occurrences)["Street light (D)"] == ("7", "70.0 %", "2,299,639", "52.3 %")
    assert rows(occurrences)["Crossing | zebra (z)"] == ("0", "0.0 %", "", "")
    paper = sum(int(row[3].replace(",", "")) for row in occurrences.rows if row[3])
    assert paper == 4_395_050
    assert paper / 312_134 == pytest.approx(14.08, abs=0.005)
    assert rows(properties)["Signatures"] == ("6", "312,134")
    assert rows(properties)["File"] == ("1.5 MB", "38.7 MB")
    assert rows(properties)["File a km²"] == ("2500.00 MB", "1.24 MB")
    assert float(rows(properties)["File"][1][:4]) / 31.2134 == pytest.approx(1.24, abs=0.005)
    assert rows(properties)["Largest group by type"] == ("DD, 3 cells", "DDD, 29,958 cells")
    assert rows(groups)["count"] == ("3", "3", "4", "140,296", "204,891")
    assert rows(groups)["mean"] == ("2.0", "2.0", "1.5", "2.2", "1.5")
    assert rows(groups)["25%"] == ("1.5", "1.5", "1", "1", "1")
    assert rows(groups)["cells alone in their group"] == (
        "16.7 %",
        "16.7 %",
        "33.3 %",
        "41.8 %",
        "",
    )
    for table in (occurrences, properties, groups, classes):
        assert all(len(row) == len(table.columns) for row in table.rows)


def test_a_database_without_a_file_has_no_size(database: SignatureDatabase) -> None:
    properties = rows(database_tables(database)[1])
    assert properties["File"] == ("", "38.7 MB")
    assert properties["File a km²"] == ("", "1.24 MB")


def test_markdown_of_a_database_escapes_text_from_data(database: SignatureDatabase) -> None:
    text = database_markdown(database)
    assert text.startswith("## Signature database\n")
    assert text.count("\n### ") == 5
    assert "Crossing \\| zebra (z)" in text
    assert "- trees: City &lt;of> Paris (ODbL)" in text
    for table in text.split("### ")[1:5]:
        lines = [line for line in table.splitlines() if line.startswith("|")]
        assert len({line.replace("\\|", "").count("|") for line in lines}) == 1


def test_a_long_sequence_is_shortened(database: SignatureDatabase) -> None:
    n = 30
    long = replace(
        database,
        columns=database.columns[:1],
        rows=database.rows[:1],
        offsets=np.array([0, n]),
        codes=np.full(n, 3, np.uint8),
        bearing_units=np.arange(n, dtype=np.uint16),
        distance_units=np.zeros(n, np.uint8),
    )
    largest = rows(database_tables(long)[1])["Largest group by type"][0]
    assert largest == "DDDDDDDDDDDDDDDDDDDD… (30 objects), 1 cells"


def test_how_it_was_looked_is_told(database: SignatureDatabase) -> None:
    plain = rows(database_tables(database)[1])
    assert plain["Visibility range"] == ("30 m", "30 m")
    assert plain["Occlusion"] == ("none", "")
    assert plain["Viewpoints"] == ("all cells", "")
    area = shapely.box(0, 0, 2000, 1000)
    other = replace(
        database,
        occlusion=0.25,
        viewpoints=ViewpointSpec(mode="streets", width=6.0, area=area),
        taxonomy=database.taxonomy.with_ranges(
            {"street_light": 50, "alignment_tree": 20, "bench": 9}
        ),
    )
    told = rows(database_tables(other)[1])
    assert told["Visibility range"][0] == "30 m (2 classes have their own)"
    assert told["Occlusion"][0] == "by buildings, more than 0.25 m deep"
    assert told["Viewpoints"][0] == (
        "cells along streets (6 m from the centre line, or by class), in an area of 2.0 km²"
    )
    outdoor = replace(database, viewpoints=ViewpointSpec(mode="outdoor"))
    assert rows(database_tables(outdoor)[1])["Viewpoints"][0] == "cells outside buildings"


def test_classes_are_told_with_and_without_a_count(database: SignatureDatabase) -> None:
    estimated = database_tables(database)[3]
    assert estimated.columns == ("Class (symbol)", "Range, m", "Objects a km²", "Entropy, bits")
    # Seven in six cells, each of which looks at 2,827 m2.
    assert rows(estimated)["Street light (D)"] == ("30", "412.6", "1.459")
    assert len(estimated.rows) == 2
    assert "estimated" in estimated.note
    assert "hide" not in estimated.note
    assert "buildings hide" in database_tables(replace(database, occlusion=0.5))[3].note
    counted = database_tables(database, object_counts={3: 2, 1: 1, 11: 1})[3]
    assert counted.columns[2] == "Objects"
    assert rows(counted)["Street light (D)"] == ("30", "2", "3,333.3", "1.459")
    # An object that no cell sees is there all the same.
    assert rows(counted)["Bus stop (M)"] == ("30", "1", "1,666.7", "0.000")
    assert "estimated" not in counted.note
    assert "| 2 |" in database_markdown(database, object_counts={3: 2})


def test_a_single_cell_has_no_deviation(database: SignatureDatabase) -> None:
    tables = database_tables(database.select(slice(1)))
    assert rows(tables[2])["std"][:3] == ("", "", "")
    assert rows(tables[2])["entropy, in bits"] == ("0.00", "0.00", "0.00", "", "")
