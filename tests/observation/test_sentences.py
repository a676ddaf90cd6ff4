"""Parse views from rows and sentences."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from noisy_cells import column
from sentences import refused

from semsig_gis.core import SemsigError
from semsig_gis.observation import (
    GUESS_ERROR,
    Photo,
    parse_seen,
    parse_view,
    read_description,
    read_sentence,
    text_row,
)
from semsig_gis.sources import (
    built_in_taxonomy,
    data_folder,
    families,
    family_words,
    paper_taxonomy,
    words_of,
)

if TYPE_CHECKING:
    from semsig_gis.core import ObjectClass
    from semsig_gis.observation import View, ViewRecord

TAXONOMY = built_in_taxonomy()


def read(row: dict[str, Any], radius: float = 30.0) -> View:
    return parse_view(row, taxonomy=TAXONOMY, radius=radius)


def parsed(row: dict[str, Any]) -> ViewRecord:
    return read(row).to_dict(TAXONOMY)


SAME = """
{"types": "LD", "bearings": [40, 80], "ranges": [null, 12]}
{"types": "DL", "bearings": "80 40", "ranges": "12 ?"}
{"types": "DL", "bearings": "80;40", "ranges": "12;"}
{"see": "bench at 40, lamp at 80 12 m"}
{"see": "lamp @80° about 12 metres\\na bench at 40 degrees"}
{"see": "amenity=bench 40 right; street light 80 right 12m away", "heading": 0}
{"see": "bench 0 right, D 40 right 12 m", "heading": 40}
{"detections": [{"class": "D", "bearing": 80, "range": "12"}, {"class": "Bench", "bearing": 40}]}
{"detections": [{"class": "D", "offset": 90, "range": 12}, {"class": "L", "offset": 50}],
 "heading": -10}
{"photos": [{"see": "bench at 40, lamp at 80 12 m"}]}

{"types": "DG", "bearings": [80, 100], "sectors": [[55, 125]], "heading_error": "unknown"}
{"types": "DG", "bearings": [80, 100], "fov": 70, "heading": 90, "heading_error": "unknown"}
{"types": "DG", "bearings": "80 100", "fov": "70", "heading": "90", "heading_error": "unknown"}
{"types": "DG", "bearings": [80, 100], "sectors": "55-90, 80 - 125", "heading_error": "unknown"}
{"photos": [{"see": "lamp 10 left, signal 10 right", "heading": 90}], "fov": 70,
 "heading_error": "unknown"}

{"types": "BD", "bearings": [20, 350], "photo": [1, 0],
 "photos": [{"sectors": [[325, 15]]}, {"sectors": [[0, 40]], "heading_error": 5}]}
{"photos": [{"see": "lamp at 350", "heading": -10},
 {"see": "tree at 20", "heading": 20, "fov": 40, "heading_error": "5"}], "fov": 50}

{"types": "D", "bearings": [80], "scores": [{"D": 0.5, "G": 0.25, "?": 0.25}]}
{"detections": [{"class": {"lamp": 0.25, "D": 0.25, "traffic light": 0.25}, "bearing": 80}]}

{}
{"types": ""}
{"types": null, "bearings": []}
{"detections": []}
{"see": " "}

{"types": "LD", "bearings": [40, 80], "texts": ["Café", ""]}
{"types": "LD", "bearings": "40 80", "texts": "Café; "}
{"types": "LD", "bearings": "40 80", "texts": "[\\"Café\\", null]"}

