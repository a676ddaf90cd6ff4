"""Text that could do something to a terminal."""

from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import visible


@given(st.text(st.characters()))
def test_what_is_seen_says_what_there_was(text: str) -> None:
    seen = visible(text)
    assert not any(ord(letter) < 32 or 127 <= ord(letter) < 160 for letter in seen)
    seen.encode("utf-8")
    # Quotes and strokes aside, it is text of JSON.
    plain = text.replace('"', "").replace("\\", "")
    assert json.loads(f'"{visible(plain)}"') == plain


def test_text_that_hides_nothing_stays() -> None:
    astronaut = "\U0001f469\u200d\U0001f680"
    for text in ("Arbre d'alignement", "\u0645\u06cc\u200c\u062e", astronaut, "6\u202f280\u00a0m"):
        assert visible(text) == text
    assert visible("\x1b[2J\n\u202e\U000e0001\ud83d") == r"\u001b[2J\u000a\u202e\udb40\udc01\ud83d"
