"""Identifiability out of nowhere, for the tests of what saves, prints and draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.evaluation.identify.result import BANDS, ClassGain, Identifiability
from semsig_gis.likelihood.noise.model import named_noise

if TYPE_CHECKING:
    from semsig_gis.database.database import SignatureDatabase

PLACES = 3


def chances_of(database: SignatureDatabase, *, seed: int = 0) -> Identifiability:
    """Return any numbers for the cells of a database."""
    rng = np.random.default_rng(seed)
    cells, codes = len(database), database.present_codes.tolist()
    lookalikes = rng.integers(0, cells, (cells, PLACES))
    lookalikes[rng.random(cells) < 0.2, PLACES - 1] = -1
    chances = rng.random((4, cells)).round(3)
    return Identifiability(
        database=database,
        noise=named_noise("medium"),
        radius=30.0,
        itself=chances[0],
        near=chances[1],
        found=np.where(rng.random(cells) < 0.5, rng.choice([*BANDS, 1.0], cells), chances[2]),
        bits=(chances[3] * np.log2(cells)).round(3),
        lookalikes=lookalikes,
        lookalike_chances=np.where(lookalikes < 0, 0.0, rng.random((cells, PLACES)).round(3)),
        gains=rng.uniform(-0.1, 0.9, (cells, len(codes))).round(3),
        classes=tuple(
            ClassGain(code=code, near=float(near), bits=float(bits))
            for code, near, bits in zip(codes, *rng.random((2, len(codes))), strict=True)
        ),
        trials=60,
        seed=4,
    )
