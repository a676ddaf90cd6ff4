from __future__ import annotations

import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mutations import with_mistakes
from noisy_cells import noise_specs
from sentences import assert_sentence, refused

from semsig_gis.core import SemsigError
from semsig_gis.evaluation import (
    Districts,
    ExperimentSpec,
    SimulatedDetector,
    open_experiment_spec,
    parse_chain,
    parse_experiment,
)
from semsig_gis.localization import LikelihoodMethod, Method, NoiseSpec, parse_method, save_noise
from semsig_gis.storage import toml_text

if TYPE_CHECKING:
    from pathlib import Path

SMALL = """
database = "city.parquet"
[methods]
paper = "edit+edit:5%"
[distortions]
medium = "medium"
"""
names = st.text("abcXYZ019_-", min_size=1, max_size=6)
methods = st.sampled_from(
    ["edit+edit:5%", "types:jaccard", "likelihood:light:refined", "likelihood:generic:heading=5"]
).map(parse_method)
chains = st.sampled_from(["", "medium", "none, compass:5", "detector:strong:half=20, view:60"]).map(
    parse_chain
)


@st.composite
def experiments(draw: st.DrawFn) -> ExperimentSpec:
    spec = ExperimentSpec(
        database=draw(st.sampled_from(["city.parquet", 'a folder/"city".parquet'])),
        methods=draw(st.dictionaries(names, methods, min_size=1, max_size=3)),
        distortions=draw(st.dictionaries(names, chains, min_size=1, max_size=3)),
        queries=draw(st.integers(1, 9999)),
        seeds=tuple(draw(st.lists(st.integers(0, 99), min_size=1, max_size=3, unique=True))),
        seen_from=draw(st.sampled_from(["cells", "anywhere"])),
        city=draw(st.sampled_from([None, "later.parquet"])),
        top=tuple(draw(st.lists(st.integers(1, 99), min_size=1, max_size=3, unique=True))),
        districts=draw(st.sampled_from([None, Districts(file="a.geojson", name="nom")])),
    )
    own = replace(draw(noise_specs()), name="own")
    if draw(st.booleans()):
        spec = replace(spec, methods={**spec.methods, "own": LikelihoodMethod(noise=own)})
    if draw(st.booleans()):
        chain = (SimulatedDetector(noise=own, half=9.5),)
        spec = replace(spec, distortions={**spec.distortions, "own": chain})
    return spec


@given(experiments())
def test_specification_round_trips_through_toml(spec: ExperimentSpec) -> None:
    assert parse_experiment(spec.to_toml()) == spec
    # Built-in noise models are written only by name.
    assert spec.to_dict().get("noises", {}).keys() <= {"own"}


def test_defaults_and_cases() -> None:
    spec = parse_experiment(SMALL)
    assert (spec.queries, spec.seeds, spec.seen_from, spec.top) == (500, (0,), "cells", (1,))
    more = replace(
        spec,
        methods={"a": Method(), "b": Method(keep=5)},
        distortions={"x": (), "y": parse_chain("light")},
        top=(1, 100),
    )
    assert [case.name for case in more.cases] == [
        *("x/a-top1", "x/a-top100", "x/b-top1", "x/b-top100"),
        *("y/a-top1", "y/a-top100", "y/b-top1", "y/b-top100"),
    ]
    queries = replace(more, queries=7, seeds=(3,)).asked("y")
    assert (queries.number, queries.seeds, queries.distortions) == (7, (3,), parse_chain("light"))


def test_noise_models_are_read_from_tables_and_files(tmp_path: Path) -> None:
    save_noise(NoiseSpec(detection=0.7, name="whatever"), tmp_path / "learnt.toml")
    (tmp_path / "spec.toml").write_text(
        SMALL.replace("[distortions]", 'generic = "likelihood:learnt"\n[distortions]')
        + 'mine = ["detector:mine:half=15", "compass:5"]\n'
        + '[noises]\nlearnt = "learnt.toml"\nmine = { clutter = 3.0, bearing_sigma = 2 }\n',
        encoding="utf-8",
    )
    spec = open_experiment_spec(tmp_path / "spec.toml")
    assert spec.noises == {
        "learnt": NoiseSpec(detection=0.7, name="learnt"),
        "mine": NoiseSpec(clutter=3.0, bearing_sigma=2, name="mine"),
    }
    # The TOML contains the noise model, so that the file is not needed again.
    assert parse_experiment(spec.to_toml()) == spec


