"""Views that grow object by object: each answer continues from the last one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.localization.likelihood.index import photo_scorer
from semsig_gis.localization.likelihood.turns import TurnScores

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.localization.likelihood.index import CellScores, LikelihoodIndex
    from semsig_gis.observation import Sector, View

    _Setting = tuple[tuple[Sector, ...], float]

MOST_BYTES = 2**28
"""Memory for the scores of two photos: half a million cells."""


@dataclass(frozen=True, eq=False, slots=True)
class _ScoredPhoto:
    """The sectors and the north of a photo, its objects, and their scores by turn."""

    setting: _Setting
    objects: Counter[bytes]
    scores: TurnScores


@dataclass(eq=False)
class IncrementalIndex:
    """An index that remembers the scores of the last photos of uncertain north.

    Of a photo that has gained objects since, only these are scored.
    """

    index: LikelihoodIndex
    _photos: list[_ScoredPhoto] = field(default_factory=list, init=False)

    def scores(self, query: Signature, *, north_sigma: float = 0.0) -> CellScores:
        """Return the scores of all cells, as `LikelihoodIndex.scores`."""
        return self.index.scores_by_photo(query, north_sigma, self._score_photo)

    def _score_photo(
        self, photo: View, north_sigma: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Return the scores of a photo in every cell, and its likeliest turns there."""
        index = self.index
        if north_sigma == 0.0:
            return photo_scorer(photo, index.levels, 0.0)(index.objects)
        setting = photo.photos[0].sectors, north_sigma
        values = [
            getattr(photo, name)
            for name in ("codes", "bearings", "bearing_errors", "ranges", "range_errors", "scores")
        ]
        marks = [
            b"|".join(b"" if value is None else value[row].tobytes() for value in values)
            for row in range(len(photo))
        ]
        objects = Counter(marks)
        # Continue from the largest part of this photo; the other photos make room for its scores.
        same = [old for old in self._photos if old.setting == setting]
        parts = [old for old in same if old.objects <= objects]
        before = max(parts, key=lambda old: old.objects.total(), default=None)
        rest = Counter[bytes]() if before is None else before.objects.copy()
        rows = []
        for row, mark in enumerate(marks):
            if rest[mark]:
                rest[mark] -= 1
            else:
                rows.append(row)
        self._photos = [] if before is None else [before]
        size, after = len(index.database), TurnScores.empty(0, north_sigma)
        if 2 * size * after.shares.shape[1] * after.shares.itemsize <= MOST_BYTES:
            room = [old.scores for old in same if old is not before]
            after = room[0] if room else TurnScores.empty(size, north_sigma)
        scorer = photo_scorer(
            photo.select(np.array(rows, np.int64)),
            index.levels,
            north_sigma,
            before=None if before is None else before.scores,
            after=after,
        )
        scores = scorer(index.objects)
        if len(after.logs):
            self._photos.append(_ScoredPhoto(setting, objects, after))
        return scores
