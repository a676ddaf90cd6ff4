"""Files of detections: the same picture in every format, and invalid files."""

from __future__ import annotations

import base64
import csv
import io
import json
import tempfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sentences import assert_sentence, refused

from semsig_gis.core import InputError
from semsig_gis.observation import FORMATS, Shot, read_pictures

if TYPE_CHECKING:
    from collections.abc import Callable

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


VOC = """<annotation>
  <folder>street</folder>
  <filename>street.jpg</filename>
  <size><width>800</width><height>400</height><depth>3</depth></size>
  <object>
    <name>bench</name><pose>Unspecified</pose><truncated>0</truncated><difficult>0</difficult>
    <part><name>seat</name><bndbox><xmin>90</xmin></bndbox></part>
    <bndbox><xmin>80</xmin><ymin>100</ymin><xmax>240</xmax><ymax>200.0</ymax></bndbox>
  </object>
  <object>
    <name>stop sign</name><truncated>1</truncated><score>0.75</score>
    <bndbox><xmax>440</xmax><xmin>400</xmin><ymax>80</ymax><ymin>40</ymin></bndbox>
  </object>
  <object><name>lamp</name><polygon><x1>1</x1><y1>2</y1></polygon></object>
</annotation>
"""

LABELME: dict[str, Any] = {
    "version": "5.4.1",
    "flags": {},
    "shapes": [
        # From its lower right corner.
        {"label": "bench", "shape_type": "rectangle", "points": [[240, 200], [80, 100]]},
        {"label": "stop sign", "shape_type": "circle", "points": [[420, 60], [432, 76]],
         "score": 0.75},
        {"label": "lamp", "shape_type": "point", "points": [[1, 2]]},
    ],
    "imagePath": "..\\pictures\\street.jpg",
    "imageData": None,
    "imageHeight": 400,
    "imageWidth": 800,
}  # fmt: skip

VIA: dict[str, Any] = {
    "street.jpg12345": {
        "filename": "street.jpg",
        "size": 12345,
        "regions": [
            {"shape_attributes": {"name": "rect", "x": 80, "y": 100, "width": 160, "height": 100},
             "region_attributes": {"quality": "good", "Type": "bench"}},
            {"shape_attributes": {
                "name": "polygon", "all_points_x": [400, 440, 410], "all_points_y": [40, 50, 80]},
             "region_attributes": {"Type": {"stop sign": True}}},
            {"shape_attributes": {"name": "point", "cx": 1, "cy": 2}, "region_attributes": {}},
        ],
        "file_attributes": {},
    }
}  # fmt: skip
# Version 1 numbers the regions.
VIA_1 = {key: {**image, "regions": dict(enumerate(image["regions"]))} for key, image in VIA.items()}

# The header of a PNG of 40 x 40 pixels.
MASK = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x28\0\0\0\x28\1\3\0\0\0"
SUPERVISELY: dict[str, Any] = {
    "description": "",
    "size": {"height": 400, "width": 800},
    "tags": [],
    "objects": [
        {"classTitle": "bench", "geometryType": "rectangle", "tags": [],
         "points": {"exterior": [[80, 100], [240, 200]], "interior": []}},
        {"classTitle": "stop sign", "geometryType": "bitmap",
         "tags": [{"name": "confidence", "value": 0.75}, {"name": "Occluded", "value": None}],
         "bitmap": {"data": base64.b64encode(zlib.compress(MASK)).decode(), "origin": [400, 40]}},
        {"classTitle": "lamp", "geometryType": "point",
         "points": {"exterior": [[1, 2]], "interior": []}},
    ],
}  # fmt: skip

ROBOFLOW = """filename,width,height,class,xmin,ymin,xmax,ymax
street.jpg,800,400,bench,80,100,240,200
street.jpg,800,400,stop sign,400,40,440,80
"""

KITTI = """bench 0.00 0 -1.57 80.00 100.00 240.00 200.00 0.85 1.5 0.5 1.0 1.7 9.0 -1.5
stop_sign 0.00 1 0.00 400.00 40.00 440.00 80.00 -1 -1 -1 -1000 -1000 -1000 -10 0.75
DontCare -1 -1 -10 503.89 169.71 590.61 190.13 -1 -1 -1 -1000 -1000 -1000 -10
"""

FRAMES: list[dict[str, Any]] = [
    {
        "name": "street.jpg",
        "size": {"width": 800, "height": 400},
        "attributes": {"weather": "clear"},
        "labels": [
            {"id": "1", "category": "bench", "attributes": {"occluded": False},
             "box2d": {"x1": 80, "y1": 100, "x2": 240, "y2": 200}},
            {"id": "2", "category": "stop sign", "attributes": {"truncated": True}, "score": 0.75,
             "poly2d": [{"vertices": [[400, 40], [440, 50], [410, 80]], "types": "LLL",
                         "closed": True}]},
            {"id": "3", "category": "lane", "attributes": {},
             "poly2d": [{"vertices": [[1, 2], [3, 4]], "types": "LL", "closed": False}]},
        ],
    }
]  # fmt: skip


def tags(**values: str) -> list[dict[str, str]]:
    return [{"key": key, "value": value} for key, value in values.items()]