def changed(old: str, new: str) -> str:
    return SMALL.replace(old, new)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (changed("database", "databse"), ["'databse'", "nearest is 'database'"]),
        (changed("[distortions]", "[other]"), ["'other'"]),
        (changed("[methods]", "[methods"), ["not valid TOML"]),
        (changed('"city.parquet"', "3"), ["database = 3", "a string"]),
        ("queries = 0" + SMALL, ["0 queries"]),
        ('queries = "many"' + SMALL, ["queries = 'many'", "a whole number"]),
        ("seeds = 4" + SMALL, ["seeds = 4", "a list"]),
        ("seeds = [1.5]" + SMALL, ["seeds = [1.5]", "whole numbers"]),
        ("seeds = []" + SMALL, ["seeds are []"]),
        ("top = [0]" + SMALL, ["top is [0]"]),
        ("top = [true]" + SMALL, ["top = [True]"]),
        ('seen_from = "cell"' + SMALL, ["nearest is 'cells'"]),
        (changed("edit+edit:5%", "edit+edti"), ["'edti'"]),
        (changed('"edit+edit:5%"', "5"), ["paper = 5", "methods"]),
        (changed("paper", '"pa/per"'), ["'pa/per'", "methods", "letters"]),
        (changed('paper = "edit+edit:5%"', ""), ["no methods"]),
        (changed('medium = "medium"', ""), ["no distortions"]),
        (changed('"medium"', '"meduim"'), ["'meduim'", "nearest is 'medium'"]),
        (changed('"medium"', "7"), ["medium = 7", "distortions", "a list of texts"]),
        (changed('"medium"', '["medium", 7]'), ["distortions"]),
        (SMALL + "[noises]\nmine = 3", ["mine = 3", "noises"]),
        (SMALL + "[noises]\nmine = { detection = 3 }", ["detection", "from 0 to 1"]),
        (SMALL + '[noises]\nmine = "nowhere.toml"', ["nowhere.toml", "cannot be read"]),
        (SMALL + '[districts]\nfile = "a.gpkg"', ["districts", "'name'"]),
    ],
)
def test_invalid_experiments_are_refused(text: str, words: list[str]) -> None:
    with refused(SemsigError, *words):
        parse_experiment(text)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "spec.toml").write_bytes(b"\xff\xfe")
    for name in ("spec.toml", "nowhere.toml"):
        with refused(SemsigError, name, "cannot be read"):
            open_experiment_spec(tmp_path / name)


@pytest.mark.parametrize("name", ["generic", "mine"])
def test_two_noise_models_with_the_same_name_are_refused(name: str) -> None:
    first, second = (NoiseSpec(clutter=value, name=name) for value in (1.0, 2.0))
    methods = {"a": LikelihoodMethod(noise=first)}
    distortions = {"b": (SimulatedDetector(noise=second),)}
    with refused(SemsigError, name, "a name of its own"):
        ExperimentSpec(database="city.parquet", methods=methods, distortions=distortions)


@settings(max_examples=200)
@given(
    with_mistakes(
        {**tomllib.loads(SMALL), "top": [1], "noises": {"mine": {}}}, "seeds", "city", "/"
    )
)
def test_changed_experiments_are_refused_in_a_sentence_or_read(values: dict[str, Any]) -> None:
    try:
        text = toml_text(values)
    except (TypeError, ValueError):  # a date, or a number that JSON does not have
        return
    try:
        parse_experiment(text)
    except SemsigError as error:
        assert_sentence(error)
