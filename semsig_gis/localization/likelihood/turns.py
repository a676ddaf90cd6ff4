"""Turns of a photo of uncertain north: their chances, and the likelihood by turn."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from semsig_gis.core import FULL_TURN, signed_degrees

if TYPE_CHECKING:
    from numpy.typing import NDArray

TURNS = 64
"""Turns of a photo of uncertain north: steps of 5.625 degrees."""
WIDE_TURNS = 32
"""Turns of a photo of uncertain north by which cells are chosen: steps of 11.25 degrees."""
TURN_BLOCK = 16
"""Turns that `kernels.scan_turned` adds up together."""
_LEAST_TURN_CHANCE = 1e-7  # of a turn, relative to the likeliest; others are left out


class TurnPrior(NamedTuple):
    """The chances of the turns from a `first` one on, in whole blocks of `TURN_BLOCK`."""

    first: int
    chances: NDArray[np.float64]

    @classmethod
    def of(cls, north_sigma: float) -> TurnPrior:
        """Return the chances of turns, for a deviation of north in degrees, perhaps infinite.

        The turns that fill the last block have chance 0.
        """
        turns = np.arange(-TURNS // 2, TURNS // 2)
        chances = np.exp(-0.5 * (turns * (FULL_TURN / TURNS) / north_sigma) ** 2)
        likely = np.flatnonzero(chances > _LEAST_TURN_CHANCE)
        chances = chances[likely] / chances[likely].sum()
        return cls(int(turns[likely[0]]), np.pad(chances, (0, -len(chances) % TURN_BLOCK)))


class TurnScores(NamedTuple):
    """The likelihood of a photo in n cells by turn: e to the power of `logs`, times `shares`."""

    logs: NDArray[np.float32]
    shares: NDArray[np.float32]

    @classmethod
    def empty(cls, cells: int, north_sigma: float) -> TurnScores:
        """Return room for the likelihood of a photo by turn."""
        turns = len(TurnPrior.of(north_sigma).chances)
        return cls(np.empty(cells, np.float32), np.empty((cells, turns), np.float32))


def wide_turn_chances(north_sigma: float) -> NDArray[np.float32]:
    """Return the chances of all `WIDE_TURNS`, for a deviation of north in degrees."""
    turns = signed_degrees(np.arange(WIDE_TURNS) * (FULL_TURN / WIDE_TURNS))
    chances = np.exp(-0.5 * (turns / north_sigma) ** 2)
    return np.asarray(chances / chances.sum(), np.float32)


def turn_logs(turns: NDArray[np.float64], step: float, north_sigma: float) -> NDArray[np.float64]:
    """Return the log of the chance of each turn, which is one `step` wide; all are in degrees."""
    if math.isinf(north_sigma):
        return np.full(turns.shape, math.log(step / 360.0))
    scale = math.log(step / (north_sigma * math.sqrt(2.0 * math.pi)))
    return np.asarray(scale - 0.5 * (signed_degrees(turns) / north_sigma) ** 2)
