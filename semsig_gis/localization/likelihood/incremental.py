"""Photos whose objects are given one by one: each answer continues from the last one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.localization.likelihood.index import turn_scores

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.localization.likelihood.index import LikelihoodIndex, TurnScores
    from semsig_gis.observation import Sector, View

    _Setting = tuple[LikelihoodIndex, tuple[Sector, ...], float]

MOST_BYTES = 2**28
"""Of what is kept of two photos: half a million cells."""


@dataclass(frozen=True, eq=False, slots=True)
class _Photo:
    """What is known of a photo: an index, sectors and north; its objects, and their scores."""

    setting: _Setting
    objects: Counter[bytes]
    turned: TurnScores


class TurnMemo:
    """What is kept of the last photos whose north is not known, for when more objects are added."""

    def __init__(self) -> None:
        self._photos: list[_Photo] = []

    def scores(
        self, index: LikelihoodIndex, photo: View, north_sigma: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Return the scores of a photo in every cell, and its likeliest turns there."""
        setting = index, photo.photos[0].sectors, north_sigma
        marks = [_object(photo, row) for row in range(len(photo))]
        objects = Counter(marks)
        less = [one for one in self._photos if one.setting == setting and one.objects <= objects]
        before = max(less, key=lambda one: one.objects.total(), default=None)
        rest = Counter[bytes]() if before is None else before.objects.copy()
        rows = []
        for row, mark in enumerate(marks):
            if rest[mark]:
                rest[mark] -= 1
            else:
                rows.append(row)
        # What is not gone on from makes room.
        self._photos, others = (
            [one for one in self._photos if (one is before) == kept] for kept in (True, False)
        )
        after = turn_scores(0, north_sigma)
        room = [one.turned for one in others if one.setting == setting]
        size = len(index.database)
        if 2 * size * after.shares.shape[1] * after.shares.itemsize <= MOST_BYTES:
            after = room[0] if room else turn_scores(size, north_sigma)
        scores = index.turned(
            photo.select(np.array(rows, np.int64)),
            north_sigma,
            before=None if before is None else before.turned,
            after=after,
        )
        if len(after.logs):
            self._photos.append(_Photo(setting, objects, after))
        return scores


def _object(photo: View, row: int) -> bytes:
    """Return all that is known of an object of a photo."""
    values = (photo.codes, photo.bearings, photo.ranges, photo.range_errors, photo.scores)
    return b"|".join(b"" if one is None else one[row].tobytes() for one in values)
