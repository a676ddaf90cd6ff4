"""Views that say a family of classes, or one of some classes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import random_database
from sentences import refused

from semsig_gis.core import InputError, ObjectClass, Taxonomy
from semsig_gis.localization import (
    LikelihoodLocator,
    NoiseSpec,
    background_loglik,
    build_index,
    explain_cell,
    locate,
    named_noise,
)
from semsig_gis.observation import View

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase

FAMILIES = {1: "shop", 2: "shop", 3: "food", 4: "", 5: "shop", 6: "worship"}
TAXONOMY = Taxonomy(
    tuple(
        ObjectClass(code, "abcdef"[code - 1], name, name.capitalize(), family=FAMILIES[code])
        for code, name in enumerate(
            ("bakery", "butcher", "cafe", "statue", "florist", "church"), start=1
        )
    )
)


def city(seed: int) -> SignatureDatabase:
    """Return cells that see the first four classes: neither a florist nor a church."""
    return replace(random_database(seed), taxonomy=TAXONOMY)


def said(view: View, *rows: tuple[int, ...]) -> View:
    """Return a view in which each of the first objects is of any of some classes."""
    scores = view.class_scores()
    for number, codes in enumerate(rows):
        scores[number] = 0.0
        scores[number, list(codes)] = 1.0 / len(codes)
    return replace(view, codes=np.zeros(len(view), np.uint8), scores=scores)


@given(st.integers(0, 99))
def test_a_family_is_its_classes_that_the_city_has(seed: int) -> None:
    database = city(seed)
    index = build_index(database, NoiseSpec(misnamed=0.1))
    view = View.of(database.signature(int(database.lengths.argmax())))
    present, shop = said(view, (1, 2)), said(view, (1, 2, 5))
    assert (index.scores(shop).loglik == index.scores(present).loglik).all()
    assert background_loglik(index, shop) == background_loglik(index, present)
    assert locate(index, shop).fit == locate(index, present).fit
    with refused(InputError, "class code 6, which no cell of the database sees"):
        index.scores(said(view, (6,)))


@given(st.integers(0, 99))
def test_a_family_says_less_than_its_class_and_more_than_nothing(seed: int) -> None:
    database = city(seed)
    index = build_index(database, named_noise("by-hand"))
    cell = int(database.lengths.argmax())
    view = View.of(database.signature(cell))
    any_class = replace(view, codes=np.zeros(len(view), np.uint8))
    families = [
        {1: (1, 2), 2: (1, 2)}.get(code, (code,))
        for code in view.class_scores().argmax(axis=1).tolist()
    ]

    def evidence(query: View) -> float:
        scores = index.scores(query).loglik.astype(float)
        return float(scores[cell] - np.logaddexp.reduce(scores))

    assert evidence(view) >= evidence(said(view, *families)) - 1e-6
    assert evidence(said(view, *families)) >= evidence(any_class) - 1e-6
    assert locate(index, said(view, *families)).fit == pytest.approx(
        locate(index, view).fit, abs=0.35
    )


def test_an_explanation_names_the_family_and_the_class_of_the_map() -> None:
    database = city(3)
    row = int(np.flatnonzero(database.lengths > 3)[0])
    view = View.of(database.signature(row))
    shops = [
        (1, 2, 5) if code in {1, 2} else (int(code), 6)
        for code in view.class_scores().argmax(axis=1)
    ]
    query = said(view, *shops)
    explanation = explain_cell(query, row, named_noise("light"), database=database)
    assert explanation.counts["matched"] == len(view)
    for item in explanation.rows:
        if item["object_class"] in {"bakery", "butcher"}:
            assert item["query_class"] == "shop"
        else:
            assert item["query_class"] == f"{item['object_class']} or church"
    location = locate(build_index(database, named_noise("light")), query, explained=1)
    first = location.explain()["you said"].tolist()[0]
    assert first.startswith(("shop at", "cafe or church at", "statue or church at"))


def test_families_without_directions_are_compared() -> None:
    database = city(5)
    index = build_index(database, named_noise("by-hand"))
    row = int(database.lengths.argmax())
    codes = View.of(database.signature(row)).class_scores().argmax(axis=1).astype(np.uint8)
    rows = ({1: (1, 2, 5), 2: (1, 2, 5)}.get(code, (code,)) for code in codes.tolist())
    view = said(View(codes, None), *rows)
    logliks = LikelihoodLocator(index=index).scores(view).loglik
    nothing = View(np.zeros(len(codes), np.uint8), None)
    assert logliks[row] - logliks.mean() > np.ptp(index.scores(nothing).loglik) * 0.1
    assert locate(index, view).answer.mass > 0


def test_a_lacking_family_is_noted() -> None:
    database = city(7)
    index = build_index(database, named_noise("by-hand"))
    view = View(np.array([0, 3], np.uint8), np.array([10.0, 80.0]), scores=np.eye(256)[[6, 3]])
    (note,) = locate(index, said(view, (6,))).notes
    assert note == "the map has no church, so this object was not used."
