"""Text that could change a terminal, a table or a page."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import InputError, escaped, one_line, shortened, visible

ASTRONAUT = "\U0001f469\u200d\U0001f680"
HARMLESS = ("Arbre d'alignement", "\u0645\u06cc\u200c\u062e", ASTRONAUT)


@given(st.text(st.characters()))
def test_visible_text_is_json_without_control_characters(text: str) -> None:
    result = visible(text)
    assert not any(ord(letter) < 32 or 127 <= ord(letter) < 160 for letter in result)
    result.encode("utf-8")
    # Quotes and backslashes have escapes of their own in JSON.
    plain = text.replace('"', "").replace("\\", "")
    assert json.loads(f'"{visible(plain)}"') == plain


def test_harmless_text_is_unchanged() -> None:
    for text in HARMLESS:
        assert visible(text) == one_line(text) == text
    assert visible("6\u202f280\u00a0m") == "6\u202f280\u00a0m"
    assert visible("\x1b[2J\n\u202e\U000e0001\ud83d") == r"\u001b[2J\u000a\u202e\udb40\udc01\ud83d"
    assert one_line(json.loads('"\\ud83d"')) == "\ufffd"


@given(st.text() | st.text(st.characters(categories=["Cc", "Cf", "Cs", "Zs", "Lo"])))
def test_one_line_is_stable_and_printable(text: str) -> None:
    plain = one_line(text)
    assert one_line(plain) == plain
    assert plain == plain.strip()
    assert not set(plain) & set("\n\r\t\0\x85\u2028\u202e\u2066\ufeff\ufffe")
    plain.encode("utf-8")
    assert one_line(f"{plain} B") == f"{plain} B".strip()


def test_escaped_text_is_one_line_without_html() -> None:
    assert escaped(" a\n& b ") == "a &amp; b"


@pytest.mark.parametrize(
    "value", ["7" * 300, "it's " * 90, '{"a": [' * 99, "'a " * 4_000, "é\n" * 5_000]
)
def test_messages_do_not_repeat_what_is_long(value: str) -> None:
    message = f"field 'x' of layer 'trees' is {value!r}; correct it, or give 'y'."
    short = shortened(message)
    assert len(short) <= 3_100
    assert short.startswith("field 'x' of layer 'trees' is ")
    assert short.endswith("; correct it, or give 'y'.")
    assert str(InputError(message)) == short


def test_messages_keep_names_and_apostrophes() -> None:
    message = f"the catalogue's not: {'level 3, ' * 40}or 'x'; give the city's name."
    assert shortened(message) == message
