"""Values as TOML; wrong TOML files are tested with catalogues."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import CatalogError
from semsig_gis.storage import metres, toml_text

WORDS = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=8)
PLAIN = st.one_of(st.booleans(), st.integers(-(10**9), 10**9), st.floats(-1e9, 1e9), WORDS)
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.one_of(PLAIN, st.lists(PLAIN, max_size=3)),
    lambda inner: st.one_of(
        st.dictionaries(WORDS, inner, min_size=1, max_size=3),
        st.lists(st.dictionaries(WORDS, PLAIN, max_size=2), max_size=2),
    ),
    max_leaves=8,
)


@given(st.dictionaries(WORDS, VALUES, max_size=4))
def test_toml_text_is_parsed_to_the_same_values(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_values_after_tables_belong_to_the_right_section() -> None:
    table = {"noises": {"mine": {"clutter": 2.0, "by_class": {"bench": 0.5}}}, "queries": 3}
    text = toml_text({**table, "parts": {}})  # an empty table is omitted
    assert text.startswith("queries = 3\n\n[noises.mine]\nclutter = 2.0\n")
    assert tomllib.loads(text) == table


@given(st.floats() | st.integers() | st.booleans() | st.text() | st.none())
def test_metres_are_above_0_and_up_to_the_limit(value: object) -> None:
    number = not isinstance(value, bool) and isinstance(value, int | float)
    if number and 0 < value <= 100:  # type: ignore[operator]
        assert math.isclose(metres(value, "a", "a.toml", most=100), float(value))  # type: ignore[arg-type]
        return
    with pytest.raises(CatalogError, match="metres above 0 and up to 100"):
        metres(value, "a", "a.toml", most=100)