{"types": "DL"}
{"see": "lamp, bench"}
{"detections": [{"class": "D"}, {"class": "L"}]}
"""


@pytest.mark.parametrize("rows", SAME.strip().split("\n\n"))
def test_all_forms_give_same_view(rows: str) -> None:
    first, *others = [parsed(json.loads(row)) for row in rows.replace("\n ", " ").split("\n")]
    assert others
    for other in others:
        assert other == first


@pytest.mark.parametrize(
    "bearings", [[360, -10, -360], "360;-10;-360", "360, -10,-360", " 360 -10 -360 "]
)
def test_bearings_in_all_forms_and_beyond_full_turn(bearings: object) -> None:
    assert parsed({"types": " DBL ", "bearings": bearings})["bearings"] == [0.0, 0.0, 350.0]


def test_offsets_without_heading_have_unknown_north() -> None:
    view = read({"see": "bench 20 left, lamp 10 right", "fov": 70})
    bearings = column(view, "bearings")
    assert bearings.tolist() == [10.0, 340.0]
    assert view.photos == (Photo.looking(heading=0, fov=70, north_sigma=math.inf),)
    assert view.photos[0].sees(bearings).all()


def test_types_are_likeliest_classes_of_scores() -> None:
    rows = [{"lamp": 0.4, "bench": 0.3}, {"lamp": 0.3}, {"lamp": 0.5}, {}]
    items = [{"class": scores, "bearing": 10} for scores in rows]
    assert parsed({"detections": items})["types"] == "D?D?"


@pytest.mark.parametrize(
    ("word", "low", "high"),
    [("near", 0, 10), ("middle", 10, 20), ("far", 20, 30), ("within 12 m", 0, 12)],
)
def test_words_give_mean_and_error_of_uniform_ring(word: str, low: int, high: int) -> None:
    rng = np.random.default_rng(0)
    logs = np.log(np.sqrt(rng.uniform(low**2, high**2, 200_000)))
    view = read({"see": f"lamp at 10 {word}"})
    assert column(view, "ranges") == pytest.approx(math.exp(logs.mean()), rel=0.01)
    error = math.hypot(logs.std(), GUESS_ERROR)
    assert column(view, "range_errors") == pytest.approx(error, rel=0.01)


def test_far_depends_on_range_of_class() -> None:
    row = {"types": "DF?", "bearings": [1, 2, 3], "ranges": "far,far,far"}
    ranges = column(read(row, radius=60.0), "ranges")
    # A hydrant is seen from 15 m.
    assert (ranges / ranges[0]).tolist() == pytest.approx([1.0, 0.25, 1.0])
    assert 40.0 < ranges[0] < 60.0


@pytest.mark.parametrize("word", ["near", "middle", "far"])
@pytest.mark.parametrize("name", ["tower", "landmark", "building", "church"])
def test_range_in_words_of_several_classes_spans_those_of_each(name: str, word: str) -> None:
    every = families(TAXONOMY)
    codes = every.get(name) or TAXONOMY.family_codes("worship")
    names = [item.name for item in TAXONOMY.classes if item.code in set(codes)]

    def moments(classes: dict[str, float]) -> tuple[float, float]:
        view = read({"detections": [{"class": classes, "bearing": 1, "range": word}]})
        return column(view, "ranges")[0], column(view, "range_errors")[0]

    single = [moments({name: 1.0}) for name in names]
    mean, error = moments(dict.fromkeys(names, 1.0 / len(names)))
    for middle, own_error in single:
        assert abs(math.log(mean / middle)) <= error
        assert own_error <= error + 1e-9


def test_kilometres() -> None:
    for text in ("a church, 2 km away at 40", "Kirche bei 40 Grad, 2 Kilometer entfernt"):
        assert understood_parts(text) == ["church at 40 2000 m"]
    assert understood_parts("église à 40 degrés, 1,5 km") == ["church at 40 1500 m"]
    for value in ("2 km", "2 kilometres away"):
        assert column(read({"types": "D", "bearings": [1], "ranges": [value]}), "ranges") == 2000.0


def test_given_error_has_priority_over_error_of_word() -> None:
    row = {"types": "DDD", "bearings": [1, 2, 3], "ranges": ["near", "far", 5]}
    errors = column(read(row | {"range_errors": [0.1, None, None]}), "range_errors")
    assert errors[0] == 0.1
    assert errors[1] > GUESS_ERROR
    assert math.isnan(errors[2])
    assert parsed(row | {"range_errors": 0.3})["range_errors"] == [0.3] * 3


NUMBERS = st.floats(0.5, 100.0)
ANGLES = st.integers(-360, 360)
RANGES = st.none() | NUMBERS | st.sampled_from(["near", "middle", "far", "within 7.5 m", "?"])
ERRORS = st.none() | st.floats(0.01, 3.0)
BEARING_ERRORS = st.none() | st.floats(0.01, 180.0)
CLASSES = st.sampled_from(["D", "lamp", "Bus stop", "bench", "?", "unknown"]) | st.dictionaries(
    st.sampled_from(["D", "bench", "traffic_light", "?"]), st.floats(0.0, 0.25), max_size=4
)
DETECTIONS = st.lists(
    st.fixed_dictionaries(
        {
            "class": CLASSES,
            "bearing": ANGLES,
            "bearing_error": BEARING_ERRORS,
            "range": RANGES,
            "range_error": ERRORS,
        }
    ),
    max_size=5,
)
PAIRS = st.lists(st.integers(0, 359), min_size=2, max_size=2, unique=True)
LOOKS: st.SearchStrategy[dict[str, Any]] = st.one_of(
    st.just({}),
    st.fixed_dictionaries({"fov": st.integers(1, 360), "heading": ANGLES}),
    st.fixed_dictionaries({"sectors": st.lists(PAIRS, max_size=3)}),
)
PHOTOS = st.builds(
    lambda detections, look, error: {"detections": detections} | look | error,
    DETECTIONS,
    LOOKS,
    st.sampled_from([{}, {"heading_error": 10}, {"heading_error": "unknown"}]),
)


@given(st.lists(PHOTOS, min_size=1, max_size=3))
def test_view_is_written_and_parsed_again(photos: list[dict[str, Any]]) -> None:
    row = {"photos": photos} if len(photos) > 1 else photos[0]
    once = parsed(row)
    assert parsed(json.loads(json.dumps(once))) == once
    assert once["length"] == sum(len(photo["detections"]) for photo in photos)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"see": "lamb at 40"}, "class 'lamb' is unknown; the nearest is 'lamp'; `semsig info`"),
    ({"see": "lamp at"}, "'lamp at' ends before it says where"),
    ({"see": "lamp at 40, bench"}, "things with and without a direction"),
    ({"see": "lamp at 40, no bench"}, "what is not in sight"),
    ({"see": "lamp 40"}, "the number 40 in 'lamp 40' is not clear"),
    ({"see": "tree stump left"}, "'stump' in"),
    ({"see": "lamp left of a tree"}, "names several things"),
    ({"see": "lamp left NE"}, "the direction in 'lamp left NE' is not clear"),
    ({"see": "lamp at 13 o'clock"}, "is not clear"),
    ({"see": "no bench on the left"}, "says where something is not"),
    ({"see": "no bench and lamp"}, "say 'no' before each thing"),
    ({"see": "I see the"}, "'I see the' does not say what is there; say what was seen"),
    ({"see": "''"}, "does not say what is there"),
    ({"see": "lamp at 2, on the left"}, "'on the left' does not say what is there"),
    ({"see": "tree left and ahead, bench behind"}, "'ahead' does not say what is there"),
    ({"see": "3 trees at 40 and 80"}, "2 directions of 3 things"),
    ({"see": "two left"}, "the number two in 'two left' is not clear"),
    ({"see": "bench between 30 and 50"}, "the number 50 in '50' is not clear"),
    ({"see": "lamp at 40, 80"}, "the number 80 in '80' is not clear"),
    ({"see": "lamp at 40 and 80, bench"}, "the number 80 in '80' is not clear"),
    ({"see": "tree to the left and to the right, bench"}, "'to the right' does not say what"),
    ({"see": "lamp n"}, "'n' in 'lamp n' is not understood"),
    ({"see": "lamp at 40,80"}, "40,80 is not clear; write 1.5, or '40 and 80'"),
    ({"see": "bench at 42,5, lamp at 80"}, "42,5 is not clear; write 1.5"),
    ({"see": "bench at NE or E"}, "the direction in 'bench at NE or E' is not clear"),
    ({"see": "Bäume bei 42,5 und 80"}, "42,5 is not clear"),
    ({"see": "bench = 30"}, "the number 30 in 'bench 30' is not clear"),
    ({"see": "lamp 1,000 m left"}, "the number 1,000 is not clear"),
    ({"see": "trees (3) left"}, "the number (3) is not clear"),
    ({"see": "tree left or ahead"}, "the direction in 'tree left or ahead' is not clear"),
    ({"see": "left turn sign ahead"}, "the direction in 'left turn sign ahead' is not clear"),
    ({"see": "ahead, on the left, a bench"}, "does not say what is there"),
    ({"see": "on the left, no bench, lamp"}, "'on the left' does not say what is there"),
    ({"see": "bench 10 m or 20 m ahead"}, "has two distances"),
    ({"see": "facing north, facing south, bench left"}, "second direction of sight"),
    ({"see": "nothing on the left"}, "does not say what is not in sight; name it"),
    ({"see": "bench left, nothing else"}, "'nothing else' does not say what is not in sight"),
    ({"see": "rien à gauche, banc à droite"}, "does not say what is not in sight"),
    ({"see": "no ?"}, "'no ?' does not say what is not in sight"),
    ({"see": "no smoking sign"}, "'smoking' in 'no smoking sign' is not understood"),
    ({"see": "blorb at 40, a lamb at 42"}, "class 'blorb' is unknown"),
    ({"see": "no bench next to the tree at 40"}, "says where something is not"),
    ({"see": "lamp at 40,50,60"}, "the number 40,50,60 is not clear"),
    ({"see": ","}, "',' does not say what is there"),
    ({"see": ";;"}, "';;' does not say what is there"),
    ({"see": "facing north, lamp left", "heading": 20}, "give it once"),
    ({"see": "lamp at 40 within 0 m"}, "'within 0 m'"),
    ({"see": "lamp at 400"}, "bearing 400"),
    ({"see": "lamp 10 left, bench at 20", "sectors": "0-90"}, "mixes directions from north"),
    ({"see": "lamp 10 left", "heading_error": 5}, "without the heading"),
    ({"see": "lamp", "types": "D"}, "see and types were given"),
    ({"see": "lamp", "fov": 70, "heading": 0}, "needs the bearings"),
    ({"detections": [], "ranges": [1]}, "detections and ranges were given"),
    ({"detections": {"class": "D"}}, "detections were given as {'class': 'D'}"),
    ({"detections": ["D"]}, "give a list"),
    ({"detections": [{"bearing": 5}]}, "class of a detection is None"),
    (
        {"detections": [{"class": "D", "bearing": 5, "offset": 5}]},
        "neither a bearing nor an offset, or both",
    ),
    ({"detections": [{"class": "D", "bearing": "east"}]}, "bearing was given as 'east'"),
    ({"detections": [{"class": {"D": 0.7, "L": 0.4}, "bearing": 5}]}, "add up to at most 1"),
    ({"detections": [{"class": {"D": -0.1}, "bearing": 5}]}, "add up to at most 1"),
    ({"detections": [{"class": {"D": math.nan}, "bearing": 5}]}, "add up to at most 1"),
    ({"detections": [{"class": {"D": "high"}, "bearing": 5}]}, "score of 'D'"),
    ({"types": "D", "bearings": [1], "ranges": [1, 2]}, "2 ranges were given for 1 objects"),
    ({"types": "D", "bearings": [1], "ranges": [-1]}, "a range is -1"),
    ({"types": "D", "bearings": [1], "ranges": [5], "range_errors": "much"}, "'much'"),
    ({"types": "D", "bearings": [1], "ranges": [5], "range_errors": 9}, "range error is 9"),
    ({"types": "D", "bearings": [1], "bearing_errors": [181]}, "bearing error is 181"),
    ({"types": "D", "bearings": [1], "bearing_errors": [0]}, "bearing error is 0"),
    ({"types": "D", "ranges": [5]}, "needs the bearings"),
    ({"types": "D", "bearings": [1], "scores": [{}, {}]}, "2 scores were given for 1 objects"),
    ({"types": "D", "bearings": [1], "fov": 70}, "without the heading"),
    ({"types": "D", "bearings": [1], "fov": 70, "sectors": "1-2", "heading": 0}, "with sectors"),
    ({"types": "D", "bearings": [1], "fov": 0, "heading": 0}, "field of view of 0"),
    ({"types": "D", "bearings": [1], "fov": "wide", "heading": 0}, "fov was given as 'wide'"),
    ({"types": "D", "bearings": [1], "sectors": "20"}, "'20'"),
    ({"types": "D", "bearings": [1], "sectors": [20, 90]}, "[20, 90]"),
    ({"types": "D", "bearings": [1], "sectors": [[20, "x"]]}, "'x'"),
    ({"types": "D", "bearings": [1], "sectors": "20-20"}, "sees nothing"),
    ({"types": "D", "bearings": [1], "heading_error": "some"}, "'some'"),
    ({"types": "D", "bearings": [1], "heading_error": 400}, "deviation of north is 400"),
    ({"types": "D", "bearings": [1], "photos": [{}, {}]}, "give photo"),
    ({"types": "D", "bearings": [1], "photos": [{}], "photo": [1]}, "from 0 to 0"),
    ({"types": "D", "bearings": [1], "photo": [0.5]}, "photo was given as [0.5]"),
    ({"types": "D", "bearings": [1], "photo": "here"}, "'here'"),
    ({"types": "D", "bearings": [1], "photo": [0, 0]}, "2 photo were given for 1 objects"),
    ({"photos": []}, "photos"),
    ({"photos": [{"see": "lamp"}, {"see": "lamp at 5"}]}, "have no bearing"),
]


@pytest.mark.parametrize(("row", "words"), REFUSED, ids=range(len(REFUSED)))
def test_invalid_rows_are_refused(row: dict[str, Any], words: str) -> None:
    with refused(SemsigError, words):
        read(row)


SENTENCES: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("sentences.toml").read_text(encoding="utf-8")
)


def expected_parts(meaning: str) -> list[str]:
    """Return the things of a meaning in ``sentences.toml``, each of several of its own."""
    parts = []
    for part in meaning.split("; "):
        count, _, thing = part.partition(" ")
        parts += [thing] * int(count) if count.isdigit() else [part]
    return sorted(parts)


def kinds_of(codes: list[int]) -> str:
    """Return the name of a class, of a family, or of several classes."""
    names = {item.code: item.name for item in TAXONOMY.classes}
    families = {item.family for item in TAXONOMY.classes}
    same = [name for name in families if TAXONOMY.family_codes(name).tolist() == codes]
    return "|".join(same or [names.get(code, "?") for code in codes])


def understood_parts(text: str) -> list[str]:
    """Return the things of a sentence in the form of ``sentences.toml``."""
    view, unplaced, absent = parse_seen({"see": text}, taxonomy=TAXONOMY, radius=30.0)
    parts = [f"no {kinds_of([code])}" for code in absent]
    parts += [kinds_of([code]) for code in unplaced]
    parts += [f"'{sign}'" for sign in view.signs]
    for row, scores in enumerate(view.class_scores()):
        part = kinds_of(np.flatnonzero(scores).tolist())
        if view.bearings is not None:
            bearing = view.bearings[row]
            offset = bearing if bearing <= 180 else bearing - 360
            relative = view.photos[view.photo_rows[row]].north_sigma is not None
            part += f" {offset:+g}" if relative else f" at {bearing:g}"
        if view.ranges is not None and not math.isnan(view.ranges[row]):
            is_word = view.range_errors is not None and not math.isnan(view.range_errors[row])
            part += " near" if is_word else f" {view.ranges[row]:g} m"
        if view.texts is not None and view.texts[row]:
            part += f" '{view.texts[row]}'"
        parts.append(part)
    return sorted(parts)


@pytest.mark.parametrize("language", SENTENCES)
def test_sentences_of_people_are_understood(language: str) -> None:
    assert len(SENTENCES[language]) == 30
    for text, meaning in SENTENCES[language].items():
        assert understood_parts(text) == expected_parts(meaning), text


UNCLEAR = {"bench 30, lamp 80, tree 120": "30 in", "bench at 42,5, lamp at 80": "42,5 is"}


def test_sentences_of_the_case_are_understood_or_name_what_was_not() -> None:
    file = Path(__file__).parents[1] / "cases" / "K_words" / "sentences.txt"
    for line in file.read_text(encoding="utf-8").splitlines():
        if line in UNCLEAR:
            with refused(SemsigError, f"the number {UNCLEAR[line]}", "write"):
                understood_parts(line)
        else:
            count = len(line.replace(" and ", ", ").split(", "))
            assert len(understood_parts(line)) >= count, line


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("A bench at 40, E at 20", ["bench at 40", "indicator at 20"]),
        ("On the left, a bench; on the right, a lamp", ["bench -90", "street_light +90"]),
        ("links 2 Bänke, 20° rechts eine Ampel", ["bench -90", "bench -90", "traffic_light +20"]),
        ("vorne links ein Baum", ["alignment_tree -45"]),
        ("tree behind me on the right", ["alignment_tree +135"]),
        ("Laterne NO, Baum O", ["alignment_tree at 90", "street_light at 45"]),
        ("lampadaire NO, arbre O", ["alignment_tree at 270", "street_light at 315"]),
        (
            "neither benches nor trees, lamp N",
            ["no alignment_tree", "no bench", "street_light at 0"],
        ),
        ("I can't see a bench", ["no bench"]),
        ("il n'y a pas de banc, un lampadaire à gauche", ["no bench", "street_light -90"]),
        ("Bank bei 40", ["bench at 40"]),
        ("two phone boxes NE", ["telephone at 45", "telephone at 45"]),
        ("c'è una fontana dietro di me", ["water_fountain +180"]),
        ("lamp near", ["street_light"]),
        ("bench left 12,5 m, tree right", ["alignment_tree +90", "bench -90 12.5 m"]),
        ("zero benches, lamp N", ["no bench", "street_light at 0"]),
        ("0 benches, lamp N", ["no bench", "street_light at 0"]),
        ("null Bänke, Baum links", ["alignment_tree -90", "no bench"]),
        ("zéro banc, arbre à gauche", ["alignment_tree -90", "no bench"]),
        ("cero bancos, farola a la izquierda", ["no bench", "street_light -90"]),
        ("zero panchine, lampione a destra", ["no bench", "street_light +90"]),
        ("nothing but a bench on the left", ["bench -90"]),
        (
            "bench at 40,2 trees at 80",
            ["alignment_tree at 80", "alignment_tree at 80", "bench at 40"],
        ),
        ("A tree left. No bench.", ["alignment_tree -90", "no bench"]),
        ("Kein Baum. Eine Bank rechts.", ["bench +90", "no alignment_tree"]),
        ("bench left approx. 10 m", ["bench -90 10 m"]),
        ("bench left, hardly any trees", ["bench -90", "no alignment_tree"]),
        ("trees absent, bench left", ["bench -90", "no alignment_tree"]),
        ("kaum Bäume, Bank links", ["bench -90", "no alignment_tree"]),
        ("il n'y a plus de bancs, arbre à gauche", ["alignment_tree -90", "no bench"]),
        ("nada de bancos, farola a la derecha", ["no bench", "street_light +90"]),
        ("bench at 40, ?", ["bench at 40"]),
        ("left a bench and on the right, a lamp", ["bench -90", "street_light +90"]),
        ("on the left, 20 m away, a bench", ["bench -90 20 m"]),
        (
            "bench 40° and 80°, 3 lamps at 90, 120, 150",
            [
                "bench at 40",
                "bench at 80",
                "street_light at 120",
                "street_light at 150",
                "street_light at 90",
            ],
        ),
        (
            "trees at 40 (12 m) and 120 (8 m)",
            ["alignment_tree at 120 8 m", "alignment_tree at 40 12 m"],
        ),
        (
            "bench between the trees at 30 and 50",
            ["alignment_tree at 30", "alignment_tree at 50", "bench at 40"],
        ),
        ("lamps 20 left and 30 right", ["street_light +30", "street_light -20"]),
        ("bench at azimuth 40, lamp at 2h", ["bench at 40", "street_light +60"]),
        ('bar called "Goyard" at 351', ["bar at 351 'Goyard'"]),
    ],
)
def test_other_sentences(text: str, parts: list[str]) -> None:
    assert understood_parts(text) == parts


def test_directions_in_words_have_errors() -> None:
    text = "bench left, lamp at 3 o'clock, tree ahead right, bin 20 left"
    assert parsed({"see": text})["bearing_errors"] == [13.0, 8.7, 26.0, None]
    assert parsed({"see": "bench N, lamp ENE"})["bearing_errors"] == [13.0, 6.5]
    view = read({"see": "facing NE, bench on the left"})
    assert column(view, "bearings").tolist() == [315.0]
    assert view.photos[0].north_sigma == 13.0


@pytest.mark.parametrize(
    ("text", "north", "errors"),
    [
        ("facing north, bench at 40, lamp at 80", None, None),
        ("facing NE, bench 20 left, lamp on the right", 13.0, [None, 26.0]),
        ("facing NNE, bench 20 left", 6.5, None),
        ("facing 40 degrees, bench 20 left", None, None),
        ("facing north, bench at 40, lamp 20 right", None, [13.0, None]),
    ],
)
def test_error_of_the_direction_of_sight_is_for_directions_from_it(
    text: str, north: float | None, errors: list[float | None] | None
) -> None:
    view = read({"see": text})
    assert view.photos[0].north_sigma == north
    assert parsed({"see": text}).get("bearing_errors") == errors


def test_something_is_of_any_class() -> None:
    assert parsed({"see": "something at 40, bench at 80"})["types"] == "?L"


@pytest.mark.parametrize("view", ["", " ", {"see": ""}, ",", {"see": ";"}, {"see": None}])
def test_descriptions_without_words_are_refused(view: Any) -> None:  # noqa: ANN401
    with pytest.raises(SemsigError, match=r"empty|does not say|do not say") as caught:
        read_description(view, taxonomy=TAXONOMY)
    assert "nearest" not in str(caught.value)


def only_classes(text: str) -> frozenset[str]:
    """Return the names of the classes that the only thing of a sentence may be of."""
    sentence = read_sentence(text, TAXONOMY)
    (thing,) = sentence.row["detections"]
    assert sentence.notes == ()
    names = {item.symbol: item.name for item in TAXONOMY.classes}
    return frozenset(names[symbol] for symbol in thing["class"])


@pytest.mark.parametrize("item", TAXONOMY.classes, ids=lambda item: item.name)
def test_title_and_name_are_of_their_class(item: ObjectClass) -> None:
    for name in (item.title, item.name, item.name.replace("_", " ")):
        assert only_classes(f"{name} at 40") == {item.name}, name


DEGREES = {
    "en": "at 40",
    "de": "bei 40 Grad",
    "fr": "à 40 degrés",
    "es": "a 40 grados",
    "it": "a 40 gradi",
    "pt": "a 40 graus",
}


@pytest.mark.parametrize("language", DEGREES)
def test_words_that_people_say_are_understood(language: str) -> None:
    shared = {
        (name, "".join(words_of(word))): {
            item.name for item in TAXONOMY.classes if item.code in codes
        }
        for name, codes, word in family_words(TAXONOMY)
    }
    path = data_folder() / "keywords.toml"
    for name, table in tomllib.loads(path.read_text("utf-8"))["classes"].items():
        for word in table.get("said", {}).get(language, ()):
            joined = "".join(words_of(word))
            is_name = language == "en" and joined == name.replace("_", "")
            expected = {name} if is_name else shared.get((language, joined), {name})
            assert only_classes(f"{word} {DEGREES[language]}") == expected, word
            assert name in expected


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("hairdresser's at 40", ["hairdresser at 40"]),
        ("the florist\u2019s on the left", ["florist -90"]),
        ("the butcher's shop at 40", ["butcher at 40"]),
        ("it's a bench at 40", ["bench at 40"]),
        ("there's a T-junction ahead", ["t_junction +0"]),
        ("U-Bahn links", ["subway_entrance -90"]),
        ("U-Bahn-Eingang links, Bank rechts", ["bench +90", "subway_entrance -90"]),
        ("S-Bahnhof links", ["railway_station -90"]),
        ("S-Bahn links", ["railway_station -90"]),
        ("Laterne S", ["street_light at 180"]),
        ("carrefour en T devant", ["t_junction +0"]),
        ("la poste à gauche, un arbre", ["alignment_tree", "post_office -90"]),
        ("Post bei 40 Grad", ["post_office at 40"]),
    ],
)
def test_letters_and_possessives_in_words(text: str, parts: list[str]) -> None:
    assert understood_parts(text) == parts


def test_words_that_are_not_used_are_noted() -> None:
    assert read({"see": "green bench left"}).notes == ("'green' was not used.",)
    (note,) = read({"see": "bench at 10 m"}).notes
    assert "the distance in 'bench at 10 m' was not used" in note
    (note,) = read({"see": "bench at 40, ?"}).notes
    assert "something in an unknown direction was not used" in note
    assert read({"see": "un banc vert à gauche"}).notes == ("'vert' was not used.",)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("bike racks on the left, bench right", "bike racks"),
        ("old bike rack, left, bench right", "bike rack"),
        ("no bike rack, bench right", "bike rack"),
        ("Fahrradständer links, Bank rechts", "Fahrradständer"),
        ("bench right, shops behind", "shops"),
        ("bench right, house number left", "house number"),
    ],
)
def test_things_that_only_other_maps_have_are_not_used(text: str, word: str) -> None:
    view = parse_view({"see": text}, taxonomy=paper_taxonomy())
    assert view.to_dict(paper_taxonomy())["types"] == "L"
    (note,) = view.notes
    assert f"the map has no {word}" in note
    with refused(SemsigError, "the map has no"):
        parse_view({"see": word}, taxonomy=paper_taxonomy())


@pytest.mark.parametrize(
    ("text", "parts", "notes"),
    [
        (
            "church at 30, blorb at 42, a bench at 50",
            ["bench at 50", "church at 30"],
            ["'blorb at 42' was not used, because 'blorb' is unknown; the nearest is"],
        ),
        ("lamp at 40, tree 120", ["street_light at 40"], ["because the number 120 is not clear"]),
        (
            "lamp 'Alko at 40",
            ["street_light at 40"],
            ["the quotation mark before 'Alko' is not closed"],
        ),
        ("lamp at abc", ["street_light"], ["'abc' was not used."]),
        ("lamp at 40 soon", ["street_light at 40"], ["'soon' was not used."]),
        ("lamp left, a big blorb, 12 m away", ["street_light -90"], ["a big blorb, 12 m away"]),
        ("blorb 42, lamp left", ["street_light -90"], ["'blorb 42' was not used"]),
        ("tree stump left, lamp right", ["street_light +90"], ["'stump' is not understood"]),
        ("no smoking sign, lamp left", ["street_light -90"], ["'smoking' is not understood"]),
        (
            "school fence at 10, bench at 20",
            ["bench at 20", "fence at 10"],
            ["'school fence at 10' was taken as 'fence'"],
        ),
        (
            "lamp at 10, bench next to the blorb",
            ["bench", "street_light at 10"],
            ["'the blorb' was not used"],
        ),
    ],
)
def test_unknown_words_are_left_out_with_a_note(
    text: str, parts: list[str], notes: list[str]
) -> None:
    assert understood_parts(text) == parts
    view, _, _ = parse_seen({"see": text}, taxonomy=TAXONOMY, radius=30.0)
    assert len(view.notes) == len(notes)
    for note, words in zip(view.notes, notes, strict=True):
        assert words in note


@pytest.mark.parametrize(
    ("text", "bearings", "errors"),
    [
        ("tree at 40 with a bench next to it", [40, 40], [None, 15]),
        ("bench next to the tree, lamp next to it at 40", [40, 40, 40], [21.21, 15, None]),
        ("bench between the tree at 350 and the lamp at 30", [10, 30, 350], [11.55, None, None]),
        ("tree N, lamp E, a bench between them", [0, 45, 90], [13, 31.83, 13]),
        ("bench between two trees at 40", [40, 40, 40], [15, None, None]),
        ("bench at 40, a shop", [40, 40], [None, 180]),
    ],
)
def test_directions_follow_from_those_of_other_things(
    text: str, bearings: list[float], errors: list[float | None]
) -> None:
    row = parsed({"see": text})
    assert row["bearings"] == pytest.approx(bearings)
    assert row["bearing_errors"] == pytest.approx(errors, abs=0.01)


def test_ends_of_unknown_or_opposite_directions_say_nothing() -> None:
    for text in ("bench between the tree and the lamp at 30", "tree N, lamp S, bench between them"):
        assert "bench" in understood_parts(text)


def test_word_for_a_family_has_equal_scores_of_its_classes() -> None:
    codes = TAXONOMY.family_codes("shop")
    for row in (
        {"see": "shop at 40"},
        {"detections": [{"class": "shop", "bearing": 40}]},
        {"bearings": [40], "scores": [{"shop": 1.0}]},
    ):
        (scores,) = column(read(row), "scores")
        assert scores[codes] == pytest.approx(1.0 / len(codes))
        assert scores.sum() == pytest.approx(1.0)
    view, _, absent = parse_seen({"see": "no shops"}, taxonomy=TAXONOMY, radius=30.0)
    assert absent == tuple(codes)
    assert len(view) == 0
    assert understood_parts("a bakery shop at 40") == ["bakery at 40"]


def test_directions_from_north_and_from_an_unknown_sight_are_of_two_photos() -> None:
    view = read(
        {"see": "shop 'Boulangerie P' at 40, street sign 'Rue du Pau', house number 12 left"}
    )
    assert view.texts == ("Boulangerie P", "12")
    assert view.signs == ("Rue du Pau",)
    assert [photo.north_sigma for photo in view.photos] == [None, math.inf]
    assert column(view, "photo").tolist() == [0, 1]
    (note,) = view.notes
    assert "say it as well" in note


@pytest.mark.parametrize(
    ("text", "read_text"),
    [
        ("house number 12 left", "12"),
        ("house number 12a left", "12a"),
        ("house number 12 bis left", "12 bis"),
        ("house number 12-14 left", "12-14"),
        ("shop 'L'Atelier d'Or' left", "L'Atelier d'Or"),
        ("shop called “Marks & Spencer” left", "Marks & Spencer"),
        ("a shop „Zum Löwen“ left", "Zum Löwen"),
        ("a shop named »Zum  Löwen« left", "Zum Löwen"),
        ("'12 o'clock' left", "12 o'clock"),
    ],
)
def test_text_on_a_thing(text: str, read_text: str) -> None:
    assert read({"see": text}).texts == (read_text,)


def test_apostrophes_are_no_quotation_marks() -> None:
    view = read({"see": "l'arbre d'en face, les bancs d'à côté à 40"})
    assert view.texts is None


def test_text_of_a_detection() -> None:
    items = [{"class": "shop", "bearing": 1, "text": "Aux  4 vents"}, {"class": "L", "bearing": 2}]
    assert read({"detections": items}).texts == ("Aux 4 vents", "")
    view = read({"see": "bench at 40, a shop 'Sole'", "signs": ["Via Roma"]})
    assert view.signs == ("Via Roma", "Sole")
    view = read({"detections": [{"text": "Sole", "bearing": 1}], "signs": "Via Roma"})
    assert column(view, "codes").tolist() == [0]
    assert (view.texts, view.signs) == (("Sole",), ("Via Roma",))
    for photos in ([{"types": "D", "bearings": [1], "signs": ["Sole"]}], [{"see": "lamp at 1"}]):
        view = read({"photos": photos * 2, "signs": ["Via Roma"]})
        assert view.signs[0] == "Via Roma"
        assert len(view) == 2


@pytest.mark.parametrize(
    ("text", "nearest"),
    [("lamb at 40", "lamp"), ("Ein Brunnn links", "brunnen"), ("un arbbre à gauche", "arbre")],
)
def test_suggestions_are_in_the_language_of_the_sentence(text: str, nearest: str) -> None:
    with refused(SemsigError, f"the nearest is '{nearest}'"):
        read({"see": text})
    with pytest.raises(SemsigError) as caught:
        read({"see": "pubbel at 40"})
    assert "poubelle" not in str(caught.value)


def test_phrases_are_written_as_they_are_compared() -> None:
    phrases = tomllib.loads((data_folder() / "phrases.toml").read_text("utf-8"))
    kinds = [frozenset(table) for table in phrases.values()]
    assert len(set(kinds)) == 1
    for table in phrases.values():
        for kind in kinds[0] - {"letters", "endings"}:
            for phrase in table[kind]:
                assert phrase == phrase.lower()
                assert phrase.isascii() or phrase == "°"
                assert 1 <= len(phrase.split()) <= 6, phrase
        assert all(letters.isupper() and len(letters) <= 3 for letters in table["letters"])


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("DDBL", "types"),
        ("DcBs", "types"),
        ("cc", "types"),
        ("?", "types"),
        ("DDBQ", "types"),
        ("shop", "see"),
        ("maison", "see"),
        ("Turm", "see"),
        ("blorb", "see"),
        ("río", "see"),
        ("BENCH", "see"),
        ("bench at 40", "see"),
    ],
)
def test_one_word_is_of_symbols_unless_it_is_written_like_a_word(text: str, key: str) -> None:
    assert text_row(text, TAXONOMY) == {key: text}
