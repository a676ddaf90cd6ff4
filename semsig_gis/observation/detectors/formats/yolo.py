"""YOLO: a .txt file per picture, in shares of the picture, with a file of class names."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import yaml

from semsig_gis.core import InputError
from semsig_gis.observation.detectors.documents import INVALID, text_of
from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    bounds,
    box_of,
    faulty_box,
)
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

NAME_FILES = ("data.yaml", "data.yml", "classes.txt", "obj.names")
"""Files with class names, in the folder of the labels or up to two above."""
LEVELS = 3
NAME_KEYS = ("names", "id2label", "categories")
"""Where YOLO, Transformers and COCO have the names of classes."""

BOX_VALUES = 4
DOTA_WORDS = 10  # eight numbers, a name and a mark
NUMBER = re.compile(r"-?\d*\.?\d+(?:[eE][-+]?\d+)?")
LEAST_WORDS = 4  # a line with fewer is of another kind of text
LEAST_NUMBERS = 3


def matches(content: Any) -> bool:  # noqa: ANN401 - words of lines
    """Return whether a text is empty, as without objects, or begins with a line of numbers."""
    words = next((line for line in content if line), None)
    if words is None:
        return True
    return (
        len(words) >= LEAST_WORDS
        and not words[0].endswith(":")
        and "." not in words[0].removesuffix(".0")
        and sum(NUMBER.fullmatch(word) is not None for word in words[1:5]) >= LEAST_NUMBERS
        and NUMBER.fullmatch(words[-1]) is not None
        and (len(words) != DOTA_WORDS or NUMBER.fullmatch(words[-2]) is not None)
    )


@detection_format("YOLO with data.yaml", ".txt", matches)
def pictures(document: Document, documents: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture that is named as the file."""
    file = document.file
    source = _names_file(file, documents) if any(document.content) else None
    labels = read_class_names(source) if source else {}
    keypoints = _keypoints(source) if source else 0
    boxes = []
    for number, words in enumerate(document.content, start=1):
        if not words:
            continue
        try:
            # Key points stand between the box and its score.
            own = [*words[: BOX_VALUES + 1], *words[BOX_VALUES + 1 + keypoints :]]
            boxes.append(_box(own, labels, f"{file}, line {number}"))
        except InputError as error:
            boxes.append(faulty_box(str(error).rstrip(".")))
    return [AnnotatedPicture(name=file.stem, boxes=tuple(boxes), shares=True)]


def _box(words: Sequence[str], labels: Mapping[int, str], where: str) -> Box:
    """Return the box of a line; InputError if it has none."""
    number = words[0].removesuffix(".0")
    if len(words) <= BOX_VALUES or not number.isdecimal():
        raise InputError(
            f"{where} is not a line of YOLO labels; write class, x, y, width, height (and score)."
        )
    if int(number) not in labels:
        raise InputError(f"{where} is of class {number}, which has no name; list it in data.yaml.")
    corners, score = _corners(words[1:], where)
    return box_of(labels[int(number)], corners, where, score=score)


def _corners(texts: Sequence[str], where: str) -> tuple[Corners, str]:
    """Return the corners, in shares of the picture, and the score of a box or polygon.

    Trackers write the number of the object at the end of the line, after the score.
    """
    tracked = len(texts) > BOX_VALUES and texts[-1].isdecimal()
    if tracked and (int(texts[-1]) > 1 or len(texts) == BOX_VALUES + 2):
        texts = texts[:-1]
    try:
        values = [float(text) for text in texts]
    except ValueError as error:
        raise InputError(
            f"{where} has a value that is not a number; write class, x, y, width, height."
        ) from error
    score = texts[-1] if len(texts) % 2 else "1"
    if len(texts) <= BOX_VALUES + 1:
        x, y, width, height = values[:BOX_VALUES]
        corners = x - width / 2, y - height / 2, x + width / 2, y + height / 2
    else:
        corners = bounds(zip(values[::2], values[1::2], strict=False))
    if not all(-1 <= value <= 2 for value in corners):  # noqa: PLR2004 - a picture away
        raise InputError(
            f"{where} is not in shares of the picture; divide pixels by its width and height."
        )
    return corners, score


def _names_file(file: Path, documents: Sequence[Document]) -> Path:
    """Return the file of class names that was given, or is near the labels."""
    own = (document.file for document in documents if document.content is None)
    near = (folder / name for folder in file.absolute().parents[:LEVELS] for name in NAME_FILES)
    source = next(own, None) or next((path for path in near if path.is_file()), None)
    if source is None:  # a file of another name, if there is one only
        others = [
            path
            for folder in file.absolute().parents[:LEVELS]
            for path in [*folder.glob("*.yaml"), *folder.glob("*.yml")]
            if re.search(r"(?m)^names *:", text_of(path))
        ]
        source = others[0] if len(others) == 1 else None
    if source is None:
        raise InputError(
            f"the classes of {file} have no names; give its data.yaml or classes.txt as well."
        )
    return source


def _keypoints(source: Path) -> int:
    """Return the number of values of key points in a line; 0 without key points."""
    shape = re.search(r"(?m)^kpt_shape *: *\[ *(\d+) *, *(\d+) *\]", text_of(source))
    return math.prod(map(int, shape.groups())) if shape else 0


def read_class_names(source: Path) -> dict[int, str]:
    """Read the names of classes by number: a name in each line, YAML or JSON."""
    text = text_of(source)
    suffix = source.suffix.lower()
    if suffix not in {".yaml", ".yml", ".json"}:
        return dict(enumerate(text.split("\n")))
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
