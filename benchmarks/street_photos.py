"""Drawn photos of a street, with the boxes of their objects."""

from __future__ import annotations

from collections import Counter
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
    """A photo in a file: symbol and box of each object fully in it, the rarest first."""

    file: Path
    heading: float
    fov: float
    things: list[tuple[str, tuple[float, float, float, float]]]

    def corner(self, number: int) -> tuple[float, float]:
        """Return the upper left corner of an object, as shares of the size of the picture."""
        x, y, _, _ = self.things[number][1]
        return x / WIDTH, y / HEIGHT

    def size(self, number: int) -> tuple[float, float]:
        """Return the width and height of an object, as shares of the size of the picture."""
        x_min, y_min, x_max, y_max = self.things[number][1]
        return (x_max - x_min) / WIDTH, (y_max - y_min) / HEIGHT


WIDTH, HEIGHT = 960, 720
NEAREST_M = 3.0


def street_photo(
    sight: Sight, taxonomy: Taxonomy, *, heading: float, file: Path, fov: float = 90
) -> StreetPhoto:
    """Draw the objects seen from a place, and write the picture, without EXIF."""
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
    boxes = scene.boxes(camera)  # NaN for objects not fully in the picture
    picture = Image.new("RGB", (WIDTH, HEIGHT), SKY)
    draw = ImageDraw.Draw(picture)
    draw.rectangle((0, HEIGHT * 0.3, WIDTH, HEIGHT / 2), fill=WALLS)
    draw.rectangle((0, HEIGHT / 2, WIDTH, HEIGHT), fill=GROUND)
    things = []
    for kind, box in zip(kinds, boxes.tolist(), strict=True):
        if np.isnan(box).any():
            continue
        x_min, y_min, x_max, y_max = box
        middle, pole = (x_min + x_max) / 2, max((x_max - x_min) / 12, 1.0)
        if kind.symbol == "B":
            draw.rectangle((middle - pole, y_min, middle + pole, y_max), fill=TRUNK)
            draw.ellipse((x_min, y_min, x_max, y_min + 0.6 * (y_max - y_min)), fill="#3f7d43")
        else:
            draw.rectangle((middle - pole, y_min, middle + pole, y_max), fill=METAL)
            draw.rectangle((x_min, y_min, x_max, y_min + (y_max - y_min) / 4), fill=kind.colour)
        things.append((kind.symbol, (x_min, y_min, x_max, y_max)))
    picture.save(file, quality=90)
    count = Counter(symbol for symbol, _ in things)
    return StreetPhoto(file, heading, fov, sorted(things, key=lambda thing: count[thing[0]]))
