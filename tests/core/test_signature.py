from __future__ import annotations

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import InputError, UnknownNameError
from semsig_gis.core.signature import Signature, SignatureSpec, quantize
from semsig_gis.database.database import BEARING_UNITS
from semsig_gis.database.visibility import Sightings, clockwise_order
from semsig_gis.sources.catalog import paper_taxonomy

TAXONOMY = paper_taxonomy()
LEVELS = st.integers(1, 255)
BEARINGS = st.floats(0.0, 360.0, exclude_max=True)


# --- Angle levels -----------------------------------------------------------------------------


@given(BEARINGS, LEVELS)
def test_a_level_is_the_floor_of_the_paper(bearing: float, levels: int) -> None:
    exact = Fraction(bearing) * levels / 360
    level = int(quantize(bearing, levels))
    assert 0 <= level < levels
    if abs(exact - round(exact)) > 1e-9:
        assert level == exact.__floor__()
    else:  # within rounding of an edge
        assert level in {round(exact) - 1, round(exact)}


@given(LEVELS, st.data())
def test_a_whole_multiple_is_the_start_of_its_level(levels: int, data: st.DataObject) -> None:
    level = data.draw(st.integers(0, levels - 1))
    edge = Fraction(360 * level, levels)
    if Fraction(float(edge)) == edge:  # else no float is the multiple
        assert quantize(float(edge), levels) == level


@pytest.mark.parametrize("levels", [8, 16, 24, 32])
def test_the_levels_of_the_paper_begin_exactly(levels: int) -> None:
    edges = np.arange(levels) * (360.0 / levels)
    assert quantize(edges, levels).tolist() == list(range(levels))
    below = np.nextafter(edges[1:], 0.0)
    assert quantize(below, levels).tolist() == list(range(levels - 1))
    assert quantize(np.nextafter(360.0, 0.0), levels) == levels - 1


