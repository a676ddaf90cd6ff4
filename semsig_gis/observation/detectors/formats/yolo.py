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
    read_boxes,
)
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box, Corners

NAME_FILES = ("data.yaml", "data.yml", "classes.txt", "obj.names", "labels.txt", "obj.data")
"""Files with class names, in the folder of the labels or up to two above."""
LEVELS = 3
NAME_KEYS = ("names", "id2label", "categories")
"""Where YOLO, Transformers and COCO have the names of classes."""

BOX_VALUES = 4
DOTA_WORDS = 10  # eight numbers, a name and a mark
NUMBER = re.compile(r"-?\d*\.?\d+(?:[eE][-+]?\d+)?")
NUMBERED = re.compile(r" *(\d+)[ \t:,]+([^\W\d].*)")
INTEGER = re.compile(r"-?\d+(?:\.0+)?")
DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
MOST_SHARE = 2.0  # a picture away
LEAST_WORDS = 4  # a line with fewer is of another kind of text
LEAST_NUMBERS = 3


def matches(content: Any) -> bool:  # noqa: ANN401 - words of lines
    """Return whether a text is empty, as without objects, or begins with a line of numbers."""
    words = next((line for line in content if line), None)
    if words is None:
        return True
    own = _words(words)
    if own != words and not all(_is_share(word) for word in own[1 : BOX_VALUES + 1]):
        return False  # another table with commas, such as one in pixels
    words = own
    return (
        len(words) >= LEAST_WORDS
        and not words[0].endswith(":")
        and "." not in words[0].removesuffix(".0")
        and sum(NUMBER.fullmatch(word) is not None for word in words[1:5]) >= LEAST_NUMBERS
        and _is_number(words[-1])
        and (len(words) != DOTA_WORDS or _is_number(words[-2]))
    )


def _words(words: Sequence[str]) -> list[str]:
    """Return the class and the values of a line, which may be separated by commas or semicolons.

    Commas in numbers that are separated by blanks are decimal points. A class may be of several
    words.
    """
    line = " ".join(words)
    if ";" in line or len(words) > BOX_VALUES:
        parts = line.split(";") if ";" in line else list(words)
        texts = [DECIMAL_COMMA.sub(".", part.strip().removesuffix(",")) for part in parts]
    else:
        texts = [part.strip() for part in line.split(",")] if "," in line else list(words)
    number = next((place for place, text in enumerate(texts) if NUMBER.fullmatch(text)), 0)
    return [" ".join(texts[:number]), *texts[number:]] if number else texts


def _is_number(word: str) -> bool:
    return NUMBER.fullmatch(word) is not None or word.casefold() == "nan"


def _is_share(word: str) -> bool:
    return NUMBER.fullmatch(word) is not None and abs(float(word)) <= MOST_SHARE


