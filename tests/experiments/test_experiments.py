"""Tests of semsig_gis.experiments.paper.reproduce."""

from __future__ import annotations

from semsig_gis.experiments.paper.reproduce import (
    BEST,
    FEWER,
    FUSIONS,
    LEVELS,
    PERCENTS,
    QUERIES,
    READ,
    SINGLES,
    WEIGHTS,
    paper_experiments,
)
from semsig_gis.matching.method import Method
from semsig_gis.queries.distortions import DISTORTIONS

SPECS = paper_experiments(
    "city.parquet",
    ranges={20.0: "r20.parquet", 40.0: "r40.parquet"},
    scales={8: "q8.parquet", 24: "q24.parquet", 32: "q32.parquet"},
)


def test_everything_that_the_paper_runs_is_there() -> None:
    for name in ("none", "medium"):
        texts = {str(method) for method in SPECS[name].methods.values()}
        singles = {
            f"{p}:{m}" for p in ("types", "angles") for m in ("jaccard", "histogram", "edit")
        }
        fusions = {"edit+jaccard", "edit+histogram", "edit+edit"}
        stages = {f"edit+edit:{k}%" for k in (1, 5, 10, 20, 50)}
        assert singles | fusions | stages <= texts
        assert SPECS[name].top == (1, 100)
    weights = {f"edit+edit:alpha={w}" for w in (0.1, 0.3, 0.7, 0.9)}
    assert weights <= {str(method) for method in SPECS["medium"].methods.values()}
    assert [spec.database for name, spec in SPECS.items() if name[:5] in {"range", "level"}] == [
        "city.parquet", "r20.parquet", "r40.parquet", "q8.parquet", "q24.parquet", "q32.parquet",
    ]  # fmt: skip


def test_the_names_lead_to_the_methods() -> None:
    medium = SPECS["medium"].methods
    for name, text in {**SINGLES, **FUSIONS}.items():
        assert medium[name] == Method.parse(text)
    for share, name in WEIGHTS.items():
        assert medium[name] == Method(alpha=share)
    for percent, name in PERCENTS.items():
        # All cells kept is the fusion of all.
        assert medium[name] == Method(keep=None if percent == 100 else percent)
    assert str(medium[BEST]) == "edit+edit:5%"


def test_the_distortions_are_the_papers_levels_in_the_order_that_was_kept() -> None:
    chains = {**SPECS["levels"].distortions, **SPECS["medium"].distortions}
    assert set(chains) == set(LEVELS)
    for level, (one,) in chains.items():
        assert one.occurrences == DISTORTIONS[level].occurrences  # type: ignore[attr-defined]
        assert not one.resort  # type: ignore[attr-defined]
    readings = SPECS["readings"].distortions.values()
    said = {(one.resort, one.false_class) for (one,) in readings}  # type: ignore[attr-defined]
    assert len(said) == 4


def test_how_many_queries() -> None:
    assert SPECS["none"].queries == SPECS["range-20"].queries == QUERIES
    assert (SPECS["readings"].queries, SPECS["ours"].queries) == (READ, FEWER)
    few = paper_experiments("city.parquet", ranges={}, scales={}, queries=7, seed=3)
    assert {spec.queries for spec in few.values()} == {7}
    assert {spec.seeds for spec in few.values()} == {(3,)}
