"""Layouts of the outputs of object detectors: boxes, scores and classes from arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    ClassNames = Mapping[int, str]

# The 80 names of COCO in their order, and the numbers from 1 to 90 without a name. Some detectors
# count the names from 0, others use the numbers.
COCO = (
    *("person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat"),
    *("traffic light", "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog"),
    *("horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella"),
    *("handbag", "tie", "suitcase", "frisbee", "skis", "snowboard", "sports ball", "kite"),
    *("baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle"),
    *("wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich"),
    *("orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch"),
    *("potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote"),
    *("keyboard", "cell phone", "microwave", "oven", "toaster", "sink", "refrigerator", "book"),
    *("clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush"),
)
COCO_GAPS = frozenset({12, 26, 29, 30, 45, 66, 68, 69, 71, 83})
COCO_NAMES = (
    dict(enumerate(COCO)),
    dict(zip((number for number in range(1, 91) if number not in COCO_GAPS), COCO, strict=True)),
)
BACKGROUND = frozenset({"background", "n/a"})

RF_DETR_OUTPUTS = frozenset({"dets", "labels"})
MOST_SHARE = 2.0  # boxes in shares of the picture have no larger values
MOST_OVERLAP = 0.5
"""Of two boxes of a class with a larger intersection over union, one is left out."""


class Detections(NamedTuple):
    """Corners in pixels of the input (n, 4), scores (n,) and class numbers (n,) with their names.

    With `overlapping`, an object may have several boxes.
    """

    corners: NDArray[np.float64]
    scores: NDArray[np.float64]
    numbers: NDArray[np.int64]
    names: ClassNames
    overlapping: bool = False


def read_outputs(
    outputs: Mapping[str, NDArray[np.generic]],
    choices: Sequence[ClassNames],
    size: tuple[int, int],
) -> Detections | None:
    """Return the boxes in the outputs of a detector for one picture; None if the layout is unknown.

    `choices` are the possible names of its classes; the number of scores decides. `size` is width
    and height of its input in pixels.
    """
    floats = {name: array.astype(np.float64) for name, array in outputs.items()}
    if len(floats) == 2:  # noqa: PLR2004 - boxes and scores
        return _boxes_and_scores(floats, choices, size)
    first, *others = floats.values()
    if not others and first.ndim == 3:  # noqa: PLR2004 - picture, row, column
        return _one_output(first[0], choices, size)
    whole = [name for name, array in outputs.items() if np.issubdtype(array.dtype, np.integer)]
    if len(others) == 2 and len(whole) == 1:  # noqa: PLR2004 - boxes, labels and scores
        labels = floats.pop(whole[0]).astype(np.int64)
        scores, boxes = sorted(floats.values(), key=lambda array: array.ndim)
        return _boxes_labels_and_scores(boxes, labels, scores, choices)
    return None


def _one_output(
    rows: NDArray[np.float64], choices: Sequence[ClassNames], size: tuple[int, int]
) -> Detections | None:
    """Return the boxes of YOLO, and of the RT-DETR of Ultralytics."""
    # Box, score and number of the class: corners of YOLO, centres and sizes of RT-DETR as shares.
    if rows.shape[1] == 6 and not (rows[:, 5] % 1).any():  # noqa: PLR2004
        shares = bool((np.abs(rows[:, :4]) <= MOST_SHARE).all())
        corners = _corners(rows[:, :4] * (*size, *size)) if shares else rows[:, :4]
        return Detections(corners, rows[:, 4], rows[:, 5].astype(np.int64), choices[0])
    for names in choices:
        classes = max(names) + 1
        if rows.shape[0] == 4 + classes:  # v8 and newer: a column for each box
            return _scored(rows[:4].T, rows[4:].T, names, overlapping=True)
        # YOLOX has the same columns, but its boxes are relative to one cell each.
        cells = size[0] * size[1] * 21 / 1024
        if rows.shape[1] == 5 + classes and rows.shape[0] != cells:  # v5: with objectness
            return _scored(rows[:, :4], rows[:, 5:] * rows[:, 4:5], names, overlapping=True)
        if rows.shape[1] == 4 + classes:
            return _scored(rows[:, :4] * (*size, *size), rows[:, 4:], names)
    return None


def _boxes_and_scores(
    outputs: Mapping[str, NDArray[np.float64]],
    choices: Sequence[ClassNames],
    size: tuple[int, int],
) -> Detections | None:
    """Return the boxes of DETR and its successors, in shares of the picture."""
    boxes, scores = (
        array[0] if array.ndim == 3 else array  # noqa: PLR2004 - picture, box, value
        for _, array in sorted(
            outputs.items(), key=lambda item: "box" not in item[0] and item[0] != "dets"
        )
    )
    if boxes.shape != (len(scores), 4) or scores.ndim != 2 or (np.abs(boxes) > MOST_SHARE).any():  # noqa: PLR2004
        return None
    for names in choices:
        classes = max(names) + 1
        if scores.shape[1] not in {classes, classes + 1}:
            continue
        if scores.min(initial=0.0) < 0 or scores.max(initial=0.0) > 1:
            # One more class is for no object, except in RF-DETR, which does not use it.
            if scores.shape[1] == classes or outputs.keys() == RF_DETR_OUTPUTS:
                scores = 1 / (1 + np.exp(-np.clip(scores, -500, 500)))
            else:
                scores = np.exp(scores - scores.max(axis=1, keepdims=True))
                scores /= scores.sum(axis=1, keepdims=True)
        return _scored(boxes * (*size, *size), scores[:, :classes], names)
    return None


def _boxes_labels_and_scores(
    corners: NDArray[np.float64],
    labels: NDArray[np.int64],
    scores: NDArray[np.float64],
    choices: Sequence[ClassNames],
) -> Detections | None:
    """Return the boxes of torchvision, or of RT-DETR with the size of the picture as an input."""
    if corners.shape != (*labels.shape, 4) or scores.shape != labels.shape or labels.ndim > 2:  # noqa: PLR2004
        return None
    if labels.ndim == 2:  # noqa: PLR2004 - picture, box
        return Detections(corners[0], scores[0], labels[0], choices[0])
    names = choices[-1]
    if names.get(0, "background").strip("_ ").lower() not in BACKGROUND:
        raise InputError(
            "detectors of torchvision count classes from 1; give 'background' as the first of the "
            "names, or a YAML file with the number of each name."
        )
    return Detections(corners, scores, labels, names)


def _scored(
    boxes: NDArray[np.float64],
    scores: NDArray[np.float64],
    names: ClassNames,
    *,
    overlapping: bool = False,
) -> Detections:
    """Return boxes, given by centre and size, with the best of the scores of all classes."""
    best = scores.max(axis=1), scores.argmax(axis=1)
    return Detections(_corners(boxes), *best, names, overlapping)


def _corners(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of boxes with centres and sizes."""
    half = boxes[:, 2:] / 2
    return np.hstack([boxes[:, :2] - half, boxes[:, :2] + half])


def suppress_overlaps(
    corners: NDArray[np.float64], scores: NDArray[np.float64], numbers: NDArray[np.int64]
) -> list[int]:
    """Return the rows of boxes that overlap no better box of their class, best first."""
    areas = np.prod(corners[:, 2:] - corners[:, :2], axis=1)
    order = np.argsort(-scores, kind="stable")
    rows: list[int] = []
    while len(order):
        best, order = order[0], order[1:]
        rows.append(int(best))
        low = np.maximum(corners[best, :2], corners[order, :2])
        high = np.minimum(corners[best, 2:], corners[order, 2:])
        shared = np.prod(np.clip(high - low, 0.0, None), axis=1)
        overlap = shared > MOST_OVERLAP * (areas[best] + areas[order] - shared)
        order = order[~overlap | (numbers[order] != numbers[best])]
    return rows
