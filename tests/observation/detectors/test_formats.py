"""Files of detections: the same picture in every format, and invalid files."""

from __future__ import annotations

import base64
import json
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused

from semsig_gis.core import InputError
from semsig_gis.observation import Shot, read_pictures

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.observation import AnnotatedPicture

# In a picture of 800 x 400 pixels: a bench, and a sign with a lower score.
CORNERS = [(80, 100, 240, 200), (400, 40, 440, 80)]
LABELS = ["bench", "stop sign"]
SCORES = [1.0, 0.75]

COCO: dict[str, Any] = {
    "images": [{"id": 7, "file_name": "street.jpg", "width": 800, "height": 400}],
    "categories": [{"id": 15, "name": "bench"}, {"id": 13, "name": "stop sign"}],
    "annotations": [
        {"id": 1, "image_id": 7, "category_id": 15, "bbox": [80, 100, 160, 100], "iscrowd": 0},
        {"id": 2, "image_id": 7, "category_id": 13, "bbox": [400, 40, 40, 40], "score": 0.75},
    ],
}


YOLO = "0 0.2 0.375 0.2 0.25\n1 0.525 0.15 0.05 0.1 0.75\n"


def rectangle(label: str, *box: float, rotation: int = 0) -> dict[str, Any]:
    x, y, width, height = box
    return {
        "id": "Dx",
        "type": "rectanglelabels",
        "from_name": "label",
        "to_name": "image",
        "original_width": 800,
        "original_height": 400,
        "image_rotation": 0,
        "value": {
            "x": x, "y": y, "width": width, "height": height, "rotation": rotation,
            "rectanglelabels": [label],
        },
    }  # fmt: skip


TASK: dict[str, Any] = {
    "id": 3,
    "data": {"image": "/data/upload/1/0a1b2c3d-street.jpg"},
    "annotations": [
        {"id": 1, "was_cancelled": True, "result": [{}]},
    ],
    "predictions": [
        {
            "model_version": "one",
            "score": 0.4,
            "result": [
                rectangle("bench", 10, 25, 20, 25),
                {
                    **rectangle("", 0, 0, 0, 0),
                    "score": 0.75,
                    "type": "polygonlabels",
                    "value": {
                        "points": [[50, 10], [55, 12], [51, 20]], "polygonlabels": ["stop sign"],
                    },
                },
                {"type": "keypointlabels", "value": {"x": 1, "y": 1}},
            ],
        }
    ],
}  # fmt: skip


CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations>
  <version>1.1</version>
  <meta><task><name>street</name></task></meta>
  <image id="0" name="street.jpg" width="800" height="400">
    <box label="bench" source="manual" occluded="0" xtl="80" ytl="100" xbr="240" ybr="200"
      z_order="0"/>
    <polygon label="stop sign" occluded="1" points="400,40;440,50;410,80">
      <attribute name="score">0.75</attribute>
    </polygon>
    <points label="lamp" occluded="0" points="1,2"/>
    <tag label="night" source="manual"/>
  </image>
