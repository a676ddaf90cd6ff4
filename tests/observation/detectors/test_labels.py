"""Label maps: built-in maps and own files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from sentences import refused

from semsig_gis.core import CatalogError, InputError, Taxonomy, UnknownNameError
from semsig_gis.observation import LabelMap, Meaning, label_maps
from semsig_gis.sources import built_in_taxonomy, paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

ALL = LabelMap.open([], built_in_taxonomy())


def test_built_in_maps() -> None:
    assert label_maps() == (
        *("ade20k", "cityscapes", "coco", "lvis", "mapillary_vistas", "objects365", "open_images"),
        "panoramax",
    )
    with refused(UnknownNameError, "'cocoa'", "the nearest is 'coco'"):
        LabelMap.open(["cocoa"], paper_taxonomy())


@pytest.mark.parametrize(
    ("label", "classes"),
    [
        ("fire hydrant", ["fire_hydrant"]),
        ("Fire_Hydrant", ["fire_hydrant"]),
        ("traffic light", ["traffic_light"]),
        ("object--street-light", ["street_light"]),
        ("Street Light", ["street_light"]),
        ("object--traffic-light--general-upright-front", ["traffic_light"]),
        ("object--traffic-sign--front", ["indicator"]),
        ("regulatory--stop--g1", ["indicator"]),
        ("marking--discrete--crosswalk-zebra", ["pedestrian_crossing"]),
        ("pole", ["street_light", "indicator", "traffic_light"]),
        ("trash bin Can", ["waste_basket", "waste_container"]),
        ("telephone_pole", ["power_pole"]),
        ("Waste container", ["waste_basket", "waste_container"]),
        ("ashcan", ["waste_basket"]),
        ("construction--flat--rail-track", ["rails", "tram_track"]),
        ("Signage - Advertisement", ["advertising_column", "billboard", "poster_box"]),
        ("fast food", []),
        ("person", []),
        ("marking--general", []),
        ("object--vehicle--car", []),
        ("taxi_station", ["taxi_station"]),  # by its own name
        ("Taxi station", ["taxi_station"]),
        ("litter bins", ["waste_basket"]),  # by a word for it
    ],
)
def test_classes_of_labels(label: str, classes: list[str]) -> None:
    meaning = ALL.find(label)
    assert meaning is not None
    assert [name for name, _ in meaning.classes] == classes


@pytest.mark.parametrize("name", label_maps())
def test_chances_of_built_in_maps_are_at_most_one(name: str) -> None:
    for taxonomy in (built_in_taxonomy(), paper_taxonomy()):
        for _, meaning in LabelMap.open([name], taxonomy).meanings:
            assert sum(share for _, share in meaning.classes) <= 1 + 1e-9


def test_family_is_any_of_its_classes_in_the_city(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        '[labels]\nfront = "shop"\nsign = { class = { shop = 0.6, indicator = 0.2 } }\n'
    )
    every = built_in_taxonomy()
    shops = [every.by_code(code).name for code in every.family_codes("shop")]
    meaning = LabelMap.open([mine], every).find("front")
    assert meaning is not None
    assert dict(meaning.classes) == pytest.approx(dict.fromkeys(shops, 1.0 / len(shops)))
    city = Taxonomy((every.by_name("bakery"), every.by_name("bank"), every.by_name("butcher")))
    meaning = LabelMap.open([mine], city).find("sign")
    assert meaning is not None
    assert dict(meaning.classes) == pytest.approx({"bakery": 0.3, "butcher": 0.3, "indicator": 0.2})


def test_sign_of_panoramax_is_plate() -> None:
    meaning = Meaning((("indicator", 1.0),), height=(0.7, 0.2))
    assert ALL.find("traffic_sign=FR:B14") == meaning
    assert ALL.find("highway=street_lamp") == Meaning((("street_light", 1.0),))


def test_unknown_labels_have_no_meaning() -> None:
    assert ALL.find("lion") is None
    assert ALL.find("unknown") is None
    assert LabelMap.open(["cityscapes"], paper_taxonomy()).find("object--bench") is None


def test_earlier_map_has_priority(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'left_out = ["bench*"]\n[labels]\nlamp = "street_light"\n'
        '"mast?" = { class = { street_light = 0.5, indicator = 0.25 }, part = true }\n'
        'bin = { class = "bollard", height_m = 1.1, height_sigma = 0.1 }\n'
    )
    labels = LabelMap.open([mine, "coco"], paper_taxonomy())
    assert labels.find("Lamp") == Meaning((("street_light", 1.0),))
    assert labels.find("mast2") == Meaning((("street_light", 0.5), ("indicator", 0.25)), part=True)
    assert labels.find("bin") == Meaning((("bollard", 1.0),), height=(1.1, 0.1))
    assert labels.find("benches") == Meaning(())
    assert labels.find("bench") == Meaning((("bench", 1.0),))  # exact in COCO
    assert labels.find("fire hydrant") is not None


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("lables = 3", CatalogError, "'lables', which is unknown; the nearest is 'labels'"),
        ("left_out = 3", CatalogError, "write a list"),
        ('[labels]\na = "lamp"', CatalogError, "label 'a' has the class 'lamp', which is unknown"),
        ("[labels]\na = 3", CatalogError, "label 'a' has class = 3; write the name"),
        ("[labels]\na = { bench = 1 }", CatalogError, "'bench', which is unknown"),
        ("[labels]\na = { part = true }", CatalogError, "lacks the key 'class'"),
        ("[labels]\na = { class = {} }", CatalogError, "write the name of a class"),
        (
            "[labels]\na = {class = {bench = 1, indicator = 1}}",
            CatalogError,
            "sum to 1 at most",
        ),
        ("[labels]\na = { class = { bench = -1 } }", CatalogError, "sum to 1 at most"),
        ('[labels]\na = { class = "bench", height_m = 2 }', CatalogError, "height_sigma"),
        (
            '[labels]\na = { class = "bench", height_m = "2", height_sigma = 1 }',
            CatalogError,
            "write metres",
        ),
        ("a", CatalogError, "is not valid TOML"),
        (None, InputError, "cannot be read"),
    ],
)
def test_invalid_map_is_refused(
    text: str | None, error: type[Exception], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    if text is not None:
        path.write_text(text)
    with refused(error, "mine.toml", words):
        LabelMap.open([path], paper_taxonomy())
