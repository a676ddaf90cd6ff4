"""Tests of semsig_gis.core.signs."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from semsig_gis.core.signs import COLOURS, SHAPES, ClassSign, class_signs
from semsig_gis.core.taxonomy import ObjectClass, Taxonomy
from semsig_gis.exports.layers import CLASS_MARKERS
from semsig_gis.maps.parts import OUTLINES
from semsig_gis.reports.scenes import MARKERS

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
