"""Read files of detections: COCO, YOLO, Label Studio, CVAT and Mapillary."""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree as ET

import yaml

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.mapillary import mapillary_images, mapillary_picture
from semsig_gis.observation.detectors.pictures import AnnotatedPicture, Shot, bounds, box_of, turned
from semsig_gis.storage import parse_json, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.observation.detectors.pictures import Box, Corners

SUFFIXES = frozenset({".json", ".xml", ".txt"})
NAME_SUFFIXES = frozenset({".yaml", ".yml", ".names"})
NAME_FILES = ("data.yaml", "data.yml", "classes.txt", "obj.names")
"""Files with class names of YOLO, in the folder of the labels or in its parent folder."""

NAME_KEYS = ("names", "id2label", "categories")
"""Where YOLO, Transformers and COCO have the names of classes."""

YOLO_BOX_VALUES = 5  # class and box; lines with more values have a score or a polygon
PERCENT = 100.0
ACCEPTED = (
    "give JSON (COCO, Label Studio, Mapillary), CVAT XML for images, YOLO .txt, or a folder of them"
)
INVALID = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError)


def read_pictures(paths: Iterable[str | Path]) -> list[AnnotatedPicture]:
    """Read pictures and boxes from files of detections; the format is detected from the content.

    A folder means its .json, .xml and .txt files. YOLO labels need a file of class names (.yaml,
    .names, classes.txt) among the files, in the same folder or its parent. COCO results need a file
    of images and categories among the files. InputError if a file cannot be read or has another
    format.
    """
    files: list[Path] = []
    for path in map(Path, paths):
        inside = [path]
        if path.is_dir():
            inside = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        if not inside:
            raise InputError(f"the folder {path} contains no file of detections; {ACCEPTED}.")
        files += inside
    names = next((file for file in files if _has_class_names(file)), None)
    documents = {file: _json(file) for file in files if file.suffix.lower() == ".json"}
    images = next((document for document in documents.values() if _is_coco(document)), None)
    results = [file for file, document in documents.items() if _is_coco_results(document)]
    pictures: list[AnnotatedPicture] = []
    for file in files:
        suffix = file.suffix.lower()
        if _has_class_names(file):
            continue
        if suffix == ".txt":
            pictures.append(_yolo(file, names))
        elif suffix == ".xml":
            pictures += _cvat(file)
        elif suffix == ".json" and not (results and documents[file] is images):
            pictures += _json_pictures(documents[file], str(file), images)
        elif suffix != ".json":
            raise InputError(f"{file} is not in a supported format; {ACCEPTED}.")
    return pictures


def _has_class_names(file: Path) -> bool:
    return file.suffix.lower() in NAME_SUFFIXES or file.name in NAME_FILES


def _text(file: Path) -> str:
    try:
        return read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"{file} cannot be read ({reason}); {ACCEPTED}.") from error


def _json(file: Path) -> Any:  # noqa: ANN401 - any JSON
    try:
        return parse_json(_text(file))
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file} is not JSON ({error}); {ACCEPTED}.") from error


def _json_pictures(document: Any, source: str, images: Any) -> list[AnnotatedPicture]:  # noqa: ANN401
    """Return the pictures of a JSON document in any known format."""
    try:
        if _is_coco(document):
            return _coco(document, document.get("annotations", []), source)
        if _is_coco_results(document):
            if images is None:
                raise InputError(
                    f"{source} contains COCO results without images and categories; give the file "
                    "of its annotations as well, which has them."
                )
            return _coco(images, document, source)
        if _is_list_with(document, "data"):
            return [_label_studio(task, source) for task in document]
        if (shots := mapillary_images(document)) is not None:
            return [mapillary_picture(image, source) for image in shots]
    except INVALID as error:
        if isinstance(error, InputError):
            raise
        lacks = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{source} does not follow its format ({lacks}); export it again."
        ) from error
    raise InputError(f"{source} contains no detections in a known format; {ACCEPTED}.")


def _is_coco(document: Any) -> bool:  # noqa: ANN401 - any JSON
    return isinstance(document, dict) and {"images", "categories"} <= document.keys()


def _is_coco_results(document: Any) -> bool:  # noqa: ANN401 - any JSON
    return _is_list_with(document, "image_id", "category_id")


def _is_list_with(document: Any, *keys: str) -> bool:  # noqa: ANN401 - any JSON
    return (
        isinstance(document, list)
        and bool(document)
        and all(isinstance(item, dict) and set(keys) <= item.keys() for item in document)
    )


def _size(width: Any, height: Any) -> tuple[int, int] | None:  # noqa: ANN401 - any JSON
    return (round(float(width)), round(float(height))) if width and height else None


