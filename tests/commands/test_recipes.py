"""The recipes of docs/guides/detectors.md, with files as those programs write them."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base
from small_detectors import CORNERS, LAYOUTS, SIZE, save_detector, save_photograph

from semsig_gis.observation import View, read_queries
from semsig_gis.sources import built_in_taxonomy

if TYPE_CHECKING:
    from conftest import Run

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "detectors.md"
TAXONOMY = built_in_taxonomy()
RED, BLUE = CORNERS.values()
COCO = {
    "info": {},
    "licenses": [{"id": 1, "url": "", "name": "Unknown"}],
    "categories": [
        {"id": number, "name": name, "supercategory": "common-objects"}
        for number, name in enumerate(("bench", "lamp"), start=1)
    ],
    "images": [{"id": 1, "license": 1, "file_name": "a.jpg", "width": SIZE[0], "height": SIZE[1]}],
    "annotations": [
        {
            "id": number,
            "image_id": 1,
            "category_id": number,
            "bbox": [left, top, right - left, bottom - top],
            "area": float((right - left) * (bottom - top)),
            "segmentation": [],
            "iscrowd": 0,
        }
        for number, (left, top, right, bottom) in enumerate((RED, BLUE), start=1)
    ],
}
MAPILLARY = {
    "id": "IMAGE_ID",
    "width": SIZE[0],
    "height": SIZE[1],
    "camera_type": "perspective",
    "camera_parameters": [26 / math.hypot(36, 24) * 800 / 640, 0.0, 0.0],
    "computed_compass_angle": 100.0,
    "detections": {
        "data": [
            {
                "id": "1",
                "value": f"object--{value}",
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [
                        [
                            [x / SIZE[0], y / SIZE[1]]
                            for x, y in ((left, top), (right, top), (right, bottom), (left, top))
                        ]
                    ],
                },
            }
            for value, (left, top, right, bottom) in zip(
                ("bench", "street-light"), (RED, BLUE), strict=True
            )
        ]
    },
}


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Write what the recipes need, and change to its folder."""
    monkeypatch.chdir(tmp_path)
    exif = Image.Exif()
    exif.get_ifd(IFD.Exif)[Base.FocalLengthIn35mmFilm] = 26
    gps: dict[int, object] = {GPS.GPSImgDirectionRef: "T", GPS.GPSImgDirection: 100.0}
    exif.get_ifd(IFD.GPSInfo).update(gps)
    Path("photos").mkdir()
    save_photograph(Path("photos/a.jpg"), exif)
    Path("boxes.json").write_text(json.dumps(COCO))
    Path("image.json").write_text(json.dumps(MAPILLARY))
    Path("data.yaml").write_text("train: images\nnc: 2\nnames: [bench, lamp]\n")
    Path("runs/detect/predict/labels").mkdir(parents=True)
    lines = []
    for number, (left, top, right, bottom) in enumerate((RED, BLUE)):
        middle = (left + right) / 2 / SIZE[0], (top + bottom) / 2 / SIZE[1]
        sides = (right - left) / SIZE[0], (bottom - top) / SIZE[1]
        lines.append(" ".join(f"{value:g}" for value in (number, *middle, *sides, 0.875)))
    Path("runs/detect/predict/labels/a.txt").write_text("\n".join(lines) + "\n")
    names = {number: f"class{number}" for number in range(80)} | {13: "bench", 10: "lamp"}
    metadata = {"task": "detect", "names": str(names), "imgsz": "[320, 320]"}
    for name in ("best.onnx", "detector.onnx"):
        save_detector(Path(name), LAYOUTS["yolo_v8"], metadata=metadata)
    save_detector(Path("retinanet.onnx"), LAYOUTS["torchvision"])


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(
    "command",
    re.findall(r"^\$ semsig (view (?!detections\.json).+)$", PAGE.read_text("utf-8"), re.MULTILINE)
    if PAGE.is_file()
    else [],
)
def test_recipes_give_the_view_of_the_photograph(command: str, run: Run) -> None:
    code, out, err = run(command.replace(" --database city.parquet", ""))
    assert code == 0, err
    assert out.startswith("1 view of 1 picture with 2 objects"), out
    (line,) = read_queries("views.jsonl", taxonomy=TAXONOMY)
    assert isinstance(line.query, View)
    assert line.query.bearings is not None
    assert line.query.bearings.min() == pytest.approx(79.5, abs=0.5)
