from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sights import CITY, CLASSES, many, paper_errors, rows, seeds, sights

from semsig_gis.likelihood.noise.model import NOISES, NoiseSpec
from semsig_gis.queries.chain import NAMED_DISTORTIONS, chain_text, parse_chain, ready_chain
from semsig_gis.queries.distortions import (
    DISTORTIONS,
    BlockedSectors,
    CompassBias,
    Detector,
    FieldOfView,
    HiddenBehind,
    MissingClasses,
    Obstacles,
)

if TYPE_CHECKING:
    from semsig_gis.queries.chain import QueryDistortion
    from semsig_gis.queries.sight import Sight

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
    st.builds(FieldOfView, degrees=st.floats(0.1, 360)),
    st.builds(HiddenBehind, width=st.floats(0, 5)),
    st.builds(Obstacles, count=st.floats(0, 9), width=st.floats(0, 9)),
    st.builds(BlockedSectors, count=st.integers(0, 5), degrees=st.floats(0, 360)),
    st.builds(Detector, noise=st.sampled_from(list(KNOWN.values())), half=st.floats(1, 99)),
)
chains = st.lists(any_distortion, max_size=4).map(tuple)


@given(chain=chains)
def test_written_and_read_is_the_same(chain: tuple[QueryDistortion, ...]) -> None:
    assert parse_chain(chain_text(chain), noises=KNOWN) == chain
    assert parse_chain((chain_text([one]) for one in chain), noises=KNOWN) == chain


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
        "detector:mine:half=20",
        "",
    ],
)
def test_texts_that_read_well(text: str) -> None:
    assert chain_text(parse_chain(text, noises=KNOWN)) == text


@given(one=sights, chain=chains, seed=seeds, number=st.integers(0, 99))
def test_any_order_of_any_distortions_gives_a_query(
    one: Sight, chain: tuple[QueryDistortion, ...], seed: int, number: int
) -> None:
    before = rows(one)
    for order in itertools.islice(itertools.permutations(chain), 6):
        seen = ready_chain(order, CITY)(one, seed, number)
        assert set(seen.codes.tolist()) <= set(CLASSES)
        assert ((seen.bearings >= 0) & (seen.bearings < 360)).all()
        assert (seen.distances >= 0).all()
        assert len(seen.signature) == len(seen)
        again = ready_chain(order, CITY)(one, seed, number)
        assert rows(again) == rows(seen)
        assert again.heading == seen.heading
    assert rows(one) == before


@given(one=sights, chain=chains, seed=seeds)
def test_a_kind_has_the_same_chances_in_any_company(
    one: Sight, chain: tuple[QueryDistortion, ...], seed: int
) -> None:
    others = tuple(item for item in chain if not isinstance(item, CompassBias))
    alone = ready_chain([CompassBias(sigma=20.0)], CITY)(one, seed, 3)
    for place in (0, len(others)):
        order = (*others[:place], CompassBias(sigma=20.0), *others[place:])
        assert ready_chain(order, CITY)(one, seed, 3).heading == alone.heading


def test_numbers_seeds_and_repeats_have_chances_of_their_own() -> None:
    spoil = ready_chain([CompassBias(), CompassBias()], CITY)
    headings = {spoil(many(1), seed, number).heading for seed in (0, 1) for number in (0, 1, 2)}
    assert len(headings) == 6
    once = ready_chain([CompassBias()], CITY)(many(1), 0, 0).heading
    twice = spoil(many(1), 0, 0).heading
    assert twice != pytest.approx(2.0 * once % 360.0)


def test_nothing_happens_without_distortions() -> None:
    one = many(3)
    assert ready_chain((), CITY)(one, 0, 0) is one
    none = ready_chain([DISTORTIONS["none"]], CITY)(one, 0, 0)
    assert rows(none) == rows(one)


def test_misses_and_clutter_add_up() -> None:
    # Seen in half of the turn, half of what is left is detected.
    half = NoiseSpec(detection=0.5, misnamed=0.0, clutter=0.0, name="half")
    chain = parse_chain("view:180, detector:half", noises={"half": half})
    spoil = ready_chain(chain, CITY)
    kept = np.array([len(spoil(many(1), 0, number)) for number in range(4000)])
    assert kept.mean() == pytest.approx(0.25, abs=0.04)


def test_the_streams_of_random_numbers_are_fixed() -> None:
    # A change would change every seeded result that was ever written down.
    streams = {name: one.stream for name, one in NAMED_DISTORTIONS.items() if name != "known"}
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
    }
