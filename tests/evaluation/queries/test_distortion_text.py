"""Chains of distortions, and invalid distortions and queries."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import CRS
from sentences import refused
from sights import CITY, CLASSES, many, paper_errors, rows, seeds, sights
from worlds import random_town

from semsig_gis.core import CrsError, InputError, Signature, UnknownNameError
from semsig_gis.evaluation import (
    NAMED_DISTORTIONS,
    BlockedSectors,
    ClassScores,
    CompassBias,
    Distortion,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
    QuerySpec,
    RoughRanges,
    SimulatedDetector,
    chain_text,
    distort,
    draw_queries,
    named_distortion,
    parse_chain,
    prepare_chain,
)
from semsig_gis.localization import NOISES, NoiseSpec

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.core import SemsigError
    from semsig_gis.evaluation import QueryDistortion, Sight

MINE = NoiseSpec(detection=0.7, name="mine")
KNOWN = {**NOISES, "mine": MINE}
classes = st.lists(
    st.sampled_from(["alignment_tree", "street_light", "traffic_light", "bench"]), unique=True
).map(tuple)
any_distortion: st.SearchStrategy[QueryDistortion] = st.one_of(
    st.sampled_from(list(NAMED_DISTORTIONS.values())),
    paper_errors,
    st.builds(CompassBias, sigma=st.floats(0, 180)),
    st.builds(MissingClasses, classes=classes, others=st.booleans()),
    st.builds(FieldOfView, degrees=st.floats(0.1, 360), told=st.booleans()),
    st.builds(RoughRanges, percent=st.floats(0.1, 300)),
    st.builds(ClassScores, right=st.floats(0.51, 0.999)),
    st.builds(HiddenBehind, width=st.floats(0, 5)),
    st.builds(Obstacles, count=st.floats(0, 9), width=st.floats(0, 9)),
    st.builds(BlockedSectors, count=st.integers(0, 5), degrees=st.floats(0, 360)),
    st.builds(
        SimulatedDetector, noise=st.sampled_from(list(KNOWN.values())), half=st.floats(1, 99)
    ),
)
chains = st.lists(any_distortion, max_size=4).map(tuple)


@given(chain=chains)
def test_chain_text_round_trip(chain: tuple[QueryDistortion, ...]) -> None:
    assert parse_chain(chain_text(chain), noises=KNOWN) == chain
    assert parse_chain((chain_text([item]) for item in chain), noises=KNOWN) == chain


@pytest.mark.parametrize(
    "text",
    [
        "medium",
        "none",
        "strong:resort=false:false_class=frequency",
        "errors:4",
        "errors:4:bearing_sigma=2.5",
        "compass:10",
        "missing:bench/bus_stop",
        "known:alignment_tree",
        "view:60, behind:0.5, obstacles:2, blocked:1:degrees=45",
        "view:60:told=false",
        "ranges:25, scores:0.8",
        "detector:mine:half=20",
        "",
    ],
)
def test_shortest_texts_are_written(text: str) -> None:
    assert chain_text(parse_chain(text, noises=KNOWN)) == text


@given(sight=sights, chain=chains, seed=seeds, number=st.integers(0, 99))
def test_distortions_in_any_order_give_valid_reproducible_queries(
    sight: Sight, chain: tuple[QueryDistortion, ...], seed: int, number: int
) -> None:
    before = rows(sight)
    for order in itertools.islice(itertools.permutations(chain), 6):
        result, repeated = (prepare_chain(order, CITY)(sight, seed, number) for _ in range(2))
        assert set(result.codes.tolist()) <= set(CLASSES)
        assert ((result.bearings >= 0) & (result.bearings < 360)).all()
        assert (result.distances >= 0).all()
        assert len(result.signature) == len(result)
        assert result.photo.sees(result.bearings).all()
        assert (rows(repeated), repeated.heading) == (rows(result), result.heading)
    assert rows(sight) == before


@given(sight=sights, chain=chains, seed=seeds)
def test_random_numbers_of_a_kind_do_not_depend_on_other_distortions(
    sight: Sight, chain: tuple[QueryDistortion, ...], seed: int
) -> None:
    others = tuple(item for item in chain if not isinstance(item, CompassBias))
    single = prepare_chain([CompassBias(sigma=20.0)], CITY)(sight, seed, 3)
    for place in (0, len(others)):
        order = (*others[:place], CompassBias(sigma=20.0), *others[place:])
        assert prepare_chain(order, CITY)(sight, seed, 3).heading == single.heading


def test_random_numbers_differ_by_number_seed_and_repeat() -> None:
    spoil = prepare_chain([CompassBias(), CompassBias()], CITY)
    headings = {spoil(many(1), seed, number).heading for seed in (0, 1) for number in (0, 1, 2)}
    assert len(headings) == 6
    once = prepare_chain([CompassBias()], CITY)(many(1), 0, 0).heading
    twice = spoil(many(1), 0, 0).heading
    assert twice != pytest.approx(2.0 * once % 360.0)


def test_distortions_of_a_chain_are_combined() -> None:
    # Half of the turn is visible, and half of the visible objects are detected.
    half = NoiseSpec(detection=0.5, misnamed=0.0, clutter=0.0, name="half")
    spoil = prepare_chain(parse_chain("view:180, detector:half", noises={"half": half}), CITY)
    counts = np.array([len(spoil(many(1), 0, number)) for number in range(4000)])
    assert counts.mean() == pytest.approx(0.25, abs=0.04)


def test_random_streams_are_fixed() -> None:
    # Other streams would change all stored results with a seed.
    streams = {name: item.stream for name, item in NAMED_DISTORTIONS.items() if name != "known"}
    for level in ("none", "light", "medium", "strong"):
        assert streams.pop(level) == streams["errors"]
    assert streams == {
        "errors": 795_306_091,
        "compass": 3_628_719_812,
        "missing": 2_848_656_676,
        "view": 20_362_731,
        "behind": 3_881_164_136,
        "obstacles": 626_356_719,
        "blocked": 4_207_042_345,
        "detector": 4_129_241_295,
        "ranges": 2_716_057_031,
        "scores": 1_530_938_417,
    }


# --- Refusals ---------------------------------------------------------------------------------

MISSPELT = NoiseSpec(detection_by_class={"bnech": 0.5})
DATABASE = random_town().database
ORIGIN = np.zeros(1)


@pytest.mark.parametrize(
    ("kind", "name", "values", "words"),
    [
        (Distortion, "occurrences", [-1], ["occurrences", "from 0"]),
        (Distortion, "bearing_sigma", [-0.1, nan], ["bearing sigma", "from 0"]),
        (Distortion, "bearing_clip", [-0.1, inf], ["bearing clip", "from 0"]),
        (CompassBias, "sigma", [-1.0, nan, inf], ["compass", "from 0"]),
        (FieldOfView, "degrees", [0.0, -5.0, 360.5, nan], ["above 0", "at most 360"]),
        (HiddenBehind, "width", [-1.0, nan, inf], ["width of the objects", "from 0"]),
        (Obstacles, "count", [-1.0, nan, inf], ["number of obstacles", "from 0"]),
        (Obstacles, "width", [-1.0, nan, inf], ["width of the obstacles", "from 0"]),
        (BlockedSectors, "count", [-1], ["sectors", "from 0"]),
        (BlockedSectors, "degrees", [-1.0, nan, inf], ["degrees", "from 0 to 360"]),
        (partial(SimulatedDetector, noise=MINE), "half", [0.0, -3.0, nan], ["from 0.01"]),
        (RoughRanges, "percent", [0.0, -5.0, 301.0, nan], ["error of the ranges", "to 300 %"]),
        (ClassScores, "right", [0.5, 1.0, nan], ["mean score", "from 0.51"]),
        (QuerySpec, "number", [0], ["queries", "from 1"]),
        (QuerySpec, "seeds", [[], [1, 1]], ["at least one", "none twice"]),
        (QuerySpec, "seeds", [[-1]], ["-1", "from 0"]),
    ],
)
def test_invalid_settings_are_refused(
    kind: Any,  # noqa: ANN401
    name: str,
    values: list[Any],
    words: list[str],
) -> None:
    for value in values:
        with refused(InputError, str(value).strip("[]"), *words):
            kind(**{name: value})


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [
        (UnknownNameError, "meduim", ["'meduim'", "nearest is 'medium'"]),
        (UnknownNameError, "medium,,view:90", ["''", "not a distortion"]),
        (UnknownNameError, "medium:7", ["'7'", "is not a setting", "of medium are occurrences"]),
        (UnknownNameError, "view:90:degree=3", ["'degree'", "nearest is 'degrees'"]),
        (UnknownNameError, "detector:mime", ["'mime'", "nearest is 'mine'"]),
        (UnknownNameError, "missing:bnech", ["'bnech'", "nearest is 'bench'"]),
        (InputError, "detector:misspelt", ["'bnech'", "nearest is 'bench'"]),
        (InputError, "compass:5:sigma=6", ["compass:5:sigma=6", "'sigma'", "given twice"]),
        (InputError, "view:sixty", ["'sixty'", "a number"]),
        (InputError, "errors:2.5", ["'2.5'", "a whole number"]),
        (InputError, "medium:resort=no", ["'no'", "true or false"]),
        (InputError, "view:0", ["0.0 degrees", "above 0"]),
        (InputError, "view:70:told=no", ["'no'", "true or false"]),
    ],
)
def test_invalid_texts_are_refused(kind: type[SemsigError], text: str, words: list[str]) -> None:
    with refused(kind, *words):
        prepare_chain(parse_chain(text, noises={**KNOWN, "misspelt": MISSPELT}), CITY)


def spoil(
    classes: list[int],
    weights: list[float] | None = None,
    *,
    bearings: NDArray[np.float64] | None = ORIGIN,
    false: Any = "frequency",  # noqa: ANN401
) -> None:
    sight, rng = Signature(np.array([1], np.uint8), bearings), np.random.default_rng(0)
    distort(sight, Distortion(false_class=false), classes=classes, weights=weights, rng=rng)


def draw(crs: int = 2154, **options: Any) -> None:  # noqa: ANN401
    draw_queries(DATABASE, QuerySpec(**options), city=replace(DATABASE, crs=CRS(crs)))


CASES: list[tuple[type[SemsigError], Callable[[], object], list[str]]] = [
    (UnknownNameError, lambda: spoil([1], false="frequencies"), ["frequencies", "is 'frequency'"]),
    (UnknownNameError, lambda: spoil([1], false="rarity"), ["rarity", "uniform or frequency"]),
    (UnknownNameError, lambda: named_distortion("heavy"), ["heavy", "light, medium or strong"]),
    (UnknownNameError, lambda: draw(seen_from="anywere"), ["is 'anywhere'", "cells or"]),
    (InputError, lambda: draw(number=10**6), ["1000000 queries", f"1 to {len(DATABASE)}"]),
    (InputError, lambda: draw(number=1, seen_from="anywhere"), ["street objects"]),
    (CrsError, lambda: draw(32631, number=1), ["EPSG:32631", "EPSG:2154"]),
    (InputError, lambda: spoil([]), ["distinct codes", "at least one"]),
    (InputError, lambda: spoil([3, 3]), ["distinct codes"]),
    (InputError, lambda: spoil([1, 3]), ["need weights", "one for each class"]),
    (InputError, lambda: spoil([1, 3], [1]), ["1 weights for 2 classes"]),
    (InputError, lambda: spoil([1, 3], [1, -1]), ["0 or more"]),
    (InputError, lambda: spoil([1, 3], [0, 0]), ["all zero", "above zero"]),
    (InputError, lambda: spoil([1, 3], [1, 1], bearings=None), ["one with both"]),
]


@pytest.mark.parametrize(("kind", "call", "words"), CASES)
def test_invalid_arguments_are_refused(
    kind: type[SemsigError], call: Callable[[], object], words: list[str]
) -> None:
    with refused(kind, *words):
        call()