def _coco(document: dict[str, Any], annotations: list[Any], source: str) -> list[AnnotatedPicture]:
    names = {item["id"]: item["name"] for item in document["categories"]}
    boxes: dict[Any, list[Box]] = {item["id"]: [] for item in document["images"]}
    others = dict.fromkeys(boxes, 0)
    for number, item in enumerate(annotations, start=1):
        where = f"{source}, annotation {number}"
        image, category = item["image_id"], item["category_id"]
        if image not in boxes or category not in names:
            what = f"image {image!r}" if image not in boxes else f"category {category!r}"
            raise InputError(
                f"{where} is of the {what}, which is not listed; give the file that lists it."
            )
        # Crowds contain several objects, and a mask without a box may be a part of an object.
        if item.get("iscrowd") or not item.get("bbox"):
            others[image] += 1
            continue
        left, top, width, height = item["bbox"]
        corners = left, top, left + width, top + height
        boxes[image].append(box_of(names[category], corners, where, score=item.get("score")))
    return [
        AnnotatedPicture(
            name=str(item.get("file_name", item["id"])),
            boxes=tuple(boxes[item["id"]]),
            others=others[item["id"]],
            shot=Shot(size=_size(item.get("width"), item.get("height"))),
        )
        for item in document["images"]
    ]


def _yolo(file: Path, names: Path | None) -> AnnotatedPicture:
    lines = [line.split() for line in _text(file).splitlines()]
    labels = _yolo_names(file, names) if any(lines) else {}
    boxes = []
    for number, values in enumerate(lines, start=1):
        if not values:
            continue
        where = f"{file}, line {number}"
        if len(values) < YOLO_BOX_VALUES or not values[0].isdecimal():
            raise InputError(
                f"{where} is not a line of YOLO labels; write class, x, y, width, height (and "
                "score)."
            )
        if int(values[0]) not in labels:
            raise InputError(
                f"{where} is of class {values[0]}, which has no name; list it in data.yaml."
            )
        corners, score = _yolo_corners(values[1:], where)
        boxes.append(box_of(labels[int(values[0])], corners, where, score=score))
    return AnnotatedPicture(name=file.stem, boxes=tuple(boxes), shares=True)


def _yolo_corners(texts: Sequence[str], where: str) -> tuple[Corners, str | None]:
    """Return the corners, in shares of the picture, and the score of a YOLO box or polygon."""
    try:
        values = [float(text) for text in texts]
    except ValueError as error:
        raise InputError(
            f"{where} has a value that is not a number; write class, x, y, width, height."
        ) from error
    score = texts[-1] if len(texts) % 2 else None
    if len(texts) <= YOLO_BOX_VALUES:
        x, y, width, height = values[:4]
        corners = x - width / 2, y - height / 2, x + width / 2, y + height / 2
    else:
        corners = bounds(zip(values[::2], values[1::2], strict=False))
    if not all(-1 <= value <= 2 for value in corners):  # noqa: PLR2004 - a picture away
        raise InputError(
            f"{where} is not in shares of the picture; divide pixels by its width and height."
        )
    return corners, score


def _yolo_names(file: Path, names: Path | None) -> dict[int, str]:
    """Return the names of classes by number."""
    nearby = [folder / name for folder in (file.parent, file.parent.parent) for name in NAME_FILES]
    source = names or next((path for path in nearby if path.is_file()), None)
    if source is None:
        raise InputError(
            f"the classes of {file} have no names; give its data.yaml or classes.txt as well."
        )
    return read_class_names(source)


def read_class_names(source: Path) -> dict[int, str]:
    """Read the names of classes by number: a name in each line, YAML or JSON."""
    text = _text(source)
    suffix = source.suffix.lower()
    if suffix not in {".yaml", ".yml", ".json"}:
        return dict(enumerate(text.rstrip().split("\n")))
    try:
        return numbered_names(parse_json(text) if suffix == ".json" else yaml.safe_load(text))
    except (yaml.YAMLError, RecursionError, *INVALID) as error:
        raise InputError(
            f"{source} has no list of class names; give a YAML file with 'names'."
        ) from error


def numbered_names(content: Any) -> dict[int, str]:  # noqa: ANN401 - any YAML or JSON
    """Return the names of classes by number from a list or a table; raise one of `INVALID`."""
    if isinstance(content, dict):
        content = next((content[key] for key in NAME_KEYS if key in content), content)
    pairs: Iterable[tuple[Any, Any]] = (
        content.items()
        if isinstance(content, dict)
        else (
            (item["id"], item["name"]) if isinstance(item, dict) else (number, item)
            for number, item in enumerate(content)
        )
    )
    names = {int(number): str(name) for number, name in pairs}
    if min(names) < 0:  # ValueError if there are no names
        raise ValueError("a number is negative")
    return names


