from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import FULL_TURN, InputError, UnknownNameError
from semsig_gis.localization import (
    METRICS,
    NOISES,
    EditWeights,
    LikelihoodMethod,
    Method,
    NoiseSpec,
    parse_method,
)
from semsig_gis.observation import LEAST_TURN

if TYPE_CHECKING:
    from semsig_gis.core import SemsigError


TEXTS = """
edit+edit edit+jaccard:alpha=0.3 jaccard+histogram:alpha=0.9:raw edit+edit:weights=3/1/2
angles:histogram edit+edit:5% edit+jaccard:0.25%:alpha=0.125:raw:weights=1/2/100 types:jaccard
"""


@pytest.mark.parametrize("text", TEXTS.split())
def test_text_of_method_is_parsed_and_written(text: str) -> None:
    assert str(Method.parse(text)) == text


MINE = {**NOISES, "mine": NoiseSpec(detection=0.7, name="mine")}
DISTANCES = st.builds(
    Method,
    types=st.sampled_from(list(METRICS)),
    angles=st.sampled_from(list(METRICS)),
    alpha=st.floats(0, 1),
    keep=st.none() | st.floats(0, 100, exclude_min=True),
    normalized=st.booleans(),
    weights=st.builds(EditWeights, *[st.integers(1, 100)] * 3),
)
LIKELIHOODS = st.builds(
    lambda noise, place, north: LikelihoodMethod(noise=noise, north_sigma=north, **place),
    st.sampled_from(list(MINE.values())),
    st.sampled_from([{}, {"refined": True}, {"on_grid": True}]),
    st.floats(LEAST_TURN, FULL_TURN) | st.sampled_from([0.0, math.inf]),
)


@settings(max_examples=100)
@given(DISTANCES | LIKELIHOODS)
def test_text_of_every_method_is_parsed_to_equal_method(method: Method | LikelihoodMethod) -> None:
    assert parse_method(str(method), noises=MINE) == method


def test_both_kinds_of_methods_are_parsed() -> None:
    assert parse_method("edit+jaccard:5%") == Method.parse("edit+jaccard:5%")
    assert parse_method(" likelihood ") == LikelihoodMethod(noise=NOISES["generic"])
    assert str(parse_method("likelihood:light:heading=unknown:refined")) == (
        "likelihood:light:refined:heading=unknown"
    )


NO_METHOD = """
edit types edit+edit+edit edit+edit:5 edit+edit:five% edit+edit:alpha edit+edit:alpha=x
edit+edit:raw:raw edit+edit:weights=1/1/1/1 edit+edit:weights=1/x/1 edit+edit:beta=1 liklihood:light
"""


@pytest.mark.parametrize("text", ["", *NO_METHOD.split()])
def test_invalid_text_is_refused(text: str) -> None:
    with refused(InputError, f"method {text!r} cannot be read; give two measures as"):
        parse_method(text)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("edit+edti", UnknownNameError, "'edti' is unknown; the nearest is 'edit'"),
        ("types:", UnknownNameError, "metric '' is unknown"),
        ("edit+edit:alpha=1.5", InputError, "alpha of the types is 1.5; give a number from 0 to 1"),
        ("edit+edit:alpha=nan", InputError, "alpha of the types is nan"),
        ("edit+edit:0%", InputError, "above 0 and up to 100"),
        ("edit+edit:101%", InputError, "above 0 and up to 100"),
        ("edit+edit:nan%", InputError, "above 0 and up to 100"),
        ("types:edit:5%", InputError, "it has one measure; give both"),
        ("edit+edit:weights=0/1/1", InputError, "edit weight 'insert' is 0"),
        ("likelihood:ligth", UnknownNameError, "nearest is 'light'"),
        ("likelihood:light:refine", InputError, "cannot be read; give 'likelihood:NOISE'"),
        ("likelihood:light:heading", InputError, "cannot be read; give 'likelihood:NOISE'"),
        ("likelihood:light:heading=north", InputError, "cannot be read; give 'likelihood:NOISE'"),
        ("likelihood:light:heading=-4", InputError, "is -4.0; give a number from 0.001 to 360"),
        ("likelihood:light:on_grid:refined", InputError, "refined and on_grid exclude"),
    ],
)
def test_invalid_values_are_refused(text: str, error: type[SemsigError], words: str) -> None:
    with refused(error, words):
        parse_method(text)


def test_method_without_metrics_is_refused() -> None:
    with refused(InputError, "neither types nor angles"):
        Method(types=None, angles=None)