@pytest.mark.parametrize("levels", [q for q in range(1, 256) if BEARING_UNITS % q == 0])
def test_a_stored_bearing_falls_into_the_level_of_its_units(levels: int) -> None:
    units = np.arange(BEARING_UNITS)
    stored = units * np.float64(360.0 / BEARING_UNITS)
    assert (quantize(stored, levels) == units // (BEARING_UNITS // levels)).all()


def test_levels_keep_the_shape_and_fit_a_byte() -> None:
    assert quantize(np.zeros((2, 3)), 255).shape == (2, 3)
    assert quantize([], 16).dtype == np.uint8
    assert quantize(359.9999, 255) == 254


# --- SignatureSpec ----------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0.0, -30.0, math.nan, math.inf, 6000.1])
def test_a_range_is_a_number_of_metres(radius: float) -> None:
    with pytest.raises(InputError) as caught:
        SignatureSpec(radius=radius)
    assert_sentence(caught.value, f"{radius} m", "above 0 and up to 6000")


@pytest.mark.parametrize("levels", [0, -1, 256, 16.5, math.nan, "16"])
def test_levels_are_a_whole_number_of_one_byte(levels: object) -> None:
    with pytest.raises(InputError) as caught:
        SignatureSpec(levels=levels)  # type: ignore[arg-type]
    assert_sentence(caught.value, str(levels), "1 to 255")


def test_a_spec_is_a_value() -> None:
    assert SignatureSpec() == SignatureSpec(30.0, 16)
    with pytest.raises(dataclasses.FrozenInstanceError):
        SignatureSpec().radius = 5.0  # type: ignore[misc]


# --- The clockwise order ----------------------------------------------------------------------


def order_of(rows: list[tuple[int, float, float, int]]) -> list[tuple[int, float, float, int]]:
    """Sort (viewpoint, bearing, distance, class code) by `clockwise_order`."""
    viewpoint, bearing, distance, code = (np.array(part) for part in zip(*rows, strict=True))
    # Objects numbered backwards, so that their numbers cannot be what orders them.
    item = np.arange(len(rows))[::-1]
    seen = Sightings(viewpoint, item, bearing.astype(float), distance.astype(float))
    order = clockwise_order(seen, code[::-1].astype(np.uint8))
    assert sorted(order.tolist()) == list(range(len(rows)))
    return [rows[row] for row in order]


SMALL = st.integers(0, 3)


@given(st.lists(st.tuples(SMALL, SMALL, SMALL, SMALL), min_size=1))
def test_order_is_by_viewpoint_bearing_distance_and_class(
    rows: list[tuple[int, float, float, int]],
) -> None:
    assert order_of(rows) == sorted(rows)


# Bearings a hair's breadth apart, and viewpoints that leave few bits of a number to a bearing.
CLOSE = st.builds(
    lambda bearing, steps: min(bearing + steps * math.ulp(bearing), math.nextafter(360.0, 0.0)),
    st.sampled_from([0.0, 1e-9, 90.0, 271.3, 359.9999]),
    SMALL,
)
FAR_APART = st.sampled_from([0, 1, 5, 2**20, 2**40, 2**50 - 1, 2**50])


@given(st.lists(st.tuples(FAR_APART, CLOSE | BEARINGS, SMALL, SMALL), min_size=1))
def test_order_is_exact_where_bearings_hardly_differ(
    rows: list[tuple[int, float, float, int]],
) -> None:
    assert order_of(rows) == sorted(rows)


def test_nothing_seen_has_an_order() -> None:
    nothing = np.empty(0, np.int64)
    seen = Sightings(nothing, nothing, nothing.astype(float), nothing.astype(float))
    assert clockwise_order(seen, np.array([3], np.uint8)).tolist() == []


def test_on_one_bearing_the_nearer_comes_first_then_the_lower_code() -> None:
    rows = [(0, 90.0, 20.0, 1), (0, 90.0, 10.0, 9), (0, 90.0, 10.0, 3), (0, 0.0, 29.0, 5)]
    assert order_of(rows) == [rows[3], rows[2], rows[1], rows[0]]


# --- Signature --------------------------------------------------------------------------------


def test_a_signature_may_lack_one_part_but_not_both() -> None:
    types = Signature(np.array([3, 3, 1], np.uint8), None)
    angles = Signature(None, np.array([0.0, 90.0]))
    assert (len(types), len(angles)) == (3, 2)
    assert angles.levels(4).tolist() == [0, 1]
    with pytest.raises(InputError) as caught:
        types.levels(16)
    assert_sentence(caught.value, "no bearings")
    with pytest.raises(InputError) as caught:
        Signature(None, None)
    assert_sentence(caught.value, "types, bearings or both")


def test_a_signature_may_be_empty() -> None:
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    assert len(nothing) == 0
    assert nothing.levels(16).tolist() == []


@pytest.mark.parametrize("bearing", [math.nan, math.inf, -math.inf, -0.1, 360.0, 720.0])
def test_a_bearing_of_a_signature_is_on_one_turn(bearing: float) -> None:
    with pytest.raises(InputError) as caught:
        Signature(np.array([1, 2], np.uint8), np.array([10.0, bearing]))
    assert_sentence(caught.value, f"bearing {bearing:g}", "[0, 360)")


def test_parts_of_different_lengths_are_an_error() -> None:
    with pytest.raises(InputError) as caught:
        Signature(np.array([1, 2], np.uint8), np.array([10.0]))
    assert_sentence(caught.value, "2 types and 1 bearings", "one bearing for each type")


def test_a_signature_is_one_row() -> None:
    with pytest.raises(InputError) as codes:
        Signature(np.ones((2, 2), np.uint8), None)
    with pytest.raises(InputError) as bearings:
        Signature(None, np.ones((2, 2)))
    assert_sentence(codes.value, "one row")
    assert_sentence(bearings.value, "one row")


# --- Queries of a person ----------------------------------------------------------------------


@given(st.lists(st.tuples(st.sampled_from("BCDEGHIJKLM"), st.floats(-360, 360)), min_size=1))
def test_a_query_is_sorted_clockwise(pairs: list[tuple[str, float]]) -> None:
    types = "".join(symbol for symbol, _ in pairs)
    query = Signature.parse(types, [bearing for _, bearing in pairs], taxonomy=TAXONOMY)
    assert query.codes is not None
    assert query.bearings is not None
    # The outer remainder is for tiny negative bearings, whose inner one rounds to 360.
    turned = [(bearing % 360.0 % 360.0, symbol) for symbol, bearing in pairs]
    expected = sorted(turned, key=lambda pair: pair[0])
    found = zip(query.bearings.tolist(), TAXONOMY.decode(query.codes), strict=True)
    assert list(found) == expected


def test_bearings_are_wrapped_and_pairs_kept() -> None:
    query = Signature.parse("DBLM", [200, -10, 0, 360], taxonomy=TAXONOMY)
    assert query.codes is not None
    assert query.bearings is not None
    assert TAXONOMY.decode(query.codes) == "LMDB"
    assert query.bearings.tolist() == [0.0, 0.0, 200.0, 350.0]


def test_on_one_bearing_the_given_order_stays() -> None:
    query = Signature.parse("DBL", [90, 90, 90], taxonomy=TAXONOMY)
    assert query.codes is not None
    assert TAXONOMY.decode(query.codes) == "DBL"


def test_types_alone_stay_in_their_order_and_bearings_alone_are_sorted() -> None:
    types = Signature.parse("DBD", taxonomy=TAXONOMY)
    assert types.codes is not None
    assert types.codes.tolist() == [3, 1, 3]
    assert types.bearings is None
    angles = Signature.parse(None, np.array([200.0, 10.0]), taxonomy=TAXONOMY)
    assert angles.codes is None
    assert angles.bearings is not None
    assert angles.bearings.tolist() == [10.0, 200.0]


@pytest.mark.parametrize(
    ("types", "bearings", "words"),
    [
        (None, None, ["types, bearings or both"]),
        ("", None, ["without objects", "one symbol or bearing an object"]),
        ("", [], ["without objects"]),
        (None, [], ["without objects"]),
        ("DD", [], ["without objects"]),
        ("DD", [10.0], ["2 types and 1 bearings"]),
        ("D", [10.0, 20.0], ["1 types and 2 bearings"]),
        ("D", [math.nan], ["bearing nan", "0 to 360"]),
        ("DD", [10.0, math.inf], ["bearing inf"]),
        ("D", [720.0], ["bearing 720", "0 to 360"]),
        (None, [10.0, -361.0], ["bearing -361"]),
        ("DD", ["10", "north"], ["not all numbers", "degrees clockwise"]),
        (None, [None, {}], ["not all numbers"]),
        (None, [[10.0], [20.0, 30.0]], ["not all numbers"]),
        ("DD", [[10.0], [20.0]], ["one row"]),
    ],
)
def test_a_query_that_cannot_be_used_has_its_sentence(
    types: str | None, bearings: list[float] | None, words: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        Signature.parse(types, bearings, taxonomy=TAXONOMY)
    assert_sentence(caught.value, *words)


@pytest.mark.parametrize("types", ["DZ", "d", "D D", "DD\n", "D,D", "É"])
def test_an_unknown_symbol_is_named(types: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        Signature.parse(types, None, taxonomy=TAXONOMY)
    unknown = next(symbol for symbol in types if symbol != "D")
    assert_sentence(caught.value, f"symbol {unknown!r}", "D street light")
