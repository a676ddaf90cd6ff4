"""Tables of databases, evaluations, experiments, identifiability, loads and updates."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
import shapely
from noisy_cells import random_database, rows, six_cells
from small_city import chances_of
from worlds import random_town

from semsig_gis.core import Distortion, Town, wilson_interval
from semsig_gis.database import UpdateReport, ViewpointSpec
from semsig_gis.evaluation import (
    ChanceBin,
    ExperimentSpec,
    IdentifiabilityCheck,
    QuerySpec,
    check_identifiability,
    evaluate,
    experiment_figures,
    experiment_markdown,
    experiment_tables,
    identify,
    parse_chain,
)
from semsig_gis.localization import LikelihoodMethod, Method, build_index, named_noise
from semsig_gis.objects import (
    ClassChange,
    ClassQuality,
    ConflatedPair,
    LayerReport,
    QualityReport,
    UnreadLayer,
)
from semsig_gis.output import (
    check_tables,
    comparison_sentence,
    comparison_table,
    database_tables,
    evaluation_tables,
    identifiability_page,
    identifiability_tables,
    lost_sentence,
    quality_tables,
    update_tables,
    write_report,
)
from semsig_gis.sources import RowCounts

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.core import Table
    from semsig_gis.localization import LikelihoodIndex

SIX = six_cells()
LONG = replace(
    SIX,
    columns=SIX.columns[:1],
    rows=SIX.rows[:1],
    offsets=np.array([0, 30]),
    codes=np.full(30, 3, np.uint8),
    bearing_units=np.arange(30, dtype=np.uint16),
    distance_units=np.zeros(30, np.uint8),
)
STREETS = replace(
    SIX,
    occlusion=0.25,
    viewpoints=ViewpointSpec(mode="streets", width=6.0, area=shapely.box(0, 0, 2000, 1000)),
    taxonomy=SIX.taxonomy.with_ranges({"street_light": 50, "alignment_tree": 20, "bench": 9}),
)

EVALUATION = evaluate(SIX, queries=6, method=Method.parse("edit+edit:5%"), seed=1)
TIMED = replace(EVALUATION, seconds_per_query=0.0125)
QUIET = QuerySpec(distortions=parse_chain("medium:resort=false, view:90"), seeds=(1, 2))
UNLOCALIZED = EVALUATION.queries.assign(error_m=np.inf, heading_error=np.arange(6) * 20.0)

DATABASE = random_database(5, cells=150)
LIGHT = named_noise("light")
SPEC = ExperimentSpec(
    database="city.parquet",
    methods={"paper": Method(), "light": LikelihoodMethod(noise=LIGHT)},
    distortions={"none": (), "some": parse_chain("errors:2, view:180")},
    queries=40,
)
METHODS: dict[str, Method | LikelihoodIndex] = {
    "paper": Method(),
    "light": build_index(DATABASE, LIGHT),
}
RESULTS = {
    case.name: evaluate(
        DATABASE,
        queries=40,
        method=METHODS[case.method],
        distortion=SPEC.distortions[case.distortion],
    )
    for case in SPEC.cases
}

CHANCES = chances_of(random_database(3, cells=40, classes=3))
TENTH = ChanceBin(
    low=0.2, high=0.3, queries=1234, stated=0.25, true=0.3, true_low=0.2, true_high=0.4
)
CHECK = IdentifiabilityCheck(
    queries=2000,
    seed=1,
    found=0.4,
    attainable=0.61,
    bins=(TENTH,),
    correlations={"found": 0.5, "near": 0.4, "length": -0.3, "type_group": math.nan},
)

PAIR = ConflatedPair(
    class_name="bench", merged="osm", kept="city", radius=5.0, count=1, median_m=2.0, largest_m=2.5
)
COUNTS = RowCounts(
    read=1405, unreadable=1, filtered=2, missing=1, misplaced=1, collapsed=50, conflated=50
)
BENCHES = ClassQuality(
    class_name="bench",
    title="Bench",
    objects=1300,
    rows=1400,
    per_km2_hull=None,
    per_km2_occupied=65.0,
    nearest_m=12.25,
)
LOAD = QualityReport(
    classes=(BENCHES,),
    absent=("alignment_tree", "taxi_station"),
    sources=(LayerReport("city", COUNTS, notes=("row 9: broken", "old")),),
    conflated=(PAIR,),
    crs="EPSG:2154",
    extent=(770000.4, 6280000.0, 771000.0, 6281000.0),
    extent_degrees=(3.87, 43.6, 3.88, 43.61),
    town=Town("Montpellier", "France", 0.5),
    distortion=Distortion(convergence=(0.62, 0.64), scale=(0.9999, 1.0)),
    hull_km2=0.5,
    occupied_km2=20.0,
    licenses=("Town: CC0",),
    unread=(UnreadLayer("posts", ("bollard", "post_box"), 1234), UnreadLayer("far", ("bench",))),
)
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
UPDATE = UpdateReport(
    classes=(TREES, replace(TREES, class_name="lamp", moved=0, moved_m=None, gained=1)),
    replaced=("lamps", "trees"),
    kept=(),
    cells_before=9_000,
    cells=9_900,
    recomputed=3_000,
    changed=1_500,
    appeared=1_000,
    vanished=100,
)

TABLES: dict[str, tuple[Table, ...]] = {
    "database-cells": database_tables(SIX, file_bytes=1_500_000),
    # With an object that no cell sees.
    "database-objects": database_tables(SIX, object_counts={3: 2, 1: 1, 11: 1}),
    "database-streets": database_tables(STREETS),
    "database-long": database_tables(LONG),
    "database-one": database_tables(SIX.select(slice(1))),
    "evaluation-paper": evaluation_tables(TIMED),
    "evaluation-other": evaluation_tables(replace(TIMED, asked=QUIET, city="b")),
    "evaluation-none": evaluation_tables(
        replace(TIMED, asked=QuerySpec(distortions=()), queries=UNLOCALIZED)
    ),
    "identifiability": (
        *identifiability_tables(CHANCES),
        identifiability_tables(CHANCES, object_counts={1: 2000, 3: 10})[1],
        *check_tables(CHECK),
    ),
    "quality": quality_tables(LOAD),
    "update": update_tables(UPDATE),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_match_their_snapshots(name: str, snapshot: Callable[[str, str], None]) -> None:
    tables = TABLES[name]
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    snapshot(f"{name}.md", "\n".join(table.markdown() for table in tables))


def test_markdown_of_tables_escapes_text_from_data() -> None:
    texts = [table.markdown() for table in TABLES["database-cells"]]
    assert "crossing \\| zebra" in texts[0]
    for table in texts:
        lines = [line for line in table.splitlines() if line.startswith("|")]
        assert len({line.replace("\\|", "").count("|") for line in lines}) == 1


def test_properties_of_a_database_match_a_count_by_hand() -> None:
    _, properties, groups, classes = map(rows, TABLES["database-cells"])
    assert properties["Signatures"] == ("6", "312,134")
    assert properties["Largest group by type"] == ("2 × street light, 3 cells", "DDD, 29,958 cells")
    assert groups["count"] == ("3", "3", "4", "140,296", "204,891")
    assert groups["cells in a group of one"][:3] == ("16.7 %", "16.7 %", "33.3 %")
    # Seven in six cells, where each cell sees 2,827 m2.
    assert classes["street light"] == ("30", "412.6", "1.459")
    _, properties, _, classes = map(rows, database_tables(SIX, symbols=True))
    assert properties["Largest group by type"][0] == "DD, 3 cells"
    assert "street light (D)" in classes
    outdoor = replace(SIX, viewpoints=ViewpointSpec(mode="outdoor"))
    assert rows(database_tables(outdoor)[1])["Viewpoints"][0] == "cells outside buildings"


def test_figures_agree_with_the_evaluation() -> None:
    figures = rows(TABLES["evaluation-paper"][1])
    mean = EVALUATION.cdf([50])[0]
    low, high = wilson_interval(mean, 6)
    assert figures["Placed within 50 m"] == (f"{mean:.4f}", f"{low:.4f} to {high:.4f}", "0.3733")
    assert figures["True cell in the best 10 %"][::2] == (f"{EVALUATION.recall(10):.4f}", "0.6462")
    assert figures["Within 25 m, best of 5"][0] == f"{EVALUATION.queries['near5'].mean():.4f}"


@pytest.mark.parametrize(
    "changed",
    [
        {"top": 100},
        {"method": Method.parse("edit+edit")},
        {"method": Method.parse("edit+edit:5%:weights=2/1/1")},
        {"asked": QuerySpec(distortions=parse_chain("light"))},
        {"asked": QuerySpec(distortions=parse_chain("medium:bearing_sigma=0"))},
        {"asked": QuerySpec(distortions=parse_chain("medium, view:90"))},
        {"asked": QuerySpec(seen_from="anywhere")},
        {"database": {**EVALUATION.database, "step_m": 5.0}},
        {"database": {**EVALUATION.database, "radius_m": 35.0}},
    ],
)
def test_other_settings_are_not_compared_with_the_paper(changed: dict[str, object]) -> None:
    figures = evaluation_tables(replace(EVALUATION, **changed))[1]  # type: ignore[arg-type]
    assert figures.columns == ("Figure", "Ours", "95 %")
    assert all(len(row) == 3 for row in figures.rows)
    assert "Paris" not in figures.note


@pytest.mark.parametrize(
    ("radius", "levels", "p50", "recall10"),
    [(20.0, 16, "0.1793", "0.5110"), (40.0, 16, "0.4946", "0.7269"), (30.0, 24, "0.3861", "")],
)
def test_figures_of_the_paper_for_other_ranges_and_levels(
    radius: float, levels: int, p50: str, recall10: str
) -> None:
    facts = {**EVALUATION.database, "radius_m": radius, "levels": levels}
    figures = rows(evaluation_tables(replace(EVALUATION, database=facts))[1])
    assert figures["Placed within 50 m"][2] == p50
    assert figures["True cell in the best 10 %"][2] == recall10


def test_experiment_figures_have_every_case() -> None:
    table = experiment_figures(RESULTS)
    assert list(dict.fromkeys(table["case"])) == [case.name for case in SPEC.cases]
    for name, evaluation in RESULTS.items():
        figures = table[table["case"] == name].set_index("figure")
        errors = evaluation.queries["error_m"]
        assert figures["value"]["error_median"] == pytest.approx(np.median(errors))
        assert figures["n"]["error_median"] == 40
        assert ("coverage" in figures.index) == ("light" in name)
        assert "heading_error_median" not in figures.index


def test_tables_of_an_experiment_match_their_snapshot(snapshot: Callable[[str, str], None]) -> None:
    tables = experiment_tables(SPEC, RESULTS)
    assert {table.columns[-1] for table in tables[1:]} == {"s a query"}
    assert all(len(row) == len(table.columns) for table in tables for row in table.rows)
    case = RESULTS["some/paper-top1"]
    unlocalized = replace(case, queries=case.queries.assign(error_m=np.inf))
    results = {**RESULTS, "some/paper-top1": unlocalized}
    snapshot("experiment.md", experiment_markdown(SPEC, results))


def test_comparison_table_has_a_verdict_for_significant_differences() -> None:
    figures = [
        ("p50", 0.5, 0.6, 0.1, 0.05, 0.2),
        ("p5", 0.5, 0.4, -0.1, -0.2, 0.0),
        ("p10", 0.5, 0.3, -0.2, -0.3, -0.1),
        ("error_p90", math.inf, 5.0, math.nan, math.nan, math.nan),
    ]
    names = ["figure", "first", "second", "difference", "low", "high"]
    table = comparison_table(pd.DataFrame(figures, columns=names), "one and other")
    assert table.rows == (
        ("p50", "0.5000", "0.6000", "+0.1000", "+0.0500 to +0.2000", "more"),
        ("p5", "0.5000", "0.4000", "-0.1000", "-0.2000 to +0.0000", ""),
        ("p10", "0.5000", "0.3000", "-0.2000", "-0.3000 to -0.1000", "less"),
        ("error_p90", "infinite", "5.0000", "", "", ""),
    )


@pytest.mark.parametrize(
    ("difference", "low", "high", "text"),
    [
        (0.041, 0.019, 0.063, "B places 4.1 points more queries within 50 m than A (95 %: 1.9 to"),
        (-0.041, -0.063, -0.019, "4.1 points fewer queries within 50 m than A (95 %: 1.9 to 6.3)"),
        (0.01, -0.02, 0.04, "than A, which may be chance (95 %: -2.0 to 4.0)"),
        (-0.01, -0.0401, 0.0001, "fewer queries within 50 m than A, which may be chance"),
        (0.0, -0.01, 0.01, "0.0 points more"),
        (0.0, 0.0, 0.0, "B places as many queries within 50 m as A."),
    ],
)  # fmt: skip
def test_sentence_of_a_comparison(difference: float, low: float, high: float, text: str) -> None:
    row = {"figure": "p50", "first": 0.5, "second": 0.5 + difference, "difference": difference}
    comparison = pd.DataFrame([{**row, "low": low, "high": high}])
    sentence = comparison_sentence(comparison, (1120, 79), names=("A", "B"))
    assert text in sentence
    assert (": 1,120 queries gained, 79 lost." in sentence) == any((difference, low, high))


def test_tables_agree_with_the_identifiability() -> None:
    whole, plain, counted, *_ = TABLES["identifiability"]
    facts, cells = CHANCES.summary(), rows(whole)
    assert cells["chance that the answer is within 30 m"] == (
        f"{100 * facts['chance_found']:.1f} %",
    )
    assert cells["bits left"] == (f"{facts['bits_left']:.2f} of {math.log2(40):.2f}",)
    assert [row[:3] for row in counted.rows] == list(plain.rows)
    gain = next(item.near for item in CHANCES.classes if item.code == 3)
    assert rows(counted)["street light"][2:] == ("10", f"{1e5 * gain / 10:+.3f} %")


def test_report_of_identifiability_agrees_with_its_check(tmp_path: Path) -> None:
    index = build_index(random_town().database, LIGHT)
    chances = identify(index, trials=40, class_trials=5)
    check = check_identifiability(chances, index, queries=60)
    page = identifiability_page(chances, check, name="<town>", object_counts={3: 5})
    assert page.headline.endswith(f"; of 60 fresh ones, {100 * check.found:.0f} % were.")
    sections = {section.name: section for section in page.sections}
    ranks = {number.row: number.ours for number in sections["ranks"].numbers}
    assert ranks["chance to be found"] == check.correlations["found"]
    calibration = sections["calibration"]
    (plot,) = calibration.plots
    assert plot.diagonal
    assert plot.curves[0].x == tuple(item.stated for item in check.bins)
    assert plot.curves[0].y == tuple(item.true for item in check.bins)
    assert sum(item.ours or 0 for item in calibration.numbers if item.column == "queries") == 60
    assert any(number.column == "objects" for number in sections["classes"].numbers)
    write_report(page, tmp_path)
    assert "&lt;town&gt;" in (tmp_path / "report.html").read_text("utf-8")
    assert (tmp_path / "figures" / "identifiability-calibration.svg").is_file()


def test_empty_parts_of_tables_and_reports_are_omitted() -> None:
    correlations = dict.fromkeys(CHECK.correlations, math.nan)
    check = replace(CHECK, correlations=correlations, attainable=math.nan)
    assert check_tables(check)[1].note == ""
    page = identifiability_page(CHANCES, check, name="town")
    ranks = page.sections[-1]
    assert (ranks.name, ranks.text) == ("ranks", ())
    assert {number.ours for number in ranks.numbers} == {None}
    columns = {number.column for section in page.sections for number in section.numbers}
    assert "objects" not in columns
    still = replace(LOAD.sources[0], notes=())
    silent = replace(LOAD, sources=(still,), conflated=(), absent=(), unread=())
    objects, *others = quality_tables(silent)
    assert objects.note.endswith("of the class.")
    assert [table.title for table in others] == ["Rows by layer", "Place", "Licences"]
    assert lost_sentence(replace(silent, sources=())) == ""


def test_layers_without_rows_are_a_line_below_the_others() -> None:
    empty = [
        LayerReport(f"empty {number}", RowCounts(read=0), notes=("the layer has no rows",))
        for number in range(23)
    ]
    causes = ("unreadable: lacks nodes (2)", "row 1: way/7 lacks nodes", "row 2: way/9 lacks nodes")
    ways = LayerReport("ways", RowCounts(read=9, unreadable=2, missing=1), notes=causes)
    twin = replace(ways, name="twin")
    report = replace(LOAD, sources=(*empty, ways, twin))
    tables = {table.title: table for table in quality_tables(report)}
    assert [row[0] for row in tables["Rows by layer"].rows] == ["ways", "twin"]
    assert "23 layers are empty: empty 0, " in tables["Rows by layer"].note
    assert tables["Rows by layer"].note.endswith(" and 11 more.")
    assert tables["Notes by layer"].rows == (("ways, twin", causes[0]),)
    assert "4 unreadable, 2 without a position;" in lost_sentence(report)
    objects, _ = update_tables(replace(UPDATE, kept=("signs",), replaced=("trees",), classes=()))
    assert objects.note == "Layers replaced: trees. Layers that stay as they were: signs."
    assert objects.rows == (("all", *["0"] * 7, ""),)