SCORE_TAG = "detection_confidence[osm|traffic_sign=stop]"
ITEM: dict[str, Any] = {
    "type": "Feature",
    "id": "street",
    "geometry": {"type": "Point", "coordinates": [7.42, 43.73]},
    "properties": {
        "datetime": "2026-05-01T10:00:00+00:00",
        "view:azimuth": 97,
        "pers:interior_orientation": {
            "field_of_view": 360, "sensor_array_dimensions": [800, 400],
        },
        "annotations": [
            {"id": "1", "semantics": tags(**{"osm|backrest": "yes", "osm|amenity": "bench"}),
             "shape": {"type": "Polygon", "coordinates": [
                 [[80, 100], [240, 100], [240, 200], [80, 200], [80, 100]]]}},
            {"id": "2", "semantics": tags(**{SCORE_TAG: "0.75", "osm|traffic_sign": "stop"}),
             "shape": [400, 40, 440, 80]},
            {"id": "3", "semantics": [], "shape": [1, 1, 2, 2]},
        ],
        "semantics": [],
    },
}  # fmt: skip

# The texts of the files of each format, or of more forms of it.
ONE = {"annotations": [{**COCO["annotations"][0], "bbox": [0, 0, 1, 1]}]}
POLYGONS = [
    {
        **item,
        "bbox": [],
        "segmentation": [[x, y, x + width, y, x, y + 1], [x + 1, y + 1, x + 2, y + height]],
    }
    for item in COCO["annotations"]
    for x, y, width, height in [item["bbox"]]
]


def run_lengths(x: int, y: int, width: int, height: int) -> list[int]:
    """Return the mask of a rectangle in a picture of 400 rows, column by column."""
    return [400 * x + y, *[height, 400 - height] * (width - 1), height, 9]


def as_text(runs: list[int]) -> str:
    """Return run lengths as COCO compresses them."""
    text = ""
    for number, run in enumerate(runs):
        value = run - runs[number - 2] if number > 2 else run
        while True:
            bits, value = value & 31, value >> 5
            last = value == (-1 if bits & 16 else 0)
            text += chr(48 + (bits if last else bits | 32))
            if last:
                break
    return text


