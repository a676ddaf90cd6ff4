"""Views: photos, sectors, ranges and scores."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import column, parts_of
from sentences import refused

from semsig_gis import paper_taxonomy
from semsig_gis.core import InputError, Signature
from semsig_gis.observation import FULL_VIEW, Photo, View, parse_view

if TYPE_CHECKING:
    from collections.abc import Callable

ANGLES = st.floats(-360, 720, allow_nan=False)


def _width(low: float, high: float) -> float:
    return high - low if 0 < high - low <= 360.0 else (high - low) % 360.0


SECTORS = st.tuples(ANGLES, ANGLES).filter(lambda sector: _width(*sector) > 0)


@given(st.lists(SECTORS, max_size=5))
def test_photo_sees_bearings_of_all_sectors(sectors: list[tuple[float, float]]) -> None:
    photo = Photo(sectors=tuple(sectors))
    bearings = np.arange(0.5, 360.0, 7.3)
    inside = np.full(len(bearings), not sectors)
    rounded = np.zeros(len(bearings), bool)
    for low, high in sectors:
        beyond = (bearings - low) % 360.0 - _width(low, high)
        inside |= beyond <= 0
        rounded |= np.abs(beyond) < 1e-6
    assert (photo.sees(bearings) == inside)[~rounded].all()
    assert 0 < photo.width <= 360.0


def test_turned_view_has_turned_photos() -> None:
    view = View.of(
        Signature(np.array([3, 1], np.uint8), np.array([10.0, 350.0])),
        ranges=np.array([5.0, math.nan]),
        photos=(Photo.looking(heading=0, fov=40, north_sigma=math.inf),),
    )
    turned = view.turned(20.0)
    codes, bearings = parts_of(turned)
    assert bearings.tolist() == [10.0, 30.0]
    assert codes.tolist() == [1, 3]
    assert column(turned, "ranges")[1] == 5.0
    assert turned.photos[0].sectors == ((0.0, 40.0),)
    assert turned.photos[0].sees(bearings).all()


def test_joined_views_are_split_again() -> None:
    first = View.of(
        Signature(np.array([3], np.uint8), np.array([10.0])),
        photos=(Photo.looking(heading=0, fov=40, north_sigma=5.0),),
    )
    second = View.of(Signature(None, np.array([200.0, 210.0])), ranges=np.array([3.0, 9.0]))
    both = View.joined([first, second])
    assert len(both) == 3
    parts = both.split()
    assert [part.photos for part in parts] == [first.photos, (FULL_VIEW,)]
    assert column(parts[1], "codes").tolist() == [0, 0]
    assert column(parts[1], "ranges").tolist() == [3.0, 9.0]
    assert parts[0].class_scores()[0, 3] == 1.0


def test_texts_stay_with_their_objects() -> None:
    lamps = Signature(np.array([3, 1], np.uint8), np.array([10.0, 350.0]))
    view = View.of(lamps, texts=("  Boulangerie  Paul ", ""), signs=("Rue du Pau", ""))
    assert view.texts == ("Boulangerie Paul", "")
    assert view.turned(20.0).texts == ("", "Boulangerie Paul")
    assert view.select(np.array([False, True])).texts is None
    both = View.joined([LAMP, view])
    assert (both.texts, both.signs) == (("", "Boulangerie Paul", ""), ("Rue du Pau",))
    assert [(part.texts, part.signs) for part in both.split()] == [
        (None, ("Rue du Pau",)),
        (("Boulangerie Paul", ""), ()),
    ]
    taxonomy = paper_taxonomy()
    row = both.turned(0.0).to_dict(taxonomy)
    again = parse_view({**row}, taxonomy=taxonomy)
    assert again.to_dict(taxonomy) == row
    assert "texts" not in View.of(LAMP).to_dict(taxonomy)


def test_row_of_a_sign_is_a_view() -> None:
    view = parse_view({"signs": ["Rue du Pau", 12, None]}, taxonomy=paper_taxonomy())
    assert (len(view), view.signs) == (0, ("Rue du Pau", "12"))


LAMP = Signature(np.array([3], np.uint8), np.array([80.0]))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: View.of(LAMP, ranges=[1.0, 2.0]), "2 ranges were given for 1 objects"),
        (lambda: View.of(LAMP, ranges=[-1.0]), "a range is -1"),
        (lambda: View.of(LAMP, range_errors=[9.0]), "a range error is 9"),
        (lambda: View.of(LAMP, scores=np.zeros((1, 256))), "add up to 1"),
        (lambda: View.of(LAMP, texts=("a", "b")), "2 texts were given for 1 objects"),
        (lambda: View.of(LAMP, texts="a"), "give a list of text"),
        (lambda: View.of(LAMP, signs=(12,)), "give a list of text"),
        (lambda: View.of(LAMP, photo=[1]), "a photo that is not there"),
        (lambda: View.of(LAMP, photos=()), "a view of no photo"),
        (lambda: Photo(sectors=((10, 10),)), "sees nothing"),
        (lambda: Photo(sectors=((10, 1000),)), "a sector is 1000"),
        (lambda: Photo(north_sigma=-1), "deviation of north"),
        (lambda: Photo.looking(heading=0, fov=0), "field of view"),
        (lambda: Photo.looking(heading=math.nan, fov=70), "heading is nan"),
    ],
)
def test_invalid_views_and_photos_are_refused(make: Callable[[], object], words: str) -> None:
    with refused(InputError, words):
        make()
