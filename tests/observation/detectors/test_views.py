"""Convert boxes and camera data to views."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from noisy_cells import column, parts_of
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
    read_pictures,
    read_shots,
)
from semsig_gis.sources import built_in_taxonomy, paper_taxonomy

TAXONOMY = built_in_taxonomy()
BUILDER = ViewBuilder(
    labels=LabelMap.open([], TAXONOMY), taxonomy=TAXONOMY, shot=Shot(fov=90.0, heading=350.0)
)
BENCH = TAXONOMY.by_name("bench")
SIZE = Shot(size=(1000, 800))  # with 90 degrees, 500 pixels to the focal length


def picture(*boxes: Box, name: str = "a.jpg", **shot: Any) -> AnnotatedPicture:  # noqa: ANN401
    return AnnotatedPicture(name=name, boxes=boxes, shot=replace(SIZE, **shot))


def box(label: str = "bench", x: float = 490, top: float = 400, **more: Any) -> Box:  # noqa: ANN401
    return Box(label=label, corners=(x, top, x + 20, top + 50), **more)


def single_view(builder: ViewBuilder, *pictures: AnnotatedPicture, **more: Any) -> View:  # noqa: ANN401
    ((_, view),), _ = builder.views(pictures, **more)
    return view


def test_box_gives_bearing_and_range() -> None:
    view = single_view(BUILDER, picture(box(), box("street_light", x=990)))
    codes, bearings = parts_of(view)
    assert codes.tolist() == [TAXONOMY.by_name("street_light").code, BENCH.code]
    assert bearings.tolist() == [34.71, 350.0]  # the first is cut at the edge
    assert BENCH.height_m is not None
    assert BENCH.height_sigma is not None
    ranges = [math.nan, BENCH.height_m * 500 / 50]
    assert column(view, "ranges") == pytest.approx(ranges, nan_ok=True)
    spread = math.hypot(BENCH.height_sigma / BENCH.height_m, 1 / 50)
    assert column(view, "range_errors")[1] == pytest.approx(spread, abs=1e-3)
    assert view.scores is None
    assert view.photos[0].sectors == ((305.0, 395.0),)
    assert view.photos[0].north_sigma is None


@pytest.mark.parametrize(
    "boxes",
    [
        box(top=0),
        box(top=750),
        box(x=0),
        box(x=979.5),
        box(whole=False),
        box("taxi_station"),
        box("pole"),
        box("object--street-light"),
    ],
    ids=str,
)
def test_cut_or_hidden_boxes_or_unknown_heights_have_no_range(boxes: Box) -> None:
    assert single_view(BUILDER, picture(boxes)).ranges is None


def test_height_of_label_has_priority_over_class() -> None:
    view = single_view(BUILDER, picture(box("stop sign")))
    assert column(view, "ranges") == pytest.approx(0.8 * 500 / 50)


def test_score_is_probability_of_class_and_rest_of_any_class() -> None:
    view = single_view(BUILDER, picture(box(score=0.8), box("pole", score=0.5, x=600)))
    row = view.to_dict(TAXONOMY)
    assert row["scores"] == [
        {"unknown": 0.6, "street_light": 0.2, "indicator": 0.15, "traffic_light": 0.05},
        {"unknown": 0.2, "bench": 0.8},
    ]
    assert row["types"] == "DL"


def test_picture_that_cannot_be_read_is_no_obstacle_where_all_is_known(tmp_path: Path) -> None:
    (tmp_path / "a.heic").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")
    builder = replace(BUILDER, folders=[tmp_path])
    boxes = picture(box(), name="a.heic")
    ((_, view),), tally = builder.views([boxes])
    assert view.to_dict(TAXONOMY) == single_view(BUILDER, boxes).to_dict(TAXONOMY)
    assert "HEIC" in tally.unread["a.heic"]
    case = Path(__file__).parents[2] / "cases" / "G21_heic" / "detections.json"
    pictures, _ = read_pictures([case])
    _, tally = replace(builder, folders=None).views(pictures)
    assert list(tally.unread) == ["p1.heic"]
    for shot in (Shot(fov=90.0), Shot(heading=0.0), Shot(fov=90.0, heading=0.0)):
        with refused(InputError, "HEIC"):
            replace(builder, shot=shot).views([picture(box(), name="a.heic", size=None)])


def test_ignored_boxes_are_counted() -> None:
    boxes = [box(score=0.2), box("person"), box("lion"), box("lion"), box("fire hydrant"), box()]
    city = replace(BUILDER, taxonomy=paper_taxonomy())
    _, tally = city.views([replace(picture(*boxes), others=2)])
    assert tally.to_dict() == {
        "photos": 1,
        "objects": 1,
        "with_range": 1,
        "unknown_heading": 0,
        "headings_from_north": {},
        "left_out": {
            "pictures": {},
            "below_min_score": 1,
            "no_boxes": 2,
            "faulty_boxes": 0,
            "no_street_objects": {"person": 1},
            "unknown_labels": {"lion": 2},
            "classes_not_in_city": {"fire hydrant": 1},
        },
    }


def test_data_of_picture_has_priority_over_data_of_all_and_of_file() -> None:
    builder = replace(
        BUILDER,
        shot=Shot(heading_error=2.0),
        shots={"a.jpg": Shot(heading=10.0, fov=60.0), "b": Shot(heading_error=5.0)},
    )
    file: dict[str, Any] = {"heading": 77.0, "heading_error": 3.0, "north": "true", "focal": 0.5}
    views, tally = builder.views([picture(**file), picture(**file, name="x/b.jpg")])
    (first,), (second,) = (view.photos for _, view in views)
    assert (first.sectors, first.north_sigma) == (((340.0, 400.0),), 2.0)
    assert (second.sectors, second.north_sigma) == (((32.0, 122.0),), 5.0)
    assert tally.north == {"true": 1}


def test_pictures_of_same_place_are_one_view() -> None:
    here, near, far = (43.0, 7.0), (43.00003, 7.0), (43.001, 7.0)
    pictures = [
        picture(box(), name=f"{number}.jpg", position=position, heading=90.0 * number, time=time)
        for number, position in enumerate((here, near, far, None))
        for time in [f"2026-05-31T10:00:0{number}Z"]
    ]
    builder = replace(BUILDER, shot=Shot(fov=60.0))
    for places, counts in (("each", [1, 1, 1, 1]), ("gps", [2, 1, 1]), ("all", [4])):
        views, tally = builder.views(pictures, places=places)  # type: ignore[arg-type]
        assert [len(view.photos) for _, view in views] == counts
    view = views[0][1]
    assert tally.times == {"0.jpg": "2026-05-31T10:00:00Z"}
    assert view.photo_rows.tolist() == [0, 1, 2, 3]
    assert column(view, "bearings").tolist() == [0.0, 90.0, 180.0, 270.0]
    table = {"1": Shot(place="corner"), "3.jpg": Shot(place="corner")}
    views, _ = replace(builder, shots=table).views(pictures)
    assert [name for name, _ in views] == ["0.jpg", "corner", "2.jpg"]


def test_view_is_written_and_parsed_again() -> None:
    pictures = [
        picture(box(score=0.8), box("taxi_station", x=700), name="1.jpg"),
        picture(box(x=100), name="2.jpg", heading=90.0, heading_error=3.0),
    ]
    view = single_view(replace(BUILDER, shot=Shot(fov=60.0)), *pictures, places="all")
    (line,) = parse_queries([json.dumps(view.to_dict(TAXONOMY))], "-", taxonomy=TAXONOMY)
    assert isinstance(line.query, View)
    assert line.query.to_dict(TAXONOMY) == view.to_dict(TAXONOMY)
    assert line.query.photos == view.photos
    assert [photo.north_sigma for photo in view.photos] == [math.inf, 3.0]
    assert 0.0 in column(view, "bearings")  # of the middle of the photo without heading


def test_size_is_read_from_picture_file(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "a.jpg")
    bare = AnnotatedPicture(
        name="a", boxes=(Box(label="bench", corners=(0.49, 0.5, 0.51, 0.6)),), shares=True
    )
    with refused(InputError, "the size of the picture a is not known"):
        BUILDER.views([bare])
    view = single_view(replace(BUILDER, folders=[tmp_path / "no", tmp_path]), bare)
    assert column(view, "ranges") == pytest.approx(0.85 * 500 / 80, abs=0.01)


def test_size_of_all_is_used_only_for_unknown_sizes(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "a.jpg")
    builder = replace(BUILDER, shot=Shot(fov=90.0, size=(100, 80)))
    sized, bare = picture(box()), AnnotatedPicture(name="a", boxes=(box(),))
    for item, folders in ((sized, []), (bare, [tmp_path])):
        view = single_view(replace(builder, folders=folders), item)
        assert column(view, "bearings").tolist() == [0.0]
    without_boxes = single_view(builder, replace(bare, boxes=()))
    assert (len(without_boxes), without_boxes.photos[0].width) == (0, 90)


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("P1.JPG", "p1.jpg"),
        ("p1.jpg", "P1.JPG"),
        ("images/p1.JPG", "p1.jpg"),
        ("C:\\photos\\p1.jpg", "p1.jpg"),
        ("photos\\p1.jpg", "photos/p1.jpg"),
        ("p1.jpg", "p1.png"),
        ("p1", "p1.JPG"),
        ("p1_jpg.rf.0a1b2c3d4e5f.jpg", "p1.jpg"),
        ("p1_JPG.rf.0a1b2c3d4e5f", "p1.JPG"),
    ],
)
def test_file_of_picture_is_found(name: str, file: str, tmp_path: Path) -> None:
    (tmp_path / file).parent.mkdir(exist_ok=True)
    Image.new("L", (1000, 800)).save(tmp_path / file)
    bare = AnnotatedPicture(name=name, boxes=(box(),))
    view = single_view(replace(BUILDER, folders=[tmp_path]), bare)
    assert column(view, "bearings").tolist() == [350.0]


def test_copy_of_roboflow_has_priority_over_its_original(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "p1_jpg.rf.0a1b.jpg")
    Image.new("L", (80, 80)).save(tmp_path / "p1.jpg")
    bare = AnnotatedPicture(name="p1_jpg.rf.0a1b.jpg", boxes=(box(),), folder=tmp_path)
    view = single_view(replace(BUILDER, folders=None), bare)
    assert column(view, "bearings").tolist() == [350.0]


def test_boxes_of_picture_of_another_shape_are_refused(tmp_path: Path) -> None:
    Image.new("L", (800, 1000)).save(tmp_path / "a.jpg")
    Image.new("L", (250, 201)).save(tmp_path / "b.jpg")  # a smaller copy, rounded
    builder = replace(BUILDER, folders=[tmp_path])
    with refused(InputError, "in a picture of 1000 x 800 pixels", "is 800 x 1000 as it is shown"):
        builder.views([picture(box())])
    assert len(single_view(builder, picture(box(), name="b.jpg"))) == 1


def test_pictures_that_cannot_be_used_are_left_out(tmp_path: Path) -> None:
    Image.new("L", (1000, 800)).save(tmp_path / "a.jpg")
    (tmp_path / "c.jpg").write_bytes(b"no picture")
    bare = [AnnotatedPicture(name=f"{name}.jpg", boxes=(box(),)) for name in "abc"]
    views, tally = replace(BUILDER, folders=[tmp_path]).views(bare)
    assert [name for name, _ in views] == ["a.jpg"]
    assert (tally.photos, tally.objects, list(tally.unusable)) == (1, 1, ["b.jpg", "c.jpg"])
    assert f"(b.jpg is not in {tmp_path}; the nearest is 'c.jpg')" in tally.unusable["b.jpg"]
    assert "it is not a picture" in tally.unusable["c.jpg"]
    with refused(InputError, "the size of the picture b.jpg is not known"):
        replace(BUILDER, folders=[tmp_path]).views(bare[1:2])


def test_unknown_field_of_view_and_table_of_other_pictures_are_refused() -> None:
    with refused(InputError, "--photos names b.jpg, but none", "name them as a.jpg"):
        replace(BUILDER, shots={"b.jpg": Shot()}).views([picture()])
    with refused(InputError, "the field of view of the picture a.jpg is not known; give --fov"):
        replace(BUILDER, shot=Shot()).views([picture()])
    panorama = single_view(replace(BUILDER, shot=Shot(camera="equirectangular")), picture())
    assert panorama.photos[0].width == 360


def test_table_of_pictures_is_read(tmp_path: Path) -> None:
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
def test_invalid_table_is_refused(row: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "photos.csv"
    path.write_text(row + "\n")
    with refused(InputError, "photos.csv", words):
        read_shots(path)
