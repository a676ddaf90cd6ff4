"""Signs, and text made fit to be shown."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.core import (
    COLOURS,
    SHAPES,
    ClassSign,
    ObjectClass,
    Taxonomy,
    class_signs,
    escaped,
    one_line,
)
from semsig_gis.exports import CLASS_MARKERS
from semsig_gis.maps import OUTLINES
from semsig_gis.reports import MARKERS

MANY = Taxonomy(
    tuple(ObjectClass(code, chr(64 + code), f"c{code}", f"C {code}") for code in range(1, 27))
)


def luminance(colour: str) -> float:
    shares = np.array(list(bytes.fromhex(colour[1:]))) / 255.0
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def test_a_sign_says_what_it_stands_for_in_whatever_order() -> None:
    signs = class_signs(MANY)
    assert class_signs(Taxonomy(MANY.classes[::-1])) == signs
    for item in MANY.classes:
        assert (signs[item.code].symbol, signs[item.code].title) == (item.symbol, item.title)


def test_signs_are_told_apart() -> None:
    signs = list(class_signs(MANY).values())
    assert len({sign.colour for sign in signs[:18]}) == 18
    assert len({(sign.colour, sign.shape) for sign in signs}) == 26
    for one, other in itertools.pairwise(signs):
        assert one.shape != other.shape
        assert one.colour != other.colour


@pytest.mark.parametrize("colour", [*COLOURS, "#000000", "#ffffff", "#777777"])
def test_a_letter_is_readable(colour: str) -> None:
    sign = ClassSign("A", "a class", "circle", colour)
    assert sign.ink in {"#000000", "#ffffff"}
    darker, lighter = sorted((luminance(sign.ink), luminance(colour)))
    assert (lighter + 0.05) / (darker + 0.05) >= 4.5


def test_all_who_draw_signs_know_every_shape() -> None:
    assert list(OUTLINES) == list(CLASS_MARKERS) == list(MARKERS) == list(SHAPES)


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
