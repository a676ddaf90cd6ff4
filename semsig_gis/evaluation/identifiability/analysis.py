"""How well a query from each cell will be placed, found out before there is one.

What comes of simulated queries from some cells, the *trials*, depends nearly alone on how like the
other cells are to the cell and on how many objects it sees. Both are cheap to know for every cell,
so that a curve through the trials gives the chances of all of them.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import FULL_TURN, MOST_SEED, MOST_WORKERS, announce, fit_shares, require_number
from semsig_gis.evaluation.identifiability.lookalikes import (
    LEAST_SUM,
    check_radius,
    find_lookalikes,
)
from semsig_gis.evaluation.identifiability.result import ClassGain, Identifiability
from semsig_gis.evaluation.identifiability.symbol_tables import symbol_columns
from semsig_gis.evaluation.identifiability.trials import (
    MOST_TRIALS,
    TRIAL_S,
    trial_cells,
    try_cells,
    try_without_classes,
)
from semsig_gis.observation import FULL_VIEW, Photo

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation.identifiability.lookalikes import Lookalikes
    from semsig_gis.evaluation.identifiability.symbol_tables import SymbolColumns
    from semsig_gis.evaluation.identifiability.trials import Trials
    from semsig_gis.localization import LikelihoodIndex

TRIALS = 3000
CLASS_TRIALS = 400  # without each class
PLACES = 3  # that are named for each cell
LEAST_VIEW, MOST_VIEW = 10, 360  # degrees
DIRECTIONS = 8  # in which photos are looked at from each cell, at least
CELLS_A_PART = 4096
TEMPERATURES = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8, 1.0)
DECIMALS = 3  # of all numbers: more than they are sure to, and short in a file

TOUCHED_CLASSES = 4  # that the mean trial tells of
# Seconds that a pair of cells takes: for telling how long and how far the work is.
PAIR_S = 5e-10


def identify(
    index: LikelihoodIndex,
    *,
    radius: float = 50.0,
    view: float = FULL_TURN,
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
    view : float, default 360
        Degrees that a query sees at once, 10 to 360: a photo in any direction, or the full turn.
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

    A photo of fewer than 360 degrees is looked at from every cell in directions that are 45 degrees
    apart or closer, and fitted as a query of its own; the results are means over the directions. In
    a direction in which a cell sees nothing it cannot be found.

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
    require_number("view", view, least=LEAST_VIEW, most=MOST_VIEW, unit="degrees")
    database, photos = index.database, _looks(view)
    cells, sample = len(database), trial_cells(len(database), trials, seed=seed)
    looks = np.random.default_rng([seed, 2]).integers(len(photos), size=trials)
    again = slice(class_trials)
    seconds = (
        trials * TRIAL_S,
        cells**2 * len(photos) * PAIR_S,
        len(sample[again]) * TOUCHED_CLASSES * TRIAL_S,
    )
    announce(sum(seconds) / threads, "comparing cells")
    stages = _stages(progress, *seconds)
    columns = symbol_columns(index, looks=photos, threads=threads)
    tried = try_cells(
        index,
        sample,
        columns=columns,
        looks=looks,
        radius=radius,
        seed=seed,
        threads=threads,
        progress=stages[0],
    )
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
        index,
        sample[again],
        columns=columns,
        looks=looks[again],
        radius=radius,
        seed=seed,
        threads=threads,
        progress=stages[2],
    )
    shares = _expected(columns, tried, like)
    gains, classes = _gains(columns, tried, like, without=without)
    rest = (1.0 - shares["near"]) / np.maximum(like.far, LEAST_SUM)
    chances = rest[:, None] * like.sums
    mean = {name: _by_cell(values, cells) for name, values in shares.items()}
    named, sums = _places(database, like.cells, chances, radius=radius)
    return Identifiability(
        database=database,
        noise=index.noise,
        radius=radius,
        view=view,
        itself=mean["itself"].round(DECIMALS),
        near=mean["near"].round(DECIMALS),
        found=mean["found"].round(DECIMALS),
        bits=mean["bits"].round(DECIMALS),
        lookalikes=named,
        lookalike_chances=sums.round(DECIMALS),
        gains=gains.round(DECIMALS) + 0.0,  # no -0.0
        classes=classes,
        trials=trials,
        seed=seed,
    )


def _looks(view: float) -> tuple[Photo, ...]:
    """Return the photos that are looked at from every cell."""
    if view == FULL_TURN:
        return (FULL_VIEW,)
    count = max(DIRECTIONS, math.ceil(FULL_TURN / view))
    headings = (np.arange(count) * (FULL_TURN / count)).tolist()
    return tuple(Photo.looking(heading=heading, fov=view) for heading in headings)


def _by_cell(values: NDArray[np.float64], cells: int) -> NDArray[np.float64]:
    """Return means over the looks from each cell, shape (n, ...)."""
    return np.asarray(values.reshape(cells, -1, *values.shape[1:]).mean(axis=1))


def _places(
    database: SignatureDatabase,
    found: NDArray[np.int64],
    chances: NDArray[np.float64],
    *,
    radius: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the places of all looks from each cell as few, and the mean chance of each.

    `found` and `chances` (looks, k) are row numbers, -1 for none, and the chance of each. Places
    within the radius of each other are one, and those named are farther apart than twice that.
    """
    cells, count = len(database), found.shape[1]
    looks = len(found) // cells
    if looks == 1:
        return found, chances
    at = np.stack([database.columns, database.rows], axis=1).astype(np.float64)
    steps = radius / database.grid.step + 1e-9
    named = np.full((cells, count), -1)
    sums = np.zeros((cells, count))
    for low in range(0, cells, CELLS_A_PART):
        part = slice(low * looks, (low + CELLS_A_PART) * looks)
        one = found[part].reshape(-1, looks * count)
        mass = np.where(one < 0, 0.0, chances[part].reshape(one.shape)) / looks
        apart = np.hypot(*np.moveaxis(at[one][:, :, None] - at[one][:, None], -1, 0))
        rows = np.arange(len(one))
        for place in range(count):
            total = np.where(mass > 0, ((apart <= steps) * mass[:, None]).sum(axis=2), 0.0)
            best = total.argmax(axis=1)
            some = total[rows, best] > 0
            named[low + rows[some], place] = one[rows, best][some]
            sums[low + rows, place] = total[rows, best]
            mass[apart[rows, best] <= 2.0 * steps] = 0.0
    return named, sums


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
    some = np.flatnonzero(np.isfinite(tried.lean))
    if not len(some):
        return 1.0
    fits = []
    for power in TEMPERATURES:
        like = find_lookalikes(
            columns,
            temperature=power,
            radius=radius,
            looks=tried.cells[some] * len(columns.looks) + tried.looks[some],
            places=1,
            threads=threads,
        )
        fits.append(float(np.mean(power * tried.lean[some] - np.log(like.near + like.far))))
    return TEMPERATURES[int(np.argmax(fits))]


