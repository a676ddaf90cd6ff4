"""The experiments of the paper: runs, invalid settings and the report."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused
from worlds import QUERIES, TOWN, contents, save_town

from semsig_gis.core import InputError, SemsigError
from semsig_gis.database import open_database, save_database
from semsig_gis.evaluation import paper_experiments, reproduce, time_queries
from semsig_gis.evaluation import published as paris
from semsig_gis.localization import Method, score_cells
from semsig_gis.output import reproduction_report
from semsig_gis.sources import CitySpec, paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.evaluation import Reproduction
    from semsig_gis.output import Number, Report


def test_all_experiments_of_the_paper_are_specified(snapshot: Callable[[str, str], None]) -> None:
    specs = paper_experiments(
        "city.parquet",
        ranges={20.0: "r20.parquet", 40.0: "r40.parquet"},
        scales={8: "q8.parquet", 24: "q24.parquet", 32: "q32.parquet"},
    )
    snapshot("paper.toml", "\n".join(f"# {name}\n{spec.to_toml()}" for name, spec in specs.items()))
    few = paper_experiments("city.parquet", ranges={}, scales={}, queries=7, seed=3)
    assert {(spec.queries, spec.seeds) for spec in few.values()} == {(7, (3,))}


@pytest.fixture(scope="module")
def reproduction(reproduced: Path) -> Reproduction:
    """Return the results of the experiments of the paper on a small town."""
    return reproduce(reproduced, database=reproduced.parent / "city.parquet", queries=QUERIES)


def test_all_experiments_are_run(reproduction: Reproduction) -> None:
    assert len(reproduction.database) == len(TOWN.database)
    assert reproduction.settings["queries"] == QUERIES
    assert reproduction.missing == ()
    assert set(reproduction.variants) == {20.0, 40.0}
    lengths = [reproduction.variants[r]["mean_length"] for r in (20.0, 40.0)]
    assert lengths[0] < reproduction.summary["mean_length"] < lengths[1]
    assert list(reproduction.experiments) == [
        *("none", "medium", "levels", "readings", "ours"),
        *("range-20", "range-40", "levels-8", "levels-24", "levels-32"),
    ]
    for results in reproduction.experiments.values():
        for evaluation in results.values():
            assert len(evaluation.queries) == QUERIES
    assert list(reproduction.seconds) == list(paris.QUERY_MS)
    levels = reproduction.experiments["levels-8"]["medium/stages-5-top1"]
    assert levels.database["levels"] == 8
    wide = reproduction.experiments["range-40"]["medium/stages-5-top1"]
    assert wide.database["radius_m"] == 40.0
    occurrences = reproduction.summary["occurrences"]
    assert sum(item["objects"] for item in occurrences) <= len(TOWN.objects)


def test_interrupted_run_ends_with_the_same_bytes(reproduced: Path, tmp_path: Path) -> None:
    save_town(tmp_path)
    calls = 0

    def progress(label: str) -> Callable[[int, int], None] | None:
        def stop(_: int, __: int) -> None:
            nonlocal calls
            calls += 1
            if calls == 3:
                raise KeyboardInterrupt

        return stop if label == "answering queries" else None

    options: dict[str, Any] = {"database": tmp_path / "city.parquet", "queries": QUERIES}
    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path / "out", progress=progress, **options)
    unfinished = {path.name for path in (tmp_path / "out" / "experiments").iterdir()}
    assert all(name.endswith(".partial") for name in unfinished)
    reproduce(tmp_path / "out", **options)
    # The same files except reports, which other tests write; digests of the same town differ.
    ours, whole = contents(tmp_path / "out"), contents(reproduced)
    assert set(ours) == {name for name in whole if name.startswith(("exp", "var", "settings"))}
    figures = [name for name in ours if name.endswith(("figures.csv", "queries.parquet"))]
    assert len(figures) > len(ours) / 4
    assert [ours[name] for name in figures] == [whole[name] for name in figures]


def test_finished_run_is_opened(reproduced: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(reproduced)
    for name in ("build_database", "time_queries", "save_database"):
        monkeypatch.delattr(f"semsig_gis.evaluation.paper.reproduction.{name}")
    monkeypatch.delattr("semsig_gis.evaluation.experiments.batches.score_queries")
    database = reproduced.parent / "city.parquet"
    results = reproduce(reproduced, database=database, queries=QUERIES)
    assert results.settings["queries"] == QUERIES
    assert contents(reproduced) == before


def test_other_settings_are_refused(reproduced: Path, tmp_path: Path) -> None:
    database = reproduced.parent / "city.parquet"
    options: dict[str, Any] = {"database": database, "queries": QUERIES}
    before = contents(reproduced)
    other_database = tmp_path / "city.parquet"
    save_database(TOWN.database.select(slice(1, None)), other_database)
    for change, word in (
        ({"queries": 11}, "queries"),
        ({"seed": 5}, "seed"),
        ({"size": "small"}, "size"),
        ({"database": other_database}, "database"),
    ):
        with refused(InputError, "other settings", f"differ in {word}"):
            reproduce(reproduced, **{**options, **change})
    assert contents(reproduced) == before


@pytest.fixture
def _few_methods(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use few methods, to save time."""
    module = "semsig_gis.evaluation.paper.reproduction"
    for name, methods in {
        "SINGLES": {"types-edit": "types:edit"},
        "FUSIONS": {"fusion-edit": "edit+edit"},
        "WEIGHTS": {0.5: "fusion-edit"},
        "PERCENTS": {5: "stages-5", 100: "fusion-edit"},
    }.items():
        monkeypatch.setattr(f"{module}.{name}", methods)


