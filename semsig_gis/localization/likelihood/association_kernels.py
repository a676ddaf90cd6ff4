"""Compiled loops over the one-to-one associations of detections with objects.

The tests compare each with a slow, obvious one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import BEARING_UNITS, FULL_TURN, compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.localization.likelihood.records import PhotoArrays, PlaceObjects, TurnGrid
    from semsig_gis.localization.noise.table import NoiseModels

_ROOT = math.sqrt(2.0 * math.pi)
_UNIT = FULL_TURN / BEARING_UNITS  # degrees of a bearing unit
_LEAST_WEIGHT = 1e-6  # pairs of a lower weight, against a miss and a false detection, are left out
_WIDE = 45.0  # degrees of deviation above which the tails of a bearing meet behind the observer
_LARGE = 1e200  # products beyond this, or below its inverse, become logarithms
_ERF_IS_ONE = 6.0
_LEAST_MASS = 1e-12
_FARTHEST = 8.0  # deviations, beyond which a normal distribution is over
# The most rounds of messages, and the relative change below which they have converged.
_ROUNDS, _SETTLED = 30, 1e-2
_PAIR_ROUNDS, _PAIR_SETTLED = 60, 1e-5


@compiled
def _mass(start: float, width: float, spread: float) -> float:
    """Return the probability of a sector under a wrapped normal distribution."""
    start -= FULL_TURN * math.floor(start / FULL_TURN + 0.5)
    scale = 1.0 / (spread * math.sqrt(2.0))
    laps = 1 if spread < _WIDE else 3
    total = 0.0
    for lap in range(-laps - 1, laps + 1):
        low = (start + FULL_TURN * lap) * scale
        high = low + width * scale
        if low < -_ERF_IS_ONE and high > _ERF_IS_ONE:
            total += 2.0
        elif low < _ERF_IS_ONE and high > -_ERF_IS_ONE:
            total += math.erf(high) - math.erf(low)
    return 0.5 * total


@compiled
def sector_shares(  # noqa: PLR0917 - a kernel takes no keywords
    starts: NDArray[np.int64],
    sectors: NDArray[np.float64],
    owners: NDArray[np.int64],
    bearings: NDArray[np.float64],
    spreads: NDArray[np.float64],
    mass: NDArray[np.float64],
    squares: NDArray[np.float64],
) -> None:
    """Fill `mass` and `squares` as `Detections.inside` returns them.

    The sectors of photo i are ``starts[i]:starts[i + 1]``.
    """
    for entry in range(len(owners)):
        first, last = starts[owners[entry]], starts[owners[entry] + 1]
        spread = spreads[entry]
        total, bent = 0.0, 0.0
        for sector in range(first, last):
            start, width = sectors[sector, 0] - bearings[entry], sectors[sector, 1]
            width -= sectors[sector, 0]
            total += _mass(start, width, spread)
            # The integral of the squares by parts: the density times the deviation at both ends.
            start -= FULL_TURN * math.floor(start / FULL_TURN + 0.5)
            for lap in range(-3, 4):
                low = (start + FULL_TURN * lap) / spread
                high = low + width / spread
                if low > _FARTHEST or high < -_FARTHEST:
                    continue
                bent += high * math.exp(-0.5 * high * high) - low * math.exp(-0.5 * low * low)
        if first == last:
            mass[entry], squares[entry] = 1.0, 1.0
        else:
            mass[entry] = min(max(total, 0.0), 1.0)
            squares[entry] = max(1.0 - bent / _ROOT / max(mass[entry], _LEAST_MASS), 0.0)


@compiled
def _power(part: float) -> float:
    """Return the exponential of 1,024 times a negative number, in steps that vectorize.

    Its relative error is below 2e-8 down to 1e-9; below that it is next to 0.
    """
    # A Taylor polynomial, squared ten times.
    part = max(part, -0.1)
    root = 1.0 + part * (1.0 + part * (0.5 + part * (1.0 / 6.0 + part / 24.0)))
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    return root * root


@compiled
def _densities(
    angles: NDArray[np.float64], bearing: float, spread: float, values: NDArray[np.float64]
) -> None:
    """Fill `values` with the density per degree of a wrapped normal; angles are in [0, 360)."""
    slope = -0.5 / (1024.0 * spread * spread)
    scale = 1.0 / (spread * _ROOT)
    for place in range(len(angles)):
        away = abs(angles[place] - bearing)
        away = min(away, FULL_TURN - away)
        values[place] = scale * _power(slope * away * away)
    if spread > _WIDE:
        for lap in range(1, 4):
            turn = FULL_TURN * lap
            for place in range(len(angles)):
                away = abs(angles[place] - bearing)
                away = min(away, FULL_TURN - away)
                values[place] += scale * _power(slope * (turn + away) * (turn + away))
                values[place] += scale * _power(slope * (turn - away) * (turn - away))


@compiled
def sum_associations(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    group: int,
    reached: float,
    margin: float,
    objects: PlaceObjects,
    photo: PhotoArrays,
    models: NoiseModels,
    turns: TurnGrid,
    totals: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of a photo with the objects seen from some places.

    Fills `totals`, shape (models, places, turns), with log-likelihoods plus the logarithms of the
    weights of the models, for the groups ``part[0]`` to ``part[1] - 1``, each of `group` places.
    Where the log-likelihood and the log prior must be more than `margin` below the highest sum
    `reached` earlier or in the group, an upper bound is written in place of the likelihood.
    """
    offsets, kinds, beyond = objects.offsets, objects.kinds, objects.beyond
    bearing_units, distance_units = objects.bearing_units, objects.distance_units
    extents = objects.extent_sigma
    bearings, ranges, range_sigma = photo.bearings, photo.ranges, photo.range_sigma
    bearing_errors = photo.bearing_errors
    own, other, density, disc = photo.own, photo.other, photo.density, photo.disc
    sectors, log_prior = photo.sectors, turns.log_prior
    detected, misnamed = models.detected, models.misnamed
    remaining, leaving = models.remaining, models.leaving
    sigma, blur, distances = models.sigma, models.blur, models.distances
    count_models, longest = detected.shape[0], detected.shape[1] - 1
    size = len(bearings)
    # Working memory for the place with the most objects.
    most = 0
    first, last = part[0] * group, min(part[1] * group, len(log_prior))
    for place in range(first, last):
        most = max(most, offsets[place + 1] - offsets[place])
    pairs = most * size + 1
    ends = np.empty(most + 1, np.int64)  # the pairs of object i are ends[i]:ends[i + 1]
    detection_of = np.empty(pairs, np.int64)
    weight = np.empty(pairs)
    forth = np.empty(pairs)  # messages from objects to detections
    back = np.empty(pairs)  # messages from detections to objects
    at_object = np.empty(most)
    at_detection = np.empty(size)
    # Detections are computed four at a time; those that fill the last four have no name.
    room = -(-size // 4) * 4
    start = np.empty(count_models)
    floor = np.ones((count_models, room))
    names = np.zeros((count_models, most, room))
    angles = np.zeros(room)
    inside = np.ones(most)
    near = np.empty((most, room))
    values = np.empty(room)
    sums = np.empty(room)
    ranged = rough = False
    for detection in range(size):
        ranged |= not math.isnan(ranges[detection])
        rough |= bearing_errors[detection] > 0.0
    # If all models have the same errors of bearings and ranges, densities are computed once.
    same_errors = True
    for model in range(1, count_models):
        same_errors &= blur[model] == blur[0]
        same_errors &= np.array_equal(sigma[model], sigma[0])
        same_errors &= np.array_equal(range_sigma[model], range_sigma[0])
    top = reached
    for place in range(first, last):
        if place % group == 0:
            top = reached
        low = offsets[place]
        count = offsets[place + 1] - low
        length = min(count, longest)
        # What does not depend on the turn: by model, the names of the objects and the density of
        # false detections, with the objects that come into range as others leave it.
        for model in range(count_models):
            all_leaving = 0.0
            for detection in range(size):
                floor[model, detection] = density[model, detection]
            for entry in range(count):
                kind = kinds[low + entry]
                wrong = misnamed[model, length, kind]
                unit = distance_units[low + entry]
                leaving_share = detected[model, length, kind] * leaving[model, kind, unit]
                if beyond[low + entry]:
                    leaving_share += detected[model, length, kind] * remaining[model, kind, unit]
                all_leaving += leaving_share
                for detection in range(size):
                    name = (1.0 - wrong) * own[kind, detection]
                    name += wrong * other[model, kind, detection]
                    names[model, entry, detection] = name
                    # Objects that come into range may be in any direction.
                    floor[model, detection] += leaving_share * name * disc[detection] / FULL_TURN
            start[model] = (
                models.log_weights[model] - (models.clutter[model] + all_leaving) * photo.width
            )
            for detection in range(size):
                start[model] += math.log(floor[model, detection])
                floor[model, detection] = 1.0 / floor[model, detection]
        for way in range(log_prior.shape[1]):
            turn = turns.degrees[place, way]
            for detection in range(size):
                angle = bearings[detection] + turn
                angles[detection] = angle - FULL_TURN * math.floor(angle / FULL_TURN)
            for model in range(count_models):
                # The densities of bearing and range of each pair, and the chance that an object
                # is in the sectors.
                if model == 0 or not same_errors:
                    for entry in range(count):
                        if beyond[low + entry]:
                            continue
                        kind, unit = kinds[low + entry], distance_units[low + entry]
                        bearing = (bearing_units[low + entry] + 0.5) * _UNIT
                        spread = sigma[model, kind, unit]
                        if len(extents):
                            wide = math.hypot(spread, extents[low + entry])
                            spread = min(wide, FULL_TURN / 2.0)
                        if len(sectors):
                            inside[entry] = 0.0
                            for sector in range(len(sectors)):
                                inside[entry] += _mass(
                                    sectors[sector, 0] + turn - bearing,
                                    sectors[sector, 1] - sectors[sector, 0],
                                    spread,
                                )
                        own_near = near[entry]
                        _densities(angles, bearing, spread, own_near)
                        if rough:
                            for detection in range(size):
                                if bearing_errors[detection] > 0.0:
                                    _densities(
                                        angles[detection : detection + 1],
                                        bearing,
                                        min(
                                            math.hypot(spread, bearing_errors[detection]),
                                            FULL_TURN / 2.0,
                                        ),
                                        own_near[detection : detection + 1],
                                    )
                        if ranged:
                            metres = distances[unit]
                            for detection in range(size):
                                if not math.isnan(ranges[detection]):
                                    error = math.hypot(
                                        range_sigma[model, kind, detection], blur[model] / metres
                                    )
                                    ratio = math.log(ranges[detection] / metres) / error
                                    own_near[detection] *= math.exp(-0.5 * ratio**2) / (
                                        error * _ROOT
                                    )
                # The pairs and their weights: one thing, against a miss and a false detection.
                total, unseen = start[model], 1.0
                edges = 0
                sums[:] = 1.0
                for entry in range(count):
                    ends[entry] = edges
                    at_object[entry] = 1.0
                    if beyond[low + entry]:
                        continue
                    kind, unit = kinds[low + entry], distance_units[low + entry]
                    chance = detected[model, length, kind] * remaining[model, kind, unit]
                    missed = 1.0 - chance * inside[entry]
                    unseen *= missed
                    if unseen < 1.0 / _LARGE:
                        total += math.log(unseen)
                        unseen = 1.0
                    if chance == 0.0:
                        continue
                    odds = chance / missed
                    own_near, own_names, own_floor = near[entry], names[model, entry], floor[model]
                    for detection in range(room):
                        values[detection] = (
                            odds * own_near[detection] * own_names[detection] * own_floor[detection]
                        )
                        sums[detection] += values[detection]
                    for detection in range(size):
                        # Always written, and kept by counting it: that is faster than a branch.
                        detection_of[edges] = detection
                        weight[edges] = values[detection]
                        forth[edges] = 0.0
                        if values[detection] > _LEAST_WEIGHT:
                            at_object[entry] += values[detection]
                            edges += 1
                ends[count] = edges
                # An upper bound: the sum over associations that give an object several detections,
                # or a detection several objects. It may be infinite, which bounds nothing.
                by_detection = by_object = unseen
                for detection in range(size):
                    by_detection *= sums[detection]
                for entry in range(count):
                    by_object *= at_object[entry]
                bound = total + math.log(min(by_detection, by_object))
                if bound + log_prior[place, way] < top - margin:
                    totals[model, place, way] = bound
                    continue
                # Belief propagation, as in `associate`; it is slower as a function of its own. An
                # object uses the messages of those before it at once: fewer rounds are needed.
                at_detection[:] = 1.0
                for _ in range(_ROUNDS):
                    settled = True
                    for entry in range(count):
                        here = 1.0
                        for edge in range(ends[entry], ends[entry + 1]):
                            rest = max(at_detection[detection_of[edge]] - forth[edge], 1.0)
                            back[edge] = weight[edge] / rest
                            here += back[edge]
                        settled &= abs(here - at_object[entry]) < _SETTLED * here
                        at_object[entry] = here
                        for edge in range(ends[entry], ends[entry + 1]):
                            new = weight[edge] / max(here - back[edge], 1.0)
                            at_detection[detection_of[edge]] += new - forth[edge]
                            forth[edge] = new
                    if settled:
                        break
                # The Bethe approximation of the sum, as a product that is moved to `total` before
                # it is too large or too small.
                product = unseen
                for entry in range(count):
                    product *= at_object[entry]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for detection in range(size):
                    product *= at_detection[detection]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for edge in range(edges):
                    product /= 1.0 + forth[edge] * back[edge] / weight[edge]
                    if product < 1.0 / _LARGE:
                        total += math.log(product)
                        product = 1.0
                totals[model, place, way] = total + math.log(product)
                top = max(top, totals[model, place, way] + log_prior[place, way])


@compiled
def mass_rows(
    sigma: NDArray[np.float64], sectors: NDArray[np.float64], masses: NDArray[np.float32]
) -> None:
    """Fill `masses`, shape (groups, levels, bins), with the chance that a bearing is in sectors.

    `sigma`, shape (groups, levels), is its deviation in degrees.
    """
    groups, levels, bins = masses.shape
    for group in range(groups):
        for level in range(levels):
            for bin_ in range(bins):
                bearing = (bin_ + 0.5) * FULL_TURN / bins
                total = 0.0
                for sector in range(len(sectors)):
                    width = sectors[sector, 1] - sectors[sector, 0]
                    total += _mass(sectors[sector, 0] - bearing, width, sigma[group, level])
                masses[group, level, bin_] = total


@compiled
def associate(  # noqa: C901, PLR0917
    starts: NDArray[np.int64],
    objects: NDArray[np.int64],
    detections: NDArray[np.int64],
    weight: NDArray[np.float64],
    at_object: NDArray[np.float64],
    at_detection: NDArray[np.float64],
    chance: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of independent problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``: their `objects` and `detections`, which
    no other problem has, and a `weight` of 0 or more. `at_object` and `at_detection` are working
    memory. Fills `chance`, that a pair is one thing, and `total`, the logarithm of the sum of each
    problem, in which the empty association counts as one.
    """
    back = np.ones(len(weight))
    forth = np.empty(len(weight))
    for problem in range(len(starts) - 1):
        low, high = starts[problem], starts[problem + 1]
        # Belief propagation: messages between objects and detections until they converge.
        for _ in range(_PAIR_ROUNDS):
            for edge in range(low, high):
                at_object[objects[edge]] = 1.0
                at_detection[detections[edge]] = 1.0
            for edge in range(low, high):
                at_object[objects[edge]] += weight[edge] * back[edge]
            for edge in range(low, high):
                rest = at_object[objects[edge]] - weight[edge] * back[edge]
                forth[edge] = weight[edge] / max(rest, 1.0)
                at_detection[detections[edge]] += forth[edge]
            change = 0.0
            for edge in range(low, high):
                new = 1.0 / max(at_detection[detections[edge]] - forth[edge], 1.0)
                change = max(change, abs(new - back[edge]) / new)
                back[edge] = new
            if change < _PAIR_SETTLED:
                break
        # The Bethe approximation of the sum. Each object and detection counts once, at the first of
        # its pairs: after it, its value is 1.
        for edge in range(low, high):
            at_object[objects[edge]] = 1.0
        for edge in range(low, high):
            at_object[objects[edge]] += weight[edge] * back[edge]
        sums = 0.0
        for edge in range(low, high):
            pair = forth[edge] * back[edge]
            chance[edge] = pair / (1.0 + pair)
            sums -= math.log1p(pair)
            for once in (at_object[objects[edge]], at_detection[detections[edge]]):
                sums += math.log(once)
            at_object[objects[edge]] = 1.0
            at_detection[detections[edge]] = 1.0
        total[problem] = sums