def _log(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.log(np.maximum(sums, LEAST_SUM))


def _most_bits(cells: int) -> float:
    return max(float(np.log2(cells)), LEAST_SUM)


def _seen(columns: SymbolColumns) -> NDArray[np.int64]:
    """Return how many objects of each class each look shows, shape (looks, k)."""
    return np.asarray(columns.counts.transpose(2, 0, 1).reshape(-1, columns.counts.shape[1]))


def _expected(
    columns: SymbolColumns, tried: Trials, like: Lookalikes
) -> dict[str, NDArray[np.float64]]:
    """Return what to expect of every look, by what came of the trials."""
    shown = _seen(columns).sum(axis=1)
    objects = np.log(np.maximum(shown, 1))
    beyond = np.stack([_log(like.far), objects], axis=1)
    others = np.stack([_log(like.far + np.maximum(like.near - 1.0, 0.0)), objects], axis=1)
    most = _most_bits(len(columns.database))
    looks = tried.cells * len(columns.looks) + tried.looks
    some = shown[looks] > 0

    def fitted(
        features: NDArray[np.float64], values: NDArray[np.float64], blank: float
    ) -> NDArray[np.float64]:
        # `blank` is what comes of a look that shows nothing.
        if not some.any():
            return np.full(len(shown), blank)
        fit = fit_shares(features[looks[some]], values[some])
        return np.where(shown > 0, fit.predict(features), blank)

    near = fitted(beyond, tried.near, 0.0)
    return {
        "itself": np.minimum(fitted(others, tried.itself, 0.0), near),
        "near": near,
        "found": fitted(beyond, tried.found.astype(np.float64), 0.0),
        "bits": most * fitted(others, np.clip(tried.bits / most, 0.0, 1.0), 1.0),
    }


def _gains(
    columns: SymbolColumns,
    tried: Trials,
    like: Lookalikes,
    *,
    without: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], tuple[ClassGain, ...]]:
    """Return what each class adds to the chance of the place, by cell and for the city.

    `without` is what came of the first trials without each class (`try_without_classes`).
    """
    codes, cells = columns.table.codes, len(columns.database)
    seen = _seen(columns)
    shown = seen.sum(axis=1)
    left = shown[:, None] - seen
    far, objects = _log(like.far), np.log(np.maximum(shown, 1))
    again = slice(len(without[0]))
    looks = (tried.cells * len(columns.looks) + tried.looks)[again]
    whole = np.stack([far, objects, objects], axis=1)

    def features(number: int, rows: NDArray[np.int64] | slice) -> NDArray[np.float64]:
        fewer = np.log(np.maximum(left[rows, number], 1))
        return np.stack([(far + like.rise[:, number])[rows], objects[rows], fewer], axis=1)

    # What is left of looks that show nothing else needs no fit.
    some = (left[looks] > 0) & np.isfinite(without[0])
    full = shown[looks] > 0
    examples = [features(number, looks[some[:, number]]) for number in range(len(codes))]
    examples = [whole[looks[full]], *examples]

    def gained(
        with_all: NDArray[np.float64], values: NDArray[np.float64], *, blank: float
    ) -> NDArray[np.float64]:
        # `blank` is what comes of a look that shows nothing.
        told = [values[some[:, number], number] for number in range(len(codes))]
        told = [with_all[again][full], *told]
        if not len(np.concatenate(told)):
            return np.zeros((cells, len(codes)))
        fit = fit_shares(np.concatenate(examples), np.concatenate(told))
        before = np.where(shown > 0, fit.predict(whole), blank)
        gains = np.empty((cells, len(codes)))
        for number in range(len(codes)):
            after = fit.predict(features(number, slice(None)))
            after = np.where(left[:, number] > 0, after, blank)
            gains[:, number] = _by_cell(before - after, cells)
        return gains

    near, bits = without
    most = _most_bits(cells)
    near_gains = gained(tried.near, near, blank=0.0)
    bit_gains = gained(np.clip(tried.bits / most, 0, 1), np.clip(bits / most, 0, 1), blank=1.0)
    of_city = zip(
        codes.tolist(), near_gains.mean(axis=0), most * bit_gains.mean(axis=0), strict=True
    )
    return near_gains, tuple(
        ClassGain(code=code, near=float(near_gain), bits=-float(bit_gain))
        for code, near_gain, bit_gain in of_city
    )