@pytest.mark.usefixtures("_few_methods")
def test_visibility_ranges_are_omitted_without_street_objects(tmp_path: Path) -> None:
    save_database(TOWN.database, tmp_path / "city.parquet")
    database = tmp_path / "city.parquet"
    results = reproduce(tmp_path / "out", database=database, queries=5, size="small")
    assert results.variants == {}
    assert not any(name.startswith("range") for name in results.experiments)
    (sentence,) = results.missing
    assert "visibility ranges" in sentence
    assert {item["objects"] for item in results.summary["occurrences"]} == {None}


@pytest.mark.usefixtures("_few_methods")
def test_synthetic_city_is_generated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = "semsig_gis.evaluation.paper.reproduction"
    cities = {"small": CitySpec(size=300.0), "full": CitySpec(size=400.0)}
    monkeypatch.setattr(f"{module}.CITIES", cities)
    monkeypatch.setattr(f"{module}.SMALL_QUERIES", 7)
    with refused(InputError, "1000000 queries"):
        reproduce(tmp_path / "out", queries=10**6)
    # The refused run left nothing behind that prevents a valid one.
    notes: list[str] = []
    results = reproduce(tmp_path / "out", size="small", note=notes.append)
    settings = {"size": "small", "database": "a made-up city", "queries": 7, "seed": 0}
    assert results.settings == settings
    assert any("made up" in note for note in notes)
    assert len(open_database(tmp_path / "out" / "city" / "city.parquet")) == len(results.database)
    width = results.database.columns.max() - results.database.columns.min()
    assert width * results.database.grid.step < 400.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": "huge"}, ["'huge'", "full or small"]),
        ({"queries": 10**6}, ["1000000 queries", "number of cells"]),
        ({"queries": 0}, ["0 queries", "number of cells"]),
        ({"database": "nowhere.parquet"}, ["nowhere.parquet", "signature database"]),
        ({"workers": -1}, ["-1 workers"]),
        ({"seed": -1}, ["a seed is -1", "from 0 to"]),
    ],
)
def test_invalid_options_are_refused(
    tmp_path: Path, options: dict[str, Any], words: list[str]
) -> None:
    save_town(tmp_path)
    with refused(SemsigError, *words):
        reproduce(
            tmp_path / "out", **{"database": tmp_path / "city.parquet", "queries": 5, **options}
        )
    assert not (tmp_path / "out").exists()


