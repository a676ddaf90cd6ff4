"""Fit a noise model to detections: one round of expectation-maximisation.

The E step computes the chances of all one-to-one associations under the current model; the M step
estimates the model from the expected counts. Objects outside the sectors of a photo are neither
missed nor false; at the edge of a sector, an object counts with the chance that its bearing was
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
    DistanceScale,
    InputError,
    log_interval,
    poisson_interval,
    wilson_interval,
)
from semsig_gis.localization.likelihood.association import (
    FARTHEST,
    Detections,
    Pairs,
    associate,
    at_distances,
    bearing_spreads,
    near_pairs,
    sum_products,
)
from semsig_gis.localization.noise.table import NoiseTable, extent_sigma, other_classes
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature, Taxonomy
    from semsig_gis.database import VisibleObjects
    from semsig_gis.localization.likelihood.association import Association


ALL = "all"
"""Name of all classes together."""
PRIOR_SAMPLES = 8.0  # weight of the overall value, in samples of a class
PAIR_DEGREES = 75.0  # largest difference of bearings of a detection and an object
LEAST, MOST = 1e-3, 1.0 - 1e-3
LEAST_SIGMA, MOST_SIGMA = 0.05, 60.0
LEAST_ERROR, MOST_ERROR = 0.01, 3.0  # of ranges
LEAST_INFORMATION = 0.05
LEAST_TRIALS = 1e-9  # fewer are none
PERCENTS = (90, 95)  # of the intervals
KNOTS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
"""Distances at which a falling chance of detection is learnt: shares of the range of a class."""
FALLING_TREND = -3.0  # standard deviations; a lower trend means that detection falls


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence:
    """The visible objects and the detections, photo by photo.

    `names` are the k classes that occur, in the order of their codes in `start`, the first model;
    `families` are theirs, all empty if there are not several.
    `views` are the objects visible in each photo, `detections` the detections, and `pairs` the
    objects and detections that may be one thing. A photo of uncertain north is there several
    times, turned by different angles: `photos` are the numbers of the photos, and `log_weights` the
    logarithm of the weight of each angle in the likelihood of the photo.
    """

    names: list[str]
    families: tuple[str, ...]
    start: NoiseTable
    views: VisibleObjects
    detections: Detections
    pairs: Pairs
    photos: NDArray[np.int64]
    log_weights: NDArray[np.float64]

    @cached_property
    def exposures(self) -> NDArray[np.float64]:
        """The share of a full turn that each photo shows, counted once for all its angles."""
        sums = np.bincount(self.photos, self.detections.turns)
        return np.asarray(sums / np.bincount(self.photos))

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

    def near(self, sigma: NDArray[np.float64]) -> Evidence:
        """Return the evidence that matters if bearings of the k classes err by at most `sigma`.

        Objects far outside the sectors of their photo, and pairs of bearings far apart, are left
        out: they change no expected count.
        """
        table, views, pairs = replace(self.start, sigma=sigma), self.views, self.pairs
        spreads = bearing_spreads(table, self.kinds, self.distances, views.extents)
        inside, _ = self.detections.inside(self.owners, views.bearings, spreads)
        units = table.scale.units(self.distances)
        mask = (inside > 0) | (table.leaving[self.kinds, units] > 0)
        rough = self.detections.bearing_errors[pairs.detections]
        close = np.abs(pairs.away) <= FARTHEST * np.hypot(spreads[pairs.objects], rough)
        mask[pairs.objects[close]] = True
        rows, ends = np.append(0, np.cumsum(mask)), np.append(0, np.cumsum(close))
        return replace(
            self,
            views=replace(
                views,
                offsets=rows[views.offsets],
                objects=views.objects[mask],
                codes=views.codes[mask],
                bearings=views.bearings[mask],
                distances=views.distances[mask],
                extents=None if views.extents is None else views.extents[mask],
            ),
            pairs=Pairs(
                starts=ends[pairs.starts],
                objects=rows[pairs.objects[close]],
                detections=pairs.detections[close],
                away=pairs.away[close],
            ),
        )

    @cached_property
    def knots(self) -> NDArray[np.float64]:
        """The share of each object in each of `KNOTS`, by linear interpolation; rows sum to one."""
        place = self.distances / self.start.ranges[self.kinds]
        hats = [np.interp(place, KNOTS, row) for row in np.eye(len(KNOTS))]
        return np.stack(hats, axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Counts:
    """The expected counts, given the detections and a model.

    By pair, `chances` that it is one thing, and `right` that its name is also right; `turns` and
    `ranges`, shape (2, pairs), are the squared errors of bearings, in square degrees, and of
    logarithms of ranges, and the number of errors that each counts for. By object and knot, `hits`
    of `trials` were detected. `false`, by detection and class, is the chance of clutter. `named`,
    shape (k, k), counts detected objects by class and label; `log_likelihood` is that of all
    detections. `totals` are the sums by class, from which a model is estimated: in columns, those
    of `named`, `false`, `turns`, `ranges`, `hits` and `trials`.
    """

    chances: NDArray[np.float64]
    right: NDArray[np.float64]
    turns: NDArray[np.float64]
    ranges: NDArray[np.float64]
    hits: NDArray[np.float64]
    trials: NDArray[np.float64]
    false: NDArray[np.float64]
    named: NDArray[np.float64]
    totals: NDArray[np.float64]
    log_likelihood: float


def gather_evidence(
    views: VisibleObjects,
    detected: Sequence[Signature],
    *,
    taxonomy: Taxonomy,
    radius: float = 30.0,
    position_sigma: float = 0.0,
) -> Evidence:
    """Join the visible objects and the detections of each photo of some samples.

    Detections have bearings and types or scores. Raises `InputError` if there is no visible object
    or no detection at all.
    """
    names = [np.flatnonzero(View.of(view).class_scores().any(axis=0)) for view in detected]
    count = sum(map(len, detected))
    if len(views.codes) == 0 or count == 0:
        raise InputError(
            f"the {len(detected)} samples have {len(views.codes)} objects to see and {count} "
            "detections; give samples with some of both."
        )
    codes = np.unique(np.concatenate([views.codes, *names])).astype(np.uint8)
    codes = codes[codes != WILDCARD]
    families = tuple(taxonomy.by_code(code).family for code in codes.tolist())
    if len({*families} - {""}) < 2:  # noqa: PLR2004 - families
        families = ("",) * len(codes)
    start = _starting_model(codes, families, taxonomy, radius, position_sigma)
    detections = Detections.of(detected, start)
    starts, bearings = detections.starts, detections.bearings
    return Evidence(
        names=[taxonomy.by_code(code).name for code in codes.tolist()],
        families=families,
        start=start,
        views=views,
        detections=detections,
        pairs=near_pairs(views.offsets, views.bearings, starts, bearings, reach=PAIR_DEGREES),
        photos=np.arange(len(views)),
        log_weights=np.zeros(len(views)),
    )


def _starting_model(
    codes: NDArray[np.uint8],
    families: Sequence[str],
    taxonomy: Taxonomy,
    radius: float,
    position_sigma: float,
) -> NoiseTable:
    """Return a typical detector, with the given deviation of places in metres."""
    count = len(codes)
    return NoiseTable(
        codes=codes,
        missed=np.full((1, count), 0.25),
        misnamed=np.full((1, count), 0.1 if count > 1 else 0.0),
        others=other_classes(families),
        clutter=np.full(count, 1.0 / count),
        sigma=np.full(count, 8.0),
        range_sigma=np.full(count, 0.25),
        position_sigma=position_sigma,
        ranges=taxonomy.ranges(radius)[codes],
        fading=np.ones((count, DISTANCE_UNITS + 1)),
        scale=DistanceScale.of(taxonomy, radius),
    )


def expected_counts(evidence: Evidence, model: NoiseTable) -> Counts:
    """Return the expected counts under a model: the E step.

    The model must be the same for signatures of all lengths.
    """
    pairs, detections = evidence.pairs, evidence.detections
    size, count = len(evidence.names), len(detections.bearings)
    lengths = np.zeros(len(evidence.views), np.int64)
    association = associate(model, evidence.views, detections, pairs, lengths=lengths)
    kind = evidence.pair_kinds
    # The chance of each angle of a photo, which all its counts are multiplied by.
    logs = association.loglik + evidence.log_weights
    logliks = np.full(len(evidence.exposures), -math.inf)
    np.logaddexp.at(logliks, evidence.photos, logs)
    angles = np.exp(logs - logliks[evidence.photos])
    of_objects, of_detections = angles[evidence.owners], angles[detections.photo_rows]
    of_pairs = of_detections[pairs.detections]
    chances = association.chances * of_pairs
    # The scores of a detection may be those of several classes.
    names = model.named(0)
    naming = sum_products("kc,cn->kn", names, detections.scores)[kind, pairs.detections]
    own = names.diagonal()[kind] * detections.scores[kind, pairs.detections]
    cells = kind * count + pairs.detections
    by_detection = np.bincount(cells, chances / naming, size * count).reshape(size, -1)
    true = np.bincount(pairs.detections, association.chances, count)
    clutter = detections.scores * model.clutter[:, None]
    false = np.clip(1.0 - true, 0.0, 1.0) * association.clutter * clutter / clutter.sum(axis=0)
    false *= of_detections
    hits, trials = of_objects[:, None] * _detected_objects(evidence, association, model)
    turns = of_pairs * _bearing_errors(evidence, association, model)
    ranges = of_pairs * _range_errors(evidence, association, model)
    by_name = names * sum_products("kd,cd->kc", by_detection, detections.scores)
    amounts = [(kind, row) for row in (*turns, *ranges)]
    amounts += [(evidence.kinds, row) for row in (*hits.T, *trials.T)]
    sums = [np.bincount(kinds, row, size) for kinds, row in amounts]
    return Counts(
        chances=chances,
        right=chances * own / naming,
        turns=turns,
        ranges=ranges,
        hits=hits,
        trials=trials,
        false=false.T,
        named=by_name,
        totals=np.column_stack([by_name, false.sum(axis=1), *sums]),
        log_likelihood=float(logliks.sum()),
    )


def _detected_objects(
    evidence: Evidence, association: Association, model: NoiseTable
) -> NDArray[np.float64]:
    """Return the expected hits and trials of detection, shape (2, objects, knots)."""
    kinds, near = evidence.kinds, model.detected[0, evidence.kinds]
    units = model.scale.units(evidence.distances)
    hits = np.bincount(evidence.pairs.objects, association.chances, len(kinds))
    hits = np.clip(hits, 0.0, 1.0)
    # The chance that an object that was not detected was in range and in the sectors.
    missed = 1.0 - near * model.fading[kinds, units]
    visible = association.inside * model.inside[kinds, units] * missed
    misses = (1.0 - hits) * visible / (1.0 - association.detection * association.inside)
    shares = near[:, None] * fading_at_knots(model)[kinds]
    of_hits, of_misses = (evidence.knots * part for part in (shares, 1.0 - shares))
    hit = hits[:, None] * of_hits / of_hits.sum(axis=1, keepdims=True)
    missed_shares = of_misses / of_misses.sum(axis=1, keepdims=True)
    return np.stack([hit, hit + misses[:, None] * missed_shares])


def fading_at_knots(model: NoiseTable) -> NDArray[np.float64]:
    """Return the remaining share of the detection of each class at each knot, shape (k, knots)."""
    units = model.scale.units(model.ranges[:, None] * KNOTS)
    return np.take_along_axis(model.fading, units.astype(np.int64), axis=1)


def _bearing_errors(
    evidence: Evidence, association: Association, model: NoiseTable
) -> NDArray[np.float64]:
    """Return the squared bearing noise of pairs, and the number of errors they count for."""
    objects, kind = evidence.pairs.objects, evidence.pair_kinds
    # A difference is due to the bearing noise, and to the place and the extent of the object, in
    # proportion to their variances.
    place = np.degrees(model.position_sigma / evidence.distances[objects])
    if evidence.views.extents is not None:
        place = np.hypot(place, extent_sigma(evidence.views.extents[objects]))
    own = model.sigma[kind] ** 2
    share = own / (own + place**2)
    squares = (evidence.pairs.away * share) ** 2 + place**2 * share
    # At the edge of a sector, objects with large errors are outside.
    whole = share * association.squares[objects] + 1.0 - share
    # Bearings with errors of their own say nothing about the error of the model.
    usable = evidence.detections.bearing_errors[evidence.pairs.detections] == 0.0
    return np.asarray(np.stack([squares, whole]) * (association.chances * usable))


def _range_errors(
    evidence: Evidence, association: Association, model: NoiseTable
) -> NDArray[np.float64]:
    """Return the squared errors of the logarithms of ranges, and the number they count for."""
    objects, rows = evidence.pairs.objects, evidence.pairs.detections
    detections, distances = evidence.detections, evidence.distances[objects]
    # Ranges with errors of their own say nothing about the error of the model.
    usable = ~np.isnan(detections.ranges[rows]) & np.isnan(detections.range_errors[rows])
    place = model.position_sigma / distances
    own = model.range_sigma[evidence.pair_kinds] ** 2
    share = own / (own + place**2)
    away = np.log(np.where(usable, detections.ranges[rows], 1.0) / distances)
    squares = (away * share) ** 2 + place**2 * share
    return np.stack([squares, np.ones(len(objects))]) * (association.chances * usable)


def next_model(
    evidence: Evidence, totals: NDArray[np.float64], model: NoiseTable, *, fading: bool = False
) -> NoiseTable:
    """Return the model of the totals: the M step.

    The rates of classes are shrunk towards those of their families, and these towards the overall
    rate. With `fading`, detection falls with distance.
    """
    size, families = len(evidence.names), evidence.families
    names, false, turns, ranges, hits, trials = _columns(totals)
    detected = names.sum(axis=1)
    wrong = names * (1.0 - np.eye(size))
    misnamed = np.clip(shrunk_rates(wrong.sum(axis=1), detected, families), LEAST, MOST)
    spread = wrong + PRIOR_SAMPLES * misnamed[:, None] * other_classes(families)
    before = np.full(size, 1.0 / size)
    if any(families):
        equal = np.full(size, false.sum() / size)
        before = _family_rates(false[:, 0], equal, families, prior=PRIOR_SAMPLES)
        before /= before.sum()
    shares = (false[:, 0] + PRIOR_SAMPLES * before) / (false.sum() + PRIOR_SAMPLES)
    rates = np.clip(_rates_by_knot(hits, trials, families, fading=fading), LEAST, MOST)
    faded = [
        np.interp(model.scale.metres, KNOTS * limit, row / row[0])
        for limit, row in zip(model.ranges.tolist(), rates, strict=True)
    ]
    return replace(
        model,
        missed=1.0 - rates[None, :, 0],
        misnamed=misnamed[None] if size > 1 else np.zeros((1, 1)),
        others=spread / np.maximum(spread.sum(axis=1, keepdims=True), 1e-12),
        clutter=np.maximum(false.sum() / evidence.exposures.sum() * shares, LEAST / size),
        sigma=np.clip(
            np.sqrt(shrunk_rates(turns[:, 0], turns[:, 1], families)), LEAST_SIGMA, MOST_SIGMA
        ),
        range_sigma=np.clip(
            np.sqrt(shrunk_rates(ranges[:, 0], ranges[:, 1], families)), LEAST_ERROR, MOST_ERROR
        )
        if ranges[:, 1].any()
        else model.range_sigma,
        fading=np.stack(faded) if fading else model.fading,
    )


def _columns(totals: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the parts of `Counts.totals`: each of one column or more."""
    widths = [len(totals), 1, 2, 2, len(KNOTS)]
    return np.split(totals, np.cumsum(widths), axis=1)


