"""KITTI: a .txt file of label_2 per picture, in pixels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from semsig_gis.observation.detectors.formats import detection_format
from semsig_gis.observation.detectors.pictures import (
    AnnotatedPicture,
    box_of,
    faulty_box,
    read_boxes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.observation.detectors.documents import Document
    from semsig_gis.observation.detectors.pictures import Box

VALUES = 15  # type, truncated, occluded, angle, box, and seven of the object in space; a score
REGION = "DontCare"  # several objects that were not labelled


def matches(content: Any) -> bool:  # noqa: ANN401 - words of lines
    """Return whether the first line of a text is a name with 14 or 15 values."""
    words: list[str] = next((line for line in content if line), [])
    return len(words) in {VALUES, VALUES + 1} and not words[0].isdecimal()


@detection_format("KITTI label_2", ".txt", matches)
def pictures(document: Document, _: Sequence[Document]) -> list[AnnotatedPicture]:
    """Return the picture that is named as the file."""
    lines = [words or [REGION] for words in document.content]
    boxes, others = read_boxes(lines, _box, f"{document.file}, line")
    others -= lines.count([REGION])  # blank lines
    return [AnnotatedPicture(name=document.file.stem, boxes=boxes, others=others)]


def _box(words: Sequence[str], where: str) -> Box | None:
    if words[0] == REGION:
        return None
    if len(words) not in {VALUES, VALUES + 1}:
        return faulty_box(
            f"{where} has {len(words)} values; a line of KITTI has 15, and a score if it is of a "
            "detector"
        )
    score = words[VALUES] if len(words) > VALUES else 1.0
    # Both are 0 for a whole object, and -1 if they are unknown.
    whole = max(float(words[1]), float(words[2])) <= 0
    return box_of(words[0], words[4:8], where, score=score, whole=whole)