</annotations>
"""


def tile(*points: tuple[int, int]) -> str:
    """Return a vector tile of one outline as Mapillary sends it, in base64."""

    def varint(number: int) -> bytes:
        low, rest = number & 127, number >> 7
        return bytes([low | 128]) + varint(rest) if rest else bytes([low])

    def field(number: int, content: bytes) -> bytes:
        return varint(number << 3 | 2) + varint(len(content)) + content

    steps = [
        (number - before) << 1 if number >= before else ((before - number) << 1) - 1
        for (x0, y0), (x, y) in zip([(0, 0), *points], points, strict=False)
        for before, number in ((x0, x), (y0, y))
    ]
    commands = [1 | 1 << 3, *steps[:2], 2 | (len(points) - 1) << 3, *steps[2:], 7 | 1 << 3]
    geometry = field(4, b"".join(map(varint, commands)))
    feature = b"\x08\x00" + b"\x18\x03" + geometry
    layer = field(1, b"mpy-or") + field(2, feature) + b"\x28" + varint(4096) + b"\x78\x02"
    return base64.b64encode(field(3, layer)).decode()


IMAGE: dict[str, Any] = {
    "id": "street",
    "width": 800,
    "height": 400,
    "camera_type": "perspective",
    "camera_parameters": [0.85, 0.01, 0.0],
    "compass_angle": 100.0,
    "computed_compass_angle": 97.5,
    "computed_geometry": {"type": "Point", "coordinates": [7.42, 43.73]},
    "detections": {
        "data": [
            {
                "id": "1",
                "value": "bench",
                "geometry": tile((410, 2048), (1229, 1024), (1000, 1500)),
            },
            {"id": "2", "value": "stop sign", "geometry": [[400, 40], [440, 60], [420, 80]]},
        ]
    },
}


# The texts of the files of each format.
ONE = {"annotations": [{**COCO["annotations"][0], "bbox": [0, 0, 1, 1]}]}
FORMATS = {
    "coco": {"street.json": json.dumps(COCO)},
    "coco results": {
        "results.json": json.dumps([{"score": 1.0, **item} for item in COCO["annotations"]]),
        "truth.json": json.dumps(COCO | ONE),
    },
    "yolo": {
        "labels/street.txt": YOLO,
        "data.yaml": "path: .\nnames:\n  0: bench\n  1: stop sign\n",
    },
    # As segmentation models write them, with another file of names.
    "yolo polygons": {
        "my.names": "bench\nstop sign\n",
        "street.txt": "0 0.1 0.25 0.3 0.3 0.2 0.5\n1 0.5 0.1 0.55 0.2 0.52 0.15 0.75\n",
    },
    "label studio": {"export.json": json.dumps([TASK])},
    "cvat": {"annotations.xml": CVAT},
    "mapillary": {"images.json": json.dumps({"data": [IMAGE]})},
}


def pixels(picture: AnnotatedPicture) -> list[list[float]]:
    scale = (800, 400, 800, 400) if picture.shares else (1, 1, 1, 1)
    corners = [box.corners for box in picture.boxes]
    return [[side * size for side, size in zip(box, scale, strict=True)] for box in corners]


def read_format(form: str, folder: Path) -> AnnotatedPicture:
    """Write and read the files of a format; return the single picture."""
    (folder / "labels").mkdir()
    for name, text in FORMATS[form].items():
        (folder / name).write_text(text)
    files = ["labels"] if form == "yolo" else FORMATS[form]
    (picture,), _ = read_pictures([folder / name for name in files])
    return picture


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_gives_same_boxes(form: str, tmp_path: Path) -> None:
    picture = read_format(form, tmp_path)
    assert picture.name.removesuffix(".jpg") == "street"
    assert [box.label for box in picture.boxes] == LABELS
    for box_pixels, corners in zip(pixels(picture), CORNERS, strict=True):
        assert box_pixels == pytest.approx(corners, abs=0.15)  # 1 / 4096 of a tile
    scores = [1.0, 1.0] if form == "mapillary" else SCORES  # it has no scores
    assert [box.score for box in picture.boxes] == scores
    assert [box.whole for box in picture.boxes] == [True, form != "cvat"]
    assert picture.others == (form in {"label studio", "cvat"})
    assert picture.shot.size == (None if form.startswith("yolo") else (800, 400))


def test_mapillary_image_has_camera_and_position(tmp_path: Path) -> None:
    shot = Shot(
        camera="pinhole",
        focal=0.85,
        heading=97.5,
        heading_error=3.0,
        north="true",
        size=(800, 400),
        position=(43.73, 7.42),
    )
    assert read_format("mapillary", tmp_path).shot == shot


def test_mapillary_detections_are_grouped_by_image(tmp_path: Path) -> None:
    first, second = IMAGE["detections"]["data"][:1] * 2
    items = [{**first, "image": {"id": "a"}}, {**second, "image": {"id": "b"}}]
    (tmp_path / "detections.json").write_text(json.dumps({"data": items}))
    assert [picture.name for picture in read_pictures([tmp_path])[0]] == ["a", "b"]


ROTATED = {
    "id": 1,
    "data": {"image": "a.jpg"},
    "annotations": [{"result": [rectangle("x", 50, 25, 10, 10, rotation=90)]}],
}
ROTATED_IN_CVAT = """<annotations><image name="a" width="800" height="400">
  <box label="x" xtl="400" ytl="100" xbr="480" ybr="140" rotation="90"/>
