"""Fit a noise model to detections: one round of expectation-maximisation.

The E step works out the chances of all one-to-one associations under the present model, the M step
takes the model that the expected counts speak for. What lies outside the sectors of a photo is
neither missed nor false; at a sector's edge an object counts as far as its bearing may have been
inside.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.core import (
    DISTANCE_UNITS,
    WILDCARD,
    InputError,
    distance_units_of,
    log_interval,
    poisson_interval,
    wilson_interval,
)
from semsig_gis.localization.likelihood.association import (
    Detections,
    associate,
    at_distances,
    near_pairs,
)
from semsig_gis.localization.noise.table import NoiseTable
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature, Taxonomy
    from semsig_gis.database import VisibleObjects
    from semsig_gis.localization.likelihood.association import Association, Pairs


ALL = "all"
"""What stands for all classes together."""
PRIOR_SAMPLES = 8.0  # that the overall value counts for, against those of a class
REACH = 75.0  # degrees beyond which a detection is never taken for an object
LEAST, MOST = 1e-3, 1.0 - 1e-3
LEAST_SIGMA, MOST_SIGMA = 0.05, 60.0
LEAST_ERROR, MOST_ERROR = 0.01, 3.0  # of ranges
LEAST_INFORMATION = 0.05
PERCENTS = (90, 95)  # of the intervals
KNOTS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Where the chance of detection is learnt, if it falls: shares of the range of a class."""
FADES = -3.0  # standard deviations of the trend with distance, below which detection falls


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """What was there and what was detected, photo by photo.

    `names` are those of the k classes that occur, in the order of their codes in `start`, a usual
    detector as the first model. `views` is what there was to see in each photo, `seen` what was
    detected, and `pairs` are objects and detections that may be one thing.
    """

    names: list[str]
    start: NoiseTable
    views: VisibleObjects
    seen: Detections
    pairs: Pairs

    @cached_property
    def kinds(self) -> NDArray[np.int64]:
        """The class row of each object."""
        return self.start.row_of[self.views.codes]

    @cached_property
    def owners(self) -> NDArray[np.int64]:
        """The photo of each object."""
        return np.repeat(np.arange(len(self.views)), self.views.lengths)

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """The distance of each object in metres, above 0."""
        return at_distances(self.start, self.views)

    @cached_property
    def pair_kinds(self) -> NDArray[np.int64]:
        """The class of the object of each pair."""
        return self.kinds[self.pairs.objects]

    def by_kind(self, amounts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add up what each pair has by the class of its object, shape (k,)."""
        return np.asarray(np.bincount(self.pair_kinds, amounts, len(self.names)), np.float64)

    @cached_property
    def knots(self) -> NDArray[np.float64]:
        """How near each object is to each of `KNOTS`; rows sum to one."""
        place = self.distances / self.start.ranges[self.kinds]
        hats = [np.interp(place, KNOTS, row) for row in np.eye(len(KNOTS))]
        return np.stack(hats, axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """The expected counts, given the detections and a model.

    By pair, `chances` that it is one thing, and `right` that it is named as what it is, too;
    `turns` and `ranges`, of shape (2, pairs), are squares of the errors of bearings, in square
    degrees, and of logarithms of ranges, and how many errors they count for. By object and knot,
    `hits` were detected of `trials`. `false`, by detection and class, is the chance that it is
    clutter. `named`, shape (k, k), counts detected objects by class and label; `log_likelihood` is
    of all detections.
    """

    chances: NDArray[np.float64]
    right: NDArray[np.float64]
    turns: NDArray[np.float64]
    ranges: NDArray[np.float64]
    hits: NDArray[np.float64]
    trials: NDArray[np.float64]
    false: NDArray[np.float64]
    named: NDArray[np.float64]
    log_likelihood: float


def gather_evidence(
    views: VisibleObjects,
    detected: Sequence[Signature],
    *,
    taxonomy: Taxonomy,
    radius: float = 30.0,
    position_sigma: float = 0.0,
) -> Evidence:
    """Join what there was to see in each photo of some samples with what was detected.

    What was detected has bearings and types or scores. Raises `InputError` if there was nothing to
    see at all, or nothing was detected.
    """
    named = [np.flatnonzero(View.of(one).class_scores().any(axis=0)) for one in detected]
    count = sum(map(len, detected))
    if len(views.codes) == 0 or count == 0:
        raise InputError(
            f"the {len(detected)} samples have {len(views.codes)} objects to see and {count} "
            "detections; give samples with some of both."
        )
    codes = np.unique(np.concatenate([views.codes, *named])).astype(np.uint8)
    codes = codes[codes != WILDCARD]
    start = _starting_model(codes, taxonomy.ranges(radius), position_sigma)
    seen = Detections.of(detected, start)
    return Evidence(
        names=[taxonomy.by_code(code).name for code in codes.tolist()],
        start=start,
        views=views,
        seen=seen,
        pairs=near_pairs(views.offsets, views.bearings, seen.starts, seen.bearings, reach=REACH),
    )


def _starting_model(
    codes: NDArray[np.uint8], ranges: NDArray[np.float64], position_sigma: float
) -> NoiseTable:
    """Return a typical detector, with the known deviation of places in metres."""
    count = len(codes)
    return NoiseTable(
        codes=codes,
        missed=np.full((1, count), 0.25),
        misnamed=np.full((1, count), 0.1 if count > 1 else 0.0),
        others=_others(count),
        clutter=np.full(count, 1.0 / count),
        sigma=np.full(count, 8.0),
        range_sigma=np.full(count, 0.25),
        position_sigma=position_sigma,
        ranges=ranges[codes],
        fading=np.ones((count, DISTANCE_UNITS + 1)),
        reach=float(ranges.max()),
    )


def expected_counts(evidence: Evidence, model: NoiseTable) -> Counts:
    """Return the expected counts under a model: the E step.

    The model must be the same for signatures of all lengths.
    """
    pairs, seen = evidence.pairs, evidence.seen
    lengths = np.zeros(len(evidence.views), np.int64)
    found = associate(model, evidence.views, seen, pairs, lengths=lengths)
    chances, kind = found.chances, evidence.pair_kinds
    # What is said of a detection may be the name of several classes.
    said = (model.named[0] @ seen.scores)[kind, pairs.detections]
    own = model.named[0].diagonal()[kind] * seen.scores[kind, pairs.detections]
    by_detection = np.bincount(
        kind * len(seen.bearings) + pairs.detections,
        chances / said,
        len(evidence.names) * len(seen.bearings),
    ).reshape(len(evidence.names), -1)
    true = np.bincount(pairs.detections, chances, len(seen.bearings))
    clutter = seen.scores * model.clutter[:, None]
    false = np.clip(1.0 - true, 0.0, 1.0) * found.clutter * clutter / clutter.sum(axis=0)
    hits, trials = _detections(evidence, found, model)
    return Counts(
        chances=chances,
        right=chances * own / said,
        turns=_turns(evidence, found, model),
        ranges=_ranges(evidence, found, model),
        hits=hits,
        trials=trials,
        false=false.T,
        named=model.named[0] * (by_detection @ seen.scores.T),
        log_likelihood=float(found.loglik.sum()),
    )


def _detections(
    evidence: Evidence, found: Association, model: NoiseTable
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how often each object was detected of how often it was in sight, by knot."""
    kinds, near = evidence.kinds, model.detected[0, evidence.kinds]
    units = distance_units_of(evidence.distances, model.reach)
    hits = np.bincount(evidence.pairs.objects, found.chances, len(kinds))
    hits = np.clip(hits, 0.0, 1.0)
    # Of what was not detected, so much was in range and in the sectors.
    sight = found.inside * model.inside[kinds, units] * (1.0 - near * model.fading[kinds, units])
    misses = (1.0 - hits) * sight / (1.0 - found.detection * found.inside)
    shares = near[:, None] * fading_at_knots(model)[kinds]
    of_hits, of_misses = (evidence.knots * part for part in (shares, 1.0 - shares))
    hit = hits[:, None] * of_hits / of_hits.sum(axis=1, keepdims=True)
    return hit, hit + misses[:, None] * of_misses / of_misses.sum(axis=1, keepdims=True)


def fading_at_knots(model: NoiseTable) -> NDArray[np.float64]:
    """Return what is left of the detection of each class at each knot, shape (k, knots)."""
    units = np.rint(model.ranges[:, None] * KNOTS * (DISTANCE_UNITS / model.reach))
    return np.take_along_axis(model.fading, units.astype(np.int64), axis=1)


def _turns(evidence: Evidence, found: Association, model: NoiseTable) -> NDArray[np.float64]:
    """Return the squares of the bearing noise of pairs, and for how many draws they count."""
    one, kind = evidence.pairs.objects, evidence.pair_kinds
    # Of a difference, the place and the bearing noise have their shares by their variances.
    place = np.degrees(model.position_sigma / evidence.distances[one])
    own = model.sigma[kind] ** 2
    share = own / (own + place**2)
    squares = (evidence.pairs.away * share) ** 2 + place**2 * share
    # At a sector's edge, large errors went out of sight.
    whole = share * found.squares[one] + 1.0 - share
    return np.stack([squares, whole]) * found.chances


def _ranges(evidence: Evidence, found: Association, model: NoiseTable) -> NDArray[np.float64]:
    """Return the squares of the errors of the logarithms of ranges, and for how many they count."""
    one, other = evidence.pairs.objects, evidence.pairs.detections
    seen, distances = evidence.seen, evidence.distances[one]
    told = ~np.isnan(seen.ranges[other]) & np.isnan(seen.range_errors[other])
    place = model.position_sigma / distances
    own = model.range_sigma[evidence.pair_kinds] ** 2
    share = own / (own + place**2)
    away = np.log(np.where(told, seen.ranges[other], 1.0) / distances)
    squares = (away * share) ** 2 + place**2 * share
    return np.stack([squares, np.ones(len(one))]) * (found.chances * told)


def next_model(
    evidence: Evidence, counts: Counts, model: NoiseTable, *, fading: bool = False
) -> NoiseTable:
    """Return the model that the counts speak for, classes drawn to the whole: the M step.

    Detection falls with distance if `fading` says so.
    """
    size = len(evidence.names)
    detected = counts.named.sum(axis=1)
    wrong = counts.named * (1.0 - np.eye(size))
    misnamed = np.clip(drawn_rates(wrong.sum(axis=1), detected), LEAST, MOST)
    spread = wrong + PRIOR_SAMPLES * misnamed[:, None] * _others(size)
    false = counts.false.sum(axis=0)
    shares = (false + PRIOR_SAMPLES / size) / (false.sum() + PRIOR_SAMPLES)
    seen = np.clip(_seen_by_knot(evidence, counts, fading=fading), LEAST, MOST)
    metres = np.arange(DISTANCE_UNITS + 1) * (model.reach / DISTANCE_UNITS)
    faded = [
        np.interp(metres, KNOTS * limit, row / row[0])
        for limit, row in zip(model.ranges.tolist(), seen, strict=True)
    ]
    turns, ranges = (
        [evidence.by_kind(row) for row in part] for part in (counts.turns, counts.ranges)
    )
    return replace(
        model,
        missed=1.0 - seen[None, :, 0],
        misnamed=misnamed[None] if size > 1 else np.zeros((1, 1)),
        others=spread / np.maximum(spread.sum(axis=1, keepdims=True), 1e-12),
        clutter=np.maximum(false.sum() / evidence.seen.turns.sum() * shares, LEAST / size),
        sigma=np.clip(np.sqrt(drawn_rates(*turns)), LEAST_SIGMA, MOST_SIGMA),
        range_sigma=np.clip(np.sqrt(drawn_rates(*ranges)), LEAST_ERROR, MOST_ERROR)
        if ranges[1].any()
        else model.range_sigma,
        fading=np.stack(faded) if fading else model.fading,
    )


def _seen_by_knot(evidence: Evidence, counts: Counts, *, fading: bool) -> NDArray[np.float64]:
    """Return the chance of detection by class and knot, shape (k, knots)."""
    hits, trials = _by_knot(evidence, counts)
    if not fading:
        rates = drawn_rates(hits.sum(axis=1), trials.sum(axis=1))
        return np.broadcast_to(rates[:, None], hits.shape)
    # A class falls as all do, so far as its own samples do not speak against it.
    overall = falling(hits.sum(axis=0), trials.sum(axis=0))
    expected = trials @ overall
    mean = PRIOR_SAMPLES * hits.sum() / trials.sum()
    level = (hits.sum(axis=1) + mean) / (expected + mean)
    drawn = np.clip(level[:, None] * overall, LEAST, MOST)
    rows = zip(hits + PRIOR_SAMPLES * drawn, trials + PRIOR_SAMPLES, strict=True)
    return np.stack([falling(*row) for row in rows])


def _by_knot(evidence: Evidence, counts: Counts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the hits and trials by class and knot, shape (k, knots)."""
    size = len(evidence.names)

    def by_class(amounts: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = [np.bincount(evidence.kinds, column, size) for column in amounts.T]
        return np.stack(sums, axis=1).astype(np.float64)

    return by_class(counts.hits), by_class(counts.trials)


def falling(hits: NDArray[np.float64], trials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the likeliest rates that never rise from one group to the next."""
    groups: list[tuple[float, float, int]] = []
    for hit, trial in zip(hits.tolist(), trials.tolist(), strict=True):
        groups.append((hit, trial, 1))
        while len(groups) > 1 and groups[-1][0] * groups[-2][1] > groups[-2][0] * groups[-1][1]:
            last, before = groups.pop(), groups.pop()
            groups.append((last[0] + before[0], last[1] + before[1], last[2] + before[2]))
    return np.repeat(
        [hit / max(trial, 1e-9) for hit, trial, _ in groups], [count for *_, count in groups]
    )


def fades(evidence: Evidence, counts: Counts) -> bool:
    """Tell whether the samples speak for a chance of detection that falls with distance.

    The counts are those of a model in which it does not. Where the true places are known roughly,
    distances are so, too, and nothing is said.
    """
    if evidence.start.position_sigma > 0:
        return False
    hits, trials = _by_knot(evidence, counts)
    rates = hits.sum(axis=1) / np.maximum(trials.sum(axis=1), 1e-9)
    places = KNOTS - (trials @ KNOTS / np.maximum(trials.sum(axis=1), 1e-9))[:, None]
    trend = ((hits - trials * rates[:, None]) * places).sum()
    variance = (trials * (rates * (1.0 - rates))[:, None] * places**2).sum()
    return bool(trend < FADES * math.sqrt(variance))


def drawn_rates(hits: NDArray[np.number], trials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rate of each class; the overall rate counts for `PRIOR_SAMPLES` trials of each."""
    overall = hits.sum() / max(trials.sum(), 1e-9)
    return np.asarray((hits + PRIOR_SAMPLES * overall) / (trials + PRIOR_SAMPLES))


def model_change(old: NoiseTable, new: NoiseTable) -> float:
    """Return the largest difference between two models of the same classes.

    Differences are of log-odds of detection, and of logarithms of chances, rates and deviations.
    """
    moves = [
        np.log(new.odds) - np.log(old.odds),
        np.log(new.sigma) - np.log(old.sigma),
        np.log(new.range_sigma) - np.log(old.range_sigma),
        np.log(new.clutter) - np.log(old.clutter),
        np.log(fading_at_knots(new)) - np.log(fading_at_knots(old)),
    ]
    if len(old.codes) > 1:
        moves.append(np.log(new.misnamed) - np.log(old.misnamed))
    return max(float(np.abs(move).max()) for move in moves)


def _others(size: int) -> NDArray[np.float64]:
    """Return rows that give each other class the same chance."""
    return np.asarray((1.0 - np.eye(size)) / max(size - 1, 1))


def estimated_rates(
    evidence: Evidence, counts: Counts, model: NoiseTable, *, fading: bool = False
) -> pd.DataFrame:
    """Return the rates by class and overall with their intervals, as in `NoiseEstimate.rates`.

    Intervals are Wilson's for chances, the equivalent for Poisson rates, and symmetric in the
    logarithm for deviations. For uncertain association, the effective number of samples follows
    from the information matrix: the sum over the photos of the outer products of their expected
    scores (Fisher's identity). Where many objects stand close together, the clutter comes out some
    per cent too large.
    """
    quantities = _quantities(evidence, counts, model, fading=fading)
    scores = np.stack([one.scores for one in quantities], axis=1)
    single = _deviations(scores.reshape(len(scores), -1)).reshape(scores.shape[1:])
    pooled = _deviations(scores.sum(axis=2))
    rows = []
    for number, one in enumerate(quantities):
        everywhere = {"distance": one.distance}
        rows.append(_row(one, ALL, one.hits.sum(), one.total, pooled[number]) | everywhere)
        for kind, name in enumerate(evidence.names):
            own = _row(one, name, one.hits[kind], one.trials[kind], single[number, kind])
            distance = one.distances[kind]
            rows.append({**own, "value": float(one.values[kind]), "distance": float(distance)})
    return pd.DataFrame(rows)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Quantity:
    """What is counted, of how many by class and in all, what the model has, and the scores.

    Scores have the shape (photos, k): chances are taken as log-odds, rates and deviations as
    logarithms. `distances` are metres, NaN where it is for all of them.
    """

    name: str
    hits: NDArray[np.float64]
    trials: NDArray[np.float64]
    values: NDArray[np.float64]
    scores: NDArray[np.float64]
    total: float
    distances: NDArray[np.float64]

    @property
    def distance(self) -> float:
        """Its distance if that is the same for all classes, otherwise NaN."""
        first = float(self.distances[0])
        return first if (self.distances == first).all() else math.nan


def _quantities(
    evidence: Evidence, counts: Counts, model: NoiseTable, *, fading: bool
) -> list[_Quantity]:
    """Return all that is learnt."""
    size, photos = len(evidence.names), len(evidence.views)
    sample = evidence.owners[evidence.pairs.objects]

    def by_photo(
        owner: NDArray[np.int64], group: NDArray[np.int64], amount: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        counted = np.bincount(owner * size + group, amount, photos * size)
        return np.asarray(counted.reshape(photos, size))

    def quantity(
        name: str,
        hits: NDArray[np.float64],
        trials: NDArray[np.float64],
        values: NDArray[np.float64],
        *,
        logarithm: bool = False,
        total: float | None = None,
        distances: NDArray[np.float64] | None = None,
    ) -> _Quantity:
        scores = hits / values**2 - trials if logarithm else hits - trials * values
        sums = trials.sum(axis=0)
        return _Quantity(
            name=name,
            hits=hits.sum(axis=0),
            trials=sums,
            values=values,
            scores=scores,
            total=float(sums.sum()) if total is None else total,
            distances=np.full(size, np.nan) if distances is None else distances,
        )

    found, rows = [], (evidence.owners, evidence.kinds)
    chances = model.detected[0][:, None] * fading_at_knots(model)
    for number, knot in enumerate(KNOTS if fading else KNOTS[:1]):
        parts = slice(number, number + 1) if fading else slice(None)
        hits, trials = (
            by_photo(*rows, part[:, parts].sum(axis=1)) for part in (counts.hits, counts.trials)
        )
        metres = knot * model.ranges if fading else None
        name = "fading" if number else "detection"
        found.append(quantity(name, hits, trials, chances[:, number], distances=metres))
    pairs = sample, evidence.pair_kinds
    false = np.zeros((photos, size))
    np.add.at(false, evidence.seen.photo_rows, counts.false)
    turns = float(evidence.seen.turns.sum())
    exposed = np.repeat(evidence.seen.turns[:, None], size, axis=1)
    wrong = by_photo(*pairs, np.maximum(counts.chances - counts.right, 0.0))
    found += [
        quantity("misnamed", wrong, by_photo(*pairs, counts.chances), model.misnamed[0]),
        quantity("clutter", false, exposed, model.clutter, total=turns),
    ]
    deviations = {"bearing_sigma": (counts.turns, model.sigma)}
    if counts.ranges[1].any():
        deviations["range_sigma"] = counts.ranges, model.range_sigma
    for name, (errors, values) in deviations.items():
        squares, whole = (by_photo(*pairs, part) for part in errors)
        found.append(quantity(name, squares, whole, values, logarithm=True))
    return found


def _row(
    quantity: _Quantity, name: str, hits: float, trials: float, deviation: float
) -> dict[str, Any]:
    """Return what the samples say of a rate: `deviation` is that of its log-odds or logarithm."""
    rate = hits / trials if trials > 0 else 0.0
    if quantity.name in {"bearing_sigma", "range_sigma"}:
        own = math.sqrt(rate)
        least = 1.0 / math.sqrt(2.0 * trials) if trials > 0 else math.inf
        interval = partial(log_interval, max(own, 1e-6), max(deviation, least))
    elif quantity.name == "clutter":
        own = rate
        worth = min(trials, 1.0 / max(own * deviation**2, 1e-12))
        interval = partial(poisson_interval, own, worth)
    else:
        own = min(rate, 1.0)
        worth = min(trials, 1.0 / max(own * (1.0 - own) * deviation**2, 1e-12))
        interval = partial(wilson_interval, own, worth)
    row: dict[str, Any] = {"quantity": quantity.name, "class": name, "value": own, "own": own}
    for percent in PERCENTS:
        row[f"low_{percent}"], row[f"high_{percent}"] = interval(percent=percent)
    return row | {"samples": trials}


def _deviations(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of each parameter, shape (p,), from scores (samples, p)."""
    # Shrinking leaves a mean, which is no information; a little more makes it invertible.
    scores = scores - scores.mean(axis=0)
    information = scores.T @ scores
    information[np.diag_indices_from(information)] += LEAST_INFORMATION
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))
