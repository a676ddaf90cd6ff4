from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semsig_gis.objects.draft import Keywords, Match, keywords, words_of
from semsig_gis.sources.catalog import catalog_names, load_catalog, paper_taxonomy


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ()),
        ("VilleMTP_MTP_ArbresAlign", ("ville", "mtp", "mtp", "arbres", "align")),
        ("les-arbres", ("arbres",)),
        ("Fontaines à boire", ("fontaines", "boire")),
        ("Straßenbäume", ("strassenbaume",)),
        ("EspacesVerts2011", ("espaces", "verts", "2011")),
        ("POINT_X", ("point", "x")),
        ("Coord_Y", ("coord", "y")),
        ("œuvre n°7", ("œuvre", "n", "7")),
        ("日本 tree", ("日本", "tree")),
    ],
)
def test_names_are_taken_apart(text: str, words: tuple[str, ...]) -> None:
    assert words_of(text) == words


@given(st.text(max_size=40))
def test_words_are_words_again(text: str) -> None:
    words = words_of(text)
    assert words_of(" ".join(words)) == words


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("les-arbres", ["alignment_tree"]),
        ("Baumkataster_Berlin", ["alignment_tree"]),
        ("Straßenbäume", ["alignment_tree"]),
        ("arbolado viario", ["alignment_tree"]),
        ("street_trees", ["alignment_tree"]),
        ("streetlights", ["street_light"]),
        ("street", []),
        ("fontaines-a-boire", ["water_fountain"]),
        ("EclairagePublic", ["street_light"]),
        ("signalisation-tricolore", ["traffic_light"]),
        ("Signalisation", ["indicator", "traffic_light"]),
        ("coord-feurouge_west", ["traffic_light"]),
        ("Ampeln", ["traffic_light"]),
        ("velib-emplacement-des-stations", ["bike_station"]),
        ("sanisettesparis", ["automatic_wc"]),
        ("WCPublic", ["automatic_wc"]),
        ("wcs", ["automatic_wc"]),
        ("wcxyz", []),
        ("bornes-d-appel-taxi", ["taxi_station"]),
        ("bornes-dappel-taxi", ["taxi_station"]),
        ("Autolib_dataset", ["car_station"]),
        ("bancs et corbeilles", ["waste_basket", "bench"]),
        ("arrêts de bus", ["bus_stop"]),
        ("BusStops", ["bus_stop"]),
        ("fermate_atac", ["bus_stop"]),
        ("semafori", ["traffic_light"]),
        ("PassagesPiet", ["pedestrian_crossing"]),
        ("PlacesGIG", ["disabled_bay"]),
        ("parking meters", ["parking_meter"]),
        ("BoiteLettre", ["post_box"]),
        ("boîtes aux lettres", ["post_box"]),
        ("arrondissements", []),
        ("limite commune", []),
    ],
)
def test_layers_are_recognised_by_their_names(name: str, expected: list[str]) -> None:
    assert [found.name for found in keywords("classes").find(name)] == expected


def test_the_longest_keyword_decides_and_hides_its_parts() -> None:
    own = Keywords.of([("sign", "light"), ("lamp", "street light"), ("lamp", "lamp")])
    assert own.find("Street_Lights") == (Match("lamp", "street lights", 11),)
    assert [item.name for item in own.find("light and street light")] == ["lamp", "sign"]
    assert own.find("streetlight") == (Match("lamp", "streetlight", 11),)


def test_every_class_can_be_found_by_its_own_words() -> None:
    for name, phrase in keywords("classes").phrases:
        assert phrase, name
        found = keywords("classes").find(" ".join(phrase))
        assert name in {item.name for item in found}, phrase


def test_the_classes_are_those_of_the_catalogues() -> None:
    known = {name for name, _ in keywords("classes").phrases}
    assert {item.name for item in paper_taxonomy().classes} <= known
    for catalog in catalog_names():
        own = {item.name for item in load_catalog(catalog).taxonomy.classes}
        assert own <= known, catalog
    assert {name for name, _ in keywords("class_fields").phrases} <= known


def test_the_keywords_are_no_catalogue() -> None:
    assert "keywords" not in catalog_names()
