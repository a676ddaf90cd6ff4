"""Object detectors in ONNX files that find a bright rectangle of each colour, in every layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image, ImageDraw

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

CORNERS = {"red": (100, 60, 180, 200), "blue": (400, 220, 600, 300)}
SIZE = 640, 480
SCORES = (0.9, 0.8, 0.7)  # of red, green and blue


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a detector is exported: inputs, outputs, and the lines that compute its outputs.

    `corners` [1, 3, 4] are in pixels, `centres` are centres and sizes, `shares` the same as shares
    of the picture, `scores` [1, 3, 1], `classes` [3, C] and `by_class` [1, 3, C]. Pixels of a
    rectangle have values between `low` and `top`.
    """

    inputs: str = "float[1, 3, 320, 320] images"
    outputs: str
    lines: str
    numbers: tuple[int, int, int] = (13, 0, 10)
    """Class numbers of red, green and blue: bench, person and fire hydrant."""
    count: int = 80
    low: float = 0.7
    top: float = 1.1


# As doubled boxes with half the score, and with empty rows below them.
DENSE = """
    halves = Mul(by_class, half)
    worse = Concat <axis = 2> (near, halves)
    better = Concat <axis = 2> (centres, by_class)
    both = Concat <axis = 1> (better, worse)
    padded = Pad (both, padding)
"""
LOGITS = """
    inside = Clip (by_class, little, most)
    rest = Sub (unit, inside)
    odds = Div (inside, rest)
    values = Log (odds)
"""
NORMALIZED = {"low": 1.5, "top": 3.0}  # by mean and deviation of ImageNet

LAYOUTS = {
    "yolo_v5": Layout(
        outputs="float[1, N, 85] output0",
        lines="""
            halves = Mul (scores, half)
            ones = Expand (classes, three)
            worse = Concat <axis = 2> (near, halves, ones)
            better = Concat <axis = 2> (centres, scores, ones)
            both = Concat <axis = 1> (better, worse)
            output0 = Pad (both, padding)
        """,
    ),
    "yolo_v8": Layout(
        outputs="float[1, 84, N] output0",
        lines=f"{DENSE} output0 = Transpose <perm = [0, 2, 1]> (padded)",
    ),
    "yolo_v8_half": Layout(
        inputs="float16[1, 3, 320, 320] images",
        outputs="float16[1, 84, N] output0",
        lines=f"""{DENSE}
            turned = Transpose <perm = [0, 2, 1]> (padded)
            output0 = Cast <to = 10> (turned)
        """,
    ),
    "yolo_v8_variable": Layout(
        inputs="float[batch, 3, height, width] images",
        outputs="float[batch, 84, N] output0",
        lines=f"{DENSE} output0 = Transpose <perm = [0, 2, 1]> (padded)",
    ),
    "yolo_end_to_end": Layout(
        outputs="float[1, N, 6] output0",
        lines="output0 = Concat <axis = 2> (corners, scores, numbers)",
    ),
    "rt_detr_of_ultralytics": Layout(
        outputs="float[1, N, 84] output0",
        lines="output0 = Concat <axis = 2> (shares, by_class)",
    ),
    "rt_detr_of_ultralytics_8_4": Layout(
        outputs="float[1, N, 6] output0",
        lines="output0 = Concat <axis = 2> (shares, scores, numbers)",
    ),
    "rt_detr_of_transformers": Layout(
        outputs="float[1, N, 80] logits, float[1, N, 4] pred_boxes",
        lines=f"{LOGITS} logits = Identity (values) pred_boxes = Identity (shares)",
    ),
    "rt_detr_with_sizes": Layout(
        inputs="float[1, 3, 320, 320] images, int64[N, 2] orig_target_sizes",
        outputs="int64[1, N] labels, float[1, N, 4] boxes, float[1, N] scores_",
        lines="""
            wanted = Cast <to = 1> (orig_target_sizes)
            twice = Concat <axis = 1> (wanted, wanted)
            middles = Mul (shares, twice)
            boxes = MatMul (middles, to_corners)
            whole = Cast <to = 7> (numbers)
            labels = Squeeze (whole, two)
            scores_ = Squeeze (scores, two)
        """,
    ),
    "detr": Layout(
        inputs="float[B, 3, H, W] images, int64[B, 64, 64] pixel_mask",
        outputs="float[B, N, 92] logits, float[B, N, 4] pred_boxes",
        lines="""
            inside = Clip (by_class, little, most)
            sums = ReduceSum (inside, two)
            rest = Sub (unit, sums)
            both = Concat <axis = 2> (inside, rest)
            logits = Log (both)
            pred_boxes = Identity (shares)
        """,
        numbers=(15, 1, 11),
        count=91,
        **NORMALIZED,
    ),
    "rf_detr": Layout(
        outputs="float[1, N, 4] dets, float[1, N, 91] labels",
        lines=f"{LOGITS} labels = Identity (values) dets = Identity (shares)",
        numbers=(15, 1, 11),
        count=91,
        **NORMALIZED,  # type: ignore[arg-type]
    ),
    "torchvision": Layout(
        inputs="float[3, H, W] images",
        outputs="float[N, 4] boxes, int64[N] labels, float[N] scores_",
        lines="""
            boxes = Squeeze (corners, zero)
            whole = Cast <to = 7> (numbers)
            labels = Squeeze (whole, ends)
            scores_ = Squeeze (scores, ends)
        """,
        numbers=(15, 1, 11),
    ),
}