BENCH_RUNS, SIGN_RUNS = (run_lengths(*item["bbox"]) for item in COCO["annotations"])
MASKS: list[dict[str, Any]] = [
    {**item, "bbox": None, "segmentation": {"size": [400, 800], "counts": counts}}
    for item, counts in zip(COCO["annotations"], (BENCH_RUNS, as_text(SIGN_RUNS)), strict=True)
]
SMALL_TASK: dict[str, Any] = {
    "id": 3,
    "image": "/data/upload/1/0a1b2c3d-street.jpg",
    "annotator": 1,
    "label": [
        {
            "original_width": 800,
            "original_height": 400,
            item["type"]: [],
            **item["value"],
            "score": item.get("score", 1.0),
        }
        for item in TASK["predictions"][0]["result"]
    ],
}
table = io.StringIO()
writer = csv.writer(table)
writer.writerow(["image", "id", "label", "annotator"])
shapes = [{key: item[key] for key in item if key != "score"} for item in SMALL_TASK["label"][:2]]
writer.writerow([SMALL_TASK["image"], 3, json.dumps(shapes), 1])
ROTATED = ("x1", "y1", "x2", "y2", "x3", "y3", "x4", "y4")
SAMPLES = {
    "COCO": {"street.json": json.dumps(COCO)},
    "COCO (masks)": {"street.json": json.dumps({**COCO, "annotations": MASKS})},
    "COCO (other identifiers)": {
        "street.json": json.dumps(
            {
                **COCO,
                "annotations": [
                    {**item, "image_id": str(item["image_id"])} for item in COCO["annotations"]
                ],
            }
        )
    },
    "COCO (polygons)": {"street.json": json.dumps({**COCO, "annotations": POLYGONS})},
    "COCO (results)": {
        "results.json": json.dumps([{"score": 1.0, **item} for item in COCO["annotations"]]),
        "truth.json": json.dumps(COCO | ONE),
    },
    "YOLO with data.yaml": {
        "labels/street.txt": YOLO,
        "data.yaml": "path: .\nnames:\n  0: bench\n  1: stop sign\n",
    },
    # As segmentation models write them, with another file of names.
    "YOLO with data.yaml (polygons)": {
        "my.names": "bench\nstop sign\n",
        "street.txt": "0 0.1 0.25 0.3 0.3 0.2 0.5\n1 0.5 0.1 0.55 0.2 0.52 0.15 0.75\n",
    },
    # As trackers write them: with a score and the number of the object, or only the number.
    "YOLO with data.yaml (tracks)": {
        "classes.txt": "bench\nstop sign\n",
        "street.txt": "0 0.2 0.375 0.2 0.25 7\n1 0.525 0.15 0.05 0.1 0.75 1\n",
    },
    "Label Studio": {"export.json": json.dumps([TASK])},
    "CVAT for images": {"annotations.xml": CVAT},
    "Mapillary": {"images.json": json.dumps({"data": [IMAGE]})},
    "Pascal VOC": {"street.xml": VOC},
    "LabelMe": {"street.json": json.dumps(LABELME)},
    "VIA": {"via.json": json.dumps(VIA)},
    "VIA (project)": {"via.json": json.dumps({"_via_settings": {}, "_via_img_metadata": VIA})},
    "VIA (version 1)": {"via.json": json.dumps(VIA_1)},
    "Supervisely": {"street.jpg.json": json.dumps(SUPERVISELY)},
    "YOLO with data.yaml (key points)": {
        "labels/street.txt": "0 0.2 0.375 0.2 0.25 0.1 0.3 2 0.2 0.4 1 1.0\n"
        "1 0.525 0.15 0.05 0.1 0.5 0.1 2 0.5 0.2 0 0.75\n",
        "own.yaml": "kpt_shape: [2, 3]\nnames: [bench, stop sign]\n",
    },
    "CSV of Roboflow": {"_annotations.csv": ROBOFLOW},
    "CSV of Roboflow (in shares)": {
        "boxes.csv": "image_name,width,height,class_name,x_min,y_min,x_max,y_max\n"
        "street.jpg,800,400,bench,0.1,0.25,0.3,0.5\n"
        "street.jpg,800,400,stop sign,0.5,0.1,0.55,0.2\n"
    },
    "CSV of Roboflow (with semicolons)": {
        "boxes.csv": "\ufeff" + ROBOFLOW.replace(",", ";").replace("80;100", "80,0;100,0")
    },
    "CSV of Roboflow (with tabs)": {
        "boxes.csv": ROBOFLOW.replace(",", "\t").replace("240", "240,0")
    },
    "CSV of Roboflow (of spreadsheets)": {"boxes.csv": "sep=;\n" + ROBOFLOW.replace(",", ";")},
    "CSV of Label Studio": {"tasks.csv": table.getvalue()},
    "JSON of supervision": {
        "street.json": json.dumps(
            [
                dict(zip(("x_min", "y_min", "x_max", "y_max"), map(float, box), strict=True))
                | {"class_id": 3, "confidence": score, "tracker_id": "", "class_name": label}
                for box, label, score in zip(CORNERS, LABELS, SCORES, strict=True)
            ]
        )
    },
    "Pascal VOC (outlines)": {
        "street.xml": VOC.replace(
            "<bndbox><xmax>440</xmax><xmin>400</xmin><ymax>80</ymax><ymin>40</ymin></bndbox>",
            "<polygon><x1>400</x1><y1>40</y1><x2>440</x2><y2>50</y2><x3>410</x3><y3>80</y3>"
            "</polygon>",
        )
    },
    "KITTI label_2": {"street.txt": KITTI},
    "BDD100K": {"bdd100k_labels.json": json.dumps(FRAMES)},
    "BDD100K (Scalabel)": {
        "scalabel.json": json.dumps(
            {
                "frames": [{**FRAMES[0], "size": None}, {"name": "b", "labels": None}][:1],
                "config": {"imageSize": {"width": 800, "height": 400}},
            }
        )
    },
    "BDD100K (frames of a file)": {
        "street.json": json.dumps(
            {
                "name": "street",
                "frames": [{"objects": FRAMES[0]["labels"], "size": FRAMES[0]["size"]}],
            }
        )
    },
    "Label Studio (JSON-MIN)": {"tasks.json": json.dumps([SMALL_TASK])},
    "Datumaro": {
        "default.json": json.dumps(
            {
                "info": {},
                "categories": {"label": {"labels": [{"name": name} for name in LABELS]}},
                "items": [
                    {
                        "id": "street",
                        "image": {"path": "street.jpg", "size": [400, 800]},
                        "annotations": [
                            {
                                "type": "bbox",
                                "label_id": 0,
                                "bbox": [80, 100, 160, 100],
                                "attributes": {"occluded": False},
                            },
                            {
                                "type": "polygon",
                                "label_id": 1,
                                "points": [400, 40, 440, 50, 410, 80],
                                "attributes": {"score": 0.75, "occluded": True},
                            },
                            {"type": "points", "label_id": 1, "points": [1, 2]},
                        ],
                    }
                ],
            }
        )
    },
    "Datumaro (masks)": {
        "default.json": json.dumps(
            {
                "info": {},
                "categories": {"label": {"labels": [{"name": name} for name in LABELS]}},
                "items": [
                    {
                        "id": "street",
                        "image": {"path": "street.jpg", "size": [400, 800]},
                        "annotations": [
                            {
                                "type": "mask",
                                "label_id": number,
                                "rle": mask["segmentation"],
                                "attributes": {
                                    "score": mask.get("score", 1.0),
                                    "truncated": number,
                                },
                            }
                            for number, mask in enumerate(MASKS)
                        ]
                        + [{"type": "caption", "caption": "street"}],
                    }
                ],
            }
        )
    },
    "results of Ultralytics or Transformers": {
        "street.json": json.dumps(
            [
                {
                    "name": "bench",
                    "class": 0,
                    "confidence": 1.0,
                    "box": {"x1": 80, "y1": 100, "x2": 240, "y2": 200},
                },
                {
                    "name": "stop sign",
                    "class": 1,
                    "confidence": 0.75,
                    "box": {"x1": 400, "y1": 40, "x2": 440, "y2": 80},
                },
            ]
        )
    },
    "results of Ultralytics or Transformers (rotated, by name)": {
        "boxes.json": json.dumps(
            {
                "street.jpg": [
                    {"name": name, "confidence": score, "box": corners}
                    for name, score, corners in (
                        (
                            "bench",
                            1.0,
                            dict(zip(ROTATED, (80, 100, 240, 100, 240, 200, 80, 200), strict=True)),
                        ),
                        (
                            "stop sign",
                            0.75,
                            dict(zip(ROTATED, (400, 60, 420, 40, 440, 60, 420, 80), strict=True)),
                        ),
                    )
                ]
            }
        )
    },
    "results of Ultralytics or Transformers (of Transformers, in shares)": {
        "street.json": json.dumps(
            [
                {
                    "label": "bench",
                    "score": 1.0,
                    "box": {"xmin": 0.1, "ymin": 0.25, "xmax": 0.3, "ymax": 0.5},
                },
                {
                    "label": "stop sign",
                    "score": 0.75,
                    "box": {"xmin": 0.5, "ymin": 0.1, "xmax": 0.55, "ymax": 0.2},
                },
            ]
        )
    },
    "answers of Rekognition, Vision or Roboflow": {
        "street.json": json.dumps(
            {
                "predictions": [
                    {"x": 160, "y": 150, "width": 160, "height": 100, "class": "bench"},
                    {
                        "x": 420,
                        "y": 60,
                        "width": 40,
                        "height": 40,
                        "class": "stop sign",
                        "confidence": 0.75,
                    },
                ]
            }
        )
    },
    "answers of Rekognition, Vision or Roboflow (of Rekognition)": {
        "street.json": json.dumps(
            {
                "Labels": [
                    {"Name": "City", "Confidence": 99.0},
                    *(
                        {
                            "Name": name,
                            "Instances": [
                                {
                                    "BoundingBox": dict(
                                        zip(("Left", "Top", "Width", "Height"), sides, strict=True)
                                    ),
                                    "Confidence": 100 * score,
                                }
                            ],
                        }
                        for name, score, sides in (
                            ("bench", 1.0, (0.1, 0.25, 0.2, 0.25)),
                            ("stop sign", 0.75, (0.5, 0.1, 0.05, 0.1)),
                        )
                    ),
                ]
            }
        )
    },
    "answers of Rekognition, Vision or Roboflow (of Vision)": {
        "street.json": json.dumps(
            {
                "responses": [
                    {
                        "localizedObjectAnnotations": [
                            {
                                "name": name,
                                "score": score,
                                "boundingPoly": {
                                    "normalizedVertices": [{"x": x, "y": y} for x, y in points]
                                },
                            }
                            for name, score, points in (
                                ("bench", 1.0, [(0.1, 0.25), (0.3, 0.25), (0.3, 0.5)]),
                                ("stop sign", 0.75, [(0.5, 0.1), (0.55, 0.2), (0.5, 0.2)]),
                            )
                        ]
                    }
                ]
            }
        )
    },
    "Darwin": {
        "street.json": json.dumps(
            {
                "version": "2.0",
                "item": {"name": "street.jpg", "slots": [{"width": 800, "height": 400}]},
                "annotations": [
                    {"name": "bench", "bounding_box": {"x": 80, "y": 100, "w": 160, "h": 100}},
                    {
                        "name": "stop sign",
                        "polygon": {
                            "paths": [
                                [{"x": 400, "y": 40}, {"x": 440, "y": 50}, {"x": 410, "y": 80}]
                            ]
                        },
                        "inference": {"confidence": 0.75},
                    },
                ],
            }
        )
    },
    "Panoramax": {"item.json": json.dumps(ITEM)},
    "Panoramax (search)": {
        "items.json": json.dumps({"type": "FeatureCollection", "features": [ITEM]})
    },
}
# Formats without scores, without sizes, with marks of hidden objects, and with other shapes.
NO_SCORES = ("Mapillary", "VIA", "CSV")
NO_SIZES = ("JSON", "YOLO", "KITTI", "VIA", "results", "answers")
WITH_HIDDEN = ("CVAT", "Datumaro", "Pascal", "Supervisely", "KITTI", "BDD100K")
WITH_OTHERS = ("Label", *WITH_HIDDEN, "VIA", "Panoramax")
OWN_LABELS = {"KITTI": ["bench", "stop_sign"], "Panor": ["amenity=bench", "traffic_sign=stop"]}


