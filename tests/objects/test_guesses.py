from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from semsig_gis.objects.draft import Column, columns_of, guess_class, guess_class_by, guess_position
from semsig_gis.sources.vector.reader import LayerInfo
from semsig_gis.sources.vector.sample import Sample


def sample(*rows: dict[str, Any]) -> Sample:
    fields = tuple((name, "") for name in dict.fromkeys(name for row in rows for name in row))
    return Sample("opendatasoft", LayerInfo("x", "Point", None, len(rows), fields), rows)


def column(name: str, *values: object) -> Column:
    (found,) = columns_of(sample(*({name: value} for value in values)))
    return found


def test_only_fields_of_plain_values_are_looked_at() -> None:
    rows = sample(
        {"a": 1, "b": {"lon": 1}, "c": "x", "d": None, "e": b"wkb"},
        {"a": None, "b": None, "c": "", "d": None, "e": None},
    )
    found = columns_of(rows)
    assert [(item.name, dict(item.counts), item.missing) for item in found] == [
        ("a", {1: 1}, 1),
        ("c", {"x": 1}, 1),
        ("d", {}, 2),
    ]


@pytest.mark.parametrize(
    ("values", "unique", "few"),
    [
        ((), False, False),
        (("a",), True, False),
        (("a", "b"), True, False),
        (("a", "b", None), False, False),
        (("a", "a", "b", "b"), False, True),
        (("a", "a", "a", "a"), False, False),
        ((True, False, True, True), False, True),
        ((1, 2, 1, 2), False, False),
        (("1", "2", "1", "2"), False, False),
        (("2019-01-02T10:00", "b", "b", "b"), False, False),
        (("x" * 61, "b", "b", "b"), False, False),
        (("a", "b", "a", "b", *[None] * 40), False, False),
        (tuple("abcdefghijklm" * 3), False, False),
    ],
)
def test_identifiers_and_filters_are_told_apart(
    values: tuple[object, ...],
    unique: bool,  # noqa: FBT001
    few: bool,  # noqa: FBT001
) -> None:
    counts = Counter(value for value in values if value is not None)
    found = Column("x", counts, len(values) - counts.total())
    assert (found.unique, found.few) == (unique, few)


@pytest.mark.parametrize(
    ("name", "purpose"),
    [
        ("TYPE_D_OPÉ", "filter"),
        ("Kind", "filter"),
        ("IDBASE", "identifier"),
        ("cod_ouvrag", "identifier"),
        ("N° Voie", None),
        ("OBJECTID_1", "row_number"),
        ("POINT_X", "x"),
        ("Longitude", "x"),
        ("LONGUEUR", None),
        ("lat", "y"),
        ("latin", None),
    ],
)
def test_fields_are_known_by_their_names(name: str, purpose: str | None) -> None:
    purposes = ("filter", "identifier", "row_number", "x", "y")
    meant = [item for item in purposes if Column(name, Counter(), 0).meant_for(item)]
    assert meant == ([purpose] if purpose else [])


def test_the_class_is_guessed_by_name_then_values_then_fields() -> None:
    kind = column("amenity", "bench", "bench", "post box", "bench")
    species = column("espece", "Platanus", "Acer", "Acer", "Acer")
    named = guess_class("Fontaines", [kind, species], geometry="point", rows=4)
    assert (named.name, named.sure) == ("water_fountain", True)
    valued = guess_class("layer 1", [species, kind], geometry="point", rows=4)
    assert (valued.name, valued.sure) == ("bench", False)
    assert valued.reason == "from amenity = bench"
    fielded = guess_class("layer 1", [species], geometry=None, rows=4)
    assert (fielded.name, fielded.sure, fielded.reason) == (
        "alignment_tree",
        False,
        "from the field espece",
    )
    assert guess_class("layer 1", [], geometry="point", rows=4).name == ""


def test_an_area_is_not_a_class_because_of_what_it_says() -> None:
    kind = column("use", "tree", "tree")
    assert guess_class("districts", [kind], geometry="polygon", rows=2).name == ""


def test_a_name_that_means_two_things_says_so() -> None:
    guess = guess_class("bancs et corbeilles", [], geometry="line", rows=0)
    assert (guess.name, guess.others, guess.sure) == ("waste_basket", ("bench",), False)


@pytest.mark.parametrize(
    ("name", "geometry", "role"),
    [
        ("Batiments", "polygon", "buildings"),
        ("Gebäude", "polygon", "buildings"),
        ("Batiments", "point", ""),
        ("FilaireVoies", "line", "streets"),
        ("streets", "line", "streets"),
        ("streets", "polygon", ""),
    ],
)
def test_what_holds_no_objects_gets_a_role(name: str, geometry: str, role: str) -> None:
    guess = guess_class(name, [], geometry=geometry, rows=0)
    assert (guess.name, guess.is_role) == (role, bool(role))


def test_a_class_that_says_more_goes_before_a_role() -> None:
    guess = guess_class("street lights", [], geometry="line", rows=0)
    assert (guess.name, guess.is_role) == ("street_light", False)


def test_values_that_name_other_classes_are_found() -> None:
    kind = column("kind", *["Taxi", "Livraison", "GIG/GIC", "Autre"] * 3)
    assert guess_class_by([kind], "reserved_bay") == (
        "kind",
        {"Taxi": "taxi_station", "GIG/GIC": "disabled_bay"},
    )
    assert guess_class_by([column("kind", *["Taxi", "Autre"] * 3)], "taxi_station") is None
    assert guess_class_by([column("kind", "Taxi", "Bench")], "") is None  # each seen once


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ([{"place": "48.85, 2.35"}, {"place": "48.85,2.35"}], ("place",)),
        ([{"place": "48.85, 2.35"}, {"place": None}], ("place",)),
        ([{"place": "rue 1, 2"}], ()),
        ([{"x": 1, "y": 2}], ("x", "y")),
        ([{"lng": "2.3", "lat": "48.8"}], ("lng", "lat")),
        ([{"lng": "here", "lat": "there"}], ()),
        ([{"x": 1}], ()),
    ],
)
def test_positions_are_found_in_a_table(
    rows: list[dict[str, Any]], expected: tuple[str, ...]
) -> None:
    table = sample(*rows)
    assert guess_position(table, columns_of(table)) == expected
