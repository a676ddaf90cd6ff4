from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import CatalogError
from semsig_gis.storage.toml import check_keys, metres, one_of, parse_toml, texts

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
    with pytest.raises(CatalogError) as caught:
        check_keys(parse_toml(text, "a.toml"), KEYS, "a.toml", ["name"])
    assert_sentence(caught.value, "a.toml", *words)


def test_what_is_no_toml() -> None:
    with pytest.raises(CatalogError) as caught:
        parse_toml("a = [", "a.toml")
    assert_sentence(caught.value, "a.toml is not valid TOML")


def test_choices_and_texts() -> None:
    assert one_of("line", "geometry", ("line", "point"), "a.toml") == "line"
    with pytest.raises(CatalogError) as caught:
        one_of("lines", "geometry", ("line", "point"), "a.toml")
    assert_sentence(caught.value, "geometry = 'lines'", "the nearest is 'line'", "'point'")
    assert texts(["a", "b"], "files", "a.toml") == ("a", "b")
    for wrong in ("a", ["a", 1], [""]):
        with pytest.raises(CatalogError) as caught:
            texts(wrong, "files", "a.toml")
        assert_sentence(caught.value, "a.toml has files", "list of texts")


@given(st.floats() | st.integers() | st.booleans() | st.text() | st.none())
def test_a_length_is_above_nothing_and_up_to_the_most(value: object) -> None:
    number = not isinstance(value, bool) and isinstance(value, int | float)
    if number and 0 < value <= 100:  # type: ignore[operator]
        assert math.isclose(metres(value, "a", "a.toml", most=100), float(value))  # type: ignore[arg-type]
        return
    with pytest.raises(CatalogError) as caught:
        metres(value, "a", "a.toml", most=100)
    assert "metres above 0 and up to 100" in str(caught.value)
