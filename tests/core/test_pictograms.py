"""Every class of the catalogues that come with semsig has a pictogram of its own."""

from __future__ import annotations

import pytest
from fontTools.pens.boundsPen import BoundsPen
from fontTools.svgLib.path import parse_path

from semsig_gis.core import (
    GENERAL_PICTOGRAM,
    PICTOGRAMS,
    ObjectClass,
    Taxonomy,
    class_signs,
)
from semsig_gis.sources import built_in_taxonomy

DRAWINGS = {**PICTOGRAMS, "another class": GENERAL_PICTOGRAM}

CLASSES = built_in_taxonomy().classes


@pytest.mark.parametrize("name", [item.name for item in CLASSES])
def test_a_class_that_comes_with_semsig_has_a_pictogram(name: str) -> None:
    assert name in PICTOGRAMS


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_pictogram_fills_its_box(name: str) -> None:
    pen = BoundsPen(None)
    parse_path(DRAWINGS[name], pen)
    left, top, right, bottom = pen.bounds
    assert 0.0 <= left < right <= 16.0
    assert 0.0 <= top < bottom <= 16.0
    assert max(right - left, bottom - top) > 12.0


def test_pictograms_differ() -> None:
    assert len({*DRAWINGS.values()}) == len(DRAWINGS)


def test_a_sign_has_the_pictogram_of_its_class() -> None:
    kiosk = ObjectClass(name="kiosk", title="Kiosk", code=90, symbol="x")
    signs = class_signs(Taxonomy((CLASSES[0], kiosk)))
    assert signs[CLASSES[0].code].pictogram == PICTOGRAMS[CLASSES[0].name]
    assert signs[90].pictogram == GENERAL_PICTOGRAM
