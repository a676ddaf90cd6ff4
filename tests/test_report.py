from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pyproj import CRS

from semsig_gis.catalog import paper_taxonomy
from semsig_gis.database import SignatureDatabase
from semsig_gis.distortion import Distortion
from semsig_gis.evaluation import evaluate
from semsig_gis.grid import GridSpec
from semsig_gis.matching import Method
from semsig_gis.report import (
    database_markdown,
    database_summary,
    database_tables,
    evaluation_markdown,
    evaluation_tables,
)
from semsig_gis.signatures import SignatureSpec
from semsig_gis.taxonomy import ObjectClass

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.evaluation import Evaluation
    from semsig_gis.report import Table

# Six cells: by type three DD, one DB, two B; by angle (levels) four alike, two alike.
CELLS = [
    ("DD", [10, 100]),
    ("DD", [10, 100]),
    ("DD", [10, 200]),
    ("DB", [10, 100]),
    ("B", [300]),
    ("B", [300]),
]


@pytest.fixture(scope="module")
def database() -> SignatureDatabase:
    crossing = ObjectClass(code=40, symbol="z", name="crossing", title="Crossing | zebra")
    bearings = np.array([angle for _, angles in CELLS for angle in angles])
    taxonomy = paper_taxonomy().extended([crossing])
    return SignatureDatabase(
        columns=np.zeros(6, np.int32),
        rows=np.arange(6, dtype=np.int32),
        offsets=np.array([0, 2, 4, 6, 8, 9, 10]),
        codes=taxonomy.encode("".join(types for types, _ in CELLS)),
        bearing_units=(bearings * 20).astype(np.uint16),
        distance_units=np.full(10, 50, np.uint8),
        grid=GridSpec(step=10.0),
        spec=SignatureSpec(radius=30.0, levels=16),
        taxonomy=taxonomy,
        crs=CRS(2154),
        licenses=("trees: City <of> Paris (ODbL)",),
        version="0.1.0",
    )


@pytest.fixture(scope="module")
def evaluation(database: SignatureDatabase) -> Evaluation:
    return evaluate(database, queries=6, method=Method.parse("edit+edit:5%"), seed=1)


def rows(table: Table) -> Mapping[str, tuple[str, ...]]:
    return {row[0]: row[1:] for row in table.rows}


def test_properties_by_hand(database: SignatureDatabase) -> None:
    facts = database_summary(database, file_bytes=1_500_000)
    assert facts["signatures"] == 6
    assert facts["mean_length"] == pytest.approx(10 / 6)
    assert facts["covered_km2"] == pytest.approx(0.0006)
    assert facts["file_mb"] == 1.5
    assert (facts["radius_m"], facts["step_m"], facts["levels"]) == (30.0, 10.0, 16)
    assert facts["crs"] == "EPSG:2154"
    assert facts["largest_type_group"] == {"types": "DD", "cells": 3}


def test_occurrences_count_an_object_in_every_signature(database: SignatureDatabase) -> None:
    facts = {one["symbol"]: one for one in database_summary(database)["occurrences"]}
    assert len(facts) == 12
    assert (facts["D"]["number"], facts["B"]["number"], facts["z"]["number"]) == (7, 3, 0)
    assert facts["D"]["share"] == pytest.approx(0.7)
    assert sum(one["share"] for one in facts.values()) == pytest.approx(1)


def test_group_statistics_by_hand(database: SignatureDatabase) -> None:
    groups = database_summary(database)["groups"]
    by_type = groups["type"]  # sizes 3, 1, 2
    assert (by_type["count"], by_type["min"], by_type["max"]) == (3, 1, 3)
    assert by_type["mean"] == pytest.approx(2)
    assert by_type["std"] == pytest.approx(1)  # of a sample
    assert (by_type["25%"], by_type["50%"], by_type["75%"]) == (1.5, 2, 2.5)
    assert by_type["alone"] == pytest.approx(1 / 6)
    assert groups["angle"]["count"] == 3  # sizes 3, 1, 2
    assert groups["both"]["count"] == 4  # sizes 2, 1, 1, 2
    assert groups["both"]["alone"] == pytest.approx(2 / 6)
    assert groups["both"]["max"] == 2


def test_a_single_group_has_no_deviation(database: SignatureDatabase) -> None:
    one = replace(
        database,
        columns=database.columns[:1],
        rows=database.rows[:1],
        offsets=database.offsets[:2],
        codes=database.codes[:2],
        bearing_units=database.bearing_units[:2],
        distance_units=database.distance_units[:2],
    )
    assert database_summary(one)["groups"]["both"]["std"] is None
    assert rows(database_tables(one)[2])["std"][:3] == ("", "", "")


def test_the_summary_is_strict_json(database: SignatureDatabase) -> None:
    facts = database_summary(database)
    assert json.loads(json.dumps(facts, allow_nan=False)) == facts


