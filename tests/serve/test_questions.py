from __future__ import annotations

import io
import json
import math
import shlex
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pytest
from hypothesis import given, settings
from mutations import with_mistakes
from noisy_cells import parts_of
from PIL import Image
from PIL.ExifTags import GPS, Base
from pyproj import Transformer
from sentences import assert_sentence
from workbench import coco, decompression_bomb, picture

from semsig_gis.core import ObjectClass, SemsigError
from semsig_gis.database import visible_objects_at
from semsig_gis.localization import NOISES, ClassQuestion
from semsig_gis.observation import Camera
from semsig_gis.serve import Question, Workbench, city_streets
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from workbench import Page

    RunOk = Callable[..., str]

WIDTH, HEIGHT, FOV = 4000, 3000, 100.0
SIDE: dict[str, Any] = {
    "name": "a.jpg",
    "sha256": "0",
    "width": WIDTH,
    "height": HEIGHT,
    "projection": "pinhole",
}


def longest(bench: Workbench) -> int:
    return int(bench.database.lengths.argmax())


def latlon(bench: Workbench, cell: int) -> list[float]:
    to_degrees = Transformer.from_crs(bench.database.crs, "EPSG:4326", always_xy=True)
    lon, lat = to_degrees.transform(*bench.database.xy[cell])
    return [lat, lon]


