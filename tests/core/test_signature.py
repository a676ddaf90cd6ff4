from __future__ import annotations

import math
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import (
    BEARING_UNITS,
    DISTANCE_UNITS,
    DistanceScale,
    InputError,
    ObjectClass,
    Signature,
    SignatureSpec,
    Taxonomy,
    UnknownNameError,
    quantize,
)
from semsig_gis.database import SightingPairs, clockwise_order
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Sequence

TAXONOMY = paper_taxonomy()
LEVELS = st.integers(1, 255)
BEARINGS = st.floats(0.0, 360.0, exclude_max=True)


# --- Angle levels -----------------------------------------------------------------------------


@given(BEARINGS, LEVELS)
def test_angle_level_is_the_floor_defined_in_the_paper(bearing: float, levels: int) -> None:
    exact = Fraction(bearing) * levels / 360
    level = int(quantize(bearing, levels))
    assert 0 <= level < levels
    if abs(exact - round(exact)) > 1e-9:
        assert level == exact.__floor__()
    else:  # within rounding of an edge
        assert level in {round(exact) - 1, round(exact)}


def test_angle_level_begins_at_an_integer_multiple() -> None:
    for levels in range(1, 256):
        # Where no float is the multiple, a level begins at a neighbour of it.
        exact = [
            n for n in range(levels) if Fraction(360 * n / levels) == Fraction(360 * n, levels)
        ]
        edges = np.array([360 * number / levels for number in exact])
        assert quantize(edges, levels).tolist() == exact
        below = quantize(np.nextafter(edges[1:], 0.0), levels)
        assert below.tolist() == [number - 1 for number in exact[1:]]
        assert quantize(np.nextafter(360.0, 0.0), levels) == levels - 1


@pytest.mark.parametrize("levels", [q for q in range(1, 256) if BEARING_UNITS % q == 0])
def test_stored_bearing_has_the_level_of_its_units(levels: int) -> None:
    units = np.arange(BEARING_UNITS)
    stored = units * np.float64(360.0 / BEARING_UNITS)
    assert (quantize(stored, levels) == units // (BEARING_UNITS // levels)).all()


def test_levels_have_the_shape_of_the_bearings_and_fit_a_byte() -> None:
    levels = quantize(np.full((2, 3), 359.9999), 255)
    assert levels.tolist() == [[254] * 3] * 2
    assert levels.dtype == quantize([], 16).dtype == np.uint8


# --- SignatureSpec ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        *(
            ("radius", value, f"{value} m, above 0 and up to 6000")
            for value in (0.0, -30.0, math.nan, math.inf, 6000.1)
        ),
        *(("levels", value, f"{value}, 1 to 255") for value in (0, -1, 256, 16.5, math.nan, "16")),
    ],
)
def test_invalid_range_or_levels_are_refused(name: str, value: object, words: str) -> None:
    with refused(InputError, *words.split(", ")):
        SignatureSpec(**{name: value})  # type: ignore[arg-type]


# --- The clockwise order ----------------------------------------------------------------------


def order_of(rows: list[tuple[int, float, float, int]]) -> list[tuple[int, float, float, int]]:
    """Sort (viewpoint, bearing, distance, class code) by `clockwise_order`."""
    viewpoint, bearing, distance, code = (np.array(part) for part in zip(*rows, strict=True))
    # Objects numbered backwards, so that their numbers cannot be what orders them.
    item = np.arange(len(rows))[::-1]
    pairs = SightingPairs(viewpoint, item, bearing.astype(float), distance.astype(float))
    order = clockwise_order(pairs, code[::-1].astype(np.uint8))
    assert sorted(order.tolist()) == list(range(len(rows)))
    return [rows[row] for row in order]


SMALL = st.integers(0, 3)


# Bearings a hair's breadth apart, and viewpoints that leave few bits of a number to a bearing.
CLOSE = st.builds(
    lambda bearing, steps: min(bearing + steps * math.ulp(bearing), math.nextafter(360.0, 0.0)),
    st.sampled_from([0.0, 1e-9, 90.0, 271.3, 359.9999]),
    SMALL,
)
FAR_APART = st.sampled_from([0, 1, 5, 2**20, 2**40, 2**50 - 1, 2**50])


@given(
    st.lists(st.tuples(SMALL, SMALL, SMALL, SMALL), min_size=1)
    | st.lists(st.tuples(FAR_APART, CLOSE | BEARINGS, SMALL, SMALL), min_size=1)
)
@settings(max_examples=100)
def test_order_is_by_viewpoint_bearing_distance_and_class(
    rows: list[tuple[int, float, float, int]],
) -> None:
    assert order_of(rows) == sorted(rows)


# --- Signature --------------------------------------------------------------------------------


def test_signature_needs_types_or_bearings() -> None:
    types = Signature(np.array([3, 3, 1], np.uint8), None)
    angles = Signature(None, np.array([0.0, 90.0]))
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    assert (len(types), len(angles), len(nothing)) == (3, 2, 0)
    assert (angles.levels(4).tolist(), nothing.levels(16).tolist()) == ([0, 1], [])
    with refused(InputError, "no bearings"):
        types.levels(16)