def _label_studio(task: dict[str, Any], source: str) -> AnnotatedPicture:
    where = f"{source}, task {task.get('id', '?')}"
    annotations = [item for item in task.get("annotations") or [] if not item.get("was_cancelled")]
    last = (annotations or task.get("predictions") or [{"result": []}])[-1]
    boxes: list[Box] = []
    size, others = None, 0
    for item in last["result"]:
        kind, value = str(item.get("type", "")), item.get("value", {})
        size = _size(item.get("original_width"), item.get("original_height")) or size
        if kind not in {"rectanglelabels", "polygonlabels"}:
            others += kind.endswith("labels")
            continue
        label = value[kind][0] if value.get(kind) else "no label"
        corners = _label_studio_corners(value, size or (1, 1))
        boxes.append(box_of(label, corners, where, score=item.get("score")))
    values = [text for text in task["data"].values() if isinstance(text, str)]
    address = str(task["data"].get("image") or next(iter(values), task.get("id", "?")))
    parts = urlsplit(address)
    path = (parse_qs(parts.query).get("d") or [parts.path])[0]
    # Uploads have a prefix of eight hexadecimal digits.
    name = re.sub(r"^[0-9a-f]{8}-", "", PurePosixPath(path).name) or address
    return AnnotatedPicture(
        name=name, boxes=tuple(boxes), shares=True, others=others, shot=Shot(size=size)
    )


def _label_studio_corners(value: dict[str, Any], size: tuple[int, int]) -> Corners:
    """Return the corners of a rectangle or polygon in percent, in shares of the picture."""
    if "points" in value:
        corners = bounds(value["points"])
    else:
        left, top = float(value["x"]), float(value["y"])
        corners = left, top, left + float(value["width"]), top + float(value["height"])
        if angle := float(value.get("rotation") or 0.0):
            # The rotation is about the left top corner, in pixels.
            wide, high = size
            scaled = corners[0] * wide, corners[1] * high, corners[2] * wide, corners[3] * high
            box = turned(scaled, angle, (left * wide, top * high))
            corners = box[0] / wide, box[1] / high, box[2] / wide, box[3] / high
    first, second, third, fourth = (number / PERCENT for number in corners)
    return first, second, third, fourth


def _cvat(file: Path) -> list[AnnotatedPicture]:
    text = _text(file)
    if "<!DOCTYPE" in text:  # to prevent expansion of entities
        raise InputError(f"{file} defines its own document type; export it as CVAT for images 1.1.")
    try:
        root = ET.fromstring(text)  # noqa: S314 - without a document type
    except (ET.ParseError, ValueError) as error:
        raise InputError(
            f"{file} is not XML that can be read ({error}); export it as CVAT for images 1.1."
        ) from error
    if root.tag != "annotations" or root.find("track") is not None:
        what = "contains tracks of a video" if root.tag == "annotations" else "is not a CVAT file"
        raise InputError(f"{file} {what}; export it as CVAT for images 1.1.")
    try:
        return [_cvat_picture(image, str(file)) for image in root.iter("image")]
    except INVALID as error:
        if isinstance(error, InputError):
            raise
        lacks = f"an image or shape lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{file} does not follow its format ({lacks}); export it as CVAT for images 1.1."
        ) from error


def _cvat_picture(image: ET.Element, source: str) -> AnnotatedPicture:
    name = image.attrib["name"]
    boxes, others = [], 0
    for number, shape in enumerate(image, start=1):
        if shape.tag == "box":
            left, top, right, bottom = (float(shape.attrib[key]) for key in CVAT_CORNERS)
            corners = left, top, right, bottom
            if angle := float(shape.get("rotation", 0.0)):
                corners = turned(corners, angle, ((left + right) / 2, (top + bottom) / 2))
        elif shape.tag == "polygon":
            corners = bounds(point.split(",") for point in shape.attrib["points"].split(";"))
        else:
            others += shape.tag != "tag"
            continue
        attributes = {item.get("name"): item.text for item in shape.iter("attribute")}
        box = box_of(
            shape.attrib["label"],
            corners,
            f"{source}, image {name!r}, shape {number}",
            score=attributes.get("score", attributes.get("confidence")),
            whole=shape.get("occluded", "0") != "1",
        )
        boxes.append(box)
    size = _size(image.get("width"), image.get("height"))
    return AnnotatedPicture(name=name, boxes=tuple(boxes), others=others, shot=Shot(size=size))


CVAT_CORNERS = ("xtl", "ytl", "xbr", "ybr")
