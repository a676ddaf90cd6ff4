"""Detectors in ONNX files: every layout, names of classes, and files that are refused."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.ExifTags import Base
from sentences import refused
from small_detectors import CORNERS, LAYOUTS, SIZE, save_detector, save_photograph

from semsig_gis.core import InputError
from semsig_gis.observation import LabelMap, detect_boxes
from semsig_gis.observation.detectors.layouts import COCO_NAMES, read_outputs, suppress_overlaps
from semsig_gis.observation.detectors.onnx import letterbox
from semsig_gis.sources import built_in_taxonomy

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from small_detectors import Layout

    from semsig_gis.observation import AnnotatedPicture


def check(picture: AnnotatedPicture, labels: tuple[str, str] = ("bench", "fire hydrant")) -> None:
    """Check the boxes of the red and the blue rectangle."""
    assert picture.name == "a.png"
    assert picture.shot.size == SIZE
    assert tuple(box.label for box in picture.boxes) == labels
    assert [box.score for box in picture.boxes] == pytest.approx([0.9, 0.7], abs=0.001)
    for box, corners in zip(picture.boxes, CORNERS.values(), strict=True):
        assert box.corners == pytest.approx(corners, abs=2.5)


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_gives_same_boxes(name: str, tmp_path: Path) -> None:
    model = save_detector(tmp_path / "a.onnx", LAYOUTS[name])
    photo = save_photograph(tmp_path / "a.png")
    (picture,), _ = detect_boxes(model, [photo], names="coco")
    check(picture)


@given(
    st.tuples(st.integers(20, 900), st.integers(20, 900)),
    st.tuples(st.integers(1, 20), st.integers(1, 20)),
    st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4),
)
def test_letterbox_and_back_is_the_same_box(
    picture: tuple[int, int], strides: tuple[int, int], shares: list[float]
) -> None:
    size = strides[0] * 32, strides[1] * 32
    pixels, scale, shift = letterbox(Image.new("RGB", picture, "white"), size)
    assert pixels.shape == (size[1], size[0], 3)
    points = np.reshape(shares, (2, 2)) * picture
    inside = points * scale + shift
    assert ((inside >= -1e-9) & (inside <= np.array(size) + 1e-9)).all()
    assert (inside - shift) / scale == pytest.approx(points)
    # The picture is where its corners are, in the middle, and touches two sides at least.
    (left, top), (right, bottom) = shift, shift + picture * scale
    rows, columns = (pixels != 114).all(axis=2).nonzero()
    assert (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1) == pytest.approx(
        (left, top, right, bottom)
    )
    margins = np.array([left, top, size[0] - right, size[1] - bottom])
    assert np.abs(margins[:2] - margins[2:]).max() <= 1 + 1e-9
    assert margins[:2].min() == 0
    # It is as large as possible, and distorted by half a pixel at most.
    ratio = min(size[0] / picture[0], size[1] / picture[1])
    assert np.abs(picture * (scale - ratio)).max() <= 0.5 + 1e-9


def overlaps(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Count pixels of boxes with whole numbers as corners."""
    pixels = [
        {(x, y) for x in range(int(left), int(right)) for y in range(int(top), int(bottom))}
        for left, top, right, bottom in (first, second)
    ]
    return len(pixels[0] & pixels[1]) > 0.5 * len(pixels[0] | pixels[1])


BOX = st.tuples(*[st.integers(0, 8)] * 2, *[st.integers(0, 6)] * 2)


@given(st.lists(st.tuples(BOX, st.integers(0, 100), st.integers(0, 1)), max_size=12))
def test_overlapping_boxes_of_a_class_are_suppressed(
    boxes: list[tuple[tuple[int, int, int, int], int, int]],
) -> None:
    corners = np.array([(x, y, x + w, y + h) for (x, y, w, h), _, _ in boxes], dtype=float)
    corners = corners.reshape(-1, 4)
    scores = np.array([score / 100 for _, score, _ in boxes])
    numbers = np.array([number for _, _, number in boxes], dtype=np.int64)
    rows: list[int] = []
    for row in sorted(range(len(boxes)), key=lambda row: (-scores[row], row)):
        if not any(
            numbers[row] == numbers[other] and overlaps(corners[row], corners[other])
            for other in rows
        ):
            rows.append(row)
    assert suppress_overlaps(corners, scores, numbers) == rows


