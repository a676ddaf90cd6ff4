from __future__ import annotations

import dataclasses
import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence

from semsig_gis.core.errors import CatalogError, UnknownNameError
from semsig_gis.core.taxonomy import ObjectClass, Taxonomy

TREE = ObjectClass(1, "B", "alignment_tree", "Alignment tree")
LIGHT = ObjectClass(3, "D", "street_light", "Street light")
TAXONOMY = Taxonomy((TREE, LIGHT))


@st.composite
def taxonomies(draw: st.DrawFn) -> Taxonomy:
    codes = draw(st.lists(st.integers(1, 255), min_size=1, max_size=62, unique=True))
    symbols = draw(st.permutations(string.ascii_letters + string.digits))
    return Taxonomy(
        tuple(
            ObjectClass(code, symbol, f"class_{code}", f"Class {code}")
            for code, symbol in zip(codes, symbols, strict=False)
        )
    )


@given(taxonomies(), st.data())
def test_decoding_undoes_encoding(taxonomy: Taxonomy, data: st.DataObject) -> None:
    symbols = "".join(item.symbol for item in taxonomy.classes)
    text = data.draw(st.text(symbols, max_size=40))
    codes = taxonomy.encode(text)
    assert codes.dtype == np.uint8
    assert len(codes) == len(text)
    assert taxonomy.decode(codes) == text
    assert taxonomy.decode(codes.tolist()) == text


@given(taxonomies())
def test_a_class_is_found_by_each_of_its_names(taxonomy: Taxonomy) -> None:
    for item in taxonomy.classes:
        assert taxonomy.by_name(item.name) is item
        assert taxonomy.by_code(item.code) is item
        assert taxonomy.by_symbol(item.symbol) is item
    assert Taxonomy.from_list(taxonomy.to_list()) == taxonomy


@pytest.mark.parametrize("code", [0, -1, 256, 1.0, True, "1", None])
def test_a_code_is_a_whole_number_of_one_byte(code: object) -> None:
    with pytest.raises(CatalogError) as caught:
        ObjectClass(code, "B", "tree", "Tree")  # type: ignore[arg-type]
    assert_sentence(caught.value, "'tree'", f"code {code!r}", "1 to 255")


@pytest.mark.parametrize("symbol", ["", "BB", "é", "-", " ", "B\n", "٣", 5, None])
def test_a_symbol_is_one_ascii_letter_or_digit(symbol: object) -> None:
    with pytest.raises(CatalogError) as caught:
        ObjectClass(1, symbol, "tree", "Tree")  # type: ignore[arg-type]
    assert_sentence(caught.value, "'tree'", f"symbol {symbol!r}", "ASCII letter or digit")


@pytest.mark.parametrize("name", ["", "Tree", "tree-1", "1tree", "arbre à fruits", "tree\n", 7])
def test_a_name_is_a_lower_case_identifier(name: object) -> None:
    with pytest.raises(CatalogError) as caught:
        ObjectClass(1, "B", name, "Tree")  # type: ignore[arg-type]
    assert_sentence(caught.value, repr(name), "lower-case")


@pytest.mark.parametrize(
    ("attribute", "other"),
    [
        ("code", ObjectClass(1, "Z", "other", "Other")),
        ("symbol", ObjectClass(9, "B", "other", "Other")),
        ("name", ObjectClass(9, "Z", "alignment_tree", "Other")),
    ],
)
def test_what_stands_twice_is_named(attribute: str, other: ObjectClass) -> None:
    value = repr(getattr(other, attribute))
    with pytest.raises(CatalogError) as made:
        Taxonomy((TREE, LIGHT, other))
    with pytest.raises(CatalogError) as extended:
        TAXONOMY.extended([other])
    with pytest.raises(CatalogError) as listed:
        Taxonomy.from_list([*TAXONOMY.to_list(), dataclasses.asdict(other)])
    for caught in (made, extended, listed):
        assert_sentence(caught.value, f"{attribute} {value}", "'alignment_tree'", repr(other.name))


def test_extending_leaves_the_taxonomy_as_it_was() -> None:
    bench = ObjectClass(10, "L", "bench", "Bench")
    assert TAXONOMY.extended(iter([bench])).classes == (TREE, LIGHT, bench)
    assert TAXONOMY.classes == (TREE, LIGHT)
    with pytest.raises(dataclasses.FrozenInstanceError):
        TAXONOMY.classes = ()  # type: ignore[misc]


def test_an_unknown_name_is_offered_the_nearest() -> None:
    with pytest.raises(UnknownNameError) as caught:
        TAXONOMY.by_name("street_ligth")
    assert_sentence(caught.value, "'street_ligth'", "the nearest is 'street_light'")


@pytest.mark.parametrize("symbol", ["", "DD", "Z", "é"])
def test_only_a_symbol_finds_a_class(symbol: str) -> None:
    with pytest.raises(UnknownNameError) as caught:
        TAXONOMY.by_symbol(symbol)
    assert_sentence(caught.value, f"symbol {symbol!r} is unknown", "D street light")


def test_an_unknown_symbol_in_a_sequence_is_named() -> None:
    with pytest.raises(UnknownNameError) as caught:
        TAXONOMY.encode("DDZB")
    assert_sentence(caught.value, "'Z'", "B alignment tree, D street light")
    with pytest.raises(UnknownNameError) as caught:
        TAXONOMY.encode("Dd")
    assert_sentence(caught.value, "'d'", "the nearest is 'D'")


def test_an_unknown_code_is_named() -> None:
    with pytest.raises(UnknownNameError) as caught:
        TAXONOMY.by_code(2)
    assert_sentence(caught.value, "class code 2", "[1, 3]")


def test_the_table_of_symbols_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        TAXONOMY.symbol_bytes[1] = 0
    assert TAXONOMY.decode([1, 2, 3]) == "B?D"
    assert not TAXONOMY.decode([])