</image></annotations>"""


@pytest.mark.parametrize(
    ("name", "text", "corners"),
    [
        # Rotated by 90 degrees about its upper left corner, and about its middle.
        ("a.json", json.dumps([ROTATED]), (360, 100, 400, 180)),
        ("a.xml", ROTATED_IN_CVAT, (420, 80, 460, 160)),
    ],
)
def test_rotated_box_becomes_bounding_box(
    name: str, text: str, corners: tuple[float, ...], tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    (picture,), _ = read_pictures([tmp_path])
    assert pixels(picture)[0] == pytest.approx(corners)


def changed(**values: object) -> str:
    return json.dumps({**COCO, **values})


def annotation(**values: object) -> str:
    return changed(annotations=[{**COCO["annotations"][0], **values}])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.json", "{", "a.json is not JSON"),
        ("a.json", "{}", "contains no detections in a known format; give JSON (COCO"),
        ("a.json", "[1]", "contains no detections"),
        ("a.json", json.dumps(COCO["annotations"]), "without images and categories"),
        ("a.json", annotation(bbox=[1, 2, 3]), "does not follow its format"),
        ("a.json", annotation(bbox=[1, 2, "x", 4]), "does not follow its format"),
        ("a.json", annotation(bbox=[1, 2, None, 4]), "does not follow its format"),
        ("a.json", annotation(bbox=[1, 2, -3, 4]), "annotation 1 has the box (1.0, 2.0, -2.0"),
        ("a.json", annotation(bbox=[1, 2, 1e999, 4]), "annotation 1 has the box"),
        ("a.json", annotation(score=7), "annotation 1 has the score 7"),
        ("a.json", annotation(score="high"), "not a number"),
        ("a.json", annotation(image_id=8), "annotation 1 is of the image 8, which is not listed"),
        ("a.json", annotation(category_id=8), "of the category 8, which is not listed"),
        ("a.json", changed(images=[{"id": 7}, 3]), "does not follow its format"),
        ("a.json", changed(annotations=[{}]), "lacks 'image_id'"),
        ("a.json", changed(categories=[{"id": 1}]), "lacks 'name'"),
        ("a.json", json.dumps([{"data": {}, "annotations": [{"result": [3]}]}]), "not follow its"),
        ("a.json", json.dumps({**IMAGE, "detections": [{"value": "x", "geometry": "?"}]}),
         "image street, detection 1 has a geometry that is not a vector tile"),
        ("a.json", json.dumps({**IMAGE, "detections": [{"value": "x", "geometry": "Gv8="}]}),
         "not a vector tile"),
        ("a.json", json.dumps({"data": [{"value": "x", "geometry": [[9, 9]]}]}), "unknown size"),
        ("a.txt", "0 0.5 0.5 0.1\n", "line 1 is not a line of YOLO"),
        ("a.txt", "bench 0.5 0.5 0.1 0.1\n", "line 1 is not a line of YOLO"),
        ("a.txt", "0 0.5 x 0.1 0.1\n", "line 1 has a value that is not a number"),
        ("a.txt", "0 400 200 10 10\n", "is not in shares of the picture"),
        ("a.txt", "9 0.5 0.5 0.1 0.1\n", "is of class 9, which has no name"),
        ("a.xml", "<a", "not XML that can be read"),
        ("a.xml", "<a/>", "is not a CVAT file"),
        ("a.xml", "<!DOCTYPE a><a/>", "its own document type"),
        ("a.xml", "<annotations><track/></annotations>", "contains tracks of a video"),
        ("a.xml", CVAT.replace(' name="street.jpg"', ""), "lacks 'name'"),
        ("a.xml", CVAT.replace('"400,40;440', '"400;440'), "does not follow its format"),
        ("a.png", "", "is not in a supported format"),
    ],
)  # fmt: skip
def test_what_is_no_such_file_is_refused(name: str, text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "classes.txt").write_text("bench\n")
    (tmp_path / name).write_text(text)
    with refused(InputError, name, words):
        read_pictures([tmp_path / name])


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (None, "have no names; give its data.yaml"),
        ("nc: 2\n", "has no list of class names"),
        ("names: 3\n", "has no list of class names"),
        ("names: [", "has no list of class names"),
    ],
)
def test_yolo_without_valid_class_names_is_refused(
    names: str | None, words: str, tmp_path: Path
) -> None:
    (tmp_path / "a.txt").write_text(YOLO)
    if names is not None:
        (tmp_path / "data.yaml").write_text(names)
    with refused(InputError, words):
        read_pictures([tmp_path])


def test_folder_without_detections_is_refused(tmp_path: Path) -> None:
    with refused(InputError, "contains no file of detections"):
        read_pictures([tmp_path])
    with refused(InputError, "absent.json cannot be read"):
        read_pictures([tmp_path / "absent.json"])
