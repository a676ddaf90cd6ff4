"""Photos of a street as they might be taken in a small city: drawn, with boxes that are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from benchmarks.rendered import Scene
from semsig_gis.core import class_signs
from semsig_gis.observation import Camera, with_heights

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.core import Taxonomy
    from semsig_gis.evaluation import Sight

SKY, WALLS, GROUND = "#b9d3ea", "#c9bba7", "#9a9a94"
TRUNK, METAL = "#6b4a2b", "#4a4f55"


@dataclass(frozen=True)
class StreetPhoto:
    """A photo in a file: the symbol and box of each object that is whole in it, rarest first."""

    file: Path
    heading: float
    fov: float
    things: list[tuple[str, tuple[float, float, float, float]]]

    def corner(self, number: int) -> tuple[float, float]:
        """Return where in the picture an object begins, as shares of its width and height."""
        left, top, _, _ = self.things[number][1]
        return left / WIDTH, top / HEIGHT

    def size(self, number: int) -> tuple[float, float]:
        """Return how large an object is, as shares of the width and height of the picture."""
        left, top, right, bottom = self.things[number][1]
        return (right - left) / WIDTH, (bottom - top) / HEIGHT


WIDTH, HEIGHT = 960, 720
NEAREST_M = 3.0


def street_photo(
    sight: Sight, taxonomy: Taxonomy, *, heading: float, file: Path, fov: float = 90
) -> StreetPhoto:
    """Draw what is seen from a place, and write it as a picture without any EXIF."""
    camera = Camera(width=WIDTH, height=HEIGHT, fov=fov)
    bearings = (sight.bearings - heading + 180) % 360 - 180
    ahead = np.flatnonzero((sight.distances > NEAREST_M) & (np.abs(bearings) < fov / 2))
    near = ahead[np.argsort(-sight.distances[ahead])]
    signs, sizes = class_signs(taxonomy), with_heights(taxonomy)
    kinds = [signs[int(code)] for code in sight.codes[near]]
    heights = np.array([sizes.by_code(code).height_m or 2.0 for code in sight.codes[near]])
    trees = np.array([kind.symbol == "B" for kind in kinds])
    widths = np.where(trees, 4.0, np.minimum(heights / 3, 0.6))
    scene = Scene(sight.distances[near], bearings[near], heights, widths)
    boxes = scene.boxes(camera)  # of what is whole in the picture
    picture = Image.new("RGB", (WIDTH, HEIGHT), SKY)
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, HEIGHT * 0.3, WIDTH, HEIGHT / 2), fill=WALLS)
    draw.rectangle((0, HEIGHT / 2, WIDTH, HEIGHT), fill=GROUND)
    things = []
    for kind, box in zip(kinds, boxes.tolist(), strict=True):
        if np.isnan(box).any():
            continue
        left, top, right, bottom = box
        middle, pole = (left + right) / 2, max((right - left) / 12, 1.0)
        if kind.symbol == "B":
            draw.rectangle((middle - pole, top, middle + pole, bottom), fill=TRUNK)
            draw.ellipse((left, top, right, top + 0.6 * (bottom - top)), fill="#3f7d43")
        else:
            draw.rectangle((middle - pole, top, middle + pole, bottom), fill=METAL)
            draw.rectangle((left, top, right, top + (bottom - top) / 4), fill=kind.colour)
        things.append((kind.symbol, (left, top, right, bottom)))
    picture.save(file, quality=90)
    symbols = [symbol for symbol, _ in things]
    return StreetPhoto(file, heading, fov, sorted(things, key=lambda one: symbols.count(one[0])))
