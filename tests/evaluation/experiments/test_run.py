"""Experiments from end to end: result files, interrupted runs, invalid experiments."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import pandas as pd
import pytest
import shapely
from geopandas.testing import assert_geodataframe_equal
from pandas.testing import assert_frame_equal
from sentences import refused
from worlds import CORNER, TOWN, World, contents, save_town

from semsig_gis.core import MACHINE_PREFIX, DatabaseError, InputError, SemsigError
from semsig_gis.evaluation import (
    Districts,
    OpenExperiment,
    QueryBatch,
    evaluate,
    open_results,
    parse_experiment,
    run_experiment,
    run_experiments,
    score_queries,
)
from semsig_gis.evaluation.experiments import batches
from semsig_gis.localization import Method, parse_method

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from distributed import LocalCluster

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import ExperimentSpec, SimulatedQuery
    from semsig_gis.localization import Answer, Locator

BATCH_QUERIES = 10
SPEC = parse_experiment("""
database = "city.parquet"
queries = 13
top = [1, 3]
[methods]
paper = "edit+edit:5%"
generic = "likelihood:generic"
[distortions]
none = []
phone = "light, compass:5, view:180"
""")
SAME_IN_EVERY_RUN = {"experiment.toml", "inputs.json", "figures.csv", "report.md"}


def interrupt(spec: ExperimentSpec, out: Path, folder: Path, *, after: int) -> None:
    """Interrupt an experiment when `after` answers are finished."""

    def stop(finished: int, total: int) -> None:
        assert total == spec.queries * len(spec.distortions) * len(spec.methods)
        if finished >= after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_experiment(spec, out, folder=folder, progress=stop)
    assert not out.exists()


def resume(folder: Path, tmp_path: Path, results: Path) -> None:
    """Run the experiment to its end; the files must be those of an uninterrupted run."""
    run_experiment(SPEC, tmp_path / "out", folder=folder)
    assert contents(tmp_path / "out") == contents(results)


@pytest.fixture(autouse=True, scope="module")
def _small_batches() -> Iterator[None]:
    """Use small batches in this process; other processes use the default."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "BATCH_QUERIES", BATCH_QUERIES)
        yield


@pytest.fixture
def _default_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batches, "BATCH_QUERIES", 100)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a town, and the same town after some objects moved."""
    place = tmp_path_factory.mktemp("towns")
    save_town(place)
    rows = enumerate(TOWN.objects)
    shifted = tuple((x + 40.0 * (row % 4 == 0), y, code) for row, (x, y, code) in rows)
    save_town(place, World(shifted), "later.parquet")
    west, nook = shapely.box(-50, -50, 100, 250), shapely.box(100, 0, 150, 9)
    boxes = gpd.GeoSeries([west, nook], crs="EPSG:2154").translate(*CORNER)
    parts = gpd.GeoDataFrame({"part": ["west", "nook"]}, geometry=boxes)
    parts.to_file(place / "parts.gpkg")
    return place


@pytest.fixture(scope="module")
def results(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the results of an uninterrupted run, which reports every batch of answers."""
    out = tmp_path_factory.mktemp("results") / "all"
    steps: list[tuple[int, int]] = []
    run_experiment(SPEC, out, folder=folder, progress=lambda *step: steps.append(step))
    assert steps == [(count, 52) for count in (20, 26, 46, 52)]
    return out


def test_result_folder_has_all_files_and_figures(results: Path) -> None:
    files = contents(results)
    cases = {case.name for case in SPEC.cases}
    expected = {
        f"{case}/{name}" for case in cases for name in ("queries.parquet", "evaluation.json")
    }
    assert set(files) == SAME_IN_EVERY_RUN | expected
    assert parse_experiment(files["experiment.toml"].decode()) == SPEC
    inputs = json.loads(files["inputs.json"])
    assert list(inputs["inputs"]) == ["city.parquet"]
    assert inputs["versions"]["semsig_gis"]
    figures = pd.read_csv(results / "figures.csv")
    assert set(figures["case"]) == cases
    for name, evaluation in open_results(results).items():
        assert open_results(results / name)[""].summary() == evaluation.summary()
        case_figures = figures[figures["case"] == name].set_index("figure")
        assert case_figures["value"]["p50"] == pytest.approx(evaluation.cdf([50])[0])
        timing = json.loads((results / name / "timing.json").read_text("utf-8"))
        assert timing["machine"]["processors"] >= 1
        assert evaluation.database["mb_per_km2"] > 0
    report = files["report.md"].decode()
    assert "### phone: light, compass:5, view:180" in report
    assert "| generic, t = 3 |" in report
    assert "s a query" not in report