def test_the_figures_of_the_paper_stand_beside_ours(database: SignatureDatabase) -> None:
    occurrences, properties, groups = database_tables(database, file_bytes=1_500_000)
    assert rows(occurrences)["Street light (D)"] == ("7", "70.0 %", "2,299,639", "52.3 %")
    assert rows(occurrences)["Crossing | zebra (z)"] == ("0", "0.0 %", "", "")
    paper = sum(int(row[3].replace(",", "")) for row in occurrences.rows if row[3])
    assert paper == 4_395_050
    assert paper / 312_134 == pytest.approx(14.08, abs=0.005)
    assert rows(properties)["Signatures"] == ("6", "312,134")
    assert rows(properties)["File"] == ("1.5 MB", "38.7 MB")
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
    for table in (occurrences, properties, groups):
        assert all(len(row) == len(table.columns) for row in table.rows)


def test_a_database_without_a_file_has_no_size(database: SignatureDatabase) -> None:
    assert rows(database_tables(database)[1])["File"] == ("", "38.7 MB")


def test_markdown_of_a_database_escapes_text_from_data(database: SignatureDatabase) -> None:
    text = database_markdown(database)
    assert text.startswith("## Signature database\n")
    assert text.count("\n### ") == 4
    assert "Crossing \\| zebra (z)" in text
    assert "- trees: City &lt;of> Paris (ODbL)" in text
    for table in text.split("### ")[1:4]:
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


def test_settings_and_figures_of_an_evaluation(evaluation: Evaluation) -> None:
    settings, figures, by_length = evaluation_tables(evaluation)
    assert rows(settings)["Method"] == ("edit+edit:5%",)
    assert rows(settings)["Distortion"] == ("medium, 7 occurrences",)
    assert rows(settings)["Bearing noise"] == ("5°, at most 30°",)
    assert rows(settings)["After the noise"] == ("sorted again",)
    assert rows(settings)["Class of a false object"] == ("uniform",)
    shown = rows(figures)
    assert shown["P(error ≤ 50 m)"] == (f"{evaluation.cdf([50])[0]:.4f}", "0.3733")
    assert shown["recall@10 %"] == (f"{evaluation.recall(10):.4f}", "0.6462")
    assert shown["P(error ≤ 10 m)"][1] == ""
    assert "Paris" in figures.note
    assert [row[0] for row in by_length.rows] == ["1-4", "5-9", "10-19", "20+"]
    assert by_length.rows[3][1:] == ("0", "", "", "", "", "", "")
    for table in (settings, figures, by_length):
        assert all(len(row) == len(table.columns) for row in table.rows)


@pytest.mark.parametrize(
    "changed",
    [
        {"top": 100},
        {"method": Method.parse("edit+edit")},
        {"method": Method.parse("edit+edit:5%:weights=2/1/1")},
        {"distortion": Distortion(occurrences=1)},
        {"distortion": Distortion(bearing_sigma=0.0)},
        {"step_m": 5.0},
        {"radius_m": 35.0},
    ],
)
def test_other_settings_are_not_compared_with_the_paper(
    evaluation: Evaluation, changed: dict[str, object]
) -> None:
    facts = {key: value for key, value in changed.items() if key.endswith("_m")}
    settings = {key: value for key, value in changed.items() if key not in facts}
    other = replace(evaluation, database={**evaluation.database, **facts}, **settings)  # type: ignore[arg-type]
    figures = evaluation_tables(other)[1]
    assert figures.columns == ("Figure", "Ours")
    assert all(len(row) == 2 for row in figures.rows)
    assert "Paris" not in figures.note


@pytest.mark.parametrize(
    ("radius", "levels", "p50", "recall10"),
    [(20.0, 16, "0.1793", "0.5110"), (40.0, 16, "0.4946", "0.7269"), (30.0, 24, "0.3861", "")],
)
def test_the_paper_has_figures_for_other_ranges_and_levels(
    evaluation: Evaluation, radius: float, levels: int, p50: str, recall10: str
) -> None:
    facts = {**evaluation.database, "radius_m": radius, "levels": levels}
    figures = rows(evaluation_tables(replace(evaluation, database=facts))[1])
    assert figures["P(error ≤ 50 m)"][1] == p50
    assert figures["recall@10 %"][1] == recall10


def test_settings_without_noise(evaluation: Evaluation) -> None:
    quiet = Distortion(bearing_sigma=0.0, resort=False, false_class="frequency", name="mine")
    settings = rows(evaluation_tables(replace(evaluation, distortion=quiet))[0])
    assert settings["Bearing noise"] == ("none",)
    assert settings["After the noise"] == ("order kept",)
    assert settings["Class of a false object"] == ("by frequency",)


def test_an_infinite_median_is_told(evaluation: Evaluation) -> None:
    lost = evaluation.queries.assign(error_m=np.inf)
    figures = rows(evaluation_tables(replace(evaluation, queries=lost))[1])
    assert figures["Median error"][0] == "infinite"


def test_markdown_of_an_evaluation(evaluation: Evaluation) -> None:
    text = evaluation_markdown(evaluation)
    assert text.startswith("## Evaluation\n\n### Settings\n")
    assert "| P(error ≤ 50 m) |" in text
    assert text.endswith("|\n")
