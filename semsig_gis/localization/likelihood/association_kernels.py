"""One-to-one associations of what is seen with what is there, as loops that are compiled.

Each has a slow, obvious twin in the tests.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_TURN = 360.0
_ROOT = math.sqrt(2.0 * math.pi)
_LEAST = 1e-6  # weight of a pair against a miss and a false detection, from which it counts
_WIDE = 45.0  # deviation in degrees from which on the tails meet behind the observer
_LARGE = 1e200  # from which on a product becomes a logarithm
_SURE = 6.0  # from which on the error function is one
# How often messages are sent, and the relative change at which they are taken for settled.
_ROUNDS, _SETTLED = 30, 1e-2
_PAIR_ROUNDS, _PAIR_SETTLED = 60, 1e-5


@compiled
def _mass(start: float, width: float, spread: float) -> float:
    """Return how much of a wrapped normal distribution lies in a sector."""
    start -= _TURN * math.floor(start / _TURN + 0.5)
    scale = 1.0 / (spread * math.sqrt(2.0))
    laps = 1 if spread < _WIDE else 3
    total = 0.0
    for lap in range(-laps - 1, laps + 1):
        low = (start + _TURN * lap) * scale
        high = low + width * scale
        if low < _SURE and high > -_SURE:
            total += math.erf(high) - math.erf(low)
    return 0.5 * total


@compiled
def _power(part: float) -> float:
    """Return the exponential of 1,024 times a number below 0, in steps that many take at once.

    It is right to 2e-8 of itself down to 1e-9, and below that next to nothing.
    """
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
    """Fill in the density of the wrapped normal at some angles, a degree; all are below a turn."""
    slope = -0.5 / (1024.0 * spread * spread)
    scale = 1.0 / (spread * _ROOT)
    for one in range(len(angles)):
        away = abs(angles[one] - bearing)
        away = min(away, _TURN - away)
        values[one] = scale * _power(slope * away * away)
    if spread > _WIDE:
        for lap in range(1, 4):
            turn = _TURN * lap
            for one in range(len(angles)):
                away = abs(angles[one] - bearing)
                away = min(away, _TURN - away)
                values[one] += scale * _power(slope * (turn + away) * (turn + away))
                values[one] += scale * _power(slope * (turn - away) * (turn - away))


@compiled
def align(  # noqa: C901, PLR0912, PLR0915, PLR0917 - a kernel takes no keywords
    part: NDArray[np.int64],
    group: int,
    reached: float,
    margin: float,
    log_weights: NDArray[np.float64],
    log_prior: NDArray[np.float64],
    offsets: NDArray[np.int64],
    kinds: NDArray[np.int64],
    bearing_units: NDArray[np.uint16],
    distance_units: NDArray[np.uint8],
    beyond: NDArray[np.bool_],
    unit: float,
    bearings: NDArray[np.float64],
    ranges: NDArray[np.float64],
    range_sigma: NDArray[np.float64],
    own: NDArray[np.float64],
    other: NDArray[np.float64],
    density: NDArray[np.float64],
    disc: NDArray[np.float64],
    sectors: NDArray[np.float64],
    width: float,
    turns: NDArray[np.float64],
    detected: NDArray[np.float64],
    misnamed: NDArray[np.float64],
    clutter: NDArray[np.float64],
    seen: NDArray[np.float64],
    left: NDArray[np.float64],
    sigma: NDArray[np.float64],
    blur: NDArray[np.float64],
    distances: NDArray[np.float64],
    totals: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of a photo with what is seen from some places.

    Fills `totals`, shape (models, places, turns), with log-likelihoods and the `log_weights` of the
    models, for the groups ``part[0]`` to ``part[1] - 1`` of so many places. With the `log_prior`,
    shape (places, turns), what must stay by a `margin` below what was `reached`, in its group or
    before, gets a bound alone. Objects of the places have class rows
    `kinds` and bearings of `unit` degrees a unit; some are `beyond` the range. The photo, turned by
    `turns`, shape (places, turns), has detections by `bearings`, `ranges` (NaN if unknown) and, by
    model and class, `range_sigma`; it saw `sectors`, shape (s, 2), or all round, `width` of the
    turn. What speaks for a class is `own`, shape (k, n), and `other` if it is
    misnamed, shape (models, k, n); `density` (models, n) is of false detections, in which `disc`
    (n,) is that of the range. By model, `detected` and `misnamed` are by length and class,
    `clutter` is the sum of false detections, and by class and distance unit `seen` and `left` are
    the chances that what is in range of the place is seen by the observer, and that it has left the
    range, and `sigma` the deviation of a bearing. `blur` is that of the observer's place in metres,
    `distances` the metres of a unit.
    """
    models, longest = detected.shape[0], detected.shape[1] - 1
    size = len(bearings)
    most = 0
    first, last = part[0] * group, min(part[1] * group, len(turns))
    for place in range(first, last):
        most = max(most, offsets[place + 1] - offsets[place])
    pairs = most * size + 1
    ends = np.empty(most + 1, np.int64)  # the pairs of an object are ends[one]:ends[one + 1]
    other_of = np.empty(pairs, np.int64)
    weight = np.empty(pairs)
    forth = np.empty(pairs)  # messages from the objects of the place to those of the query
    back = np.empty(pairs)
    at_left = np.empty(most)
    at_right = np.empty(size)
    # Four detections are worked out at once; the last ones may be none.
    room = -(-size // 4) * 4
    start = np.empty(models)
    floor = np.ones((models, room))
    named = np.zeros((models, most, room))
    angles = np.zeros(room)
    inside = np.ones(most)
    near = np.empty((most, room))
    values = np.empty(room)
    sums = np.empty(room)
    ranged = False
    for one in range(size):
        ranged |= not math.isnan(ranges[one])
    # How far off bearings and ranges are is often the same by all models.
    alike = True
    for model in range(1, models):
        alike &= blur[model] == blur[0]
        alike &= np.array_equal(sigma[model], sigma[0])
        alike &= np.array_equal(range_sigma[model], range_sigma[0])
    top = reached
    for place in range(first, last):
        if place % group == 0:
            top = reached
        low = offsets[place]
        count = offsets[place + 1] - low
        length = min(count, longest)
        for model in range(models):
            gone = 0.0
            for two in range(size):
                floor[model, two] = density[model, two]
            for one in range(count):
                kind = kinds[low + one]
                wrong = misnamed[model, length, kind]
                far = distance_units[low + one]
                leaving = detected[model, length, kind] * left[model, kind, far]
                if beyond[low + one]:
                    leaving += detected[model, length, kind] * seen[model, kind, far]
                gone += leaving
                for two in range(size):
                    name = (1.0 - wrong) * own[kind, two] + wrong * other[model, kind, two]
                    named[model, one, two] = name
                    # As many objects come into range as leave it, in any direction.
                    floor[model, two] += leaving * name * disc[two] / _TURN
            start[model] = log_weights[model] - (clutter[model] + gone) * width
            for two in range(size):
                start[model] += math.log(floor[model, two])
                floor[model, two] = 1.0 / floor[model, two]
        for way in range(turns.shape[1]):
            turn = turns[place, way]
            for two in range(size):
                angle = bearings[two] + turn
                angles[two] = angle - _TURN * math.floor(angle / _TURN)
            for model in range(models):
                if model == 0 or not alike:
                    for one in range(count):
                        if beyond[low + one]:
                            continue
                        kind, far = kinds[low + one], distance_units[low + one]
                        bearing = (bearing_units[low + one] + 0.5) * unit
                        spread = sigma[model, kind, far]
                        if len(sectors):
                            inside[one] = 0.0
                            for sector in range(len(sectors)):
                                inside[one] += _mass(
                                    sectors[sector, 0] + turn - bearing,
                                    sectors[sector, 1] - sectors[sector, 0],
                                    spread,
                                )
                        own_near = near[one]
                        _densities(angles, bearing, spread, own_near)
                        if ranged:
                            away_m = distances[far]
                            for two in range(size):
                                if not math.isnan(ranges[two]):
                                    error = math.hypot(
                                        range_sigma[model, kind, two], blur[model] / away_m
                                    )
                                    ratio = math.log(ranges[two] / away_m) / error
                                    own_near[two] *= math.exp(-0.5 * ratio**2) / (error * _ROOT)
                total, unseen = start[model], 1.0
                edges = 0
                sums[:] = 1.0
                for one in range(count):
                    ends[one] = edges
                    at_left[one] = 1.0
                    if beyond[low + one]:
                        continue
                    kind, far = kinds[low + one], distance_units[low + one]
                    chance = detected[model, length, kind] * seen[model, kind, far]
                    missed = 1.0 - chance * inside[one]
                    unseen *= missed
                    if unseen < 1.0 / _LARGE:
                        total += math.log(unseen)
                        unseen = 1.0
                    if chance == 0.0:
                        continue
                    odds = chance / missed
                    own_near, own_named, own_floor = near[one], named[model, one], floor[model]
                    for two in range(room):
                        values[two] = odds * own_near[two] * own_named[two] * own_floor[two]
                        sums[two] += values[two]
                    for two in range(size):
                        # Written in any case: a step that is foreseen is faster than a jump.
                        other_of[edges] = two
                        weight[edges] = values[two]
                        forth[edges] = 0.0
                        if values[two] > _LEAST:
                            at_left[one] += values[two]
                            edges += 1
                ends[count] = edges
                # More than one detection for an object, or more than one object for a detection.
                by_detection = by_object = unseen  # perhaps infinite, which bounds nothing
                for two in range(size):
                    by_detection *= sums[two]
                for one in range(count):
                    by_object *= at_left[one]
                bound = total + math.log(min(by_detection, by_object))
                if bound + log_prior[place, way] < top - margin:
                    totals[model, place, way] = bound
                    continue
                # Belief propagation, as in `associate`; as a function of its own it is slower. Each
                # object hears at once what those before it have said, which settles it sooner.
                at_right[:] = 1.0
                for _ in range(_ROUNDS):
                    settled = True
                    for one in range(count):
                        here = 1.0
                        for edge in range(ends[one], ends[one + 1]):
                            rest = max(at_right[other_of[edge]] - forth[edge], 1.0)
                            back[edge] = weight[edge] / rest
                            here += back[edge]
                        settled &= abs(here - at_left[one]) < _SETTLED * here
                        at_left[one] = here
                        for edge in range(ends[one], ends[one + 1]):
                            new = weight[edge] / max(here - back[edge], 1.0)
                            at_right[other_of[edge]] += new - forth[edge]
                            forth[edge] = new
                    if settled:
                        break
                product = unseen
                for one in range(count):
                    product *= at_left[one]
                    if product > _LARGE:
                        total += math.log(product)
                        product = 1.0
                for two in range(size):
                    product *= at_right[two]
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
            for one in range(bins):
                bearing = (one + 0.5) * _TURN / bins
                total = 0.0
                for part in range(len(sectors)):
                    width = sectors[part, 1] - sectors[part, 0]
                    total += _mass(sectors[part, 0] - bearing, width, sigma[group, level])
                masses[group, level, one] = total


@compiled
def associate(  # noqa: C901, PLR0917
    starts: NDArray[np.int64],
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    weight: NDArray[np.float64],
    at_left: NDArray[np.float64],
    at_right: NDArray[np.float64],
    chance: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """Sum over the one-to-one associations of independent problems.

    The pairs of problem i are ``starts[i]:starts[i + 1]``, each an object `left` and a detection
    `right` with a weight of 0 or more; no two problems share one. `at_left` and `at_right` are
    working memory. Fills `chance`, that a pair is one thing, and `total`, the logarithm of the sum
    of each problem, in which the empty association counts as one.
    """
    back = np.ones(len(weight))
    forth = np.empty(len(weight))
    for problem in range(len(starts) - 1):
        low, high = starts[problem], starts[problem + 1]
        for _ in range(_PAIR_ROUNDS):
            for edge in range(low, high):
                at_left[left[edge]] = 1.0
                at_right[right[edge]] = 1.0
            for edge in range(low, high):
                at_left[left[edge]] += weight[edge] * back[edge]
            for edge in range(low, high):
                rest = at_left[left[edge]] - weight[edge] * back[edge]
                forth[edge] = weight[edge] / max(rest, 1.0)
                at_right[right[edge]] += forth[edge]
            change = 0.0
            for edge in range(low, high):
                new = 1.0 / max(at_right[right[edge]] - forth[edge], 1.0)
                change = max(change, abs(new - back[edge]) / new)
                back[edge] = new
            if change < _PAIR_SETTLED:
                break
        # Each object and detection counts once, at the first of its pairs.
        for edge in range(low, high):
            at_left[left[edge]] = 1.0
        for edge in range(low, high):
            at_left[left[edge]] += weight[edge] * back[edge]
        sums = 0.0
        for edge in range(low, high):
            pair = forth[edge] * back[edge]
            chance[edge] = pair / (1.0 + pair)
            sums -= math.log1p(pair)
            for once in (at_left[left[edge]], at_right[right[edge]]):
                sums += math.log(once)
            at_left[left[edge]] = 1.0
            at_right[right[edge]] = 1.0
        total[problem] = sums