def test_settings_of_another_program_are_refused(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text("{}", encoding="utf-8")
    (tmp_path / "me.jpg").touch()
    with refused(InputError, str(tmp_path), "'me.jpg'", "another folder"):
        reproduce(tmp_path, size="small")


def test_each_method_is_timed_with_the_given_repetitions(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths: list[int] = []

    def counted(database: object, queries: list[object], method: object) -> object:
        lengths.append(len(queries[0]))  # type: ignore[arg-type]
        return score_cells(database, queries, method)  # type: ignore[arg-type]

    monkeypatch.setattr("semsig_gis.evaluation.paper.reproduction.score_cells", counted)
    methods = {"types": Method.parse("types:edit"), "both": Method()}
    steps: list[tuple[int, int]] = []
    times = time_queries(
        TOWN.database, methods, length=5, repetitions=4, progress=lambda *step: steps.append(step)
    )
    assert list(times) == ["types", "both"]
    assert min(times.values()) > 0
    assert lengths == [5] * 12  # for each method, two calls that are not timed and four that are
    assert steps == [(1, 2), (2, 2)]
    # Queries of the nearest length are used if none has the given length.
    longest = int(TOWN.database.lengths.max())
    time_queries(TOWN.database, {"both": Method()}, length=longest + 50, repetitions=1)
    assert lengths[12:] == [longest] * 3
    with refused(InputError, "0 repetitions", "from 1"):
        time_queries(TOWN.database, {}, repetitions=0)


@pytest.fixture(scope="module")
def report(reproduction: Reproduction) -> Report:
    return reproduction_report(reproduction)


def numbers(report: Report, section: str) -> dict[tuple[str, str], Number]:
    """Return the numbers of a section by row and column."""
    (match,) = (item for item in report.sections if item.name == section)
    return {(number.row, number.column): number for number in match.numbers}


def test_report_contains_every_figure_of_the_paper(report: Report) -> None:
    papers = [number.paper for section in report.sections for number in section.numbers]
    printed = [
        *paris.OCCURRENCES.values(),
        *paris.DATABASE.values(),
        *(float(text.replace(",", "")) for key in ("count", "mean", "std", "max")
          for text in paris.GROUPS[key]),
        *(value for pair in paris.ACCURACY.values() for value in pair if value is not None),
        *paris.QUERY_MS.values(),
        paris.UNAMBIGUOUS,
    ]  # fmt: skip
    assert set(printed) <= set(papers)
    points = [y for part in report.sections for plot in part.plots for _, y, _ in plot.paper]
    assert set(paris.READ_OFF.values()) <= {*papers, *points}


def test_report_has_the_figures_of_the_evaluations(
    report: Report, reproduction: Reproduction
) -> None:
    experiments = reproduction.experiments
    medium = experiments["medium"]["medium/stages-5-top1"]
    shown = numbers(report, "levels")["medium", "P(error ≤ 50 m)"]
    assert shown.ours == pytest.approx(medium.cdf([50])[0])
    assert (shown.low, shown.high) == tuple(medium.means().loc["p50", ["low", "high"]])
    assert shown.paper == 0.3733
    recall = numbers(report, "ranges")["R = 40 m", "recall@10 %"]
    assert recall.ours == pytest.approx(experiments["range-40"]["medium/stages-5-top1"].recall(10))
    assert recall.paper == 0.7269
    wide = experiments["range-40"]["medium/stages-5-top1"].queries
    some = wide[(wide["length"] >= 10) & (wide["length"] <= 19)]
    column = "P(error ≤ 50 m) of queries that see 10 to 19 objects"
    middling = numbers(report, "ranges")["R = 40 m", column].ours
    assert middling == (pytest.approx(some["p50"].mean()) if len(some) else None)
    assert numbers(report, "scales")["Q = 24", "P(error ≤ 50 m)"].paper == 0.3861
    single = numbers(report, "single")
    recall = single["edit, angles", "medium: recall@20 %"]
    angles = experiments["medium"]["medium/angles-edit-top100"]
    assert recall.ours == pytest.approx(angles.recall(20))
    best = single["best of these", "no distortion: P(error ≤ 10 m)"]
    others = [number for (_, column), number in single.items() if column == best.column]
    assert best.ours == max(number.ours or 0.0 for number in others)
    times = numbers(report, "times")["edit distance", "angles"]
    assert (times.paper, times.unit) == (1850.0, "ms")
    assert times.ours == 1000 * reproduction.seconds["angles:edit"]


def test_section_on_unambiguous_queries(report: Report, reproduction: Reproduction) -> None:
    queries = reproduction.experiments["levels"]["light/stages-5-top1"].queries
    unambiguous = queries[queries["type_group"] == 1]
    section = numbers(report, "unambiguous")
    assert section["light", "P(error ≤ 50 m)"].ours == pytest.approx(unambiguous["p50"].mean())
    assert section["queries", "share in a group of one"].ours == pytest.approx(
        len(unambiguous) / QUERIES
    )


def test_share_is_reweighted_to_the_papers_unambiguous_queries(
    report: Report, reproduction: Reproduction
) -> None:
    queries = reproduction.experiments["medium"]["medium/stages-5-top1"].queries
    unambiguous = queries["type_group"] == 1
    row = "as the first, with the paper's share of unambiguous queries"
    weighed = numbers(report, "readings")[row, "P(error ≤ 50 m)"]
    means = queries["p50"][unambiguous].mean(), queries["p50"][~unambiguous].mean()
    expected = 0.418 * means[0] + 0.582 * means[1]
    assert weighed.ours == pytest.approx(expected)
    assert (weighed.low or 1.0) < expected < (weighed.high or 0.0)


def test_curves_are_monotonic_and_recall_ends_at_one(report: Report) -> None:
    plots = [plot for part in report.sections for plot in part.plots]
    assert len(plots) >= 14
    for plot in plots:
        assert plot.curves
        for curve in plot.curves:
            assert list(curve.x) == sorted(curve.x)
            if plot.name.endswith(("error", "recall")):
                assert list(curve.y) == sorted(curve.y)
            if plot.name.endswith("recall"):
                assert curve.y[-1] == pytest.approx(1.0)


def test_headline_has_the_papers_figure_and_ours(
    report: Report, reproduction: Reproduction
) -> None:
    ours = reproduction.experiments["ours"]["medium/likelihood-top1"].cdf([50])[0]
    words = f"(the paper, on Paris: 37 %); the likelihood method places {100 * ours:.0f}"
    assert f"within 50 m {words}" in report.headline
    assert "recommended" in report.sections[0].title


def test_plots_have_the_papers_values_and_ours(report: Report) -> None:
    plots = {plot.name: plot for part in report.sections for plot in part.plots}
    ours, theirs, _, recalls = plots["ranges-shares"].curves
    assert theirs.x == recalls.x == (20.0, 30.0, 40.0)
    assert theirs.y == (0.1793, 0.3733, 0.4946)
    assert recalls.y == (0.5110, 0.6462, 0.7269)
    assert all(low <= y <= high for low, y, high in zip(ours.low, ours.y, ours.high, strict=True))
    _, theirs = plots["scales-shares"].curves
    assert (theirs.x, theirs.y) == ((8.0, 16.0, 24.0, 32.0), (0.3243, 0.3733, 0.3861, 0.3766))
    points = {name: {(x, y) for x, y, _ in plot.paper} for name, plot in plots.items()}
    assert points["levels-error"] == {(50.0, 0.3733), (10.0, 0.70), (10.0, 0.25)}
    assert points["levels-recall"] == {(10.0, 0.6462), (10.0, 0.90), (10.0, 0.50)}
    assert points["fusion-none-error"] == {(0.0, 0.93)}
    assert all(plot.log for name, plot in plots.items() if name.endswith(("error", "recall")))


def test_sections_of_missing_experiments_are_omitted(reproduction: Reproduction) -> None:
    less = {k: v for k, v in reproduction.experiments.items() if not k.startswith("range")}
    partial = replace(reproduction, experiments=less, variants={}, missing=("No ranges.",))
    report = reproduction_report(partial)
    assert "ranges" not in [part.name for part in report.sections]
    assert "No ranges." in report.text


# --- The published figures --------------------------------------------------------------------

SIGNATURES = 312_134


def test_published_figures_are_consistent() -> None:
    assert list(paris.OCCURRENCES) == [item.name for item in paper_taxonomy().classes]
    assert sum(paris.OCCURRENCES.values()) / SIGNATURES == pytest.approx(14.08, abs=0.005)
    for kind in range(2):
        count = int(paris.GROUPS["count"][kind].replace(",", ""))
        assert SIGNATURES / count == pytest.approx(float(paris.GROUPS["mean"][kind]), abs=0.05)
    # Accuracy increases with the range; times of two stages are between those of types and angles.
    for shares in zip(*(paris.ACCURACY[radius, 16] for radius in (20.0, 30.0, 40.0)), strict=True):
        assert list(shares) == sorted(shares)
    assert paris.STEP_M == 10.0
    assert [str(Method.parse(name)) for name in paris.QUERY_MS] == list(paris.QUERY_MS)
    for name in ("jaccard", "histogram", "edit"):
        types, angles = (paris.QUERY_MS[f"{part}:{name}"] for part in ("types", "angles"))
        assert types < paris.QUERY_MS[f"{name}+{name}:5%"] < angles
