"""What a catalogue accepts of a tag or a field."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import CatalogError
from semsig_gis.sources import BETWEEN_SLASHES, Condition, as_text, matches

numbers = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
plain = st.text().filter(lambda text: not BETWEEN_SLASHES.fullmatch(text))
values = st.none() | st.booleans() | numbers | plain


@given(values)
def test_value_matches_itself_and_no_missing_value(value: Any) -> None:  # noqa: ANN401
    if value is None:
        assert not matches(value, "None")
    else:
        assert matches(value, value)
        assert matches(value, as_text(value))


@given(numbers, numbers)
def test_numbers_are_compared_as_numbers(a: float, b: float) -> None:
    assert matches(a, b) == (a == b)
    assert matches(repr(a), b) == (a == b)


@given(plain, plain)
def test_text_is_compared_as_text(a: str, b: str) -> None:
    assert matches(a, b) == (a == b)


@pytest.mark.parametrize(
    ("value", "accepted", "expected"),
    [
        (1, True, False),
        (True, 1, False),
        (0, False, False),
        (math.nan, 0, False),
        ("", 0, False),
        ("x", 1, False),
        ("1.0", "1", False),
        ("en fonction ", "en fonction", False),
        ("En fonction", "en fonction", False),
        (["en fonction"], 3, False),
        ("BASTILLE", "/[^a-z]+/", True),
        ("Bastille", "/[^a-z]+/", False),
        ("Taxi (nuit)", "/Taxi.*/", True),
        ("un Taxi", "/Taxi.*/", False),
        (75012, "/75.../", True),
        (12.0, "/1./", True),
        (None, "/.*/", False),
        ("//", "//", True),
        ("/", "/", True),
        ("a/b", "a/b", True),
    ],
)
def test_match_is_exact_or_a_pattern(value: object, accepted: Any, *, expected: bool) -> None:  # noqa: ANN401
    assert matches(value, accepted) == expected


AT_STREET_LEVEL = ">=0 or none"


@pytest.mark.parametrize(
    ("accepted", "yes", "no"),
    [
        (AT_STREET_LEVEL, ["0", "1", 0, 2.5, "0.5", "-1;0", "0;-1", "-1-0", None, "", math.nan],
         ["-1", "-0.5", -1, "-2;-1", "-2--1", "ground", True]),
        ([">=0", "none"], ["0", None, " "], ["-1"]),
        ("none or >= 0", ["0", None], ["-1"]),
        ("<2", ["1.9", "-3", 1, "1,5"], ["2", 2, None, "", "x"]),
        ("<=-1 or >2.5", ["-1", "3", "2;3"], ["2.5", "0", "0;1"]),
        ("yes or none", ["yes", None], ["no", "none"]),
        ("none", [None, ""], ["none", "no", 0]),
        ("/none/", ["none"], [None]),
        ("*", ["yes", "room", 0], ["no", None, ""]),
        ("black or white", ["black or white"], ["black", "white"]),
        (["yes", "/<.*/"], ["yes", "<x>"], ["no", None]),
        ("", [""], ["x", None]),
    ],
)  # fmt: skip
def test_condition_accepts(accepted: Any, yes: list[Any], no: list[Any]) -> None:  # noqa: ANN401
    condition = Condition.parse(accepted if isinstance(accepted, list) else [accepted])
    assert [value for value in yes if not condition.accepts(value)] == []
    assert [value for value in no if condition.accepts(value)] == []


@given(st.lists(st.integers(-9, 9), min_size=1), st.integers(-9, 9))
def test_comparison_of_any_or_every_number(numbers: list[int], limit: int) -> None:
    """A thing on several levels is left out as too low only where all of them are."""
    text = ";".join(map(str, numbers))
    assert Condition.parse([f">={limit}"]).accepts(text) == (max(numbers) >= limit)
    assert Condition.parse([f"<{limit}"]).accepts(text, every=True) == (max(numbers) < limit)


def test_comparison_rejects_text() -> None:
    below = Condition.parse(["<0"])
    for text in ("ground", "-1;ground", "", None, "-1;"):
        assert not below.accepts(text, every=True)


@pytest.mark.parametrize(
    "text", [">=x", "=>0", "=0", "!=no", "≥0", ">=0 or <", "<unknown>", "> =1"]
)
def test_invalid_comparison_is_refused(text: str) -> None:
    with refused(CatalogError, "is not a comparison", "'>=0 or none'", "'/"):
        Condition.parse([text])