def _rates_by_knot(
    hits: NDArray[np.float64],
    trials: NDArray[np.float64],
    families: Sequence[str],
    *,
    fading: bool,
) -> NDArray[np.float64]:
    """Return the chance of detection by class and knot, shape (k, knots)."""
    if not fading:
        rates = shrunk_rates(hits.sum(axis=1), trials.sum(axis=1), families)
        return np.broadcast_to(rates[:, None], hits.shape)
    # The shape of all classes together, scaled to the class, is its prior.
    overall = falling(hits.sum(axis=0), trials.sum(axis=0))
    expected = trials @ overall
    mean = PRIOR_SAMPLES * hits.sum() / trials.sum()
    before = _family_rates(hits.sum(axis=1), expected, families, prior=mean)
    level = (hits.sum(axis=1) + mean * before) / (expected + mean)
    prior = np.clip(level[:, None] * overall, LEAST, MOST)
    rows = zip(hits + PRIOR_SAMPLES * prior, trials + PRIOR_SAMPLES, strict=True)
    return np.stack([falling(*row) for row in rows])


def falling(hits: NDArray[np.float64], trials: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the likeliest rates that do not rise, by pooling adjacent violators."""
    groups: list[tuple[float, float, int]] = []
    for hit, trial in zip(hits.tolist(), trials.tolist(), strict=True):
        groups.append((hit, trial, 1))
        while len(groups) > 1 and groups[-1][0] * groups[-2][1] > groups[-2][0] * groups[-1][1]:
            last, before = groups.pop(), groups.pop()
            groups.append((last[0] + before[0], last[1] + before[1], last[2] + before[2]))
    return np.repeat(
        [hit / max(trial, 1e-9) for hit, trial, _ in groups], [count for *_, count in groups]
    )


def detection_falls(evidence: Evidence, counts: Counts) -> bool:
    """Whether the chance of detection falls significantly with distance.

    The counts are from a model in which it does not. It is False if the true places are uncertain,
    because the distances are then uncertain as well.
    """
    if evidence.start.position_sigma > 0:
        return False
    hits, trials = _columns(counts.totals)[-2:]
    rates = hits.sum(axis=1) / np.maximum(trials.sum(axis=1), 1e-9)
    places = KNOTS - (trials @ KNOTS / np.maximum(trials.sum(axis=1), 1e-9))[:, None]
    trend = ((hits - trials * rates[:, None]) * places).sum()
    variance = (trials * (rates * (1.0 - rates))[:, None] * places**2).sum()
    return bool(trend < FALLING_TREND * math.sqrt(variance))


def shrunk_rates(
    hits: NDArray[np.number], trials: NDArray[np.float64], families: Sequence[str] = ()
) -> NDArray[np.float64]:
    """Return the rates of classes, each with `PRIOR_SAMPLES` trials at the overall rate added.

    A class of a family has them at the rate of the family, to which the same number is added.
    """
    overall = hits.sum() / max(trials.sum(), 1e-9)
    added = PRIOR_SAMPLES * overall
    before = _family_rates(hits, trials * overall, families, prior=added)
    return np.asarray((hits + added * before) / (trials + PRIOR_SAMPLES))


def _family_rates(
    hits: NDArray[np.number],
    expected: NDArray[np.float64],
    families: Sequence[str],
    *,
    prior: float,
) -> NDArray[np.float64]:
    """Return how often the family of each class is hit, relative to what is expected.

    The `prior` is added to both; classes without a family have 1.
    """
    rates = np.ones(len(hits))
    for family in {*families} - {""}:
        rows = np.array(families) == family
        rates[rows] = (hits[rows].sum() + prior) / max(expected[rows].sum() + prior, 1e-9)
    return rates


def model_change(old: NoiseTable, new: NoiseTable) -> float:
    """Return the largest difference between two models of the same classes.

    It is in log-odds of detection, and in logarithms of chances, rates and deviations.
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


def estimated_rates(
    evidence: Evidence, counts: Counts, model: NoiseTable, *, fading: bool = False
) -> pd.DataFrame:
    """Return the rates by class and overall with their intervals, as in `NoiseEstimate.rates`.

    Intervals are Wilson's for chances, the equivalent for Poisson rates, and symmetric in the
    logarithm for deviations. As the associations are uncertain, the effective number of samples is
    from the information matrix: the sum over the photos of the outer products of their expected
    scores (Fisher's identity). Where many objects are close together, the estimate of the clutter
    is some per cent too large.
    """
    quantities = _quantities(evidence, counts, model, fading=fading)
    scores = np.stack([quantity.scores for quantity in quantities], axis=1)
    single = _deviations(scores.reshape(len(scores), -1)).reshape(scores.shape[1:])
    pooled = _deviations(scores.sum(axis=2))
    rows = []
    for number, quantity in enumerate(quantities):
        hits, total, trials = quantity.hits, quantity.total, quantity.trials
        overall = _row(quantity, ALL, hits.sum(), total, pooled[number])
        rows.append(overall | {"distance": quantity.distance})
        for kind, name in enumerate(evidence.names):
            own = _row(quantity, name, hits[kind], trials[kind], single[number, kind])
            distance = float(quantity.distances[kind])
            rows.append({**own, "value": float(quantity.values[kind]), "distance": distance})
    return pd.DataFrame(rows)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Quantity:
    """A learnt quantity by class: hits, trials, value in the model, and scores by photo.

    `scores`, shape (photos, k), are those of log-odds for chances, of logarithms for rates and
    deviations. `total` is the number of trials of all classes, and `distances` are in metres, NaN
    for a quantity that is for all distances.
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
        """Distance in metres of the quantity; NaN if it has none or differs by class."""
        first = float(self.distances[0])
        return first if (self.distances == first).all() else math.nan


def _quantities(
    evidence: Evidence, counts: Counts, model: NoiseTable, *, fading: bool
) -> list[_Quantity]:
    """Return all learnt quantities."""
    size, photos = len(evidence.names), len(evidence.exposures)
    photo_of_object = evidence.photos[evidence.owners]

    def by_photo(
        owner: NDArray[np.int64], group: NDArray[np.int64], amount: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        sums = np.bincount(owner * size + group, amount, photos * size)
        return np.asarray(sums.reshape(photos, size))

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

    quantities, rows = [], (photo_of_object, evidence.kinds)
    chances = model.detected[0][:, None] * fading_at_knots(model)
    for number, knot in enumerate(KNOTS if fading else KNOTS[:1]):
        parts = slice(number, number + 1) if fading else slice(None)
        hits, trials = (
            by_photo(*rows, part[:, parts].sum(axis=1)) for part in (counts.hits, counts.trials)
        )
        metres = knot * model.ranges if fading else None
        name = "fading" if number else "detection"
        quantities.append(quantity(name, hits, trials, chances[:, number], distances=metres))
    pairs = photo_of_object[evidence.pairs.objects], evidence.pair_kinds
    false = np.zeros((photos, size))
    np.add.at(false, evidence.photos[evidence.detections.photo_rows], counts.false)
    turns = float(evidence.exposures.sum())
    exposed = np.repeat(evidence.exposures[:, None], size, axis=1)
    wrong = by_photo(*pairs, np.maximum(counts.chances - counts.right, 0.0))
    quantities += [
        quantity("misnamed", wrong, by_photo(*pairs, counts.chances), model.misnamed[0]),
        quantity("clutter", false, exposed, model.clutter, total=turns),
    ]
    deviations = {"bearing_sigma": (counts.turns, model.sigma)}
    if counts.ranges[1].any():
        deviations["range_sigma"] = counts.ranges, model.range_sigma
    for name, (errors, values) in deviations.items():
        squares, whole = (by_photo(*pairs, part) for part in errors)
        quantities.append(quantity(name, squares, whole, values, logarithm=True))
    return quantities


def _row(
    quantity: _Quantity, name: str, hits: float, trials: float, deviation: float
) -> dict[str, Any]:
    """Return a rate with its intervals; `deviation` is that of its log-odds or logarithm."""
    if trials < LEAST_TRIALS:
        hits = trials = 0.0
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
    # Shrinkage leaves a mean, which is no information; the small term makes the matrix invertible.
    scores = scores - scores.mean(axis=0)
    information = scores.T @ scores
    information[np.diag_indices_from(information)] += LEAST_INFORMATION
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))
