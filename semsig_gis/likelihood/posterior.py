"""Where a query was seen: the chance of every cell, and what follows from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.grid import cell_ids

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.database.database import SignatureDatabase

PLACES = 1000
"""Likeliest cells among which the best place is looked for."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Posterior:
    """The chance that a query was seen from each cell of a database.

    Parameters
    ----------
    database, chances : SignatureDatabase, and ndarray of float64, shape (n,)
        The cells, and their chances, which sum to one.

    Examples
    --------
    >>> flat = posterior(demo_database, np.zeros(len(demo_database)))
    >>> bool(np.isclose(flat.entropy, np.log2(len(demo_database))))
    True
    """

    database: SignatureDatabase
    chances: NDArray[np.float64]

    @property
    def entropy(self) -> float:
        """How much is not known of the cell, in bits: 0 for one cell, 1 for two alike, ..."""
        chances = self.chances[self.chances > 0]
        return float(-(chances * np.log2(chances)).sum())

    def credible_cells(self, share: float = 0.9) -> NDArray[np.int64]:
        """Return the row numbers of the fewest cells that hold a share of the chance.

        The share is above 0 and at most 1, or raises `InputError`. Likeliest first, equal chances
        in the order of the database; cells without any chance are never among them.
        """
        if not 0 < share <= 1:
            msg = f"a region of a share of {share} was asked for; give a number above 0, at most 1."
            raise InputError(msg)
        cells = np.flatnonzero(self.chances)
        # Most of the cells hold next to nothing together and need not be sorted.
        level = 0.5 * (1.0 - share) / len(self.chances)
        likely = cells[self.chances[cells] >= level]
        cells = likely[np.argsort(-self.chances[likely], kind="stable")]
        total = np.cumsum(self.chances[cells])
        # The small term keeps a sum of 0.9 - 1e-17 from asking for one cell more.
        return cells[: int(np.searchsorted(total, share * (1.0 - 1e-12))) + 1]

    def mass_within(
        self, radius: float, cells: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Return the chance that the place is at most `radius` metres from a cell, shape (c,).

        It is the sum over the viewpoints in the circle, for some cells (row numbers) or all. A
        radius that is negative or not finite raises `InputError`.
        """
        if not (math.isfinite(radius) and radius >= 0):
            msg = f"a radius of {radius} m was given; give metres, 0 or more."
            raise InputError(msg)
        database = self.database
        centres = slice(None) if cells is None else cells
        columns = database.columns[centres].astype(np.int64)
        rows = database.rows[centres].astype(np.int64)
        # The cells are ordered by column and row: in each column, the circle is one run of them.
        ids = database.cell_ids
        before = np.concatenate([[0.0], np.cumsum(self.chances)])
        steps = radius / database.grid.step + 1e-9
        total = np.zeros(len(columns))
        for aside in range(-math.floor(steps), math.floor(steps) + 1):
            up = math.floor(math.sqrt(steps**2 - aside**2))
            low = np.searchsorted(ids, cell_ids(columns + aside, rows - up), side="left")
            high = np.searchsorted(ids, cell_ids(columns + aside, rows + up), side="right")
            total += before[high] - before[low]
        return np.clip(total, 0.0, 1.0)

    def best_place(self, radius: float = 50.0) -> tuple[int, float]:
        """Return the cell around which the place most probably lies, and the chance that it does.

        Of the thousand likeliest cells it is the one with most of the chance within `radius`
        metres, of equals the likeliest.
        """
        count = min(PLACES, len(self.chances))
        cells = np.sort(np.argpartition(-self.chances, count - 1)[:count])
        # In steps, so that rounding does not choose among equals.
        mass = np.round(self.mass_within(radius, cells), 9)
        best = np.lexsort((-self.chances[cells], -mass))[0]
        return int(cells[best]), float(mass[best])


def posterior(
    database: SignatureDatabase,
    loglik: ArrayLike,
    *,
    log_prior: NDArray[np.float64] | None = None,
) -> Posterior:
    """Return chances that are proportional to likelihood times prior, both as logarithms by cell.

    Both are up to a constant; without `log_prior` (see `likelihood.priors`) all cells are alike.
    Raises `InputError` if a number is NaN or plus infinity, or no cell is possible.
    """
    parts = [loglik] if log_prior is None else [loglik, log_prior]
    total = np.zeros(len(database))
    for part in parts:
        values = np.asarray(part, dtype=np.float64)
        if values.shape != total.shape:
            msg = (
                f"{values.size} likelihoods or priors were given for {len(database)} cells; "
                "give one a cell."
            )
            raise InputError(msg)
        total += values
    top = total.max()
    if np.isnan(top) or top == np.inf:
        msg = "a likelihood or a prior is not a number below infinity; give logarithms."
        raise InputError(msg)
    if top == -np.inf:
        msg = "the prior excludes every cell that the query may be in; widen it."
        raise InputError(msg)
    chances = np.exp(total - top)
    return Posterior(database=database, chances=chances / chances.sum())
