"""From boxes and what is known of the camera to views."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.observation import (
    AnnotatedPicture,
    Box,
    LabelMap,
    Shot,
    View,
    ViewBuilder,
    parse_queries,
    read_shots,
)
from semsig_gis.sources import built_in_taxonomy, paper_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

TAXONOMY = built_in_taxonomy()
DETECTOR = ViewBuilder(
    labels=LabelMap.open([], TAXONOMY), taxonomy=TAXONOMY, shot=Shot(fov=90.0, heading=350.0)
)
BENCH = TAXONOMY.by_name("bench")
SIZE = Shot(size=(1000, 800))  # with 90 degrees, 500 pixels to the focal length


def picture(*boxes: Box, name: str = "a.jpg", **known: Any) -> AnnotatedPicture:  # noqa: ANN401
    return AnnotatedPicture(name=name, boxes=boxes, shot=replace(SIZE, **known))


def box(label: str = "bench", left: float = 490, top: float = 400, **more: Any) -> Box:  # noqa: ANN401
    return Box(label=label, corners=(left, top, left + 20, top + 50), **more)


def one(detector: ViewBuilder, *pictures: AnnotatedPicture, **more: Any) -> View:  # noqa: ANN401
    ((_, view),), _ = detector.views(pictures, **more)
    return view


def test_a_box_gives_bearing_and_range() -> None:
    view = one(DETECTOR, picture(box(), box("street_light", left=990)))
    assert view.codes is not None
    assert view.bearings is not None
    assert view.ranges is not None
    assert view.range_errors is not None
    assert view.codes.tolist() == [TAXONOMY.by_name("street_light").code, BENCH.code]
    assert view.bearings.tolist() == [34.71, 350.0]  # the first is cut at the edge
    assert BENCH.height_m is not None
    assert BENCH.height_sigma is not None
    assert math.isnan(view.ranges[0])
    assert view.ranges[1] == pytest.approx(BENCH.height_m * 500 / 50)
    spread = math.hypot(BENCH.height_sigma / BENCH.height_m, 1 / 50)
    assert view.range_errors[1] == pytest.approx(spread, abs=1e-3)
    assert view.scores is None
    assert view.photos[0].sectors == ((305.0, 395.0),)
    assert view.photos[0].north_sigma is None


@pytest.mark.parametrize(
    "boxes",
    [
        box(top=0),
        box(top=750),
        box(left=0),
        box(left=979.5),
        box(whole=False),
        box("taxi_station"),
        box("pole"),
        box("object--street-light"),
    ],
    ids=str,
)
def test_what_is_cut_hidden_or_of_no_known_height_has_no_range(boxes: Box) -> None:
    assert one(DETECTOR, picture(boxes)).ranges is None


def test_the_height_of_a_label_goes_before_that_of_its_class() -> None:
    view = one(DETECTOR, picture(box("stop sign")))
    assert view.ranges is not None
    assert view.ranges[0] == pytest.approx(0.8 * 500 / 50)


def test_a_score_is_the_chance_of_the_class_and_the_rest_any() -> None:
    view = one(DETECTOR, picture(box(score=0.8), box("pole", score=0.5, left=600)))
    assert view.scores is not None
    assert view.to_dict(TAXONOMY)["scores"] == [
        {"unknown": 0.6, "street_light": 0.2, "indicator": 0.15, "traffic_light": 0.05},
        {"unknown": 0.2, "bench": 0.8},
    ]
    assert view.to_dict(TAXONOMY)["types"] == "DL"


def test_what_is_left_out_is_counted() -> None:
    boxes = [box(score=0.2), box("person"), box("lion"), box("lion"), box("fire hydrant"), box()]
    city = replace(DETECTOR, taxonomy=paper_taxonomy())
    ((_, view),), tally = city.views([replace(picture(*boxes), others=2)])
    assert len(view) == 1
    assert tally.to_dict() == {
        "photos": 1,
        "objects": 1,
        "with_range": 1,
        "unknown_heading": 0,
        "headings_from_north": {},
        "left_out": {
            "below_min_score": 1,
            "no_boxes": 2,
            "no_street_objects": {"person": 1},
            "unknown_labels": {"lion": 2},
            "classes_not_in_city": {"fire hydrant": 1},
        },
    }


def test_a_heading_that_nobody_knows_is_unknown() -> None:
    view = one(replace(DETECTOR, shot=Shot(fov=90.0)), picture(box()))
    assert view.photos[0].north_sigma == math.inf
    assert view.bearings is not None
    assert view.bearings.tolist() == [0.0]


def test_what_is_said_of_a_picture_goes_before_what_is_said_of_all_and_its_file() -> None:
    detector = replace(
        DETECTOR,
        shot=Shot(heading_error=2.0),
        shots={"a.jpg": Shot(heading=10.0, fov=60.0), "b": Shot(heading_error=5.0)},
    )
    file: dict[str, Any] = {"heading": 77.0, "heading_error": 3.0, "north": "true", "focal": 0.5}
    views, tally = detector.views([picture(**file), picture(**file, name="x/b.jpg")])
    (first,), (second,) = (view.photos for _, view in views)
    assert (first.sectors, first.north_sigma) == (((340.0, 400.0),), 2.0)
    assert (second.sectors, second.north_sigma) == (((32.0, 122.0),), 5.0)
    assert tally.north == {"true": 1}


def test_pictures_of_one_place_are_one_view() -> None:
    here, near, far = (43.0, 7.0), (43.00003, 7.0), (43.001, 7.0)
    pictures = [
        picture(
            box(),
            name=f"{number}.jpg",
            position=position,
            heading=90.0 * number,
            time=f"2026-05-31T10:00:0{number}Z",
        )
        for number, position in enumerate((here, near, far, None))
    ]
    detector = replace(DETECTOR, shot=Shot(fov=60.0))
    for places, counts in (("each", [1, 1, 1, 1]), ("gps", [2, 1, 1]), ("all", [4])):
        views, tally = detector.views(pictures, places=places)  # type: ignore[arg-type]
        assert [len(view.photos) for _, view in views] == counts
    view = views[0][1]
    assert tally.times == {"0.jpg": "2026-05-31T10:00:00Z"}
    assert view.photo_rows.tolist() == [0, 1, 2, 3]
    assert view.bearings is not None
    assert view.bearings.tolist() == [0.0, 90.0, 180.0, 270.0]
    table = {"1": Shot(place="corner"), "3.jpg": Shot(place="corner")}
    views, _ = replace(detector, shots=table).views(pictures)
    assert [name for name, _ in views] == ["0.jpg", "corner", "2.jpg"]


def test_what_is_written_is_read_as_it_was() -> None:
    pictures = [
        picture(box(score=0.8), box("taxi_station", left=700), name="1.jpg"),
        picture(box(left=100), name="2.jpg", heading=90.0, heading_error=3.0),
    ]
    view = one(replace(DETECTOR, shot=Shot(fov=60.0)), *pictures, places="all")
    (line,) = parse_queries([json.dumps(view.to_dict(TAXONOMY))], "-", taxonomy=TAXONOMY)
    assert isinstance(line.query, View)
    assert line.query.to_dict(TAXONOMY) == view.to_dict(TAXONOMY)
    assert line.query.photos == view.photos
    assert [photo.north_sigma for photo in view.photos] == [math.inf, 3.0]


def test_the_file_of_a_picture_tells_its_size(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "a.jpg")
    bare = AnnotatedPicture(
        name="a", boxes=(Box(label="bench", corners=(0.49, 0.5, 0.51, 0.6)),), shares=True
    )
    with refused(InputError, "the size of the picture a is not known"):
        DETECTOR.views([bare])
    view = one(replace(DETECTOR, folders=[tmp_path / "no", tmp_path]), bare)
    assert view.ranges is not None
    assert view.ranges[0] == pytest.approx(0.85 * 500 / 80, abs=0.01)


def test_a_size_that_is_said_is_for_pictures_of_unknown_size(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "a.jpg")
    detector = replace(DETECTOR, shot=Shot(fov=90.0, size=(100, 80)))
    known, bare = picture(box()), AnnotatedPicture(name="a", boxes=(box(),))
    for taken, folders in ((known, []), (bare, [tmp_path])):
        view = one(replace(detector, folders=folders), taken)
        assert view.bearings is not None
        assert view.bearings.tolist() == [0.0]
    assert one(detector, replace(bare, boxes=())).photos[0].width == 90


def test_a_table_of_other_pictures_is_refused() -> None:
    with refused(InputError, "--photos names b.jpg, but none", "name them as a.jpg"):
        replace(DETECTOR, shots={"b.jpg": Shot()}).views([picture()])


def test_a_photograph_of_unknown_field_of_view_is_refused() -> None:
    with refused(InputError, "the field of view of the picture a.jpg is not known; give --fov"):
        replace(DETECTOR, shot=Shot()).views([picture()])
    assert (
        one(replace(DETECTOR, shot=Shot(camera="equirectangular")), picture()).photos[0].width
        == 360
    )


def test_pictures_in_a_table(tmp_path: Path) -> None:
    path = tmp_path / "photos.csv"
    path.write_text(
        "image,camera,fov,heading,heading_error,pitch,roll,place\n"
        "a.jpg,fisheye,180,-10,unknown,,5,x\nb.jpg,,,20,3,-2,,\n"
    )
    shots = read_shots(path)
    assert shots["a"] == shots["a.jpg"]
    assert shots["a"] == Shot(
        camera="fisheye", fov=180, heading=-10, heading_error=math.inf, roll=5, place="x"
    )
    assert shots["b.jpg"] == Shot(heading=20, heading_error=3, pitch=-2)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("image\n,", "names no image"),
        ("image,camera\na,phone", "the camera 'phone' is none of pinhole"),
        ("image,fov\na,wide", "line 2 of"),
        ("image,heading\na,1000", "the heading is 1000.0"),
        ("image,heading_error\na,much", "'much'; give degrees or 'unknown'"),
    ],
)
def test_a_table_that_is_wrong_is_refused(row: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "photos.csv"
    path.write_text(row + "\n")
    with refused(InputError, "photos.csv", words):
        read_shots(path)


def test_nothing_seen_is_a_view_too() -> None:
    view = one(DETECTOR, picture())
    assert len(view) == 0
    assert np.isfinite(view.photos[0].width)
