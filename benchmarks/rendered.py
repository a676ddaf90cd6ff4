"""Scenes of upright things in front of a camera, and the boxes that a perfect detector draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.observation import Camera

EYE_M = 1.6


@dataclass(frozen=True)
class Scene:
    """Distances, bearings from the direction of the camera, heights and widths; shapes (n,)."""

    distances: NDArray[np.float64]
    bearings: NDArray[np.float64]
    heights: NDArray[np.float64]
    widths: NDArray[np.float64]

    @classmethod
    def random(cls, seed: int, number: int = 60) -> Scene:
        """Return things anywhere around the camera."""
        rng = np.random.default_rng(seed)
        return cls(
            rng.uniform(4, 30, number),
            rng.uniform(-180, 180, number),
            rng.uniform(0.8, 8, number),
            rng.uniform(0.02, 1, number),
        )

    def select(self, rows: NDArray[np.int64]) -> Scene:
        """Return some of the things."""
        columns = (self.distances, self.bearings, self.heights, self.widths)
        return Scene(*(column[rows] for column in columns))

    def boxes(self, camera: Camera) -> NDArray[np.float64]:
        """Return left, top, right and bottom in pixels, NaN for things not fully in the picture."""
        angle = np.radians(self.bearings)[:, None, None]
        offset = self.widths[:, None, None] * np.linspace(-0.5, 0.5, 5)[None, :, None]
        rise = self.heights[:, None, None] * np.linspace(0, 1, 41)[None, None, :]
        away = self.distances[:, None, None]
        right = away * np.sin(angle) + offset * np.cos(angle)
        ahead = away * np.cos(angle) - offset * np.sin(angle)
        points = np.broadcast_arrays(right, EYE_M - rise, ahead)
        pixels = camera.pixels(np.stack(points, axis=-1)).reshape(len(away), 5 * 41, 2)
        boxes = np.concatenate([pixels.min(axis=1), pixels.max(axis=1)], axis=-1)
        size = np.array([camera.width, camera.height])
        # Across the seam of a panorama, a thing is in two pieces.
        whole = (boxes[:, :2] >= 0).all(1) & (boxes[:, 2:] <= size).all(1)
        whole &= boxes[:, 2] - boxes[:, 0] < camera.width / 2
        boxes[~whole] = np.nan
        return boxes