def pixels(picture: AnnotatedPicture) -> list[list[float]]:
    scale = (800, 400, 800, 400) if picture.shares else (1, 1, 1, 1)
    corners = [box.corners for box in picture.boxes]
    return [[side * size for side, size in zip(box, scale, strict=True)] for box in corners]


def read_format(form: str, folder: Path) -> AnnotatedPicture:
    """Write and read the files of a format; return the single picture."""
    for name, text in SAMPLES[form].items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    files = ["labels"] if form == "YOLO with data.yaml" else SAMPLES[form]
    (picture,), unknown = read_pictures([folder / name for name in files])
    assert unknown == {}
    return picture


def test_every_format_has_sample() -> None:
    assert {form.partition(" (")[0] for form in SAMPLES} == {form.name for form in FORMATS.values()}


@pytest.mark.parametrize("form", SAMPLES)
def test_every_format_gives_same_boxes(form: str, tmp_path: Path) -> None:
    picture = read_format(form, tmp_path)
    assert picture.names[-1] == "street"
    assert picture.folder in {tmp_path, tmp_path / "labels"}
    assert [box.label for box in picture.boxes] == OWN_LABELS.get(form[:5], LABELS)
    for box_pixels, corners in zip(pixels(picture), CORNERS, strict=True):
        assert box_pixels == pytest.approx(corners, abs=0.15)  # 1 / 4096 of a tile
    assert [box.score for box in picture.boxes] == (
        [1.0, 1.0] if form.startswith(NO_SCORES) else SCORES
    )
    assert [box.whole for box in picture.boxes] == [True, not form.startswith(WITH_HIDDEN)]
    assert picture.others == form.startswith(WITH_OTHERS)
    assert picture.shot.size == (None if form.startswith(NO_SIZES) else (800, 400))


