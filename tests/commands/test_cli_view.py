"""`semsig view`: from the file of a detector to an answer."""

from __future__ import annotations

import json
import math
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base
from sentences import sentence
from small_detectors import LAYOUTS, save_detector, save_photograph
from workbench import picture

from benchmarks.rendered import Scene
from semsig_gis.observation import Camera, Photo, View, read_queries
from semsig_gis.sources import built_in_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

TAXONOMY = built_in_taxonomy()
CAMERA = Camera(width=4000, height=3000, fov=90)
SCENE = Scene(
    np.array([12.0, 20.0, 8.0]),
    np.array([-20.0, 5.0, 25.0]),
    np.array([0.85, 0.85, 0.75]),
    np.array([0.2, 0.1, 0.1]),
)
NAMES = ["bench", "bench", "fire hydrant"]
IDS = {"bench": 15, "fire hydrant": 11, "person": 1, "lion": 99}


@pytest.fixture
def coco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a file with boxes in a rendered photograph; some of them are not used."""
    monkeypatch.chdir(tmp_path)
    boxes = np.round(SCENE.boxes(CAMERA)).tolist()
    detections = [
        *zip(NAMES, boxes, [0.9, 0.8, 1.0], strict=True),
        ("bench", [0, 0, 9, 9], 0.1),
        ("person", [0, 0, 9, 9], 1.0),
        ("lion", [0, 0, 9, 9], 1.0),
    ]
    content = {
        "images": [{"id": 1, "file_name": "a.jpg", "width": 4000, "height": 3000}],
        "categories": [{"id": number, "name": name} for name, number in IDS.items()],
        "annotations": [
            {
                "id": number,
                "image_id": 1,
                "category_id": IDS[name],
                "bbox": [x0, y0, x1 - x0, y1 - y0],
                "score": score,
            }
            for number, (name, (x0, y0, x1, y1), score) in enumerate(detections)
        ],
    }
    path = tmp_path / "coco.json"
    path.write_text(json.dumps(content))
    return path


def written(path: Path) -> tuple[str | int, View]:
    """Return name and view of a file with one view, as other commands read them."""
    (line,) = read_queries(path, taxonomy=TAXONOMY)
    assert isinstance(line.query, View)
    return line.name, line.query


def test_boxes_become_views(coco: Path, run: Run) -> None:
    code, out, err = run("view coco.json --fov 90 --heading 100 --heading-error 5 --out v.jsonl")
    assert code == 0, err
    assert out == "1 view of 1 picture with 3 objects, 3 with a range.\nviews: v.jsonl\n"
    assert err.splitlines() == [
        "semsig: left out: 1 box below --min-score",
        "semsig: left out: 1 box with labels that are in no label map: lion 1",
        "semsig: left out: 1 box of things that are not street objects: person 1",
    ]
    name, view = written(coco.with_name("v.jsonl"))
    assert view.codes is not None
    assert view.ranges is not None
    assert view.range_errors is not None
    assert view.scores is not None
    assert name == "a.jpg"
    assert TAXONOMY.decode(view.codes) == "LLF"
    assert view.bearings == pytest.approx([80, 105, 125], abs=0.1)
    assert view.ranges == pytest.approx(SCENE.distances, rel=0.02)
    bench = TAXONOMY.by_name("bench")
    assert bench.height_m is not None
    assert bench.height_sigma is not None
    spread = bench.height_sigma / bench.height_m
    assert view.range_errors[0] == pytest.approx(spread, abs=0.01)
    assert view.scores[:, bench.code].tolist() == [0.9, 0.8, 0.0]
    assert view.scores[:, 0] == pytest.approx([0.1, 0.2, 0.0])
    assert view.photos == (Photo(sectors=((55.0, 145.0),), north_sigma=5.0),)


def test_json_contains_the_counts(coco: Path, run: Run) -> None:
    code, out, _ = run(f"view {coco} --fov 90 --out v.jsonl --json --min-score 0")
    report = json.loads(out)
    assert code == 0
    assert (report["views"], report["objects"], report["unknown_heading"]) == (1, 4, 1)
    assert report["left_out"]["unknown_labels"] == {"lion": 1}
    assert written(coco.with_name("v.jsonl"))[1].photos[0].north_sigma == math.inf


def test_focal_length_is_read_from_exif(coco: Path, run: Run) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 26  # millimetres of film
    (coco.parent / "images").mkdir()
    Image.new("L", (400, 300)).save(coco.parent / "images/a.jpg", exif=exif)
    assert run("view coco.json --out v.jsonl")[0] == 0
    assert written(coco.with_name("v.jsonl"))[1].photos[0].width == pytest.approx(67.3, abs=0.1)


def test_direction_of_travel_and_picture_that_is_not_read_are_noted(coco: Path, run: Run) -> None:
    file = coco.with_name("a.jpg")
    content = picture(exif={Base.FocalLengthIn35mmFilm: 26}, gps={GPS.GPSTrack: 200.0})
    file.write_bytes(content)
    code, _, err = run("view coco.json --out v.jsonl")
    assert (code, "the direction of travel" in err, "true north" in err) == (0, True, True)
    file.write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")
    code, _, err = run("view coco.json --out v.jsonl --fov 90 --heading 200")
    assert (code, "not opened" in err, "HEIC" in err, "travel" in err) == (0, True, True, False)
    sentence(run("view coco.json --out v.jsonl --fov 90"), "HEIC", "--heading")


def test_pictures_and_files_that_are_left_out_are_named(coco: Path, run: Run) -> None:
    folder = coco.parent / "labels"
    folder.mkdir()
    rows = ["filename,class,xmin,ymin,xmax,ymax", "a.jpg,bench,9,9,50,90", "b.jpg,bench,9,9,50,90"]
    (folder / "_annotations.csv").write_text("\n".join(rows))
    (folder / "README.txt").write_text("Two pictures.\n")
    Image.new("L", (400, 300)).save(folder / "a.jpg")
    code, out, err = run("view labels --fov 90 --out v.jsonl")
    assert code == 0, err
    assert out == "1 view of 1 picture with 1 object, 1 with a range.\nviews: v.jsonl\n"
    first, second = err.splitlines()[:2]
    assert first == "semsig: left out: labels/README.txt, in no format of detections"
    assert second.startswith("semsig: left out: 1 picture: the size of the picture b.jpg is not ")
    assert second.endswith(
        "or --size WIDTHxHEIGHT (b.jpg is not in labels; the nearest is 'a.jpg')."
    )
    report = json.loads(run("view labels --fov 90 --out v.jsonl --json")[1])
    assert report["unknown_files"] == ["labels/README.txt"]
    assert list(report["left_out"]["pictures"]) == ["b.jpg"]


@pytest.mark.usefixtures("coco")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("coco.json --fov 90 --out v.jsonl --size 4000", "give width and height in pixels"),
        ("coco.json --fov 90 --out v.jsonl --images no", "which is not a folder"),
        ("coco.json --fov 90 --out v.jsonl --heading-error big", "give degrees or 'unknown'"),
    ],
)
def test_invalid_options_are_refused(arguments: str, words: str, run: Run) -> None:
    sentence(run(f"view {arguments}"), words)


@pytest.fixture
def photos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of photographs of the same name with different headings, and a detector."""
    monkeypatch.chdir(tmp_path)
    for folder, heading in (("north", 350.0), ("east", 80.0), ("unknown", None)):
        exif = Image.Exif()
        exif.get_ifd(IFD.Exif)[Base.FocalLengthIn35mmFilm] = 26
        if heading is not None:
            gps: dict[int, object] = {GPS.GPSImgDirectionRef: "T", GPS.GPSImgDirection: heading}
            exif.get_ifd(IFD.GPSInfo).update(gps)
        (tmp_path / "photos" / folder).mkdir(parents=True)
        save_photograph(tmp_path / "photos" / folder / "a.jpg", exif)
    save_detector(tmp_path / "model.onnx", LAYOUTS["yolo_v8"])
    return tmp_path / "photos"


