from __future__ import annotations

import tomllib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.storage.toml import toml_text

texts = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=8)
plain = st.one_of(st.booleans(), st.integers(-(10**9), 10**9), st.floats(-1e9, 1e9), texts)
values: st.SearchStrategy[Any] = st.recursive(
    st.one_of(plain, st.lists(plain, max_size=3)),
    lambda inner: st.one_of(
        st.dictionaries(texts, inner, min_size=1, max_size=3),
        st.lists(st.dictionaries(texts, plain, max_size=2), max_size=2),
    ),
    max_leaves=8,
)


@given(st.dictionaries(texts, values, max_size=4))
def test_any_values_are_read_back(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_values_beside_tables_stay_with_their_own() -> None:
    table = {"noises": {"mine": {"clutter": 2.0, "by_class": {"bench": 0.5}}}, "queries": 3}
    text = toml_text(table)
    assert text.startswith("queries = 3\n\n[noises.mine]\nclutter = 2.0\n")
    assert tomllib.loads(text) == table


def test_empty_tables_are_left_out() -> None:
    assert tomllib.loads(toml_text({"size": 1, "parts": {}})) == {"size": 1}