@pytest.mark.parametrize(
    ("form", "part", "bad"),
    [
        ("Darwin", '"x": 80, ', '"x": "n/a", '),
        ("Darwin", '"w": 160, ', ""),
        ("CVAT for images", 'xtl="80" ', 'xtl="n/a" '),
        ("CVAT for images", 'xtl="80" ', ""),
        ("VIA", '"x": 80, ', ""),
        ("Supervisely", "[[80, 100], [240, 200]]", "null"),
        ("BDD100K", '"x1": 80', '"x1": null'),
        ("answers of Rekognition, Vision or Roboflow", '"x": 160, ', ""),
        ("LabelMe", '"label": "bench", ', ""),
        ("LabelMe", '"shape_type": "rectangle", "points"', '"corners"'),
        ("Supervisely", '"classTitle": "bench", ', ""),
        ("BDD100K", '"category": "bench", ', ""),
        ("Darwin", '"name": "bench", ', ""),
        ("CVAT for images", 'label="bench" ', ""),
        ("Datumaro", '"label_id": 0, ', ""),
        ("KITTI label_2", "bench 0.00", "bench x"),
        ("Label Studio", '"width": 20, ', ""),
    ],
)
def test_one_shape_that_cannot_be_read_is_one_fault(
    form: str, part: str, bad: str, tmp_path: Path
) -> None:
    ((name, text),) = SAMPLES[form].items()
    assert part in text
    (tmp_path / name).write_text(text.replace(part, bad, 1))
    (picture,), _ = read_pictures([tmp_path / name])
    assert [bool(box.fault) for box in picture.boxes] == [True, False]


@pytest.mark.parametrize(
    ("form", "empty"),
    [
        *((form, "null") for form in ("COCO", "BDD100K", "Datumaro", "Darwin", "Label Studio")),
        *((form, '"n/a"') for form in ("COCO", "LabelMe", "Supervisely")),
        ("COCO", "NaN"),
        ("Panoramax", "nan"),
        ("Pascal VOC", "n/a"),
        ("CVAT for images", "-"),
        ("YOLO with data.yaml (polygons)", "nan"),
    ],
)
def test_box_without_score_is_one_fault_where_others_have_scores(
    form: str, empty: str, tmp_path: Path
) -> None:
    texts = {name: text.replace("0.75", empty) for name, text in SAMPLES[form].items()}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (picture,), _ = read_pictures([tmp_path / name for name in texts])
    assert ["has no score" in box.fault for box in picture.boxes] == [False, True]


def test_boxes_count_as_certain_where_none_has_a_score(tmp_path: Path) -> None:
    items = [{**item, "score": None} for item in COCO["annotations"]]
    (tmp_path / "a.json").write_text(json.dumps({**COCO, "annotations": items}))
    header, *rows = ROBOFLOW.splitlines()
    (tmp_path / "b.csv").write_text("\n".join([f"{header},score", *(f"{row}," for row in rows)]))
    for picture in read_pictures([tmp_path])[0]:
        assert [(box.score, box.fault) for box in picture.boxes] == [(1.0, "")] * 2


@pytest.mark.parametrize(
    "text",
    [
        "0 0.2 0.375 0.2 0.25 1.0 7\n1 0.525 0.15 0.05 0.1 0.75 1\n",
        "0 0.2 0.375 0.2 0.25 7 1.0\n1 0.525 0.15 0.05 0.1 1 0.75\n",
        "0 0.2 0.375 0.2 0.25 1 1\n1 0.525 0.15 0.05 0.1 0.75 2\n",
        "0 0.2 0.375 0.2 0.25 3 1\n1 0.525 0.15 0.05 0.1 -1 0.75\n",
        "0,0.2,0.375,0.2,0.25\n1,0.525,0.15,0.05,0.1,0.75\n",
        "0, 0.2, 0.375, 0.2, 0.25\n1, 0.525, 0.15, 0.05, 0.1, 0.75\n",
        "0 0,2 0,375 0,2 0,25\n1 0,525 0,15 0,05 0,1 0,75\n",
        "0;0,2;0,375;0,2;0,25\n1;0,525;0,15;0,05;0,1;0,75\n",
        "bench 0.2 0.375 0.2 0.25\nstop sign 0.525 0.15 0.05 0.1 0.75\n",
        "bench,0.2,0.375,0.2,0.25\nstop sign,0.525,0.15,0.05,0.1,0.75\n",
    ],
)
@pytest.mark.parametrize(
    ("name", "names"),
    [
        ("labels.txt", "bench\nstop sign\n"),
        ("labels.txt", "0 bench\n1 stop sign\n"),
        ("obj.data", "classes = 2\nnames = data/obj.names\n"),
    ],
)
def test_forms_of_yolo_give_same_boxes(text: str, name: str, names: str, tmp_path: Path) -> None:
    (tmp_path / "street.txt").write_text(text)
    (tmp_path / name).write_text(names)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "obj.names").write_text("bench\nstop sign\n")
    for files in ([tmp_path], [tmp_path / "street.txt", tmp_path / name]):
        (picture,), _ = read_pictures(files)
        assert [box.label for box in picture.boxes] == LABELS
        assert [box.score for box in picture.boxes] == SCORES
        for box_pixels, corners in zip(pixels(picture), CORNERS, strict=True):
            assert box_pixels == pytest.approx(corners)


PREDICTIONS = [
    {
        "image_id": "street", "file_name": "street.jpg", "category_id": number,
        "bbox": item["bbox"], "score": score,
    }
    for number, (item, score) in enumerate(zip(COCO["annotations"], SCORES, strict=True))
]  # fmt: skip


@pytest.mark.parametrize("first", [0, 1])
def test_results_of_ultralytics_need_names_and_the_first_number(first: int, tmp_path: Path) -> None:
    file, names = tmp_path / "predictions.json", tmp_path / "data.yaml"
    items = [{**item, "category_id": item["category_id"] + first} for item in PREDICTIONS]
    file.write_text(json.dumps(items))
    with refused(InputError, "the data.yaml"):
        read_pictures([file])
    names.write_text("names: [bench, stop sign]\n")
    (picture,), _ = read_pictures([file, names])
    assert [(box.label, box.corners) for box in picture.boxes] == [
        *zip(LABELS, CORNERS, strict=True)
    ]
    names.write_text("names: [car, bench, stop sign, lamp]\n")
    file.write_text(json.dumps([{**PREDICTIONS[0], "category_id": 1}]))
    with refused(InputError, "counted from 0 or from 1"):
        read_pictures([file, names])


