from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence, refused

from semsig_gis.core.errors import CatalogError
from semsig_gis.storage.toml import check_keys, metres, one_of, parse_toml, texts, toml_text

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
def test_any_values_are_read_back(table: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_values_beside_tables_stay_with_their_own() -> None:
    table = {"noises": {"mine": {"clutter": 2.0, "by_class": {"bench": 0.5}}}, "queries": 3}
    text = toml_text(table)
    assert text.startswith("queries = 3\n\n[noises.mine]\nclutter = 2.0\n")
    assert tomllib.loads(text) == table


def test_empty_tables_are_left_out() -> None:
    assert tomllib.loads(toml_text({"size": 1, "parts": {}})) == {"size": 1}


KEYS = {"name": str, "code": int, "files": list, "where": dict, "optional": bool, "free": object}


def test_a_table_of_known_keys_passes() -> None:
    table = parse_toml(
        'name = "a"\ncode = 3\nfiles = []\nwhere = {}\noptional = true\nfree = 2.5', "a.toml"
    )
    check_keys(table, KEYS, "a.toml", KEYS)
    check_keys({}, KEYS, "a.toml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nam = 1", ["'nam'", "the nearest is 'name'"]),
        ("name = 1", ["name = 1", "a string"]),
        ("code = true", ["code = True", "a whole number"]),
        ("optional = 1", ["optional = 1", "true or false"]),
        ("files = {}", ["files = {}", "a list"]),
        ("where = []", ["where = []", "a table"]),
        ("code = 1", ["lacks the key 'name'", "add it"]),
    ],
)
def test_every_mistake_has_its_sentence(text: str, words: list[str]) -> None:
    with refused(CatalogError, "a.toml", *words):
        check_keys(parse_toml(text, "a.toml"), KEYS, "a.toml", ["name"])


def test_what_is_no_toml() -> None:
    with refused(CatalogError, "a.toml is not valid TOML"):
        parse_toml("a = [", "a.toml")


def test_choices_and_texts() -> None:
    assert one_of("line", "geometry", ("line", "point"), "a.toml") == "line"
    with pytest.raises(CatalogError) as caught:
        one_of("lines", "geometry", ("line", "point"), "a.toml")
    assert_sentence(caught.value, "geometry = 'lines'", "the nearest is 'line'", "'point'")
    assert texts(["a", "b"], "files", "a.toml") == ("a", "b")
    for wrong in ("a", ["a", 1], [""]):
        with refused(CatalogError, "a.toml has files", "list of texts"):
            texts(wrong, "files", "a.toml")


@given(st.floats() | st.integers() | st.booleans() | st.text() | st.none())
def test_a_length_is_above_nothing_and_up_to_the_most(value: object) -> None:
    number = not isinstance(value, bool) and isinstance(value, int | float)
    if number and 0 < value <= 100:  # type: ignore[operator]
        assert math.isclose(metres(value, "a", "a.toml", most=100), float(value))  # type: ignore[arg-type]
        return
    with pytest.raises(CatalogError) as caught:
        metres(value, "a", "a.toml", most=100)
    assert "metres above 0 and up to 100" in str(caught.value)