@pytest.mark.usefixtures("photos")
@pytest.mark.parametrize("labels", ["--labels coco", "--labels names.yaml --labels coco"])
def test_detector_finds_the_objects_of_photographs(labels: str, run: Run, tmp_path: Path) -> None:
    names = {number: f"thing {number}" for number in range(80)} | {13: "bench", 10: "hydrant"}
    (tmp_path / "names.yaml").write_text(json.dumps({"names": names}))
    code, out, err = run(
        "view --detector model.onnx photos/north photos/east photos/unknown --out v.jsonl",
        *labels.split(),
    )
    assert code == 0, err
    assert out.startswith("3 views of 3 pictures with ")
    assert "measured from true north: 2 headings" in err
    assert "the heading of 1 picture is unknown" in err
    views = [line.query for line in read_queries("v.jsonl", taxonomy=TAXONOMY)]
    bearings = []
    for view in views:
        assert isinstance(view, View)
        assert view.codes is not None
        assert view.bearings is not None
        bench = TAXONOMY.decode(view.codes).index("L")
        bearings.append(float(view.bearings[bench]))
    # The bench is 180 pixels left of the middle; the focal length is 26 mm of 43.27 mm.
    offset = math.degrees(math.atan(180 / (26 / math.hypot(36, 24) * 800)))
    expected = [(heading - offset) % 360 for heading in (350, 80, 0)]
    assert bearings == pytest.approx(expected, abs=0.5)


@pytest.mark.usefixtures("photos")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("photos/north --detector model.onnx", "give --labels coco"),
        ("photos/north --detector model.onnx --labels a.txt --labels b.txt", "a.txt and b.txt"),
    ],
)
def test_invalid_detectors_are_refused(
    arguments: str, words: str, run: Run, tmp_path: Path
) -> None:
    sentence(run(f"view {arguments} --out v.jsonl"), words)
    assert not (tmp_path / "v.jsonl").exists()


@pytest.mark.usefixtures("photos")
def test_missing_onnxruntime_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    arguments = "view photos/north --detector model.onnx --labels coco --out v.jsonl"
    sentence(run(arguments), "a detector needs onnxruntime", "pip install 'semsig_gis[detect]'")
