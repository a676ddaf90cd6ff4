"""Detectors in ONNX files: every layout, names of classes, and files that are refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from small_detectors import CORNERS, LAYOUTS, SIZE, save_detector, save_photograph

from semsig_gis.observation import detect_boxes

if TYPE_CHECKING:
    from pathlib import Path

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
    (picture,) = detect_boxes(model, [photo], names="coco")
    check(picture)
