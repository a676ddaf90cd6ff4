"""Words for classes."""

from __future__ import annotations

import tomllib
from collections import defaultdict

import pytest
from sentences import refused

from semsig_gis.core import WILDCARD, ObjectClass, Taxonomy, UnknownNameError
from semsig_gis.sources import (
    built_in_taxonomy,
    class_codes,
    data_folder,
    families,
    family_words,
    load_catalog,
    paper_taxonomy,
    words_of,
)

TAXONOMY = load_catalog("openstreetmap").taxonomy
WORDS = {
    "street_light": "D, street_light, Street light, lamp, Street Lamps, lamp-post, lampadaire, "
    "highway=street_lamp, highway = street_lamp",
    "bench": "L, Bench, Public bench, benches, the bench, banc, amenity=bench",
    "alignment_tree": "B, tree, trees, Baum, natural=tree",
    "bus_stop": "M, bus-stop, BusStop, bus stops, highway=bus_stop",
    "indicator": "sign, traffic signs, traffic_sign=maxspeed",
    "pedestrian_crossing": "zebra crossing, crossing=zebra",
    "parking_meter": "vending=parking_tickets",
    "waste_basket": "bin, litter bins, trash cans",
}


@pytest.mark.parametrize("name", WORDS)
def test_word_for_a_class(name: str) -> None:
    for word in WORDS[name].split(", "):
        assert class_codes(word, TAXONOMY) == (TAXONOMY.by_name(name).code,), word


@pytest.mark.parametrize("word", ["?", "unknown", " Unknown "])
def test_word_for_the_unknown_class(word: str) -> None:
    assert class_codes(word, TAXONOMY) == (WILDCARD,)


def test_names_of_classes_are_words() -> None:
    for item in TAXONOMY.classes:
        for word in (item.symbol, item.name, item.title):
            assert class_codes(word, TAXONOMY) == (item.code,), word


def test_names_of_the_taxonomy_have_priority() -> None:
    own = Taxonomy((ObjectClass(7, "W", "lamp", "Wall lamp"), ObjectClass(3, "D", "light", "Pole")))
    assert [class_codes(word, own) for word in ("lamp", "wall lamps", "pole")] == [(7,), (7,), (3,)]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("lampe", "the nearest is 'lamp'"),
        ("treehouse", "the nearest is 'Tree'"),
        ("fire hydrant", "'fire hydrant' is unknown"),
        ("highway=crossing", "`semsig info` lists the classes of a city"),
        ("", "class '' is unknown"),
        ("b", "symbol 'b' is unknown; the nearest is 'B'"),
    ],
)
def test_unknown_word_is_refused_with_the_nearest(word: str, message: str) -> None:
    with refused(UnknownNameError, message):
        class_codes(word, paper_taxonomy())


KEYWORDS = tomllib.loads((data_folder() / "keywords.toml").read_text(encoding="utf-8"))
LANGUAGES = ("en", "de", "fr", "es", "it", "pt")


def test_classes_and_families_have_words_in_six_languages() -> None:
    every = built_in_taxonomy()
    names = {item.name for item in every.classes}
    assert set(KEYWORDS["classes"]) == names
    assert {item.family for item in every.classes} <= set(KEYWORDS["families"])
    for name, table in {**KEYWORDS["families"], **KEYWORDS["classes"]}.items():
        assert set(table.get("classes", ())) <= names
        for language in LANGUAGES:
            # English has the name itself.
            assert language == "en" or table.get(language) or table["said"].get(language), name


def test_word_that_people_say_is_for_one_class() -> None:
    every = built_in_taxonomy()
    classes: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for name, table in KEYWORDS["classes"].items():
        tables = {**table.get("said", {}), "name": [name.replace("_", " ")]}
        for language, phrases in tables.items():
            for phrase in phrases:
                assert phrase == phrase.lower()
                assert phrase.isascii(), phrase
                classes[language]["".join(words_of(phrase))].add(name)
    for language, words in classes.items():
        for word, names in words.items():
            assert len(names) == 1, (language, word, names)
    # A word for several classes may be one for some of these.
    codes = {item.name: item.code for item in every.classes}
    for language, several, phrase in family_words(every):
        for name in classes[language]["".join(words_of(phrase))]:
            assert codes[name] in several, (language, phrase, name)


def test_word_for_a_family_is_for_its_classes_in_the_taxonomy() -> None:
    every = built_in_taxonomy()
    assert class_codes("shops", every) == tuple(every.family_codes("shop"))
    some = Taxonomy((every.by_name("bakery"), every.by_name("rails")))
    assert families(some)["shop"] == (every.by_name("bakery").code,)
    assert class_codes("track", some) == (every.by_name("rails").code,)
    with refused(UnknownNameError, "'church' is unknown"):
        class_codes("church", some)
    # The names of classes are theirs, also where a family has the word.
    assert class_codes("tower", every) == (every.by_name("tower").code,)


def test_a_family_of_own_classes_is_understood() -> None:
    stalls = [
        ObjectClass(230, "1", "fruit_stall", "Fruit stall", family="market_stall"),
        ObjectClass(231, "2", "fish_stall", "Fish stall", family="market_stall"),
    ]
    assert families(paper_taxonomy().extended(stalls))["market_stall"] == (230, 231)
    assert class_codes("market stall", paper_taxonomy().extended(stalls)) == (230, 231)
