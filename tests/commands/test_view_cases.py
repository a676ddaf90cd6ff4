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
    ("case", "line", "bearings", "words"),
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
    bearings: list[float],
    words: str,
    run: Run,
) -> None:
    shutil.copytree(CASES / case, ".", dirs_exist_ok=True)
    code, _, err = run(f"view {line} --out v.jsonl")
    assert (code, words in err) == (0, True), err
    (view,) = map(json.loads, Path("v.jsonl").read_text().splitlines())
    assert view["bearings"] == pytest.approx(bearings, abs=0.02)


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