GOOD, DAMAGED = ("good.json", json.dumps(COCO)), ("damaged.json", json.dumps(COCO)[:50])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        DAMAGED,
        ("empty.json", ""),
        ("a.xml", CVAT[:200]),
        ("a.json", json.dumps({**COCO, "images": [{"id": 7}, 3]})),
        ("a.json", json.dumps({**SUPERVISELY, "size": {}})),
        ("a.txt", YOLO),
    ],
)
@pytest.mark.parametrize("whole_folder", [True, False])
def test_damaged_file_loses_that_file(
    name: str, text: str, tmp_path: Path, *, whole_folder: bool
) -> None:
    for file, content in ((name, text), GOOD):
        (tmp_path / file).write_text(content)
    files = [tmp_path] if whole_folder else [tmp_path / name, tmp_path / "good.json"]
    (picture,), left_out = read_pictures(files)
    assert (len(picture.boxes), *left_out) == (2, tmp_path / name)
    assert_sentence(InputError(left_out[tmp_path / name]), name)
    (tmp_path / "good.json").write_text("[")
    with refused(InputError):
        read_pictures(files)


def test_folder_with_all_formats_and_other_files_is_read(tmp_path: Path) -> None:
    forms = [form for form in SAMPLES if form != "COCO (results)"]
    for number, form in enumerate(forms):
        folder = tmp_path / "sets" / str(number)
        for name, text in SAMPLES[form].items():
            (folder / name).parent.mkdir(exist_ok=True, parents=True)
            (folder / name).write_text(text)
    others = {
        "meta.json": '{"classes": []}',
        "README.roboflow.txt": "This data set has 2 pictures.\n",
        "photos.csv": "image,fov\nstreet.jpg,60\n",
        "calib/street.txt": "P0: 7.2e+02 0 6.1e+02 0\n",
        "ImageSets/train.txt": "street 1\n",
    }
    (tmp_path / ".hidden.json").write_text("{")
    for name, text in others.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    # The names of classes with a suffix of their own are near no labels: give them.
    (tmp_path / "sets").joinpath("classes.txt").write_text("bench\nstop sign\n")
    pictures, unknown = read_pictures([tmp_path])
    assert [picture.names[-1] for picture in pictures] == ["street"] * len(forms)
    assert all(len(picture.boxes) == len(CORNERS) for picture in pictures)
    assert {file.relative_to(tmp_path).as_posix() for file in unknown} == set(others)


def test_pictures_are_looked_for_near_their_labels(tmp_path: Path) -> None:
    labels = tmp_path / "set" / "labels" / "train"
    labels.mkdir(parents=True)
    (labels / "street.txt").write_text("")
    (picture,), _ = read_pictures([tmp_path / "set"])
    assert picture.folders[:2] == (labels, tmp_path / "set" / "images" / "train")


LABEL = st.sampled_from(["bench", "stop_sign", "Laternen-Mast", "ベンチ"])
SIDE = st.integers(0, 9999)
BOXES = st.lists(
    st.tuples(LABEL, SIDE, SIDE, SIDE, SIDE).map(
        lambda box: (box[0], min(box[1::2]), min(box[2::2]), max(box[1::2]) + 1, max(box[2::2]) + 1)
    ),
    min_size=1,
    max_size=4,
)
Boxes = list[tuple[str, int, int, int, int]]


def voc(boxes: Boxes) -> str:
    sides = "<xmin>{}</xmin><ymin>{}</ymin><xmax>{}</xmax><ymax>{}</ymax>"
    objects = "".join(
        f"<object><name>{label}</name><bndbox>{sides.format(*corners)}</bndbox></object>"
        for label, *corners in boxes
    )
    return f"<annotation>{objects}</annotation>"


def labelme(boxes: Boxes) -> str:
    shapes = [
        {"label": label, "points": [[right, top], [left, bottom]], "shape_type": "rectangle"}
        for label, left, top, right, bottom in boxes
    ]
    return json.dumps({"shapes": shapes, "imagePath": "a.jpg"})


def via(boxes: Boxes) -> str:
    regions = [
        {
            "shape_attributes": {
                "name": "rect", "x": left, "y": top, "width": right - left, "height": bottom - top,
            },
            "region_attributes": {"own": label},
        }
        for label, left, top, right, bottom in boxes
    ]  # fmt: skip
    return json.dumps({"a.jpg-1": {"filename": "a.jpg", "size": -1, "regions": regions}})


def supervisely(boxes: Boxes) -> str:
    objects = [
        {
            "classTitle": label,
            "geometryType": "polygon",
            "points": {"exterior": [[left, top], [right, top], [left, bottom]], "interior": []},
        }
        for label, left, top, right, bottom in boxes
    ]
    return json.dumps({"size": {"width": 9999, "height": 9999}, "objects": objects})


def roboflow(boxes: Boxes) -> str:
    rows = [f"a.jpg,9999,9999,{','.join(map(str, box))}" for box in boxes]
    return "\n".join(["filename,width,height,class,xmin,ymin,xmax,ymax", *rows])


def kitti(boxes: Boxes) -> str:
    return "".join(
        f"{label} 0 0 0 {left} {top} {right} {bottom} 0 0 0 0 0 0 0\n"
        for label, left, top, right, bottom in boxes
    )


def bdd100k(boxes: Boxes) -> str:
    labels = [
        {"category": label, "box2d": dict(zip(("x1", "y1", "x2", "y2"), corners, strict=True))}
        for label, *corners in boxes
    ]
    return json.dumps([{"name": "a.jpg", "labels": labels}, {"name": "b.jpg"}][:1])


