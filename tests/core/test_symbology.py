"""Symbols of classes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from semsig_gis.core import COLOURS, SHAPES, ClassSign, ObjectClass, Taxonomy, class_signs
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


def test_signs_do_not_depend_on_the_order_of_classes() -> None:
    signs = class_signs(MANY)
    assert class_signs(Taxonomy(MANY.classes[::-1])) == signs
    for item in MANY.classes:
        assert (signs[item.code].symbol, signs[item.code].title) == (item.symbol, item.title)


def test_signs_differ_in_colour_or_shape() -> None:
    signs = list(class_signs(MANY).values())
    assert len({sign.colour for sign in signs[:18]}) == 18
    assert len({(sign.colour, sign.shape) for sign in signs}) == 26
    for sign, following in itertools.pairwise(signs):
        assert sign.shape != following.shape
        assert sign.colour != following.colour


@pytest.mark.parametrize("colour", [*COLOURS, "#000000", "#ffffff", "#777777"])
def test_letter_contrasts_with_its_shape(colour: str) -> None:
    sign = ClassSign("A", "a class", "circle", colour)
    assert sign.ink in {"#000000", "#ffffff"}
    darker, lighter = sorted((luminance(sign.ink), luminance(colour)))
    assert (lighter + 0.05) / (darker + 0.05) >= 4.5


def test_every_output_format_draws_every_shape() -> None:
    assert list(OUTLINES) == list(CLASS_MARKERS) == list(MARKERS) == list(SHAPES)