def save_detector(path: Path, layout: Layout, *, metadata: Mapping[str, str] | None = None) -> Path:
    """Write a detector; skip the test without onnx."""
    onnx = pytest.importorskip("onnx")
    parser, numpy_helper = pytest.importorskip("onnx.parser"), onnx.numpy_helper
    batch = (
        "batch_ = Unsqueeze (images, zero)"
        if layout.inputs.startswith("float[3")
        else "batch_ = Identity (images)"
    )
    model = parser.parse_model(
        f"""
        <ir_version: 9, opset_import: ["": 17]>
        detector ({layout.inputs}) => ({layout.outputs}) {{
            {batch}
            picture = Cast <to = 1> (batch_)
            above = Greater (picture, low)
            below = Less (picture, top)
            bright = And (above, below)
            mask = Cast <to = 1> (bright)
            columns = ReduceMax <axes = [2], keepdims = 0> (mask)
            rows = ReduceMax <axes = [3], keepdims = 0> (mask)
            left = ArgMax <axis = 2> (columns)
            upper = ArgMax <axis = 2> (rows)
            last = ArgMax <axis = 2, select_last_index = 1> (columns)
            lowest = ArgMax <axis = 2, select_last_index = 1> (rows)
            right = Add (last, step)
            lower = Add (lowest, step)
            sides = Concat <axis = 2> (left, upper, right, lower)
            corners = Cast <to = 1> (sides)
            present = ReduceMax <axes = [2]> (columns)
            scores = Mul (present, best)
            centres = MatMul (corners, to_centres)
            near = Add (centres, unit)
            shape = Shape (picture)
            size = Gather (shape, width_and_height)
            pixels = Cast <to = 1> (size)
            shares = Div (centres, pixels)
            by_class = Mul (scores, classes)
            {layout.lines}
        }}
        """.replace(") ", ")\n")
    )
    to_centres = np.array([[0.5, 0, -1, 0], [0, 0.5, 0, -1], [0.5, 0, 1, 0], [0, 0.5, 0, 1]])
    classes = np.zeros((1, 3, layout.count))
    classes[0, [0, 1, 2], layout.numbers] = 1
    floats = {
        "low": layout.low,
        "top": layout.top,
        "best": np.reshape(SCORES, (1, 3, 1)),
        "classes": classes,
        "numbers": np.reshape(layout.numbers, (1, 3, 1)),
        "to_centres": to_centres,
        "to_corners": np.linalg.inv(to_centres),
        "half": 0.5,
        "unit": 1.0,
        "little": 1e-6,
        "most": 1 - 1e-6,
    }
    whole = {
        "step": 1,
        "width_and_height": [3, 2, 3, 2],
        "padding": [0, 0, 0, 0, 94, 0],
        "three": [1, 3, layout.count],
        "zero": [0],
        "two": [2],
        "ends": [0, 2],
    }
    constants: dict[str, NDArray[np.generic]] = {
        **{name: np.array(value, dtype=np.float32) for name, value in floats.items()},
        **{name: np.array(value, dtype=np.int64) for name, value in whole.items()},
    }
    used = {name for node in model.graph.node for name in node.input}
    model.graph.initializer.extend(
        numpy_helper.from_array(value, name) for name, value in constants.items() if name in used
    )
    onnx.helper.set_model_props(model, dict(metadata or {}))
    onnx.checker.check_model(model)
    onnx.save(model, path)
    return path


def save_photograph(path: Path, exif: Image.Exif | None = None, *, turned: int = 0) -> Path:
    """Write a grey picture with a red and a blue rectangle, turned by a multiple of 90 degrees."""
    image = Image.new("RGB", SIZE, (60, 60, 60))
    for colour, (left, top, right, bottom) in CORNERS.items():
        ImageDraw.Draw(image).rectangle((left, top, right - 1, bottom - 1), fill=colour)
    image.rotate(turned, expand=True).save(path, quality=95, subsampling=0, exif=exif)
    return path
