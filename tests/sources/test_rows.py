"""How values of fields compare with what a catalogue says."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.catalog import LayerSpec
from semsig_gis.sources._rows import RowRules, as_text, matches

numbers = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
values = st.none() | st.booleans() | numbers | st.text()


@given(values)
def test_a_value_is_itself_and_nothing_is_missing(value: Any) -> None:  # noqa: ANN401
    if value is None:
        assert not matches(value, "None")
    else:
        assert matches(value, value)
        assert matches(value, as_text(value))


@given(numbers, numbers)
def test_numbers_compare_as_numbers(a: float, b: float) -> None:
    assert matches(a, b) == (a == b)
    assert matches(repr(a), b) == (a == b)


@given(st.text(), st.text())
def test_text_compares_as_text(a: str, b: str) -> None:
    assert matches(a, b) == (a == b)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        (1, True),
        (True, 1),
        (0, False),
        (math.nan, 0),
        ("", 0),
        ("x", 1),
        ("1.0", "1"),
        ("en fonction ", "en fonction"),
        ("En fonction", "en fonction"),
        (["en fonction"], 3),
    ],
)
def test_near_is_not_equal(value: object, wanted: Any) -> None:  # noqa: ANN401
    assert not matches(value, wanted)


@given(st.integers(-(2**53), 2**53))
def test_whole_identifiers_have_no_decimals(number: int) -> None:
    spec = LayerSpec(name="things", class_name="bench", id_field="n")
    rules = RowRules(spec, ["n"], filters=True, where="here")
    for value in (number, float(number), str(number), f"{number}.0", f" {number}.00 "):
        assert rules.source_id({"n": value}, "7") == str(number)
    for nothing in (None, "", "  "):
        assert rules.source_id({"n": nothing}, "7") == "7"