NAMES = {
    "a.txt": "lamp\nbench\n\nlitter bin\n",
    "a.yaml": "names: {0: lamp, 1: bench, 3: litter bin}",
    "a.json": '{"id2label": {"0": "lamp", "1": "bench", "3": "litter bin"}}',
    "list.json": '["lamp", "bench", "", "litter bin"]',
    "coco.json": '{"categories": [{"id": 1, "name": "bench"}, {"id": 3, "name": "litter bin"}]}',
}
OWN = replace(LAYOUTS["yolo_v8"], outputs="float[1, 8, N] output0", numbers=(1, 0, 3), count=4)


@pytest.mark.parametrize("name", NAMES)
def test_names_of_classes_are_read_from_a_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(NAMES[name])
    model = save_detector(tmp_path / "a.onnx", OWN)
    (picture,), _ = detect_boxes(
        model, [save_photograph(tmp_path / "a.png")], names=tmp_path / name
    )
    check(picture, ("bench", "litter bin"))


@pytest.mark.parametrize(
    "names", ["{0: 'lamp', 1: 'bench', 3: 'litter bin'}", "['lamp', 'bench', '', 'litter bin']"]
)
def test_names_of_classes_are_read_from_the_model(names: str, tmp_path: Path) -> None:
    metadata = {"names": names, "task": "detect", "imgsz": "[320, 320]"}
    variable = replace(OWN, inputs="float[1, 3, H, W] images")
    model = save_detector(tmp_path / "a.onnx", variable, metadata=metadata)
    save_photograph(tmp_path / "a.png")
    (tmp_path / "notes.txt").write_text("no photograph")
    finished: list[tuple[int, int]] = []
    (picture,), _ = detect_boxes(
        model, [tmp_path], progress=lambda count, total: finished.append((count, total))
    )
    check(picture, ("bench", "litter bin"))
    assert finished == [(1, 1)]


