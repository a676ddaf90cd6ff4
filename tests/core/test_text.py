from __future__ import annotations

import json

from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core.signs import escaped, one_line


def test_text_from_data_breaks_no_markdown() -> None:
    assert escaped(" a\n& b ") == "a &amp; b"


@given(st.text() | st.text(st.characters(categories=["Cc", "Cf", "Cs", "Zs", "Lo"])))
def test_text_on_one_line(text: str) -> None:
    plain = one_line(text)
    assert one_line(plain) == plain
    assert plain == plain.strip()
    assert not set(plain) & set("\n\r\t\0\x85\u2028\u202e\u2066\ufeff\ufffe")
    plain.encode("utf-8")
    assert one_line(f"{plain} B") == f"{plain} B".strip()


def test_text_that_hides_nothing_stays() -> None:
    astronaut = "\U0001f469\u200d\U0001f680"
    for text in ("Arbre d'alignement", "\u0645\u06cc\u200c\u062e", astronaut):
        assert one_line(text) == text
    assert one_line(json.loads('"\\ud83d"')) == "\ufffd"
