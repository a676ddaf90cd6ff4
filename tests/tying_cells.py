"""Cells of few classes, so that many are equal or tie, and queries of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from noisy_cells import TAXONOMY, database_of

from semsig_gis.core.signature import Signature

if TYPE_CHECKING:
    from collections.abc import Sequence

METHODS = [
    "edit+edit",
    "edit+jaccard:alpha=0.3",
    "histogram+edit:raw",
    "jaccard+histogram:alpha=0.9:raw",
    "edit+edit:weights=3/1/2",
    "types:edit",
    "angles:histogram",
]


def random_cells(count: int, *, seed: int = 0) -> list[tuple[str, list[float]]]:
    """Return short signatures of few classes, so that many are equal or tie."""
    rng = np.random.default_rng(seed)
    return [
        ("".join(rng.choice(list("DDDBG"), length)), np.sort(rng.uniform(0, 360, length)).tolist())
        for length in rng.integers(1, 6, count)
    ]


CITY = database_of(random_cells(400))
NOTHING = Signature(np.empty(0, np.uint8), np.empty(0))


def asked(types: str | None, bearings: Sequence[float] | None = None) -> Signature:
    return Signature.parse(types, bearings, taxonomy=TAXONOMY)
