"""What is known of every cell before any query: how well one from it will be placed.

`semsig_gis.identifying` finds it out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.noise import Noise

__all__ = ["BANDS", "ClassGain", "Identifiability"]

BANDS = (0.0, 0.1, 0.5, 0.9)
"""Lower ends of the chances to be found by which cells are counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassGain:
    """What a city gains by publishing a class of objects.

    `near` is what the mean cell's chance of the place within the radius gains; `bits` what the mean
    query tells of the cell beyond what the other classes tell.
    """

    code: int
    near: float
    bits: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Identifiability:
    """How well a query from each cell of a database will be placed.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        How the detector fails.
    radius : float
        Metres that count as near.
    itself : ndarray of float64, shape (n,)
        Expected chance that the answer to a query from the cell gives to the cell itself.
    near : ndarray of float64, shape (n,)
        Expected chance that it gives to the cells within the radius.
    found : ndarray of float64, shape (n,)
        Chance that the best place of the answer is within the radius.
    bits : ndarray of float64, shape (n,)
        Expected entropy of the chances of all cells: what is left to be known.
    lookalikes : ndarray of int64, shape (n, k)
        Row numbers of the cells in whose surroundings, farther away than the radius, the answer
        puts most of the rest; -1 where there are no more.
    lookalike_chances : ndarray of float64, shape (n, k)
        Expected chance that it gives to the surroundings of each.
    gains : ndarray of float64, shape (n, c)
        What `near` gains by each class that occurs, in the order of `classes`.
    classes : tuple of ClassGain
        The same for the city as a whole.
    trials : int
        Number of simulated queries.
    seed : int
        Seed of all chances.
    """

    database: SignatureDatabase
    noise: Noise
    radius: float
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.float64]
    bits: NDArray[np.float64]
    lookalikes: NDArray[np.int64]
    lookalike_chances: NDArray[np.float64]
    gains: NDArray[np.float64]
    classes: tuple[ClassGain, ...]
    trials: int
    seed: int

    def require_cells_of(self, database: SignatureDatabase) -> None:
        """Raise where another database has other cells.

        Parameters
        ----------
        database : SignatureDatabase
            The database.

        Raises
        ------
        InputError
            If its cells are others.
        """
        if not np.array_equal(self.database.cell_ids, database.cell_ids):
            msg = "the identifiability is that of other cells; give that of this database."
            raise InputError(msg)

    def table(self, rows: slice = slice(None)) -> pa.Table:
        """Return what is known of the cells as columns.

        Parameters
        ----------
        rows : slice, optional
            Which cells; all by default.

        Returns
        -------
        pyarrow.Table
            ``chance_itself``, ``chance_near``, ``chance_found``, ``bits_left``; for each place
            from 1 ``lookalike_1`` (cell id, null where there is none) and ``lookalike_1_chance``;
            for each class that occurs ``gain_NAME``.
        """
        names = {item.code: item.name for item in self.database.taxonomy.classes}
        columns = {
            "chance_itself": pa.array(self.itself[rows]),
            "chance_near": pa.array(self.near[rows]),
            "chance_found": pa.array(self.found[rows]),
            "bits_left": pa.array(self.bits[rows]),
        }
        ids = self.database.cell_ids
        for place in range(self.lookalikes.shape[1]):
            cells = self.lookalikes[rows, place]
            name = f"lookalike_{place + 1}"
            columns[name] = pa.array(ids[cells], mask=cells < 0)
            columns[f"{name}_chance"] = pa.array(self.lookalike_chances[rows, place])
        for number, item in enumerate(self.classes):
            columns[f"gain_{names[item.code]}"] = pa.array(self.gains[rows, number])
        return pa.table(columns)

    def summary(self, *, object_counts: Mapping[int, int] | None = None) -> dict[str, Any]:
        """Return what there is to say of the city as plain values for JSON.

        Parameters
        ----------
        object_counts : mapping of int to int, optional
            How many objects of each class code there are, where they are at hand.

        Returns
        -------
        dict
            ``cells``, ``noise``, ``radius_m``, ``trials``, ``seed``; ``chance_itself``,
            ``chance_near``, ``chance_found`` and ``bits_left`` of the mean cell; ``cell_bits``;
            ``bands``: one dict a band of the chance to be found (``from``, ``to``, ``cells``,
            ``share``); ``classes``: one dict a class (``code``, ``symbol``, ``name``, ``title``,
            ``chance_near``, ``bits``, ``objects`` and ``chance_near_per_1000``, the last two None
            where the objects are not at hand), the most useful first.
        """
        kinds = {item.code: item for item in self.database.taxonomy.classes}
        cells = len(self.database)
        counts = np.bincount(np.digitize(self.found, BANDS) - 1, minlength=len(BANDS)).tolist()
        classes = []
        for gain in sorted(self.classes, key=lambda one: -one.near):
            objects = None if object_counts is None else int(object_counts.get(gain.code, 0))
            classes.append(
                {
                    "code": gain.code,
                    "symbol": kinds[gain.code].symbol,
                    "name": kinds[gain.code].name,
                    "title": kinds[gain.code].title,
                    "chance_near": gain.near,
                    "bits": gain.bits,
                    "objects": objects,
                    "chance_near_per_1000": 1000.0 * gain.near / objects if objects else None,
                }
            )
        return {
            "cells": cells,
            "noise": self.noise.name,
            "radius_m": self.radius,
            "trials": self.trials,
            "seed": self.seed,
            "chance_itself": float(self.itself.mean()),
            "chance_near": float(self.near.mean()),
            "chance_found": float(self.found.mean()),
            "bits_left": float(self.bits.mean()),
            "cell_bits": float(np.log2(cells)),
            "bands": [
                {"from": low, "to": high, "cells": count, "share": count / cells}
                for low, high, count in zip(BANDS, (*BANDS[1:], 1.0), counts, strict=True)
            ],
            "classes": classes,
        }
