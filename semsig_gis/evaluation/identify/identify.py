"""How well a query from each cell will be placed, found out before there is one.

What comes of simulated queries from some cells, the *trials*, depends nearly alone on how like the
other cells are to the cell and on how many objects it sees. Both are cheap to know for every cell,
so that a curve through the trials gives the chances of all of them.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.effort import announce
from semsig_gis.core.ranges import MOST_SEED, MOST_WORKERS, require_number
from semsig_gis.core.statistics import fit_shares
from semsig_gis.evaluation.identify.columns import symbol_columns
from semsig_gis.evaluation.identify.lookalikes import (
    LEAST_SUM,
    check_radius,
    find_lookalikes,
)
from semsig_gis.evaluation.identify.result import ClassGain, Identifiability
from semsig_gis.evaluation.identify.trials import (
    MOST_TRIALS,
    TRIAL_S,
    trial_cells,
    try_cells,
    try_without_classes,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.evaluation.identify.columns import SymbolColumns
    from semsig_gis.evaluation.identify.lookalikes import Lookalikes
    from semsig_gis.evaluation.identify.trials import Trials
    from semsig_gis.likelihood.index import LikelihoodIndex

TRIALS = 3000
CLASS_TRIALS = 400  # without each class
PLACES = 3  # that are named for each cell
TEMPERATURES = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8, 1.0)
TEMPERATURE_TRIALS = 300
DECIMALS = 3  # of all numbers: more than they are sure to, and short in a file

# Seconds that a pair of cells takes: for telling how long and how far the work is.
PAIR_S = 5e-10


def identify(
    index: LikelihoodIndex,
    *,
    radius: float = 50.0,
    trials: int = TRIALS,
    class_trials: int = CLASS_TRIALS,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Identifiability:
    """Find out how well a query from each cell will be placed.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells, and how the detector fails; the answers know that, too.
    radius : float, default 50
        Metres that count as near, 0 to 1,000,000.
    trials : int, default 3000
        How many simulated queries to ask, 1 to 1,000,000.
    class_trials : int, default 400
        How many of them to ask again without each class, 1 or more.
    seed : int, default 0
        Seed of all chances, 0 to 10**18.
    threads : int, default 1
        How many threads share the work, 1 to 1,024; the result does not depend on it.
    progress : callable, optional
        Called with how much is done and how much there is in all.

    Returns
    -------
    Identifiability
        Chances, lookalikes and gains of all cells.

    Raises
    ------
    InputError
        If a number is out of range.

    Notes
    -----
    Queries are seen from the middles of the cells; a noise model with a position_sigma has them
    elsewhere. Let l_d(c) be the log-likelihood of the signature of cell c, as a query, in cell d,
    and F(c) the logarithm of the sum over the cells d beyond the radius of
    ``exp(T (l_d(c) - l_c(c)))``, with the temperature T at which ``exp(T l_d(c))``, made to sum to
    one, is nearest to the chances that the answers to the trials gave (least cross-entropy). What
    came of the trials is fitted as a share that depends on F and on the logarithm of the number
    of objects (`core.statistics`). The rest of the chance is divided by the same powers.

    For the gains, trials are asked again without each class, and the fit takes the logarithm of
    the number of objects that are left as a third feature.

    The time grows with the square of the number of cells.

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> cells = identify(index, trials=100, class_trials=20)
    >>> rich, poor = demo_database.lengths >= 15, demo_database.lengths <= 3
    >>> bool(cells.found[rich].mean() > cells.found[poor].mean())
    True
    """
    for what, count, least, most in (
        ("number of trials", trials, 1, MOST_TRIALS),
        ("number of trials without a class", class_trials, 1, MOST_TRIALS),
        ("number of threads", threads, 1, MOST_WORKERS),
        ("seed", seed, 0, MOST_SEED),
    ):
        require_number(what, count, least=least, most=most)
    check_radius(radius)
    database = index.database
    cells, sample = len(database), trial_cells(len(index.database), trials, seed=seed)
    again = sample[:class_trials]
    seconds = (
        trials * TRIAL_S,
        cells**2 * PAIR_S,
        len(again) * len(index.table.codes) * TRIAL_S,
    )
    announce(sum(seconds) / threads, "comparing cells")
    stages = _stages(progress, *seconds)
    tried = try_cells(index, sample, radius=radius, seed=seed, threads=threads, progress=stages[0])
    columns = symbol_columns(index, threads=threads)
    temperature = _temperature(columns, tried, radius=radius, threads=threads)
    like = find_lookalikes(
        columns,
        temperature=temperature,
        radius=radius,
        places=PLACES,
        seed=seed,
        threads=threads,
        progress=stages[1],
    )
    without = try_without_classes(
        index, again, radius=radius, seed=seed, threads=threads, progress=stages[2]
    )
    shares = _expected(tried, like, database.lengths)
    gains, classes = _gains(index, tried, like, again=again, without=without)
    rest = (1.0 - shares["near"]) / np.maximum(like.far, LEAST_SUM)
    return Identifiability(
        database=database,
        noise=index.noise,
        radius=radius,
        itself=shares["itself"].round(DECIMALS),
        near=shares["near"].round(DECIMALS),
        found=shares["found"].round(DECIMALS),
        bits=shares["bits"].round(DECIMALS),
        lookalikes=like.cells,
        lookalike_chances=(rest[:, None] * like.sums).round(DECIMALS),
        gains=gains.round(DECIMALS) + 0.0,  # no -0.0
        classes=classes,
        trials=trials,
        seed=seed,
    )


def _stages(
    progress: Callable[[int, int], None] | None, *seconds: float
) -> list[Callable[[int, int], None] | None]:
    """Return what each stage calls with its progress, to tell that of all, by expected seconds."""
    if progress is None:
        return [None] * len(seconds)
    ends = np.cumsum([0.0, *seconds]).tolist()

    def tell(low: float, high: float, done: int, count: int) -> None:
        progress(round(1000.0 * (low + (high - low) * done / count)), round(1000.0 * ends[-1]))

    return [partial(tell, low, high) for low, high in pairwise(ends)]


def _temperature(columns: SymbolColumns, tried: Trials, *, radius: float, threads: int) -> float:
    """Return the power that brings the likelihoods of signatures nearest to the answers."""
    some = np.flatnonzero(np.isfinite(tried.lean))[:TEMPERATURE_TRIALS]
    if not len(some):
        return 1.0
    fits = []
    for power in TEMPERATURES:
        like = find_lookalikes(
            columns,
            temperature=power,
            radius=radius,
            cells=tried.cells[some],
            places=1,
            threads=threads,
        )
        fits.append(float(np.mean(power * tried.lean[some] - np.log(like.near + like.far))))
    return TEMPERATURES[int(np.argmax(fits))]


def _log(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.log(np.maximum(sums, LEAST_SUM))


def _most_bits(cells: int) -> float:
    return max(float(np.log2(cells)), LEAST_SUM)


def _expected(
    tried: Trials, like: Lookalikes, lengths: NDArray[np.int64]
) -> dict[str, NDArray[np.float64]]:
    """Return what to expect of every cell, by what came of the trials."""
    objects = np.log(lengths)
    beyond = np.stack([_log(like.far), objects], axis=1)
    others = np.stack([_log(like.far + np.maximum(like.near - 1.0, 0.0)), objects], axis=1)
    most = _most_bits(len(lengths))
    shares = {
        name: fit_shares(features[tried.cells], values).predict(features)
        for name, features, values in (
            ("itself", others, tried.itself),
            ("near", beyond, tried.near),
            ("found", beyond, tried.found),
            ("bits", others, np.clip(tried.bits / most, 0.0, 1.0)),
        )
    }
    return {
        **shares,
        "itself": np.minimum(shares["itself"], shares["near"]),
        "bits": most * shares["bits"],
    }


def _gains(
    index: LikelihoodIndex,
    tried: Trials,
    like: Lookalikes,
    *,
    again: NDArray[np.int64],
    without: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], tuple[ClassGain, ...]]:
    """Return what each class adds to the chance of the place, by cell and for the city.

    `without` is what came of the cells `again` (`try_without_classes`).
    """
    database, codes = index.database, index.table.codes
    starts = database.offsets[:-1]
    seen = [np.add.reduceat(database.codes == code, starts, dtype=np.int64) for code in codes]
    left = database.lengths[:, None] - np.stack(seen, axis=1)
    features = _features(like, database.lengths, like.rise, left)
    whole = _features(like, database.lengths, np.zeros((len(left), 1)), database.lengths[:, None])
    whole = whole[:, 0]
    # What is left of cells that see nothing else needs no fit.
    some = left[again] > 0
    examples = np.concatenate([whole[again], features[again][some]])

    def gained(
        with_all: NDArray[np.float64], values: NDArray[np.float64], *, blank: float
    ) -> NDArray[np.float64]:
        # `blank` is what comes of a cell that sees nothing.
        fit = fit_shares(examples, np.concatenate([with_all[: len(again)], values[some]]))
        before = fit.predict(whole)
        after = [
            np.where(left[:, number] > 0, fit.predict(features[:, number]), blank)
            for number in range(left.shape[1])
        ]
        return np.asarray(before[:, None] - np.stack(after, axis=1))

    near, bits = without
    most = _most_bits(len(database))
    near_gains = gained(tried.near, near, blank=0.0)
    bit_gains = gained(np.clip(tried.bits / most, 0, 1), np.clip(bits / most, 0, 1), blank=1.0)
    of_city = zip(
        codes.tolist(), near_gains.mean(axis=0), most * bit_gains.mean(axis=0), strict=True
    )
    return near_gains, tuple(
        ClassGain(code=code, near=float(near_gain), bits=-float(bit_gain))
        for code, near_gain, bit_gain in of_city
    )


def _features(
    like: Lookalikes,
    lengths: NDArray[np.int64],
    rise: NDArray[np.float64],
    left: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Return what decides over a cell without each class, shape (n, c, 3)."""
    parts = (
        _log(like.far)[:, None] + rise,
        np.broadcast_to(np.log(lengths)[:, None], rise.shape),
        np.log(np.maximum(left, 1)),
    )
    return np.stack(parts, axis=2)