def test_all_methods_answer_the_same_queries(results: Path) -> None:
    columns = ["seed", "number", "cell", "query_types", "query_bearings", "heading", "geometry"]
    cases = open_results(results)
    for distortion in SPEC.distortions:
        first, *others = [
            cases[case.name].queries[columns]
            for case in SPEC.cases
            if case.distortion == distortion
        ]
        for table in others:
            assert_geodataframe_equal(table, first)
    none, phone = (cases[f"{name}/paper-top1"].queries for name in ("none", "phone"))
    assert none.geometry.equals(phone.geometry)
    assert none["query_bearings"].tolist() != phone["query_bearings"].tolist()


def test_a_case_equals_a_single_evaluation(results: Path) -> None:
    case = open_results(results)["none/paper-top3"]
    single = evaluate(TOWN.database, queries=13, method="edit+edit:5%", distortion="", top=3)
    assert_geodataframe_equal(case.queries, single.queries)


@pytest.mark.parametrize("finished", [1, 21, 40, 52])
def test_interrupted_run_ends_with_the_same_bytes(
    finished: int, folder: Path, results: Path, tmp_path: Path
) -> None:
    interrupt(SPEC, tmp_path / "out", folder, after=finished)
    resume(folder, tmp_path, results)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.usefixtures("_default_batches")
def test_killed_run_ends_with_the_same_bytes(folder: Path, results: Path, tmp_path: Path) -> None:
    spec = folder / "killed.toml"
    spec.write_text(SPEC.to_toml(), encoding="utf-8")
    command = [sys.executable, *f"-m semsig_gis.cli experiment {spec} --out".split()]
    with subprocess.Popen(
        [*command, tmp_path / "out"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        parts = tmp_path / "out.partial" / "_parts"
        while process.poll() is None:
            if any(parts.glob("*.parquet")):
                process.send_signal(signal.SIGKILL)
                break
            time.sleep(0.002)
        process.wait()
    resume(folder, tmp_path, results)


@pytest.mark.usefixtures("_default_batches")
def test_workers_write_the_same_files_as_one_process(
    folder: Path, results: Path, tmp_path: Path, cluster: LocalCluster
) -> None:
    steps: list[int] = []
    options: dict[str, Any] = {"progress": lambda finished, _: steps.append(finished)}
    address = cluster.scheduler_address
    run_experiment(SPEC, tmp_path / "out", folder=folder, scheduler=address, **options)
    assert contents(tmp_path / "out") == contents(results)
    assert sorted(steps) == [26, 52]


@pytest.mark.usefixtures("_default_batches")
def test_several_experiments_write_the_same_files_as_single_ones(
    folder: Path, results: Path, tmp_path: Path, cluster: LocalCluster
) -> None:
    other = replace(SPEC, queries=5, seeds=(3, 4))
    run_experiment(other, tmp_path / "single", folder=folder)
    specs = {tmp_path / "a": SPEC, tmp_path / "b": other}
    first = run_experiments(specs, folder=folder, scheduler=cluster.scheduler_address)
    assert contents(tmp_path / "a") == contents(results)
    assert contents(tmp_path / "b") == contents(tmp_path / "single")
    second = run_experiments(specs, folder=folder)
    for out, evaluations in first.items():
        assert list(second[out]) == list(evaluations)


def test_failed_batches_are_reported_and_the_others_are_kept(
    folder: Path, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(
        database: SignatureDatabase,
        locator: Locator[Answer],
        queries: Sequence[SimulatedQuery],
        **options: Any,  # noqa: ANN401
    ) -> object:
        if len(queries) < BATCH_QUERIES:
            raise OSError("the disk hiccups")
        return score_queries(database, locator, queries, **options)

    monkeypatch.setattr("semsig_gis.evaluation.experiments.batches.score_queries", fail)
    with refused(DatabaseError, "2 of the 4 parts", "disk hiccups", "out.partial", "kept"):
        run_experiment(SPEC, tmp_path / "out", folder=folder)
    monkeypatch.undo()
    parts = tmp_path / "out.partial" / "_parts"
    assert len(list(parts.iterdir())) == 4
    resume(folder, tmp_path, results)


def test_run_killed_before_its_inputs_are_written_or_after_its_rename_is_resumed(
    folder: Path, results: Path, tmp_path: Path
) -> None:
    (tmp_path / "out.partial").mkdir()
    shutil.copy(results / "experiment.toml", tmp_path / "out.partial")
    resume(folder, tmp_path, results)
    (tmp_path / "out" / "_parts").mkdir()
    (tmp_path / "out" / "_parts" / "none.paper.00000.parquet").write_bytes(b"left")
    resume(folder, tmp_path, results)


def test_damaged_batches_are_answered_again(folder: Path, results: Path, tmp_path: Path) -> None:
    interrupt(SPEC, tmp_path / "out", folder, after=52)
    parts = tmp_path / "out.partial" / "_parts"
    first, second, *_ = sorted(parts.iterdir())
    first.write_bytes(first.read_bytes()[:-50])
    pd.read_parquet(second).iloc[1:].to_parquet(second)
    (parts / f"{MACHINE_PREFIX}left").mkdir()
    resume(folder, tmp_path, results)


def test_finished_results_are_opened(
    folder: Path, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr("semsig_gis.evaluation.experiments.batches.score_queries")
    before = contents(results)
    evaluations = run_experiment(SPEC, results, folder=folder)
    assert list(evaluations) == [case.name for case in SPEC.cases]
    assert contents(results) == before


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"queries": 14}, "queries"),
        ({"seeds": (1,)}, "seeds"),
        ({"methods": {"paper": Method()}}, "methods"),
        ({"seen_from": "anywhere"}, "seen_from"),
        ({"city": "later.parquet"}, "city"),
    ],
)
def test_results_of_another_experiment_are_refused(
    change: dict[str, object], word: str, folder: Path, results: Path
) -> None:
    before = contents(results)
    with refused(InputError, "another experiment", word, "another folder"):
        run_experiment(replace(SPEC, **change), results, folder=folder)  # type: ignore[arg-type]
    assert contents(results) == before


