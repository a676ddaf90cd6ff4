from __future__ import annotations

import dataclasses
import string
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import refused

from semsig_gis.core import CatalogError, ObjectClass, Taxonomy, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Callable

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
def test_decode_is_the_inverse_of_encode(taxonomy: Taxonomy, data: st.DataObject) -> None:
    symbols = "".join(item.symbol for item in taxonomy.classes)
    text = data.draw(st.text(symbols, max_size=40))
    codes = taxonomy.encode(text)
    assert codes.dtype == np.uint8
    assert len(codes) == len(text)
    assert taxonomy.decode(codes) == text
    assert taxonomy.decode(codes.tolist()) == text


@given(taxonomies())
def test_class_is_found_by_name_code_and_symbol(taxonomy: Taxonomy) -> None:
    for item in taxonomy.classes:
        assert taxonomy.by_name(item.name) is item
        assert taxonomy.by_code(item.code) is item
        assert taxonomy.by_symbol(item.symbol) is item
    assert Taxonomy.from_list(taxonomy.to_list()) == taxonomy


OTHER = ObjectClass(1, "B", "tree", "Tree")
BAD_CODES = (0, -1, 256, 1.0, True, "1", None)
BAD_SYMBOLS = ("", "BB", "日", "-", " ", "B\n", "٣", 5, None)
BAD_NAMES = ("", "Tree", "tree-1", "1tree", "arbre à fruits", "tree\n", 7)
BAD_FAMILIES = ("Shop", "!!!", "shop ", 7)


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        *(("code", bad, ("'tree'", f"code = {bad!r}", "1 to 255")) for bad in BAD_CODES),
        *(
            ("symbol", bad, ("'tree'", f"symbol = {bad!r}", "one letter or digit"))
            for bad in BAD_SYMBOLS
        ),
        *(("name", bad, (repr(bad), "lower-case")) for bad in BAD_NAMES),
        *(("family", bad, (repr(bad), "lower-case")) for bad in BAD_FAMILIES),
    ],
)
def test_invalid_code_symbol_or_name_is_refused(
    attribute: str, value: object, words: tuple[str, ...]
) -> None:
    with refused(CatalogError, *words):
        dataclasses.replace(OTHER, **{attribute: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("height", "sigma"),
    [(2.0, None), (None, 1.0), (0.0, 1.0), (2.0, 0.0), (2.0, 3.0), (999.0, 1.0)],
)
def test_height_needs_a_deviation(height: float | None, sigma: float | None) -> None:
    with refused(CatalogError, "'tree'", "height_", "above 0 and up to 500"):
        dataclasses.replace(OTHER, height_m=height, height_sigma=sigma)
    tall = Taxonomy((dataclasses.replace(OTHER, height_m=9.0, height_sigma=4.0),))
    assert Taxonomy.from_list(tall.to_list()) == tall


def test_titles_do_not_distinguish_taxonomies() -> None:
    titled = TAXONOMY.with_titles({"alignment_tree": "Baum"})
    assert titled == TAXONOMY
    assert [item["title"] for item in titled.to_list()] == ["Baum", "Street light"]
    assert Taxonomy.from_list(titled.to_list()).words([1, 1, 3, 0]) == (
        "2 × baum, street light, something"
    )
    assert titled.words([]) == "nothing"
    with refused(UnknownNameError, "code 7"):
        titled.words([7])
    with refused(UnknownNameError, "'street_ligth'", "nearest is 'street_light'"):
        TAXONOMY.with_titles({"street_ligth": "Lampe"})


@pytest.mark.parametrize("attribute", ["code", "symbol", "name"])
def test_duplicate_code_symbol_or_name_is_refused(attribute: str) -> None:
    value = getattr(TREE, attribute)
    other = dataclasses.replace(ObjectClass(9, "Z", "other", "Other"), **{attribute: value})
    with refused(CatalogError, f"{attribute} {value!r}", "'alignment_tree'", repr(other.name)):
        TAXONOMY.extended([other])


def test_extended_does_not_change_the_taxonomy() -> None:
    bench = ObjectClass(10, "L", "bench", "Bench")
    assert TAXONOMY.extended(iter([bench])).classes == (TREE, LIGHT, bench)
    assert TAXONOMY.classes == (TREE, LIGHT)


@pytest.mark.parametrize(
    ("look_up", "value", "words"),
    [
        (TAXONOMY.by_name, "street_ligth", ("'street_ligth'", "the nearest is 'street_light'")),
        *(
            (TAXONOMY.by_symbol, symbol, (f"symbol {symbol!r} is unknown", "--symbols"))
            for symbol in ("", "DD", "Z", "é")
        ),
        (TAXONOMY.encode, "DDZB", ("'Z'", "`semsig info --symbols`")),
        (TAXONOMY.encode, "Dd", ("'d'", "the nearest is 'D'")),
        (TAXONOMY.by_code, 2, ("class code 2", "1, 3")),
    ],
)
def test_error_names_an_unknown_class(
    look_up: Callable[[object], object], value: object, words: tuple[str, ...]
) -> None:
    with refused(UnknownNameError, *words):
        look_up(value)


def test_table_of_symbols_is_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        TAXONOMY.symbol_points[1] = 0
    assert TAXONOMY.decode([1, 2, 3]) == "B?D"
    assert not TAXONOMY.decode([])