def test_rf_detr_has_one_more_class_that_it_does_not_use(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(NAMES["a.txt"])
    layout = replace(
        LAYOUTS["rf_detr"],
        outputs="float[1, N, 4] dets, float[1, N, 5] labels",
        numbers=(1, 4, 3),
        count=5,
    )
    model = save_detector(tmp_path / "a.onnx", layout)
    (picture,), _ = detect_boxes(
        model, [save_photograph(tmp_path / "a.png")], names=tmp_path / "a.txt"
    )
    check(picture, ("bench", "litter bin"))


def test_picture_is_detected_in_its_shown_orientation(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[Base.Orientation] = 6  # shown after a turn of 90 degrees clockwise
    save_photograph(tmp_path / "a.png", exif, turned=90)
    model = save_detector(tmp_path / "a.onnx", LAYOUTS["yolo_v8"])
    (picture,), _ = detect_boxes(model, [tmp_path / "a.png"], names="coco")
    check(picture)


def test_settings_of_transformers_apply(tmp_path: Path) -> None:
    """A folder as of their exports: colours of the input, and its size."""
    settings = {
        "do_normalize": True,
        "image_mean": [0.5, 0.5, 0.5],
        "image_std": [0.25, 0.25, 0.25],
        "size": {"height": 320, "width": 320},
    }
    (tmp_path / "preprocessor_config.json").write_text(json.dumps(settings))
    (tmp_path / "onnx").mkdir()
    layout = replace(
        LAYOUTS["rt_detr_of_transformers"],
        inputs="float[1, 3, H, W] images",
        low=1.5,
        top=2.1,
    )
    model = save_detector(tmp_path / "onnx/model.onnx", layout)
    (picture,), _ = detect_boxes(model, [save_photograph(tmp_path / "a.png")], names="coco")
    check(picture)


def test_boxes_below_the_score_are_left_out(tmp_path: Path) -> None:
    model = save_detector(tmp_path / "a.onnx", LAYOUTS["yolo_end_to_end"])
    photo = save_photograph(tmp_path / "a.png")
    scores = [
        [
            box.score
            for box in detect_boxes(model, [photo], names="coco", min_score=least)[0][0].boxes
        ]
        for least in (0.0, 0.8, 0.95)
    ]
    assert [len(part) for part in scores] == [3, 1, 0]


CORNERS_ONLY = replace(OWN, lines="output0 = Identity (corners)", outputs="float[1, N, 4] output0")


@pytest.mark.parametrize(
    ("layout", "metadata", "names", "words"),
    [
        ("yolo_v8", {}, None, "does not contain the names of its classes; give --labels coco"),
        ("yolo_v8", {}, "no.txt", "no.txt is not a file"),
        ("yolo_v8", {}, "three.txt", "has the outputs output0 [1, 84, 100], which is no known"),
        ("yolo_v8", {"names": "['lamp', 'bench']"}, "coco", "has 2 classes, and coco has 80"),
        ("yolo_v8", {"names": "['lamp', 'bench']"}, None, "no known layout for 2 classes"),
        ("yolo_v8", {"task": "pose"}, "coco", "is for the task 'pose'"),
        ("yolo_v8_variable", {"imgsz": "[wide"}, "coco", "the input of"),
        ("yolo_end_to_end", {}, "three.txt", "found the class 13 on a.png, but the names end"),
        ("torchvision", {}, "three.txt", "give 'background' as the first of the names"),
        (CORNERS_ONLY, {}, "coco", "output0 [1, 3, 4]"),
        (replace(OWN, inputs="float[8, 3, 9, 9] images"), {}, "coco", "[8, 3, 9, 9]"),
        (replace(CORNERS_ONLY, inputs="float[1, 1, 9, 9] images"), {}, "coco", "[1, 1, 9, 9]"),
        (replace(OWN, inputs="uint8[1, 3, 9, 9] images"), {}, "coco", "tensor(uint8)"),
        (replace(OWN, inputs=f"{OWN.inputs}, float[1] scale"), {}, "coco", "scale tensor(float)"),
    ],
)
def test_unknown_layouts_and_names_are_refused(  # noqa: PLR0917 - the cases
    layout: str | Layout,
    metadata: dict[str, str],
    names: str | None,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "three.txt").write_text("lamp\nbench\nbin\n")
    layout = LAYOUTS[layout] if isinstance(layout, str) else layout
    model = save_detector(tmp_path / "a.onnx", layout, metadata=metadata)
    photo = save_photograph(tmp_path / "a.png")
    with refused(InputError, words):
        detect_boxes(model, [photo], names=names)


def test_boxes_of_yolox_are_not_taken_for_those_of_yolo_v5() -> None:
    for count, recognized in ((25200, True), (8400, False)):
        outputs = {"output": np.zeros((1, count, 85), dtype=np.float32)}
        assert (read_outputs(outputs, COCO_NAMES, (640, 640)) is not None) == recognized


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    photo = save_photograph(tmp_path / "a.png")
    for content in (b"", b"PK", b"%PDF-1.7\n"):
        (tmp_path / "a.onnx").write_bytes(content)
        with refused(InputError, "a.onnx cannot be loaded as an ONNX model"):
            detect_boxes(tmp_path / "a.onnx", [photo], names="coco")
    with refused(InputError, "no.onnx is not a file"):
        detect_boxes(tmp_path / "no.onnx", [photo], names="coco")
    (tmp_path / "empty").mkdir()
    with refused(InputError, "empty contains no photograph"):
        detect_boxes(tmp_path / "a.onnx", [tmp_path / "empty"], names="coco")
    model = save_detector(tmp_path / "a.onnx", LAYOUTS["yolo_v8"])
    whole = photo.read_bytes()
    photo.write_bytes(whole[: len(whole) // 2])
    with refused(InputError, "a.png cannot be read"):
        detect_boxes(model, [photo], names="coco")
    (tmp_path / "preprocessor_config.json").write_text("[]")
    with refused(InputError, "preprocessor_config.json is not a table"):
        detect_boxes(model, [save_photograph(photo)], names="coco")


def test_unreadable_photograph_does_not_end_the_batch(tmp_path: Path) -> None:
    model = save_detector(tmp_path / "a.onnx", LAYOUTS["yolo_v8"])
    content = save_photograph(tmp_path / "a.png").read_bytes()
    bad = {"0.jpg": b"", "b.png": content[: len(content) // 2], "c.heic": b"x"}
    for name, part in bad.items():
        (tmp_path / name).write_bytes(part)
    (picture,), left_out = detect_boxes(model, [tmp_path], names="coco")
    check(picture)
    assert [*left_out] == [tmp_path / name for name in bad]
    assert all(file.name in reason for file, reason in left_out.items())


def test_names_of_coco_are_those_of_its_label_map() -> None:
    labels = LabelMap.open(["coco"], built_in_taxonomy())
    from_0, from_1 = COCO_NAMES
    assert {label for label, _ in labels.meanings} == {*from_0.values()} == {*from_1.values()}
    assert (len(from_0), max(from_1)) == (80, 90)
    assert (from_0[13], from_1[15]) == ("bench", "bench")
