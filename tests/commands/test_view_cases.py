"""Files of detections as people have them: each gives the same bearings, or one sentence."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from sentences import sentence

if TYPE_CHECKING:
    from conftest import Run

CASES = Path(__file__).parents[1] / "cases"
BOTH = [65.44, 113.39]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("case", "line", "right", "words"),
    [
        ("G17_names", "detections.json --images .", BOTH, ""),
        ("G19_roboflow_name", "detections.json", BOTH, ""),
        ("G23_case", "detections.json --images .", BOTH, ""),
        ("H04_kitti", "p1.txt", BOTH, ""),
        ("H11_yolo_track", "p1.txt", BOTH, ""),
        *(("H16_yolo_layout", path, BOTH, "") for path in (".", "data.yaml", "labels/train")),
        ("H31_coco_seg_only", "d.json", BOTH, ""),
        ("H35_coco_many_empty", "d.json --images .", BOTH, "p2.jpg is not in"),
        # Column 460 of 1200 in the upright picture.
        ("G09_portrait_boxes_unrotated", "detections.json", [83.36], "turned"),
    ],
)
def test_bearings_are_right(
    case: str,
    line: str,
    right: list[float],
    words: str,
    run: Run,
) -> None:
    shutil.copytree(CASES / case, ".", dirs_exist_ok=True)
    code, _, err = run(f"view {line} --out v.jsonl")
    assert (code, words in err) == (0, True), err
    assert bearings() == pytest.approx(right, abs=0.02)


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("C:\\street\\P1.JPG", "p1.jpg"),
        ("file:///home/my%20pictures/p1.jpg", "p1.jpg"),
        ("https://example.org/a/p1.jpeg?width=9", "p1.jpg"),
        ("/data/upload/3/ab12cd34-p1.jpg", "p1.jpg"),
        ("/data/local-files/?d=a/p1.jpg", "p1.jpg"),
        ("p1.rf.0a1b2c.jpg", "p1.JPEG"),
        ("p1.jpg", "train/p1.jpg"),
        ("caf\u00e9.jpg", "cafe\u0301.jpg"),
    ],
)
def test_pictures_are_found_by_the_names_of_other_programs(name: str, place: str, run: Run) -> None:
    write_case(name, place)
    assert run("view d.json --images . --out v.jsonl")[0] == 0
    assert bearings() == pytest.approx(BOTH, abs=0.02)


@pytest.mark.parametrize(
    ("name", "places", "words"),
    [
        ("p1.jpg", ["street-p1.jpg"], "p1.jpg is not in .; the nearest is 'street-p1.jpg'"),
        ("p1.jpg", ["a/p1.jpg", "b/p1.jpg"], "p1.jpg may be a/p1.jpg or b/p1.jpg"),
    ],
)
def test_pictures_not_found_are_named(name: str, places: list[str], words: str, run: Run) -> None:
    write_case(name, *places)
    sentence(run("view d.json --images . --out v.jsonl"), words)


def test_one_of_several_pictures_is_named(run: Run) -> None:
    write_case("p1", "p1.jpg", "p1.jpeg")
    code, _, err = run("view d.json --images . --out v.jsonl")
    assert (code, "several files may be the picture p1; p1.jpg is used" in err) == (0, True)


@pytest.mark.parametrize(
    ("box", "words"),
    [
        ([1700, 300, 40, 120], "is out of the picture"),
        ([-90, 300, 40, 120], "is out of the picture"),
        ([1300, 300, 0, 120], "annotation 1 has the box"),
    ],
)
def test_box_without_pixels_is_left_out(box: list[float], words: str, run: Run) -> None:
    write_case("p1.jpg", "p1.jpg", boxes={0: box})
    code, _, err = run("view d.json --out v.jsonl")
    assert (code, words in err) == (0, True)
    assert bearings() == pytest.approx(BOTH[1:], abs=0.02)
    write_case("p1.jpg", "p1.jpg", boxes={0: box, 1: box})
    sentence(run("view d.json --out v.jsonl"), words)


def test_boxes_of_a_stretched_copy_are_stretched_back(run: Run) -> None:
    boxes: dict[int, list[float]] = {0: [80, 373.33, 40, 42.67], 1: [520, 160, 16, 64]}
    write_case("p1_jpg.rf.0a1b2c.jpg", "p1.jpg", boxes=boxes, size=(640, 640))
    code, _, err = run("view d.json --out v.jsonl")
    assert (code, "stretched" in err) == (0, True)
    assert bearings() == pytest.approx(BOTH, abs=0.02)


def write_case(
    name: str,
    *places: str,
    boxes: dict[int, list[float]] | None = None,
    size: tuple[int, int] = (1600, 1200),
) -> None:
    """Write COCO boxes of a picture that is named `name`, and the picture to `places`."""
    content = json.loads((CASES / "G23_case" / "detections.json").read_text())
    (image,) = content["images"]
    image |= {"file_name": name, "width": size[0], "height": size[1]}
    for number, box in (boxes or {}).items():
        content["annotations"][number]["bbox"] = box
    Path("d.json").write_text(json.dumps(content))
    for place in places:
        Path(place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(CASES / "G23_case" / "p1.jpg", place)


def bearings() -> list[float]:
    """Return the bearings of the view that was written."""
    (view,) = map(json.loads, Path("v.jsonl").read_text().splitlines())
    numbers: list[float] = view["bearings"]
    return numbers


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("a place\nto read\n", "contains no detections in a known format"),
        ("10.0 20.0 30.0 20.0 30.0 40.0 10.0 40.0 bench 0\n", "contains no detections"),
    ],
)
def test_other_texts_are_not_taken_for_labels(content: str, words: str, run: Run) -> None:
    Path("p1.txt").write_text(content)
    sentence(run("view p1.txt --fov 60 --size 800x600 --out v.jsonl"), words)
    assert not Path("v.jsonl").exists()


def test_damaged_file_is_left_out_of_a_folder(run: Run) -> None:
    write_case("p1.jpg", "p1.jpg")
    Path("e.json").write_text(Path("d.json").read_text()[:90])
    code, out, err = run("view . --out v.jsonl --json")
    assert (code, bearings(), *json.loads(out)["damaged_files"]) == (0, BOTH, "e.json")
    assert "left out: 1 file: e.json is not JSON" in err


def test_crowds_without_other_objects_are_refused(run: Run) -> None:
    write_case("p1.jpg", "p1.jpg")
    content = json.loads(Path("d.json").read_text())
    for item in content["annotations"]:
        item |= {"iscrowd": 1, "segmentation": {"size": [1200, 1600], "counts": [10, 9, 1919981]}}
    Path("d.json").write_text(json.dumps(content))
    sentence(run("view d.json --out v.jsonl"), "only points, lines or groups; mark each object")