def panoramax(boxes: Boxes) -> str:
    annotations = [
        {"shape": corners, "semantics": [{"key": "osm|object", "value": label}]}
        for label, *corners in boxes
    ]
    return json.dumps({"id": "a", "properties": {"annotations": annotations}})


WRITERS: list[tuple[Callable[[Boxes], str], str]] = [
    (voc, ".xml"),
    (labelme, ".json"),
    (via, ".json"),
    (supervisely, ".json"),
    (roboflow, ".csv"),
    (kitti, ".txt"),
    (bdd100k, ".json"),
    (panoramax, ".json"),
]


@pytest.mark.parametrize(("write", "suffix"), WRITERS)
@given(boxes=BOXES)
def test_boxes_are_read_as_written(
    write: Callable[[Boxes], str], suffix: str, boxes: Boxes
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "a" + suffix)
        file.write_text(write(boxes), encoding="utf-8")
        (picture,), _ = read_pictures([file])
    assert [(box.label.removeprefix("object="), *box.corners) for box in picture.boxes] == boxes
    assert picture.names[-1] == "a"


def places(value: Any) -> list[tuple[Any, Any]]:  # noqa: ANN401 - any JSON
    """Return the lists and objects in a JSON value with each of their keys."""
    if not isinstance(value, (list, dict)):
        return []
    pairs = list(value.items() if isinstance(value, dict) else enumerate(value))
    inner = [place for _, part in pairs for place in places(part)]
    return [(value, key) for key, _ in pairs] + inner


JSON_FORMS = [
    form
    for form, files in SAMPLES.items()
    if len(files) == 1 and next(iter(files)).endswith(".json")
]
ANY_VALUE: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, 0, -1, 1.5, 1e999, 10**400, "", "x", "1", [], {}, [None], [[]], [1], {"x": 1}]
)


@pytest.mark.parametrize("form", JSON_FORMS)
@given(data=st.data())
def test_damaged_json_is_read_or_refused(form: str, data: st.DataObject) -> None:
    ((name, text),) = SAMPLES[form].items()
    content = json.loads(text)
    parent, key = data.draw(st.sampled_from(places(content)))
    parent[key] = data.draw(ANY_VALUE)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        file.write_text(json.dumps(content), encoding="utf-8")
        try:
            read_pictures([file])
        except InputError as error:
            assert_sentence(error, name)


def test_panoramax_picture_has_camera_and_heading(tmp_path: Path) -> None:
    shot = Shot(
        camera="equirectangular",
        fov=360.0,
        heading=97.0,
        heading_error=10.0,
        north="true",
        size=(800, 400),
        position=(43.73, 7.42),
        time="2026-05-01T10:00:00+00:00",
    )
    assert read_format("Panoramax", tmp_path).shot == shot


@pytest.mark.parametrize(
    ("shape", "corners"),
    [
        ({"name": "circle", "cx": 50, "cy": 60, "r": 10}, (40, 50, 60, 70)),
        ({"name": "ellipse", "cx": 50, "cy": 60, "rx": 10, "ry": 5}, (40, 55, 60, 65)),
    ],
    ids=lambda value: value["name"] if isinstance(value, dict) else "",
)
def test_round_regions_of_via_have_boxes(
    shape: dict[str, Any], corners: tuple[int, ...], tmp_path: Path
) -> None:
    image = {"filename": "a", "regions": [{"shape_attributes": shape, "region_attributes": {}}]}
    (tmp_path / "a.json").write_text(json.dumps({"a1": image}))
    ((box,),) = (picture.boxes for picture in read_pictures([tmp_path])[0])
    assert (box.label, box.corners) == ("no label", corners)


def test_old_files_without_size_or_type_of_shape_are_read(tmp_path: Path) -> None:
    shape = {"label": "bench", "points": [[1, 2], [5, 2], [3, 9]]}
    (tmp_path / "a.json").write_text(json.dumps({"shapes": [shape], "imagePath": None}))
    (tmp_path / "b.xml").write_text(
        VOC.replace("800</w", "0</w").replace("400</h", "0</h").replace("street.jpg", "")
    )
    old, no_size = read_pictures([tmp_path])[0]
    assert (old.name, old.boxes[0].corners, old.shot.size) == ("a", (1, 2, 5, 9), None)
    assert (no_size.name, no_size.shot.size) == ("b", None)


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
    assert read_format("Mapillary", tmp_path).shot == shot


def test_mapillary_detections_are_grouped_by_image(tmp_path: Path) -> None:
    first, second = IMAGE["detections"]["data"][:1] * 2
    items = [{**first, "image": {"id": "a"}}, {**second, "image": {"id": "b"}}]
    (tmp_path / "detections.json").write_text(json.dumps({"data": items}))
    assert [picture.name for picture in read_pictures([tmp_path])[0]] == ["a", "b"]


