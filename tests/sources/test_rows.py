"""How values of fields compare with what a catalogue says."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.errors import CatalogError
from semsig_gis.layer_spec import LayerSpec
from semsig_gis.sources._rows import BETWEEN_SLASHES, RowRules, as_text, matches

numbers = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False)
plain = st.text().filter(lambda text: not BETWEEN_SLASHES.fullmatch(text))
values = st.none() | st.booleans() | numbers | plain


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


@given(plain, plain)
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


@pytest.mark.parametrize(
    ("value", "pattern", "expected"),
    [
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
def test_a_text_between_slashes_is_a_pattern(
    value: object, pattern: str, *, expected: bool
) -> None:
    assert matches(value, pattern) == expected


def test_a_pattern_that_is_none() -> None:
    spec = LayerSpec(name="things", class_name="bench", where=(("kind", ("/[/",)),))
    with pytest.raises(CatalogError) as caught:
        RowRules(spec, ["kind"], filters=True, where="layer 'things'")
    assert_sentence(caught.value, "layer 'things'", "/[/", "regular expression")


def test_only_true_ids_may_be_unique() -> None:
    spec = LayerSpec(name="things", class_name="bench", id_field="n", unique_id=True)
    rules = RowRules(spec, ["n"], filters=True, where="things")
    assert [rules.source_id({"n": value}, "7") for value in (3.0, "3.0", None, " ")] == [
        "3",
        "3",
        "",
        "",
    ]
