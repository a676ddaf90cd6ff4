"""Every class of the catalogues that come with semsig has a pictogram, of its own or its family."""

from __future__ import annotations

import pytest
from fontTools.pens.boundsPen import BoundsPen
from fontTools.svgLib.path import parse_path

from semsig_gis.core import (
    FAMILIES,
    GENERAL_PICTOGRAM,
    PICTOGRAMS,
    ObjectClass,
    Taxonomy,
    class_signs,
)
from semsig_gis.sources import built_in_taxonomy

DRAWINGS = {
    **PICTOGRAMS,
    "another class": GENERAL_PICTOGRAM,
    **{f"family {name}": family.pictogram for name, family in FAMILIES.items()},
}

CLASSES = built_in_taxonomy().classes


def test_a_class_that_comes_with_semsig_has_a_pictogram() -> None:
    signs = class_signs(Taxonomy(CLASSES))
    assert [item.name for item in CLASSES if signs[item.code].pictogram == GENERAL_PICTOGRAM] == []


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


def test_a_sign_has_the_pictogram_and_a_shade_of_its_family() -> None:
    kinds = [
        ObjectClass(code, letter, f"stall_{code}", f"Stall {code}", family="shop")
        for code, letter in enumerate("\u0416\u03a9\u00c6", start=90)
    ]
    signs = class_signs(Taxonomy((CLASSES[0], *kinds)))
    assert {signs[code].pictogram for code in (90, 91, 92)} == {FAMILIES["shop"].pictogram}
    assert len({signs[code].colour for code in (90, 91, 92)}) == 3
    assert signs[90].colour == FAMILIES["shop"].colour
    assert signs[CLASSES[0].code] == class_signs(Taxonomy(CLASSES[:1]))[CLASSES[0].code]
