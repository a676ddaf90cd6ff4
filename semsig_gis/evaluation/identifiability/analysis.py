"""Estimate how well a query from each cell will be located, before there are queries.

The outcomes of simulated queries from some cells, the *trials*, depend almost only on the
similarity of other cells and on the number of visible objects. Both are fast to compute for every
cell, so that a curve fitted to the trials gives the probabilities of all cells.
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
PLACES = 3  # lookalikes of each cell
LEAST_VIEW, MOST_VIEW = 10, 360  # degrees
DIRECTIONS = 8  # least number of photo directions from each cell
CELLS_A_PART = 4096
TEMPERATURES = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8, 1.0)
DECIMALS = 3  # of all numbers: more than their accuracy, but short in a file

TRIAL_CLASSES = 4  # approximate number of classes of a trial
CELL_PAIR_S = 5e-10  # approximate seconds of a pair of cells, to announce the duration


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
    """Estimate how well a query from each cell will be located.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model of the detector, which the answers assume as well.
    radius : float, default 50
        Distance that counts as near, 0 to 1,000,000 metres.
    view : float, default 360
        Degrees that a query sees, 10 to 360: a photo in any direction, or the full turn.
    trials : int, default 3000
        Number of simulated queries, 1 to 1,000,000.
    class_trials : int, default 400
        Number of them that are repeated without each class, 1 or more.
    seed : int, default 0
        Random seed, 0 to 10**18.
    threads : int, default 1
        Number of threads, 1 to 1,024; the result does not depend on it.
    progress : callable, optional
        Called with the finished work and the total work.

    Returns
    -------
    Identifiability
        Probabilities, lookalikes and gains of all cells.

    Raises
    ------
    InputError
        If a number is out of range.

    Notes
    -----
    Queries are from the centres of the cells; the position_sigma of a noise model moves them. Let
    l_d(c) be the log-likelihood of the signature of cell c, as a query, in cell d, and F(c) the
    logarithm of the sum of ``exp(T (l_d(c) - l_c(c)))`` over the cells d beyond the radius. The
    temperature T is the one with the least cross-entropy between the normalized ``exp(T l_d(c))``
    and the probabilities in the answers to the trials. The outcomes of the trials are fitted as
    shares that depend on F and on the logarithm of the number of objects (`core.statistics`). The
    remaining probability is distributed over the lookalikes in proportion to the same powers.

    With a view of less than 360 degrees, photos in directions of at most 45 degrees apart are
    compared from every cell, and each is fitted as a query; the results are means over the
    directions. A cell cannot be found in a direction without visible objects.

    For the gains, trials are repeated without each class, and the logarithm of the number of
    remaining objects is a third feature of the fit.

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
    again = slice(class_trials)  # the trials that are repeated without each class
    seconds = (
        trials * TRIAL_S,
        cells**2 * len(photos) * CELL_PAIR_S,
        len(sample[again]) * TRIAL_CLASSES * TRIAL_S,
    )
    announce(sum(seconds) / threads, "comparing cells")
    stages = _stages(progress, *seconds)
    columns = symbol_columns(index, looks=photos, threads=threads)
    outcomes = try_cells(
        index,
        sample,
        columns=columns,
        looks=looks,
        radius=radius,
        seed=seed,
        threads=threads,
        progress=stages[0],
    )
    temperature = _temperature(columns, outcomes, radius=radius, threads=threads)
    lookalikes = find_lookalikes(
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
    shares = _expected(columns, outcomes, lookalikes)
    gains, classes = _gains(columns, outcomes, lookalikes, without=without)
    rest = (1.0 - shares["near"]) / np.maximum(lookalikes.far, LEAST_SUM)
    chances = rest[:, None] * lookalikes.sums
    mean = {name: _by_cell(values, cells) for name, values in shares.items()}
    places, place_chances = _merged_places(database, lookalikes.cells, chances, radius=radius)
    return Identifiability(
        database=database,
        noise=index.noise,
        radius=radius,
        view=view,
        itself=mean["itself"].round(DECIMALS),
        near=mean["near"].round(DECIMALS),
        found=mean["found"].round(DECIMALS),
        bits=mean["bits"].round(DECIMALS),
        lookalikes=places,
        lookalike_chances=place_chances.round(DECIMALS),
        gains=gains.round(DECIMALS) + 0.0,  # no -0.0
        classes=classes,
        trials=trials,
        seed=seed,
    )


def _looks(view: float) -> tuple[Photo, ...]:
    """Return the photos, or the full turn, that are compared from every cell."""
    if view == FULL_TURN:
        return (FULL_VIEW,)
    count = max(DIRECTIONS, math.ceil(FULL_TURN / view))
    headings = (np.arange(count) * (FULL_TURN / count)).tolist()
    return tuple(Photo.looking(heading=heading, fov=view) for heading in headings)


def _by_cell(values: NDArray[np.float64], cells: int) -> NDArray[np.float64]:
    """Return the means over the looks from each cell, shape (n, ...)."""
    return np.asarray(values.reshape(cells, -1, *values.shape[1:]).mean(axis=1))


def _merged_places(
    database: SignatureDatabase,
    places: NDArray[np.int64],
    chances: NDArray[np.float64],
    *,
    radius: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Merge the places of all looks from each cell; return k places and their mean probabilities.

    `places` and `chances`, shape (looks, k), are row numbers, -1 for none, and the probability of
    each. The probabilities of places within the radius of each other are added, and the returned
    places are more than two radii apart.
    """
    cells, count = len(database), places.shape[1]
    looks = len(places) // cells
    if looks == 1:
        return places, chances
    at = np.stack([database.columns, database.rows], axis=1).astype(np.float64)
    steps = radius / database.grid.step + 1e-9
    merged = np.full((cells, count), -1)
    sums = np.zeros((cells, count))
    for low in range(0, cells, CELLS_A_PART):
        part = slice(low * looks, (low + CELLS_A_PART) * looks)
        candidates = places[part].reshape(-1, looks * count)
        mass = np.where(candidates < 0, 0.0, chances[part].reshape(candidates.shape)) / looks
        offsets = at[candidates][:, :, None] - at[candidates][:, None]
        apart = np.hypot(*np.moveaxis(offsets, -1, 0))
        rows = np.arange(len(candidates))
        for place in range(count):
            # Take the candidate with the highest sum around it, then clear its surroundings.
            total = np.where(mass > 0, ((apart <= steps) * mass[:, None]).sum(axis=2), 0.0)
            best = total.argmax(axis=1)
            with_mass = total[rows, best] > 0
            merged[low + rows[with_mass], place] = candidates[rows, best][with_mass]
            sums[low + rows, place] = total[rows, best]
            mass[apart[rows, best] <= 2.0 * steps] = 0.0
    return merged, sums


def _stages(
    progress: Callable[[int, int], None] | None, *seconds: float
) -> list[Callable[[int, int], None] | None]:
    """Return the progress function of each stage, which reports overall progress by seconds."""
    if progress is None:
        return [None] * len(seconds)
    ends = np.cumsum([0.0, *seconds]).tolist()

    def report(low: float, high: float, finished: int, count: int) -> None:
        progress(round(1000.0 * (low + (high - low) * finished / count)), round(1000.0 * ends[-1]))

    return [partial(report, low, high) for low, high in pairwise(ends)]


def _temperature(columns: SymbolColumns, outcomes: Trials, *, radius: float, threads: int) -> float:
    """Return the power with which likelihoods of signatures fit the answers to the trials best."""
    trials = np.flatnonzero(np.isfinite(outcomes.lean))
    if not len(trials):
        return 1.0
    fits = []
    for power in TEMPERATURES:
        lookalikes = find_lookalikes(
            columns,
            temperature=power,
            radius=radius,
            looks=outcomes.cells[trials] * len(columns.looks) + outcomes.looks[trials],
            places=1,
            threads=threads,
        )
        totals = np.log(lookalikes.near + lookalikes.far)
        fits.append(float(np.mean(power * outcomes.lean[trials] - totals)))
    return TEMPERATURES[int(np.argmax(fits))]


def _log(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.log(np.maximum(sums, LEAST_SUM))


def _most_bits(cells: int) -> float:
    return max(float(np.log2(cells)), LEAST_SUM)


def _object_counts(columns: SymbolColumns) -> NDArray[np.int64]:
    """Return the number of objects of each class in each look, shape (looks, k)."""
    return np.asarray(columns.counts.transpose(2, 0, 1).reshape(-1, columns.counts.shape[1]))


def _expected(
    columns: SymbolColumns, outcomes: Trials, lookalikes: Lookalikes
) -> dict[str, NDArray[np.float64]]:
    """Return the expected outcomes of every look, fitted to those of the trials."""
    shown = _object_counts(columns).sum(axis=1)
    objects = np.log(np.maximum(shown, 1))
    beyond = np.stack([_log(lookalikes.far), objects], axis=1)
    others = np.stack(
        [_log(lookalikes.far + np.maximum(lookalikes.near - 1.0, 0.0)), objects], axis=1
    )
    most = _most_bits(len(columns.database))
    looks = outcomes.cells * len(columns.looks) + outcomes.looks
    with_objects = shown[looks] > 0

    def fitted(
        features: NDArray[np.float64], values: NDArray[np.float64], blank: float
    ) -> NDArray[np.float64]:
        # `blank` is the outcome of a look without objects.
        if not with_objects.any():
            return np.full(len(shown), blank)
        fit = fit_shares(features[looks[with_objects]], values[with_objects])
        return np.where(shown > 0, fit.predict(features), blank)

    near = fitted(beyond, outcomes.near, 0.0)
    return {
        "itself": np.minimum(fitted(others, outcomes.itself, 0.0), near),
        "near": near,
        "found": fitted(beyond, outcomes.found.astype(np.float64), 0.0),
        "bits": most * fitted(others, np.clip(outcomes.bits / most, 0.0, 1.0), 1.0),
    }


def _gains(
    columns: SymbolColumns,
    outcomes: Trials,
    lookalikes: Lookalikes,
    *,
    without: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], tuple[ClassGain, ...]]:
    """Return the gain in probability of the place by each class, by cell and for the city.

    `without` is the outcome of the first trials without each class (`try_without_classes`).
    """
    codes, cells = columns.table.codes, len(columns.database)
    counts = _object_counts(columns)
    shown = counts.sum(axis=1)
    remaining = shown[:, None] - counts
    far, objects = _log(lookalikes.far), np.log(np.maximum(shown, 1))
    again = slice(len(without[0]))
    looks = (outcomes.cells * len(columns.looks) + outcomes.looks)[again]
    whole = np.stack([far, objects, objects], axis=1)

    def features(number: int, rows: NDArray[np.int64] | slice) -> NDArray[np.float64]:
        fewer = np.log(np.maximum(remaining[rows, number], 1))
        return np.stack([(far + lookalikes.rise[:, number])[rows], objects[rows], fewer], axis=1)

    # The fit needs only looks with objects of other classes.
    usable = (remaining[looks] > 0) & np.isfinite(without[0])
    full = shown[looks] > 0
    examples = [features(number, looks[usable[:, number]]) for number in range(len(codes))]
    examples = [whole[looks[full]], *examples]

    def class_gains(
        with_all: NDArray[np.float64], values: NDArray[np.float64], *, blank: float
    ) -> NDArray[np.float64]:
        # `blank` is the outcome of a look without objects.
        targets = [values[usable[:, number], number] for number in range(len(codes))]
        targets = [with_all[again][full], *targets]
        if not len(np.concatenate(targets)):
            return np.zeros((cells, len(codes)))
        fit = fit_shares(np.concatenate(examples), np.concatenate(targets))
        before = np.where(shown > 0, fit.predict(whole), blank)
        gains = np.empty((cells, len(codes)))
        for number in range(len(codes)):
            after = fit.predict(features(number, slice(None)))
            after = np.where(remaining[:, number] > 0, after, blank)
            gains[:, number] = _by_cell(before - after, cells)
        return gains

    near, bits = without
    most = _most_bits(cells)
    near_gains = class_gains(outcomes.near, near, blank=0.0)
    bit_gains = class_gains(
        np.clip(outcomes.bits / most, 0, 1), np.clip(bits / most, 0, 1), blank=1.0
    )
    of_city = zip(
        codes.tolist(), near_gains.mean(axis=0), most * bit_gains.mean(axis=0), strict=True
    )
    return near_gains, tuple(
        ClassGain(code=code, near=float(near_gain), bits=-float(bit_gain))
        for code, near_gain, bit_gain in of_city
    )
