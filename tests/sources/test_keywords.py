"""Words for classes."""

from __future__ import annotations

import pytest
from sentences import refused

from semsig_gis.core import WILDCARD, ObjectClass, Taxonomy, UnknownNameError
from semsig_gis.sources import class_codes, load_catalog, paper_taxonomy

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