@detection_format("YOLO with data.yaml", ".txt", matches)
def pictures(document: Document, documents: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture that is named as the file."""
    file = document.file
    lines = {
        number: _words(words) for number, words in enumerate(document.content, start=1) if words
    }
    numbered = any(NUMBER.fullmatch(words[0]) for words in lines.values())
    source = _names_file(file, documents) if numbered else None
    labels = read_class_names(source) if source else {}
    keypoints = _keypoints(source) if source else 0
    # Key points stand between the box and its score.
    values = {
        number: [*words[1 : BOX_VALUES + 1], *words[BOX_VALUES + 1 + keypoints :]]
        for number, words in lines.items()
    }
    orders = {
        odd: _order([texts for texts in values.values() if len(texts) % 2 == odd]) for odd in (0, 1)
    }

    def box(number: int, _: str) -> Box:
        where, texts = f"{file}, line {number}", values[number]
        label = _label(lines[number], labels, where)
        corners, score = _corners(texts, orders[len(texts) % 2], where)
        return box_of(label, corners, where, score=score)

    boxes, _ = read_boxes(lines, box, f"{file}, line")
    return [AnnotatedPicture(name=file.stem, boxes=boxes, shares=True)]


def _label(words: Sequence[str], labels: Mapping[int, str], where: str) -> str:
    """Return the class of a line; InputError if it has no name, or the line no box."""
    number = words[0].removesuffix(".0")
    if len(words) <= BOX_VALUES or number.startswith("-"):
        raise InputError(
            f"{where} is not a line of YOLO labels; write class, x, y, width, height (and score)."
        )
    if not number.isdecimal():
        return number
    if int(number) not in labels:
        raise InputError(f"{where} is of class {number}, which has no name; list it in data.yaml.")
    return labels[int(number)]


def _order(lines: Sequence[Sequence[str]]) -> str:
    """Return what the values after the boxes or outlines of lines are: of score and id.

    All lines have an even, or all an odd number of values. Trackers write the number of an object,
    before or after the score. It is an integer in all lines, and in one at least none of 0 and 1,
    which scores and coordinates may be. The text is "?" if the order is not known.
    """
    lines = [texts for texts in lines if len(texts) > BOX_VALUES]
    if not lines:
        return ""
    before, last = ([texts[place] for texts in lines] for place in (-2, -1))
    kinds = _kind(before), _kind(last)
    if len(lines[0]) % 2:
        return "?" if kinds[1] == "id or score" and "0" in last else kinds[1].split()[-1]
    if kinds == ("id", "id"):
        return "?"
    if "id" in kinds:
        return "id score" if kinds[0] == "id" else "score id"
    if any(len(texts) > BOX_VALUES + 2 for texts in lines) or kinds == ("score", "score"):
        return ""  # outlines
    return "score id" if kinds[0] == "score" or before == last else "?"


def _kind(texts: Sequence[str]) -> str:
    """Return what the values of a column may be: "id", "score", or "id or score"."""
    if not all(map(INTEGER.fullmatch, texts)):
        return "score"
    return "id or score" if {float(text) for text in texts} <= {0.0, 1.0} else "id"


def _corners(texts: Sequence[str], order: str, where: str) -> tuple[Corners, str]:
    """Return the corners, in shares of the picture, and the score of a box or polygon."""
    score = "1"
    if len(texts) > BOX_VALUES:
        if order == "?":
            raise InputError(
                f"{where} ends with {texts[-2]} {texts[-1]}, which may be a score or the number of "
                "an object; write class, x, y, width, height, score."
            )
        names = order.split()
        ends = dict(zip(names, texts[len(texts) - len(names) :], strict=True))
        texts, score = texts[: len(texts) - len(names)], ends.get("score", "1")
    try:
        values = [float(text) for text in texts]
    except ValueError as error:
        raise InputError(
            f"{where} has a value that is not a number; write class, x, y, width, height."
        ) from error
    if len(texts) == BOX_VALUES:
        x, y, width, height = values
        corners = x - width / 2, y - height / 2, x + width / 2, y + height / 2
    else:
        corners = bounds(zip(values[::2], values[1::2], strict=True))
    if not all(-1 <= value <= MOST_SHARE for value in corners):
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
    """Read the names of classes by number: a name in each line, YAML or JSON.

    A line may begin with its number. A file of Darknet (.data) has the place of such a file.
    """
    text = text_of(source)
    suffix = source.suffix.lower()
    if suffix == ".data":
        stated = re.search(r"(?m)^ *names *= *(\S+)", text)
        places = [folder / stated[1] for folder in source.absolute().parents] if stated else []
        places += [source.with_name(places[0].name)] if places else []
        names = next((place for place in places if place.is_file()), None)
        if names is None:
            raise InputError(f"{source} names no file of class names; give the .names file.")
        return read_class_names(names)
    if suffix not in {".yaml", ".yml", ".json"}:
        numbered = [NUMBERED.fullmatch(line) for line in text.splitlines() if line.strip()]
        if numbered and all(numbered):
            return {int(match[1]): match[2].strip() for match in numbered if match}
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