def test_an_unfinished_run_of_another_experiment_is_refused(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    interrupt(SPEC, out, folder, after=1)
    other = replace(SPEC, queries=5)
    with refused(InputError, "out.partial", "queries"):
        run_experiment(other, out, folder=folder)
    shutil.rmtree(tmp_path / "out.partial" / "_parts")  # without answers it may be replaced
    run_experiment(other, out, folder=folder)
    assert len(open_results(out)["none/paper-top1"].queries) == 5


def test_other_inputs_and_versions_are_refused(
    folder: Path, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(folder, tmp_path / "towns")
    save_town(tmp_path / "towns", World(TOWN.objects[:-1]))
    with refused(InputError, "inputs", "city.parquet"):
        run_experiment(SPEC, results, folder=tmp_path / "towns")
    monkeypatch.setattr("semsig_gis.evaluation.experiments.run.versions", lambda: {"numpy": "99"})
    with refused(InputError, "versions", "numpy"):
        run_experiment(SPEC, results, folder=folder)


def test_folders_of_other_things_and_missing_files_are_refused(
    folder: Path, results: Path, tmp_path: Path
) -> None:
    for name in ("photos", "new.partial"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "me.jpg").touch()
        with refused(InputError, name, "'me.jpg'", "another folder"):
            run_experiment(SPEC, tmp_path / name.removesuffix(".partial"), folder=folder)
        assert (tmp_path / name / "me.jpg").exists()
    with refused(DatabaseError, "photos", "semsig evaluate"):
        open_results(tmp_path / "photos")
    shutil.copytree(results, tmp_path / "out")
    shutil.rmtree(tmp_path / "out" / "none" / "paper-top1")
    with refused(DatabaseError, "queries.parquet", "does not exist"):
        open_results(tmp_path / "out")


def test_experiments_that_do_not_fit_their_inputs_are_refused(folder: Path, tmp_path: Path) -> None:
    chain = parse_experiment(SPEC.to_toml().replace("view:180", "missing:bnech")).distortions
    without_store = tmp_path / "city.parquet"
    shutil.copyfile(folder / without_store.name, without_store)
    for changes, words in (
        ({"queries": 10**6}, ["1000000 queries", "number of cells"]),
        ({"top": (10**6,)}, ["1000000 candidates"]),
        ({"database": "nowhere.parquet"}, ["nowhere.parquet", "does not exist"]),
        ({"city": "nowhere.parquet"}, ["nowhere.parquet", "does not exist"]),
        ({"distortions": chain}, ["'bnech'", "nearest is 'bench'"]),
        ({"districts": Districts(file="none.gpkg", name="part")}, ["none.gpkg"]),
        ({"districts": Districts(file="parts.gpkg", name="nom")}, ["'nom'", "part"]),
        ({"districts": Districts(file="city.parquet", name="nom")}, ["cannot be read"]),
        ({"database": str(without_store), "seen_from": "anywhere"}, ["city.objects"]),
    ):
        with refused(SemsigError, *words):
            run_experiment(replace(SPEC, **changes), tmp_path / "out", folder=folder)
        assert not (tmp_path / "out").exists()
    # The refused experiments left nothing behind that prevents a valid one.
    run_experiment(replace(SPEC, queries=5), tmp_path / "out", folder=folder)


def test_queries_from_anywhere_in_a_later_city(folder: Path, tmp_path: Path) -> None:
    spec = replace(
        SPEC,
        queries=20,
        seen_from="anywhere",
        city="later.parquet",
        methods={**SPEC.methods, "generic": parse_method("likelihood:light:refined:heading=10")},
        districts=Districts(file="parts.gpkg", name="part"),
    )
    evaluations = run_experiment(spec, tmp_path / "out", folder=folder)
    inputs = json.loads((tmp_path / "out" / "inputs.json").read_text("utf-8"))["inputs"]
    names = ["city.parquet", "later.parquet", "later.objects", "city.objects", "parts.gpkg"]
    assert list(inputs) == names
    refined = evaluations["phone/generic-top1"]
    assert refined.city == "later.parquet"
    assert refined.queries["heading_error"].notna().any()
    outside = refined.queries[refined.queries["cell"] == -1]
    assert len(outside)
    assert (outside[["rank_low", "rank_high"]] == len(TOWN.database)).all(axis=None)
    assert (outside["type_group"] == 0).all()
    districts = pd.read_csv(tmp_path / "out" / "phone" / "generic-top1" / "districts.csv")
    assert districts["n"].sum() == 20
    assert districts["district"].tolist()[0] == "west"
    assert set(districts["district"]) <= {"west", "nook", "elsewhere"}
    assert set(open_results(tmp_path / "out")) == set(evaluations)


MANY_METHODS = parse_experiment("""
database = "city.parquet"
queries = 13
seeds = [0, 5]
[methods]
fusion = "edit+edit"
stages = "edit+edit:5%"
types = "types:jaccard"
[distortions]
none = []
medium = "medium"
""")


def test_batches_cover_all_queries(folder: Path) -> None:
    experiment = OpenExperiment(MANY_METHODS, folder)
    expected = [QueryBatch(name, number) for name in ("none", "medium") for number in range(3)]
    assert list(experiment.batches) == expected
    assert [experiment.batch_size(batch) for batch in experiment.batches] == [10, 10, 6] * 2


def test_shared_distances_do_not_change_the_answers(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = OpenExperiment(MANY_METHODS, folder)

    def answers(place: Path) -> dict[str, pd.DataFrame]:
        place.mkdir()
        experiment.answer(place, QueryBatch("medium", 1))
        files = sorted(place.iterdir())
        return {file.name: pd.read_parquet(file).drop(columns="seconds") for file in files}

    together = answers(tmp_path / "together")
    methods = sorted(MANY_METHODS.methods)
    assert list(together) == [f"medium.{name}.00001.parquet" for name in methods]
    seeds = together["medium.fusion.00001.parquet"]["seed"]
    assert seeds.value_counts().to_dict() == {0: 3, 5: 7}
    monkeypatch.setattr(batches, "MEMO_BYTES", 1)
    one_by_one = answers(tmp_path / "one_by_one")
    for name, table in together.items():
        assert_frame_equal(one_by_one[name], table)