ROTATED_TASK = {
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
        ("a.json", json.dumps([ROTATED_TASK]), (360, 100, 400, 180)),
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
        ("a.json", "{}", "contains no detections in a known format; give BDD100K, COCO, CVAT"),
        ("a.json", "[1]", "contains no detections"),
        ("a.json", json.dumps(COCO["annotations"]), "without images and categories"),
        ("a.json", annotation(bbox=[1, 2, 3]), "annotation 1 has a box or a score"),
        ("a.json", annotation(bbox=[1, 2, "x", 4]), "annotation 1 has a box or a score"),
        ("a.json", annotation(bbox=[1, 2, None, 4]), "annotation 1 has a box or a score"),
        ("a.json", annotation(bbox=[1, 2, -3, 4]), "annotation 1 has the box (1.0, 2.0, -2.0"),
        ("a.json", annotation(bbox=[1, 2, 1e999, 4]), "annotation 1 has the box"),
        ("a.json", annotation(score=7), "annotation 1 has the score 7"),
        ("a.json", annotation(score="high"), "not a number"),
        ("a.json", annotation(image_id=8), "annotation 1 is of the image 8, which is not listed"),
        ("a.json", annotation(category_id=8), "of the category 8, which is not listed"),
        ("a.json", changed(images=[{"id": 7}, 3]), "does not follow its format"),
        ("a.json", changed(annotations=[{}]), "lacks 'image_id'"),
        ("a.json", changed(categories=[{"id": 1}]), "lacks 'name'"),
        ("a.json", json.dumps([{"data": {}, "annotations": [{"result": [3]}]}]),
         "result 1 has a box or a score"),
        ("a.json", json.dumps({**IMAGE, "detections": [{"value": "x", "geometry": "?"}]}),
         "image street, detection 1 has a geometry that is not a vector tile"),
        ("a.json", json.dumps({**IMAGE, "detections": [{"value": "x", "geometry": "Gv8="}]}),
         "not a vector tile"),
        ("a.json", json.dumps({"data": [{"value": "x", "geometry": [[9, 9]]}]}), "unknown size"),
        ("a.txt", "0 0.5 0.5 0.1\n", "line 1 is not a line of YOLO"),
        ("a.txt", "-1 0.5 0.5 0.1 0.1\n", "line 1 is not a line of YOLO"),
        ("a.txt", "0 .5 .5 .1 .1 1 0\n", "line 1 ends with 1 0, which may be a score or"),
        ("a.txt", "0 .5 .5 .1 .1 0\n", "which may be a score or the number"),
        ("a.txt", "0 .5 .5 .1 .1 7 7\n", "which may be a score or the number"),
        ("a.txt", "0 .5 .5 .1 .1 1 0.9\n", "which may be a score or the number"),
        ("a.txt", "0 0.5 x 0.1 0.1\n", "line 1 has a value that is not a number"),
        ("a.txt", "0 400 200 10 10\n", "is not in shares of the picture"),
        ("a.txt", "9 0.5 0.5 0.1 0.1\n", "is of class 9, which has no name"),
        ("a.xml", "<a", "not XML that can be read"),
        ("a.xml", "<a/>", "contains no detections in a known format"),
        ("a.xml", VOC.replace("<xmin>80</xmin>", ""), "object 1 has a box or a score that is not"),
        ("a.xml", VOC.replace(">80<", ">900<"), "object 1 has the box (900.0, 100.0, 240.0"),
        ("a.xml", VOC.replace(">800<", ">wide<"), "does not follow its format, Pascal VOC"),
        ("a.json", json.dumps({**LABELME, "shapes": [{"label": "x"}]}),
         "shape 1 lacks 'points'"),
        ("a.json", json.dumps({**LABELME, "shapes": [{"label": "x", "points": []}]}),
         "shape 1 has a box or a score that is not a number"),
        ("a.json", json.dumps({"a": {"filename": "a", "regions": [{}]}}),
         "region 1 lacks 'shape_attributes'"),
        ("a.json", json.dumps({**SUPERVISELY, "size": {"width": 9}}), "lacks 'height'"),
        ("a.json", json.dumps(SUPERVISELY).replace('"eJ', '"AA'), "has a box or a score"),
        ("a.json", json.dumps([{"name": "a", "labels": [{"box2d": {"x1": 1}}]}]), "lacks 'y1'"),
        ("a.json", json.dumps({**ITEM, "id": 3}).replace("0.75", "sure"),
         "picture 3, annotation 2 has a box or a score that is not a number"),
        ("a.json", json.dumps({"properties": ITEM["properties"]}), "Panoramax (it lacks 'id')"),
        ("a.csv", "filename,class\na,b\n", "contains no detections in a known format"),
        ("a.csv", ROBOFLOW + "street.jpg,800,400,bench,80,,240,200\n", "line 4 has a box"),
        ("a.csv", ROBOFLOW + "street.jpg\n", "line 4 has a box"),
        ("a.txt", KITTI + "bench 0 0\n", "line 4 has 3 values; a line of KITTI has 15"),
        ("a.txt", KITTI.replace("bench 0.00", "bench x"), "line 1 has a box or a score"),
        ("a.txt", KITTI.replace("0.75", "75"), "line 2 has the score 75"),
        ("a.txt", "Some words.\n", "contains no detections in a known format"),
        ("a.xml", "<!DOCTYPE a><a/>", "its own document type"),
        ("a.xml", "<annotations><track/></annotations>", "contains tracks of a video"),
        ("a.xml", CVAT.replace(' name="street.jpg"', ""), "lacks 'name'"),
        ("a.xml", CVAT.replace('"400,40;440', '"400;440'), "shape 2 has a box or a score"),
        ("a.png", "", "is not in a supported format"),
    ],
)  # fmt: skip
def test_invalid_file_is_refused_and_single_invalid_box_has_a_fault(
    name: str, text: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / "classes.txt").write_text("bench\n")
    (tmp_path / name).write_text(text)
    try:
        pictures, _ = read_pictures([tmp_path / name])
    except InputError as error:
        assert_sentence(error, name, words)
    else:
        boxes = [box for picture in pictures for box in picture.boxes]
        (fault,) = (box.fault for box in boxes if box.fault)
        assert (len(boxes) > 1, name in fault, words in fault) == (True, True, True)


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
