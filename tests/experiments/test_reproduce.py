from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING, Any

import pytest
from reproductions import QUERIES, TOWN, contents, save_town
from sentences import refused

from semsig_gis.core.errors import DatabaseError, InputError, SemsigError
from semsig_gis.database.file import open_database, save_database
from semsig_gis.experiments.paper.reproduce import reproduce, time_queries
from semsig_gis.matching.method import Method
from semsig_gis.matching.scores import score_cells
from semsig_gis.reports import paris

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from semsig_gis.experiments.paper.reproduce import Reproduction


def test_everything_is_run(reproduction: Reproduction) -> None:
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
    assert sum(one["objects"] for one in occurrences) <= len(TOWN.objects)


def test_a_run_that_was_interrupted_ends_with_the_same_bytes(
    reproduced: Path, tmp_path: Path
) -> None:
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
    half = {path.name for path in (tmp_path / "out" / "experiments").iterdir()}
    assert all(name.endswith(".partial") for name in half)
    reproduce(tmp_path / "out", **options)
    # The same files but for reports, which other tests write; digests of the same town differ.
    ours, whole = contents(tmp_path / "out"), contents(reproduced)
    assert set(ours) == {name for name in whole if name.startswith(("exp", "var", "settings"))}
    figures = [name for name in ours if name.endswith(("figures.csv", "queries.parquet"))]
    assert len(figures) > len(ours) / 4
    assert [ours[name] for name in figures] == [whole[name] for name in figures]


def test_a_finished_run_is_opened(reproduced: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    before = contents(reproduced)
    for name in ("build_database", "time_queries", "save_database"):
        monkeypatch.setattr(f"semsig_gis.experiments.paper.reproduce.{name}", never)
    monkeypatch.setattr("semsig_gis.experiments.run.score_queries", never)
    database = reproduced.parent / "city.parquet"
    found = reproduce(reproduced, database=database, queries=QUERIES)
    assert found.settings["queries"] == QUERIES
    assert contents(reproduced) == before


def test_other_settings_are_refused(reproduced: Path, tmp_path: Path) -> None:
    database = reproduced.parent / "city.parquet"
    options: dict[str, Any] = {"database": database, "queries": QUERIES}
    before = contents(reproduced)
    moved = tmp_path / "city.parquet"
    save_database(TOWN.database.select(slice(1, None)), moved)
    for change, word in (
        ({"queries": 11}, "queries"),
        ({"seed": 5}, "seed"),
        ({"size": "small"}, "size"),
        ({"database": moved}, "database"),
    ):
        with refused(InputError, "other settings", f"differ in {word}"):
            reproduce(reproduced, **{**options, **change})
    assert contents(reproduced) == before


def test_without_street_objects_one_part_is_left_out(tmp_path: Path) -> None:
    save_database(TOWN.database, tmp_path / "city.parquet")
    found = reproduce(tmp_path / "out", database=tmp_path / "city.parquet", queries=5, size="small")
    assert found.variants == {}
    assert not any(name.startswith("range") for name in found.experiments)
    (sentence,) = found.missing
    assert "visibility ranges" in sentence
    assert {one["objects"] for one in found.summary["occurrences"]} == {None}


def test_a_city_is_made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from semsig_gis.sources.synthetic.city import CitySpec

    cities = {"small": CitySpec(size=300.0), "full": CitySpec(size=400.0)}
    monkeypatch.setattr("semsig_gis.experiments.paper.reproduce.CITIES", cities)
    monkeypatch.setattr("semsig_gis.experiments.paper.reproduce.SMALL_QUERIES", 7)
    notes: list[str] = []
    found = reproduce(tmp_path / "out", size="small", note=notes.append)
    assert found.settings == {
        "size": "small",
        "database": "a made-up city",
        "queries": 7,
        "seed": 0,
    }
    assert any("made up" in note for note in notes)
    assert len(open_database(tmp_path / "out" / "city" / "city.parquet")) == len(found.database)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": "huge"}, ["'huge'", "full or small"]),
        ({"queries": 10**6}, ["1000000 queries", "number of cells"]),
        ({"queries": 0}, ["0 queries", "number of cells"]),
        ({"database": "nowhere.parquet"}, ["nowhere.parquet", "signature database"]),
        ({"workers": -1}, ["-1 workers"]),
        ({"seed": -1}, ["seed of -1"]),
    ],
)
def test_what_is_refused(tmp_path: Path, options: dict[str, Any], words: list[str]) -> None:
    save_town(tmp_path)
    with refused(SemsigError, *words):
        reproduce(
            tmp_path / "out", **{"database": tmp_path / "city.parquet", "queries": 5, **options}
        )
    assert not (tmp_path / "out").exists()


def test_a_run_that_came_to_nothing_is_not_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from semsig_gis.sources.synthetic.city import CitySpec

    cities = {"small": CitySpec(size=300.0), "full": CitySpec(size=400.0)}
    monkeypatch.setattr("semsig_gis.experiments.paper.reproduce.CITIES", cities)
    with refused(InputError, "1000000 queries"):
        reproduce(tmp_path / "out", queries=10**6)
    found = reproduce(tmp_path / "out", size="small", queries=3)
    assert found.settings["queries"] == 3
    large = found.database.columns.max() - found.database.columns.min()
    assert large * found.database.grid.step < 400.0


def test_folders_of_other_things_are_refused(reproduced: Path, tmp_path: Path) -> None:
    save_town(tmp_path)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "me.jpg").touch()
    file = tmp_path / "note.txt"
    file.touch()
    for out in (tmp_path / "photos", file):
        with refused((InputError, DatabaseError), str(out), "another folder"):
            reproduce(out, database=tmp_path / "city.parquet", queries=5)
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["me.jpg"]
    shutil.copyfile(reproduced / "settings.json", tmp_path / "photos" / "settings.json")
    (tmp_path / "photos" / "settings.json").write_text(json.dumps([1]), encoding="utf-8")
    with refused(InputError, "photos", "another folder"):
        reproduce(tmp_path / "photos", database=tmp_path / "city.parquet", queries=5)


def test_every_method_is_asked_that_often(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths: list[int] = []

    def counted(database: object, queries: list[object], method: object) -> object:
        lengths.append(len(queries[0]))  # type: ignore[arg-type]
        return score_cells(database, queries, method)  # type: ignore[arg-type]

    monkeypatch.setattr("semsig_gis.experiments.paper.reproduce.score_cells", counted)
    methods = {"types": Method.parse("types:edit"), "both": Method()}
    told: list[tuple[int, int]] = []
    times = time_queries(
        TOWN.database, methods, length=5, repetitions=4, progress=lambda *done: told.append(done)
    )
    assert list(times) == ["types", "both"]
    assert min(times.values()) > 0
    assert lengths == [5] * 12  # twice before the four that count
    assert told == [(1, 2), (2, 2)]


def test_the_nearest_length_is_taken() -> None:
    longest = int(TOWN.database.lengths.max())
    assert time_queries(TOWN.database, {"a": Method()}, length=longest + 50, repetitions=1)["a"] > 0


def test_no_repetitions_are_refused() -> None:
    with refused(InputError, "0 repetitions", "from 1"):
        time_queries(TOWN.database, {}, repetitions=0)
