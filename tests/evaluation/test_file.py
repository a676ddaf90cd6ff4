from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from geopandas.testing import assert_geodataframe_equal
from hypothesis import given
from hypothesis import strategies as st
from late_failures import failures
from noisy_cells import noise_specs, random_database
from pandas.testing import assert_frame_equal
from sentences import assert_sentence, refused

from semsig_gis.core import DatabaseError, InputError
from semsig_gis.evaluation import (
    NAMED_DISTORTIONS,
    QuerySpec,
    SimulatedDetector,
    evaluate,
    machine,
    open_evaluation,
    parse_chain,
    save_evaluation,
    settings_from_dict,
    settings_to_dict,
    used_noises,
)
from semsig_gis.localization import EditWeights, LikelihoodMethod, Method, NoiseSpec
from semsig_gis.storage import digest, read_geoparquet, write_geoparquet

if TYPE_CHECKING:
    from pathlib import Path


MINE = NoiseSpec(name="mine", detection_by_class={"bench": 0.5})
EVALUATION = evaluate(
    random_database(5, cells=150), queries=150, method=Method(keep=20), distortion="light"
)


@given(
    noise=noise_specs(),
    kind=st.sampled_from(["distance", "likelihood"]),
    others=st.lists(st.sampled_from(list(NAMED_DISTORTIONS.values())), max_size=3),
    number=st.integers(1, 99),
)
def test_settings_round_trip_through_json(
    noise: NoiseSpec, kind: str, others: list[SimulatedDetector], number: int
) -> None:
    query_spec = QuerySpec(
        number=number, seeds=(3, 0), distortions=(*others, SimulatedDetector(noise=noise))
    )
    by_chance = LikelihoodMethod(noise=noise, refined=True)
    method = by_chance if kind == "likelihood" else Method(keep=5, weights=EditWeights(insert=2))
    values = json.loads(json.dumps(settings_to_dict(method, query_spec), allow_nan=False))
    assert settings_from_dict(values) == (method, query_spec)


@pytest.mark.parametrize("name", ["a:b", "a/b", "a,b", "a=b"])
def test_noise_names_with_reserved_characters_are_refused(name: str) -> None:
    with refused(InputError, repr(name), "without"):
        used_noises([LikelihoodMethod(noise=NoiseSpec(name=name))], [])


def test_saved_evaluation_is_opened(tmp_path: Path) -> None:
    chain = parse_chain("light:resort=false, detector:mine:half=9", noises={"mine": MINE})
    query_spec = QuerySpec(number=9, seeds=(4, 2), seen_from="anywhere", distortions=chain)
    saved = replace(
        EVALUATION, method=LikelihoodMethod(noise=MINE), asked=query_spec, city="other.parquet"
    )
    save_evaluation(saved, tmp_path / "made" / "here")
    opened = open_evaluation(tmp_path / "made" / "here")
    assert_geodataframe_equal(opened.queries, saved.queries)
    assert opened.queries["error_m"].isin([math.inf]).any()
    assert (opened.method, opened.asked) == (saved.method, saved.asked)
    assert (opened.top, opened.city) == (saved.top, saved.city)
    assert opened.summary() == saved.summary()
    assert_frame_equal(opened.by_length(), saved.by_length())


def test_json_files_are_strict_json(tmp_path: Path) -> None:
    save_evaluation(EVALUATION, tmp_path)
    names = ["evaluation.json", "queries.parquet", "timing.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    summary, timing = (
        json.loads((tmp_path / name).read_text(encoding="utf-8"), parse_constant=pytest.fail)
        for name in ("evaluation.json", "timing.json")
    )
    run = digest(tmp_path / "queries.parquet")
    assert (summary.pop("run"), timing.pop("run")) == (run, run)
    assert summary | {"timing": timing} == EVALUATION.summary()
    assert timing["seconds_per_query"] == EVALUATION.seconds_per_query
    assert timing["machine"] == machine()
    assert timing["machine"]["processors"] >= 1
    assert summary["settings"]["method"] == "edit+edit:20%"
    assert summary["settings"]["distortions"] == ["light"]
    assert summary["database"]["cells"] == 150
    assert summary["results"]["recall_at_percent"]["10"] == EVALUATION.recall(10)
    assert summary["versions"].keys() == {"semsig_gis", "python", "numpy", "pandas", "rapidfuzz"}


def test_files_of_different_runs_are_refused(tmp_path: Path) -> None:
    """As an interruption between two renames leaves them."""
    save_evaluation(EVALUATION, tmp_path)
    save_evaluation(replace(EVALUATION, top=2), tmp_path / "other")
    for name in ("evaluation.json", "timing.json"):
        own = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes((tmp_path / "other" / name).read_bytes())
        with refused(DatabaseError, name, "of another run", "evaluate again"):
            open_evaluation(tmp_path)
        (tmp_path / name).write_bytes(own)
    for name in ("evaluation.json", "timing.json"):
        (tmp_path / name).unlink()
    assert len(open_evaluation(tmp_path).queries) == len(EVALUATION.queries)


def test_files_of_two_runs_are_never_read_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever system call fails: the old evaluation, the new one, or none of the two is read."""
    new, folder = replace(EVALUATION, top=2), tmp_path / "results"
    for run in failures(monkeypatch, exchange=True, every=2):
        save_evaluation(EVALUATION, folder)
        error = run(lambda: save_evaluation(new, folder))
        try:
            assert open_evaluation(folder).top == (1 if error else 2)
        except DatabaseError as mixed:
            assert_sentence(mixed, "of another run")


def test_missing_and_damaged_files_are_refused(tmp_path: Path) -> None:
    with refused(DatabaseError, "does not exist"):
        open_evaluation(tmp_path / "nowhere")
    save_evaluation(EVALUATION, tmp_path)
    file = tmp_path / "queries.parquet"
    content = file.read_bytes()
    table, specs, crs = read_geoparquet(file, kind="localization evaluation")
    geo = json.loads(table.schema.metadata[b"geo"])
    assert crs == EVALUATION.queries.crs
    write_geoparquet(table.drop_columns("p50"), file, geo=geo, specs=specs)
    with pytest.raises(DatabaseError, match="lacks the column 'p50'"):
        open_evaluation(tmp_path)
    wrongs: list[dict[str, Any]] = [
        {"method": "hamming+edit"},
        {"method": 7},
        {"asked": {**specs["asked"], "distortions": ["errors:1:unknown=2"]}},
        {"asked": {"number": 3}},
        {"noises": {"custom": {"detection": 7}}},
    ]
    for wrong in wrongs:
        write_geoparquet(table, file, geo=geo, specs=specs | wrong)
        with pytest.raises(DatabaseError, match=r"is damaged .* evaluate again"):
            open_evaluation(tmp_path)
    file.write_bytes(content[: len(content) // 2])
    with pytest.raises(DatabaseError, match="damaged"):
        open_evaluation(tmp_path)
