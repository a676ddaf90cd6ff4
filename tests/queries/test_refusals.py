"""What the package refuses, each in one sentence that says what was given and what is accepted."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pyproj import CRS
from sentences import assert_sentence
from sights import CITY
from worlds import random_town

from semsig_gis.core.errors import CrsError, InputError, SemsigError, UnknownNameError
from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.noise.model import NOISES, NoiseSpec
from semsig_gis.queries.chain import parse_chain, ready_chain
from semsig_gis.queries.distortions import (
    BlockedSectors,
    CompassBias,
    Detector,
    Distortion,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
    distort,
    named_distortion,
)
from semsig_gis.queries.draw import QuerySpec, draw_queries
from semsig_gis.queries.file import parse_queries, parse_route, read_queries, read_route

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

MINE = NoiseSpec(name="mine")
MISSPELT = NoiseSpec(detection_by_class={"bnech": 0.5})
DATABASE = random_town().database


def refuse(call: Callable[[], object], kind: type[SemsigError], *words: str) -> None:
    with pytest.raises(SemsigError) as caught:
        call()
    assert type(caught.value) is kind
    assert_sentence(caught.value, *words)


@pytest.mark.parametrize(
    ("kind", "name", "values", "words"),
    [
        (Distortion, "occurrences", [-1], ["occurrences", "0 or more"]),
        (Distortion, "bearing_sigma", [-0.1, nan], ["bearing sigma", "0 or more"]),
        (Distortion, "bearing_clip", [-0.1, inf], ["bearing clip", "0 or more"]),
        (CompassBias, "sigma", [-1.0, nan, inf], ["compass", "0 or more"]),
        (FieldOfView, "degrees", [0.0, -5.0, 360.5, nan], ["above 0", "at most 360"]),
        (HiddenBehind, "width", [-1.0, nan, inf], ["width of the objects", "0 or more"]),
        (Obstacles, "count", [-1.0, nan, inf], ["number of obstacles", "0 or more"]),
        (Obstacles, "width", [-1.0, nan, inf], ["width of the obstacles", "0 or more"]),
        (BlockedSectors, "count", [-1], ["sectors", "from 0"]),
        (BlockedSectors, "degrees", [-1.0, nan, inf], ["degrees", "from 0 to 360"]),
        (Detector, "half", [0.0, -3.0, nan], ["above 0"]),
        (QuerySpec, "number", [0], ["queries", "from 1"]),
        (QuerySpec, "seeds", [[], [1, 1]], ["at least one", "none twice"]),
        (QuerySpec, "seeds", [[-1]], ["-1", "0 or more"]),
    ],
)
def test_settings_out_of_range(kind: type, name: str, values: list[Any], words: list[str]) -> None:
    needed = {"noise": MINE} if kind is Detector else {}
    for value in values:
        options = {**needed, name: value}
        call = partial(kind, **options)
        refuse(call, InputError, str(value).strip("[]"), *words)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda name: Distortion(false_class=name), ["frequencies", "nearest is 'frequency'"]),
        (lambda name: Distortion(false_class=name), ["rarity", "uniform or frequency"]),
        (named_distortion, ["heavy", "none, light, medium or strong"]),
        (lambda name: MissingClasses(classes=(name,)).ready(CITY), ["bnech", "nearest is 'bench'"]),
        (lambda name: QuerySpec(seen_from=name), ["anywere", "nearest is 'anywhere'", "cells or"]),
    ],
)
def test_unknown_names(call: Callable[[str], object], words: list[str]) -> None:
    refuse(lambda: call(words[0]), UnknownNameError, *words)


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        (UnknownNameError, "meduim", ["'meduim'", "nearest is 'medium'"]),
        (UnknownNameError, "medium,,view:90", ["''", "no distortion"]),
        (UnknownNameError, "medium:7", ["'7'", "means nothing", "of medium are occurrences"]),
        (UnknownNameError, "view:90:degree=3", ["'degree'", "nearest is 'degrees'"]),
        (UnknownNameError, "detector:mime", ["'mime'", "nearest is 'mine'"]),
        (UnknownNameError, "missing:bnech", ["'bnech'", "nearest is 'bench'"]),
        (InputError, "detector:misspelt", ["'bnech'", "nearest is 'bench'"]),
        (InputError, "compass:5:sigma=6", ["compass:5:sigma=6", "'sigma'", "given twice"]),
        (InputError, "view:sixty", ["'sixty'", "a number"]),
        (InputError, "errors:2.5", ["'2.5'", "a whole number"]),
        (InputError, "medium:resort=no", ["'no'", "true or false"]),
        (InputError, "view:0", ["0.0 degrees", "above 0"]),
    ],
)
def test_texts_of_distortions(kind: type[SemsigError], text: str, words: list[str]) -> None:
    noises = {**NOISES, "mine": MINE, "misspelt": MISSPELT}
    refuse(lambda: ready_chain(parse_chain(text, noises=noises), CITY), kind, *words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"classes": []}, ["distinct codes", "at least one"]),
        ({"classes": [3, 3]}, ["distinct codes"]),
        ({"classes": [1, 3]}, ["need weights", "one a class"]),
        ({"classes": [1, 3], "weights": [1]}, ["1 weights for 2 classes"]),
        ({"classes": [1, 3], "weights": [1, -1]}, ["0 or more"]),
        ({"classes": [1, 3], "weights": [0, 0]}, ["all zero", "above zero"]),
        ({"classes": [1, 3], "weights": [1, 1], "bearings": None}, ["one with both"]),
    ],
)
def test_what_cannot_be_distorted(options: dict[str, Any], words: list[str]) -> None:
    one = Signature(np.array([1], np.uint8), options.pop("bearings", np.zeros(1)))
    how = Distortion(false_class="frequency")
    rng = np.random.default_rng(0)
    refuse(lambda: distort(one, how, **options, rng=rng), InputError, *words)


@pytest.mark.parametrize(
    ("parsers", "text", "words"),
    [
        ([parse_queries, parse_route], "", ["no rows"]),
        ([parse_queries, parse_route], "{", ["line 1", "not JSON"]),
        ([parse_queries, parse_route], '{"types": "Z"}', ["line 1", "'Z'"]),
        ([parse_queries, parse_route], '{"types": "DB", "bearings": [1]}', ["2 types and 1 bear"]),
        ([parse_queries, parse_route], '{"bearings": ["north"]}', ["line 1", "not all numbers"]),
        ([parse_queries], "[1]", ["line 1", "no query"]),
        ([parse_queries], '{"types": "D"}\n{"other": 1}', ["line 2", "types, bearings or both"]),
        ([parse_route], "[1]", ["line 1", "no view"]),
        ([parse_route], '{"types": "D", "dx": 1, "dy": 2}', ["line 1", "tells a way", "the first"]),
        ([parse_route], '{"types": "D"}\n{"types": "B"}', ["line 2", "does not tell the way"]),
        ([parse_route], '{"dx": 5}', ["line 1", "dx and dy, or distance and bearing"]),
    ],
)
def test_lines_of_files(parsers: list[Callable[..., object]], text: str, words: list[str]) -> None:
    for parse in parsers:
        call = partial(parse, text, "these lines", taxonomy=CITY.taxonomy)
        refuse(call, InputError, "these lines", *words)


@pytest.mark.parametrize("read", [read_queries, read_route])
def test_files_that_cannot_be_read(tmp_path: Path, read: Callable[..., object]) -> None:
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("a.csv", "b.csv"):
        call = partial(read, tmp_path / name, taxonomy=CITY.taxonomy)
        refuse(call, InputError, name, "cannot be read")


@pytest.mark.parametrize(
    ("kind", "spec", "crs", "words"),
    [
        (InputError, {"number": 10**6}, 2154, ["1000000 queries", f"1 to {len(DATABASE)}"]),
        (InputError, {"number": 1, "seen_from": "anywhere"}, 2154, ["street objects"]),
        (CrsError, {"number": 1}, 32631, ["EPSG:32631", "EPSG:2154"]),
    ],
)
def test_cities(kind: type[SemsigError], spec: dict[str, Any], crs: int, words: list[str]) -> None:
    city = replace(DATABASE, crs=CRS(crs))
    refuse(lambda: draw_queries(DATABASE, QuerySpec(**spec), city=city), kind, *words)