def photo(bench: Workbench, cell: int, middle: float, **changes: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return a photo from the middle of a cell with marks on all visible objects."""
    assert bench.store is not None
    spec, place = bench.database.spec, bench.database.xy[cell : cell + 1]
    visible = visible_objects_at(
        bench.store.objects, place, index=bench.store.index, radius=spec.radius
    )
    camera = Camera(width=WIDTH, height=HEIGHT, fov=FOV)
    angles = np.radians(visible.bearings - middle)
    pixels = camera.pixels(np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=1))
    names = {item.code: item.name for item in bench.taxonomy.classes}
    marks = [
        {"x": x, "y": y, "class": names[code], "range": round(metres, 1)}
        for (x, y), code, metres in zip(
            pixels.tolist(), visible.codes.tolist(), visible.distances.tolist(), strict=True
        )
        if 0 <= x <= WIDTH
    ]
    return {**SIDE, "fov": FOV, "heading": middle, "heading_error": None, "marks": marks, **changes}


def test_city_request_returns_facts_about_the_city(page: Page) -> None:
    city, database = page.ask("/api/city"), page.bench.database
    assert (city["name"], city["cells"], city["radius"]) == ("town", len(database), 30.0)
    assert city["noise"][0] == "by-hand"
    assert set(city["noise"]) == set(NOISES)
    assert any(line.startswith("Town") for line in city["licences"])
    assert city["licences"] == list(page.bench.city.licenses)
    assert city["image"]["url"].startswith("data:image/png;base64,")
    codes = [item["code"] for item in city["classes"]]
    assert sorted(codes) == database.present_codes.tolist()
    assert codes == sorted(codes, key=lambda code: -database.occurrences[code])  # frequent first


def test_ground_request_returns_streets(page: Page, bench: Workbench) -> None:
    streets = page.ask("/api/ground")
    assert streets["area"]["crs"] == "EPSG:32631"
    assert list(streets["ground"][0]) == ["streets"]
    assert city_streets(bench.database, None)["ground"] is None
    store = bench.store
    assert store is not None
    assert store.streets is not None
    away = store.streets.set_geometry(store.streets.translate(9000.0))
    assert city_streets(bench.database, replace(store, streets=away))["ground"] is None


def test_photo_request_reads_camera_from_exif(page: Page) -> None:
    content = picture(
        image={Base.Orientation: 6},
        exif={Base.FocalLengthIn35mmFilm: 26},
        gps={
            GPS.GPSImgDirection: 90.0,
            GPS.GPSImgDirectionRef: "T",
            GPS.GPSLatitude: (48.0, 30.0, 0.0),
            GPS.GPSLatitudeRef: "N",
            GPS.GPSLongitude: (3.0, 0.0, 0.0),
            GPS.GPSLongitudeRef: "E",
        },
    )
    code, _, answer = page.send("/api/photo?name=a%20%3Cb%3E.jpg", content)
    info = json.loads(answer)
    assert (code, info["name"], info["width"], info["height"]) == (200, "a <b>.jpg", 300, 400)
    assert info["place"] == [48.5, 3.0]
    assert 50 < info["fov"] < 56
    assert abs(info["heading"] - 90.0) < 3.0  # of grid north
    assert (info["heading_error"], len(info["sha256"])) == (10.0, 64)


def test_panorama_is_recognized_by_its_ratio(page: Page) -> None:
    content = io.BytesIO()
    Image.new("L", (400, 200)).save(content, "PNG")
    info = json.loads(page.send("/api/photo?name=p.png", content.getvalue())[2])
    assert (info["projection"], info["fov"], info["heading"]) == ("equirectangular", 360.0, None)
    assert len(info["notes"]) == 1


def test_cropped_panorama_is_read_with_its_horizon(page: Page) -> None:
    xmp = {
        "ProjectionType": "equirectangular",
        "PoseHeadingDegrees": 90,
        "FullPanoWidthPixels": 1600,
        "FullPanoHeightPixels": 800,
        "CroppedAreaImageWidthPixels": 400,
        "CroppedAreaImageHeightPixels": 300,
        "CroppedAreaLeftPixels": 400,
        "CroppedAreaTopPixels": 280,
    }
    info = json.loads(page.send("/api/photo?name=p.jpg", picture(xmp=xmp))[2])
    assert (info["projection"], info["fov"], info["horizon"]) == ("equirectangular", 90.0, 120.0)
    assert abs(info["heading"] - 45.0) < 3.0  # of grid north
    assert "panorama of 90°" in info["notes"][0]
    mark = {"box": [195, 120, 205, 140], "class": "bench"}
    rows = [
        page.ask("/api/answer", {"views": [{"photos": [info | {"marks": [mark], **more}]}]})[
            "views"
        ][0]
        for more in ({}, {"horizon": None})
    ]
    assert rows[0]["bearings"] == rows[1]["bearings"] == [round(info["heading"], 2)]
    assert rows[0]["ranges"] != rows[1]["ranges"]


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"just a text", "cannot be read as a picture"),
        (b"", "cannot be read as a picture"),
        (
            b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>",
            "cannot be read as a picture",
        ),
        (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(100), "HEIC"),
        (decompression_bomb(), "pixels"),
        (picture()[:-400], "cannot be read as a picture"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n", "cannot be read as a picture"),
    ],
    ids=["text", "nothing", "svg", "heic", "bomb", "cut", "postscript"],
)
def test_invalid_picture_is_refused(page: Page, content: bytes, word: str) -> None:
    page.refused("/api/photo?name=x.jpg", content, word, "x.jpg")


@pytest.mark.parametrize("heading", [None, 80.0])
def test_quick_answer_has_the_same_best_cell(
    page: Page, bench: Workbench, heading: float | None
) -> None:
    cell = longest(bench)
    view = {"photos": [photo(bench, cell, 80.0, heading=heading)]}
    later_view = {"photos": [photo(bench, cell, 200.0)], "step": {"bearing": 90.0, "metres": 0.0}}
    for views in ([view], [view, later_view]):
        quick = page.ask("/api/answer", {"views": views, "quick": True})
        after = page.ask("/api/answer", {"views": views})
        expected = Workbench(city=bench.city, store=bench.store).answer({"views": views})
        assert (quick["quick"], after["quick"]) == (True, False)
        for answer, count in ((quick, 3), (after, 10)):
            assert sum(bool(view["rays"]) for view in answer["candidates"]) == count
        assert quick["candidates"][0]["cell_id"] == after["candidates"][0]["cell_id"]
        del after["seconds"], expected["seconds"]
        assert after == json.loads(json.dumps(expected))
    grid = {"views": [view], "quick": True, "seen_from": "cells"}
    assert not page.ask("/api/answer", grid)["quick"]  # complete at once


@pytest.mark.parametrize("heading", [None, 80.0])
def test_marks_of_photos_are_localized(page: Page, heading: float | None) -> None:
    cell = longest(page.bench)
    views: list[dict[str, Any]] = [
        {"photos": [photo(page.bench, cell, 80.0, heading=heading)]},
        {"photos": [photo(page.bench, cell, 200.0, name="b.jpg")], "step": None},
    ]
    question = {"views": views, "truth": latlon(page.bench, cell), "noise": "light", "top": 3}
    answer = page.ask("/api/answer", question)
    assert answer["given"]
    assert answer["truth"]["found"]
    assert answer["truth"]["metres"] < 10
    assert answer["truth"]["rank"] <= 3
    assert answer["region"]["text"].startswith("90 % region: ")
    assert answer["elsewhere"] < 1e-9
    assert answer["fit"] > 0.5
    assert not answer["doubt"]
    assert list(answer["region"]["counts"]) == ["0.99", "0.9", "0.5"]
    first, *others = answer["candidates"]
    assert len(others) == 2
    assert first["place"] == pytest.approx(question["truth"], abs=1e-4)
    # Every mark has one ray with the class of the mark.
    rays = {tuple(ray["mark"]): ray for ray in first["rays"] if ray["mark"] is not None}
    marks = {
        (view, 0, number): mark["class"]
        for view, item in enumerate(views)
        for number, mark in enumerate(item["photos"][0]["marks"])
    }
    assert {key: ray["seen_class"] for key, ray in rays.items()} == marks
    assert {ray["verdict"] for ray in rays.values()} == {"matched"}
    assert first["for_against"]
    weights = [abs(reason["weight"]) for reason in first["for_against"]]
    assert weights == sorted(weights, reverse=True)


def questions(bench: Workbench) -> dict[str, dict[str, Any]]:
    cell = longest(bench)
    marked_photo = photo(bench, cell, 80.0)
    vague = {**marked_photo, "marks": [{**mark, "range": "near"} for mark in marked_photo["marks"]]}
    step = {"bearing": 90.0, "metres": 10.0}
    compass = [{"class": "street_light", "bearing": at, "range": None} for at in (10, 200)]
    return {
        "photo": {"views": [{"photos": [marked_photo]}]},
        "heading unknown": {
            "views": [{"photos": [{**marked_photo, "heading": None}]}],
            "noise": "light",
        },
        "rough": {"views": [{"photos": [vague]}], "top": 5},
        "near": {"views": [{"photos": [marked_photo]}], "near": [*latlon(bench, cell // 2), 40.0]},
        "two photos": {"views": [{"photos": [marked_photo, photo(bench, cell, 200.0)]}]},
        "compass": {"views": [{"compass": compass, "heading_error": 10}], "seen_from": "cells"},
        "route": {
            "views": [
                {"photos": [marked_photo]},
                {"photos": [photo(bench, cell, 90.0)], "step": step},
            ]
        },
    }


@pytest.mark.parametrize(
    "way", ["photo", "heading unknown", "rough", "near", "two photos", "compass", "route"]
)
def test_command_line_returns_the_same_answer(
    page: Page, way: str, run_ok: RunOk, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = page.ask("/api/answer", questions(page.bench)[way])
    before, _, command = answer["command"].rpartition(" | ")
    lines = shlex.split(before)[2:]  # printf, and how each is printed
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines).encode())))
    _, *words = shlex.split(command)
    out = run_ok("", *words, *([] if lines else ["--json"]))
    result = json.loads(out.splitlines()[-1] if lines else out)
    listed = [(row["cell_id"], row["chance"]) for row in result["candidates"]]
    shown = [(row["cell_id"], row["chance"]) for row in answer["candidates"]]
    assert listed == [(cell, pytest.approx(chance)) for cell, chance in shown]
    place = [result["place"]["lat"], result["place"]["lon"]]
    assert answer["estimate"]["place"] == pytest.approx(place, abs=1e-6)


def test_families_and_texts_of_marks_are_part_of_the_question(page: Page) -> None:
    marks = [
        {"class": "furniture", "bearing": 10.0, "range": None},
        {"class": "bench", "bearing": 50.0, "range": None, "text": "Rue de l'École"},
    ]
    answer = page.ask("/api/answer", {"views": [{"compass": marks, "heading_error": None}]})
    (view,) = answer["views"]
    assert len(view["scores"][0]) > 10
    assert view["texts"] == ["", "Rue de l'École"]
    assert "Rue de l" in answer["command"]
    words = {item["name"]: item["words"] for item in page.ask("/api/city")["classes"]}
    assert {"bench", "banc", "bank"} <= {*words["bench"]}
    assert page.ask("/api/city")["families"] == []  # there is only one


@pytest.mark.parametrize("quick", [True, False])
def test_known_place_raises_its_chance(page: Page, *, quick: bool) -> None:
    bench = page.bench
    cell = longest(bench)
    other = int(np.hypot(*(bench.database.xy - bench.database.xy[cell]).T).argmax())
    lamp = {"class": "street_light", "bearing": 10.0, "range": None}
    views = [{"compass": [lamp], "heading_error": "unknown"}]
    for place in (cell, other):
        near = [*latlon(bench, place), 5.0]
        answer = page.ask("/api/answer", {"views": views, "near": near, "quick": quick})
        best_place = answer["candidates"][0]["place"]
        assert best_place == pytest.approx(near[:2], abs=2e-4)
        assert f"--near {near[0]:.10g}N,{near[1]:.10g}E,5" in answer["command"]
    # A place that contradicts the view causes a note.
    view = {"photos": [photo(bench, cell, 80.0)]}
    answer = page.ask("/api/answer", {"views": [view], "near": [*latlon(bench, other), 5.0]})
    assert "disagree" in answer["notes"][0]


def test_box_of_known_height_gives_a_range(page: Page) -> None:
    camera = Camera(width=WIDTH, height=HEIGHT, fov=FOV)
    tall = next(item for item in page.bench.taxonomy.classes if item.name == "street_light")
    assert tall.height_m is not None
    pixels = camera.focal * tall.height_m / 15.0
    box = [1900, 2500, 2100, 2500 - pixels]  # drawn from below
    photo_of_box = {**SIDE, "fov": FOV, "heading": 0.0, "marks": [{"box": box, "class": tall.name}]}
    (view,) = page.ask("/api/answer", {"views": [{"photos": [photo_of_box]}]})["views"]
    assert view["ranges"] == [pytest.approx(15.0, rel=0.01)]
    # A given range and an unknown class override the box.
    for more in ({"range": 20.0}, {"class": "?"}):
        changed = {**photo_of_box, "marks": [{**photo_of_box["marks"][0], **more}]}
        (view,) = page.ask("/api/answer", {"views": [{"photos": [changed]}]})["views"]
        assert view.get("ranges") == ([20.0] if "range" in more else None)


def test_marks_keep_their_numbers_in_sorted_views(bench: Workbench) -> None:
    rng = np.random.default_rng(3)
    photos: list[dict[str, Any]] = []
    for number, heading in enumerate((300.0, 20.0, None)):
        marks = [{"x": float(x), "y": 10, "class": "?"} for x in rng.uniform(0, WIDTH, 6)]
        photos.append({**SIDE, "name": str(number), "fov": FOV, "heading": heading, "marks": marks})
    # Two marks on one bearing.
    photos[0]["marks"].append(dict(photos[0]["marks"][2]))
    question = Question.parse({"views": [{"photos": photos}]}, taxonomy=bench.taxonomy, radius=30.0)
    ((view,),), ((numbers,),) = question.versions, question.marks
    assert sorted(numbers) == [(0, n, m) for n in range(3) for m in range(len(photos[n]["marks"]))]
    camera = Camera(width=WIDTH, height=HEIGHT, fov=FOV)
    for bearing, (_, row, mark) in zip(parts_of(view)[1].tolist(), numbers, strict=True):
        x = photos[row]["marks"][mark]["x"]
        away = math.degrees(math.atan((x - WIDTH / 2) / camera.focal))
        expected = ((photos[row]["heading"] or 0.0) + away) % 360
        assert bearing == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"views": []}, "nothing is marked"),
        ({"views": [{"photos": []}]}, "nothing is marked"),
        ({"views": [{"compass": []}]}, "nothing is marked"),
        ({"views": 3}, "views"),
        ({"views": [3]}, "view 1 is 3; give a table"),
        ({"views": [{"photos": 1}]}, "list"),
        ({"views": [{"photos": [{"marks": [{}]}]}]}, "width"),
        ({"views": [{}] * 21}, "give at most 20 entries."),
        ({"views": [{"compass": [{"bearing": 5}]}]}, "compass 1 lacks the key 'class'"),
        (
            {"views": [{"step": {"bearing": 0, "metres": 1e8}}]},
            "metres = 100000000.0; give metres from -1,000,000 to 1,000,000",
        ),
        ({"near": [91, 3, 1]}, "latitude from -90 to 90, longitude from -360 to 360"),
        ({"width": None}, "width"),
        ({"view": 7}, "view"),
        ({"top": 0}, "top"),
        ({"top": True}, "top"),
        ({"seen_from": "space"}, "space"),
        ({"noise": "loud"}, "loud"),
        ({"noise": []}, "noise model"),
        ({"truth": [1]}, "truth = [1]; give latitude and longitude"),
        ({"truth": [100, 3]}, "from -90 to 90"),
        ({"fov": 300}, "field of view"),
        ({"projection": "flat"}, "flat"),
        ({"heading": "north"}, "heading"),
        ({"heading_error": "huge"}, "heading_error"),
        ({"mark": {"class": "unicorn"}}, "unicorn"),
        ({"mark": {"class": 3}}, "class"),
        ({"mark": {"x": None}}, "mark"),
        ({"mark": {"box": [1, 2]}}, "box"),
        ({"mark": {"range": "afar"}}, "afar"),
        ({"mark": {"range": 1e-30}}, "a range is 1e-30; give a number from 0.01"),
    ],
)
def test_invalid_question_is_refused(page: Page, change: dict[str, Any], word: str) -> None:
    mark = {"x": 10, "y": 10, "class": "street_light"} | change.get("mark", {})
    marked_photo = {**SIDE, "fov": FOV, "heading": 0.0, "heading_error": None, "marks": [mark]}
    inner = {key: value for key, value in change.items() if key in marked_photo}
    outer = {key: value for key, value in change.items() if key not in {"mark", *inner}}
    marked_photo |= inner
    page.refused("/api/answer", {"views": [{"photos": [marked_photo]}], **outer}, word)


MARK = {"x": 10, "y": 10, "box": [1, 2, 3, 4], "class": "bench", "range": "near"}
ROUTE: dict[str, Any] = {
    "views": [
        {"photos": [{**SIDE, "fov": FOV, "heading": 0.0, "heading_error": 5, "marks": [MARK]}]},
        {"compass": [{"class": "bench", "bearing": 5.0}], "step": {"bearing": 9.0, "metres": 1.0}},
    ],
    "near": [48.0, 3.0, 9.0],
}


@settings(max_examples=300)
@given(with_mistakes(ROUTE, "views", "marks", "range", "truth", "sectors", "projection"))
def test_changed_question_is_refused_in_a_sentence_or_parsed(question: dict[str, Any]) -> None:
    try:
        Question.parse(question, taxonomy=paper_taxonomy(), radius=30.0)
    except SemsigError as error:
        assert_sentence(error)


@pytest.mark.parametrize("quick", [None, 1, False])
def test_saved_question_may_lack_values(*, quick: object) -> None:
    (marked,) = ROUTE["views"][0]["photos"]
    photos = [{**marked, "name": None}, {"name": "b.jpg", "width": None, "marks": []}, {}]
    question = Question.parse(
        {"views": [{"photos": photos}], "quick": quick}, taxonomy=paper_taxonomy(), radius=30.0
    )
    assert not question.quick
    assert [len(views) for views in question.versions] == [1]


def test_detector_boxes_become_marks(page: Page) -> None:
    boxes: list[tuple[str, list[float], float]] = [
        ("bench", [1900, 1500, 200, 100], 0.9),
        ("dog", [100, 100, 50, 50], 0.9),
        ("bench", [100, 100, 50, 50], 0.1),
    ]
    photos = [{**SIDE, "fov": FOV, "heading": 90.0}]
    document = coco("a.jpg", (WIDTH, HEIGHT), *boxes)
    body = {"text": document, "name": "../../boxes.json", "photos": photos}
    reply = page.ask("/api/boxes", body)
    (mark,) = reply["photos"]["a.jpg"]
    assert (mark["box"], mark["score"]) == ([1900, 1500, 2100, 1600], 0.9)
    assert mark["class"] == "bench"
    assert mark["bearing"] == pytest.approx(90.0, abs=0.1)
    assert mark["range"] > 0
    assert len(reply["notes"]) == 2
    for change, word in (
        ({"text": "{"}, "boxes.json"),
        ({"text": ""}, "boxes.json"),
        ({"name": "boxes.exe"}, "format"),
        ({"labels": ["nowhere"]}, "nowhere"),
        ({"photos": [{**SIDE, "name": "z.jpg", "fov": FOV}]}, "a.jpg"),
        ({"photos": [{}]}, "width"),
        ({"photos": "a.jpg"}, "photos"),
        ({"labels": [{}]}, "label 1 is {}"),
        ({"name": ".."}, "cannot be read"),
        ({"name": "a\0b.json"}, "give it a plain name"),
        ({"name": "x" * 300}, "cannot be read (File name too long)"),
        ({"name": "\ud800.json"}, "cannot be read"),
        ({"text": "\ud800"}, "text in UTF-8"),
        ({"classes": "\ud800"}, "text in UTF-8"),
    ):
        page.refused("/api/boxes", body | change, word)


def test_yolo_boxes_use_the_list_of_labels(page: Page) -> None:
    body = {
        "text": "1 0.5 0.5 0.1 0.1 0.8\n0 0.2 0.5 0.1 0.1 0.9\n",
        "name": "a.txt",
        "classes": "dog\nbench\n",
        "photos": [{**SIDE, "fov": FOV, "heading": 90.0}],
    }
    (mark,) = page.ask("/api/boxes", body)["photos"]["a.jpg"]
    assert (mark["class"], mark["score"]) == ("bench", 0.8)
    reply = page.ask("/api/boxes", {**body, "classes": "dog\n"})
    assert (reply["photos"]["a.jpg"], len(reply["notes"])) == ([], 2)


@pytest.mark.parametrize(
    ("title", "more", "text"),
    [
        ("Steps", False, "Do you see steps within 30 m?"),
        ("Toilets", True, "Do you see more toilets within 30 m?"),
        ("Row of bollards", False, "Is there a row of bollards within 30 m?"),
        ("Gap between buildings", True, "Is there another gap between buildings within 30 m?"),
        ("Arches, large or small", False, "Do you see arches, large or small within 30 m?"),
        ("Underpass", False, "Is there an underpass within 30 m?"),
    ],
)
def test_questions_about_several_things_are_in_the_plural(
    title: str, text: str, *, more: bool
) -> None:
    item = ObjectClass(224, "z", "thing", title)
    question = ClassQuestion(item=item, metres=30, more=more, in_view=False, chance=0.5, gain=1.0)
    assert question.text == text


def test_suggestions_are_questions_by_gain(page: Page) -> None:
    compass = [{"class": "street_light", "bearing": at, "range": None} for at in (10, 200)]
    suggestions = page.ask("/api/suggest", {"views": [{"compass": compass}]})
    gains = [item["gain"] for item in suggestions]
    assert gains == sorted(gains, reverse=True)
    assert 0 < gains[0] <= 1
    by_name = {item["class"]: item["question"] for item in suggestions}
    assert by_name["street_light"] == "Is there another street light within 30 m?"
    assert by_name["indicator"] == "Is there a sign within 30 m?"
    assert len(by_name) == len(page.bench.database.present_codes)


def test_unknown_field_of_view_is_summed_over(page: Page, bench: Workbench) -> None:
    cell = longest(bench)
    own = photo(bench, cell, 0.0, fov=FOV, heading=None)
    unknown = {**own, "fov": None}
    certain = page.ask("/api/answer", {"views": [{"photos": [own]}]})
    answer = page.ask("/api/answer", {"views": [{"photos": [unknown]}]})
    assert certain["fov"] is None
    # The likeliest of the fields of view is the true one.
    assert answer["fov"] == FOV
    assert answer["entropy"] >= certain["entropy"]
    assert answer["candidates"][0]["cell_id"] == certain["candidates"][0]["cell_id"]
    assert answer["command"].endswith("# if the field of view is 100 degrees")
    # A photo of known field of view decides nothing about the others.
    other = page.ask("/api/answer", {"views": [{"photos": [{**unknown, "marks": []}, own]}]})
    assert other["fov"] is None


def test_questions_about_a_photo_are_about_its_sector(page: Page, bench: Workbench) -> None:
    cell = longest(bench)
    body = {"views": [{"photos": [photo(bench, cell, 0.0)]}]}
    suggestions = page.ask("/api/suggest", body)
    by_name = {item["class"]: item["question"] for item in suggestions}
    assert by_name["indicator"] == "Is there a sign in view, within 30 m?"
    # Nothing more is in the photo than what is marked, whatever is behind the camera.
    row = bench.database.select(slice(cell, cell + 1))
    away = (np.asarray(row.bearings) + 180.0) % 360.0 - 180.0
    behind = {int(code) for code in np.asarray(row.codes)[np.abs(away) > 60.0]}
    absent = [item.name for item in bench.taxonomy.classes if item.code in behind]
    assert absent
    chances = {item["class"]: item["chance"] for item in suggestions}
    assert max(chances[name] for name in absent) < 0.5
    before = page.ask("/api/answer", body)["candidates"][0]
    after = page.ask("/api/answer", {**body, "absent": absent})["candidates"][0]
    assert after["cell_id"] == before["cell_id"] == bench.database.cell_ids[cell]


def test_cell_request_returns_the_view_from_its_middle(page: Page) -> None:
    database, cell = page.bench.database, longest(page.bench)
    place = latlon(page.bench, cell)
    reply = page.ask("/api/cell", {"place": place})
    assert reply["cell"] == database.cell_ids[cell]
    assert reply["place"] == pytest.approx(place)
    assert reply["types"] == database.types(cell)
    row = database.select(slice(cell, cell + 1))
    bearings = [mark["bearing"] for mark in reply["view"]["compass"]]
    assert bearings == pytest.approx(row.bearings, abs=0.01)
    assert reply["distances"] == pytest.approx(row.distances, abs=0.06)
    types = [database.types(index) for index in range(len(database))]
    assert reply["alike"] == types.count(reply["types"]) - 1
    question = {"views": [reply["view"]], "seen_from": "cells", "top": 3}
    best = page.ask("/api/answer", question)["candidates"][0]
    assert (best["cell_id"], best["types"]) == (reply["cell"], reply["types"])
    page.refused("/api/cell", {"place": [0.0, 0.0]}, "no cell")


@pytest.mark.parametrize("fov", [None, 120.0])
def test_simulated_view_is_answered(page: Page, fov: float | None) -> None:
    cell = longest(page.bench)
    place = latlon(page.bench, cell)
    body = {"place": place, "fov": fov, "heading": 350.0, "noise": None, "seed": 1}
    reply = page.ask("/api/simulate", body)
    assert reply == page.ask("/api/simulate", body)
    assert reply["cell"] == page.bench.database.cell_ids[cell]
    if fov is None:
        assert len(reply["view"]["compass"]) == reply["objects"]
    else:
        assert reply["view"]["sectors"] == [[290.0, 50.0]]
        assert 0 < len(reply["view"]["compass"]) < reply["objects"]
    answer = page.ask("/api/answer", {"views": [reply["view"]], "truth": reply["truth"]["place"]})
    assert answer["truth"]["found"] == (answer["truth"]["metres"] <= answer["radius"])
    assert answer["truth"]["rank"] >= 1
    spoiled = page.ask("/api/simulate", body | {"noise": "strong"})
    assert spoiled["view"]["compass"] != reply["view"]["compass"]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"place": [0.0, 0.0]}, "no cell"),
        ({"place": "here"}, "place"),
        ({"noise": "loud"}, "loud"),
        ({"seed": -1}, "seed"),
        ({"fov": 0}, "field of view"),
        ({"heading": 1e9, "fov": 90}, "heading"),
    ],
)
def test_invalid_simulation_is_refused(page: Page, change: dict[str, Any], word: str) -> None:
    place = latlon(page.bench, longest(page.bench))
    page.refused("/api/simulate", {"place": place, **change}, word)


@pytest.mark.parametrize("suffix", ["gpkg", "geojson", "kml"])
def test_answer_is_exported(page: Page, suffix: str, tmp_path: Path) -> None:
    cell = longest(page.bench)
    body = {"views": [{"photos": [photo(page.bench, cell, 80.0)]}]}
    code, headers, content = page.send(f"/api/export?format={suffix}", json.dumps(body).encode())
    assert code == 200
    assert headers["content-disposition"] == f'attachment; filename="answer.{suffix}"'
    file = tmp_path / f"answer.{suffix}"
    file.write_bytes(content)
    folders = ["Regions to search", "Candidates", "Objects of the query"]
    layers = {"gpkg": ["regions", "candidates", "rays"], "kml": folders}.get(suffix, [None])
    tables = [gpd.read_file(file, layer=layer).to_crs("EPSG:4326") for layer in layers]
    kinds = {kind for table in tables for kind in table.geom_type}
    assert kinds == {"Polygon", "Point", "LineString"}
    if suffix != "gpkg":
        assert tables[0]["Name"].tolist()[0] == "region 1"
    lat, lon = latlon(page.bench, cell)
    bounds = np.array([table.total_bounds for table in tables])
    assert (bounds[:, :2].min(axis=0) <= (lon, lat)).all()
    assert (bounds[:, 2:].max(axis=0) >= (lon, lat)).all()


@pytest.mark.parametrize(
    ("pattern", "legs", "place"),
    [
        ("101", [(30.0, 40.0)], 1),
        ("110", [(10.0, 0.0)], 1),
        ("011", [(20.0, 40.0)], 1),
        ("010", [], 0),
    ],
)
def test_steps_over_a_view_without_marks_are_added(
    bench: Workbench, pattern: str, legs: list[tuple[float, float]], place: int
) -> None:
    mark = {"x": 10, "y": 10, "class": "?"}
    steps = [None, {"bearing": 90, "metres": 10}, {"bearing": 26.565051177, "metres": 44.72135955}]
    views = [
        {"photos": [{**SIDE, "fov": FOV, "marks": [mark] * int(has_marks)}], "step": step}
        for has_marks, step in zip(pattern, steps, strict=True)
    ]
    question = Question.parse({"views": views}, taxonomy=bench.taxonomy, radius=30.0)
    assert [(leg.dx, leg.dy) for leg in question.legs] == [pytest.approx(leg) for leg in legs]
    assert [len(views) for views in question.versions] == [pattern.count("1")]
    assert question.place_number == place