@pytest.mark.parametrize(
    ("codes", "bearings", "words"),
    [
        *(
            ([1, 2], [10.0, bearing], (f"bearing {bearing:g}", "[0, 360)"))
            for bearing in (math.nan, math.inf, -math.inf, -0.1, 360.0, 720.0)
        ),
        ([1, 2], [10.0], ("2 types and 1 bearings", "one bearing for each type")),
        ([[1, 1], [1, 1]], None, ("one row",)),
        (None, [[1.0, 1.0], [1.0, 1.0]], ("one row",)),
        (None, None, ("types, bearings or both",)),
    ],
)
def test_invalid_signature_is_refused(
    codes: list[int] | None, bearings: list[float] | None, words: tuple[str, ...]
) -> None:
    with refused(InputError, *words):
        Signature(
            None if codes is None else np.array(codes, np.uint8),
            None if bearings is None else np.array(bearings),
        )


# --- Queries of a person ----------------------------------------------------------------------


def parsed(
    types: str | None, bearings: Sequence[float] | None = None
) -> tuple[str | None, list[float] | None]:
    """Return the symbols and the bearings of a query."""
    query = Signature.parse(types, bearings, taxonomy=TAXONOMY)
    return (
        None if query.codes is None else TAXONOMY.decode(query.codes),
        None if query.bearings is None else query.bearings.tolist(),
    )


@given(st.lists(st.tuples(st.sampled_from("BCDEGHIJKLM"), st.floats(-360, 360)), min_size=1))
def test_query_is_sorted_clockwise(pairs: list[tuple[str, float]]) -> None:
    # The outer remainder is for tiny negative bearings: the inner one rounds to 360.
    turned = [(bearing % 360.0 % 360.0, symbol) for symbol, bearing in pairs]
    bearings, symbols = zip(*sorted(turned, key=lambda pair: pair[0]), strict=True)
    types = "".join(symbol for symbol, _ in pairs)
    assert parsed(types, [bearing for _, bearing in pairs]) == ("".join(symbols), list(bearings))


def test_query_without_bearings_keeps_its_order() -> None:
    assert parsed("DBL", [90, 90, 90]) == ("DBL", [90.0] * 3)
    assert parsed("DBD") == ("DBD", None)
    assert parsed(None, [200.0, 10.0]) == (None, [10.0, 200.0])


@pytest.mark.parametrize(
    ("types", "bearings", "words"),
    [
        (None, None, ["types, bearings or both"]),
        ("DD", [], ["2 types and 0 bearings"]),
        ("", [10], ["0 types and 1 bearings"]),
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
def test_unusable_query_is_refused(
    types: str | None, bearings: list[float] | None, words: list[str]
) -> None:
    with refused(InputError, *words):
        parsed(types, bearings)


@pytest.mark.parametrize("types", ["DZ", "d", "D D", "DD\n", "D,D", "É"])
def test_error_names_an_unknown_symbol(types: str) -> None:
    unknown = next(symbol for symbol in types if symbol != "D")
    with refused(UnknownNameError, f"symbol {unknown!r}", "semsig info --symbols"):
        parsed(types)


# --- Distance units ---------------------------------------------------------------------------


def rounded_share(distances: list[float], reach: float) -> list[int]:
    """Return distances in whole parts of the reach over 255."""
    return [min(round(distance * (255 / reach)), 255) for distance in distances]


@given(st.floats(0.5, 6000.0), st.lists(st.floats(0.0, 1.1), max_size=20))
def test_linear_units_are_equal_parts_of_the_reach(reach: float, shares: list[float]) -> None:
    scale, distances = DistanceScale(reach), [share * reach for share in shares]
    assert scale.units(np.array(distances)).tolist() == rounded_share(distances, reach)
    numbers = np.arange(DISTANCE_UNITS + 1)
    assert scale.metres.tolist() == (numbers * np.float64(reach / 255)).tolist()
    assert scale.positive_metres.tolist() == (np.maximum(numbers, 0.5) * (reach / 255)).tolist()
    assert scale.rounding(np.array(shares)).tolist() == [reach / 255 / 2.0] * len(shares)


@given(st.floats(100.0, 6000.0), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_logarithmic_units_are_off_by_a_small_share(reach: float, shares: list[float]) -> None:
    scale, distances = DistanceScale(reach, logarithmic=True), np.array(shares) * reach
    errors = np.abs(scale.metres[scale.units(distances)] - distances)
    assert (errors <= scale.rounding(distances) * (1.0 + 1e-9)).all()
    assert (errors <= np.maximum(0.15, 0.021 * distances) + 0.05).all()
    assert scale.metres[0] == 0.0
    assert scale.metres[-1] == pytest.approx(reach)
    assert (scale.units(scale.metres) == np.arange(256)).all()


def test_scale_is_logarithmic_if_a_class_is_tall() -> None:
    tower = ObjectClass(224, "w", "tower", "Tower", range_m=2000.0, tall=True)
    kiosk = ObjectClass(225, "k", "kiosk", "Kiosk", range_m=45.0)
    near = TAXONOMY.extended([kiosk])
    assert DistanceScale.of(near, 30.0) == DistanceScale(45.0)
    far = near.extended([tower])
    assert DistanceScale.of(far, 30.0) == DistanceScale(2000.0, logarithmic=True)
    assert far.near_reach(30.0) == near.near_reach(30.0) == 45.0
    assert Taxonomy((tower,)).near_reach(30.0) == 30.0
