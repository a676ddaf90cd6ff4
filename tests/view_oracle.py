"""The likelihood of a view in a cell by a slow and simple implementation, to test every engine.

Object i has the class tau, the bearing theta_i, the distance d_i, the chance of detection p_i and
the share w_i of its wrapped normal in the sectors S of a photo; detection j has the bearing
a_j, the range r_j (or none) and the weights of classes c_j(t). In a photo,

    hit_ij   = p_i * sum_t c_j(t) C(tau_i, t) * N(a_j - theta_i; sigma_i) * LN(r_j; d_i, s_ij)
    lambda_j = sum_t c_j(t) (clutter_t + sum_i l_i C(tau_i, t)) / 360 * (2 r_j^2 / R^2 with a range)
    log L    = -|S| / 360 * (sum_t clutter_t + sum_i l_i) + sum_i log(1 - p_i w_i) + log of
               exact: the sum over all one-to-one associations of products of hit_ij / (1 - p_i w_i)
                      of pairs and of lambda_j of the detections that are in none;
               set:   prod_j (lambda_j + sum_i hit_ij / (1 - p_i w_i))

LN is a density of the logarithm of the range. Photos are independent given the place. For an
observer who is not at the centre of the cell (position_sigma), some objects near the limit of the
range are beyond it, which reduces p_i, and as many others are visible anywhere instead: l_i.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import visible_objects_in
from semsig_gis.localization import database_tables
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Noise, NoiseSpec, NoiseTable
    from semsig_gis.observation import Photo

LAPS = range(-4, 5)


@dataclass(frozen=True, kw_only=True)
class Thing:
    """An object in sight; `names` is the chance of each name if it is detected, by class row.

    Detections more than `tails` deviations away are not of it: engines skip such pairs.
    """

    chance: float
    names: Sequence[float]
    bearing: float
    bearing_sigma: float
    distance: float
    range_sigma: float
    distance_sigma: float = 0.0
    leaving: float = 0.0
    tails: float = math.inf


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What there is to see from a place, false objects a full turn by class row, and the reach."""

    things: Sequence[Thing]
    clutter: Sequence[float]
    reach: float


@dataclass(frozen=True, kw_only=True)
class Glimpse:
    """A detection, with the weight of each class row."""

    bearing: float
    weights: Sequence[float]
    bearing_error: float = 0.0
    range: float = math.nan
    range_error: float = math.nan


def bearing_density(away: float, sigma: float) -> float:
    """Return the wrapped normal density a degree."""
    lobes = [math.exp(-0.5 * ((away + 360.0 * lap) / sigma) ** 2) for lap in LAPS]
    return sum(lobes) / (sigma * math.sqrt(2.0 * math.pi))


def mass_inside(bearing: float, sigma: float, photo: Photo) -> float:
    """Return how much of a wrapped normal lies in the sectors of a photo."""
    if not photo.sectors:
        return 1.0

    def below(edge: float) -> float:
        return 0.5 * math.erfc(-edge / (sigma * math.sqrt(2.0)))

    return sum(
        below(end - bearing + 360.0 * lap) - below(start - bearing + 360.0 * lap)
        for start, end in photo.sectors
        for lap in LAPS
    )


def range_density(glimpse: Glimpse, thing: Thing) -> float:
    """Return the density of the logarithm of a range, 1 without a range."""
    if math.isnan(glimpse.range):
        return 1.0
    error = thing.range_sigma if math.isnan(glimpse.range_error) else glimpse.range_error
    sigma = math.hypot(error, thing.distance_sigma / thing.distance)
    away = math.log(glimpse.range / thing.distance) / sigma
    return math.exp(-0.5 * away**2) / (sigma * math.sqrt(2.0 * math.pi))


def false_density(glimpse: Glimpse, scene: Scene) -> float:
    """Return the density of a false detection: lambda_j."""
    disc = 1.0 if math.isnan(glimpse.range) else 2.0 * (glimpse.range / scene.reach) ** 2
    entering = sum(
        thing.leaving * float(np.dot(glimpse.weights, thing.names)) for thing in scene.things
    )
    return disc * (float(np.dot(glimpse.weights, scene.clutter)) + entering) / 360.0


def hit_density(glimpse: Glimpse, thing: Thing) -> float:
    """Return the density of an object being detected so: hit_ij."""
    away = abs((glimpse.bearing - thing.bearing + 180.0) % 360.0 - 180.0)
    sigma = min(math.hypot(thing.bearing_sigma, glimpse.bearing_error), 180.0)
    if away > min(thing.tails * sigma, 180.0):
        return 0.0
    return (
        thing.chance
        * float(np.dot(glimpse.weights, thing.names))
        * bearing_density(glimpse.bearing - thing.bearing, sigma)
        * range_density(glimpse, thing)
    )


def _empty(scene: Scene, photo: Photo) -> tuple[float, list[float]]:
    """Return the log-likelihood that a photo shows nothing, and the chance of missing each."""
    missed = [
        1.0 - thing.chance * mass_inside(thing.bearing, thing.bearing_sigma, photo)
        for thing in scene.things
    ]
    false = sum(scene.clutter) + sum(thing.leaving for thing in scene.things)
    return sum(map(math.log, missed)) - photo.width / 360.0 * false, missed


def set_loglik(scene: Scene, glimpses: Sequence[Glimpse], photo: Photo) -> float:
    """Return the log-likelihood of one photo as a product over its detections."""
    total, missed = _empty(scene, photo)
    for glimpse in glimpses:
        hits = [
            hit_density(glimpse, thing) / chance
            for thing, chance in zip(scene.things, missed, strict=True)
        ]
        total += math.log(false_density(glimpse, scene) + sum(hits))
    return total


def exact_loglik(scene: Scene, glimpses: Sequence[Glimpse], photo: Photo) -> float:
    """Return the log-likelihood of one photo, summed over all one-to-one associations."""
    nothing, missed = _empty(scene, photo)
    total = 0.0
    for choice in itertools.product(range(-1, len(scene.things)), repeat=len(glimpses)):
        rows = [row for row in choice if row >= 0]
        if len(set(rows)) < len(rows):
            continue
        total += math.prod(
            false_density(glimpse, scene)
            if row < 0
            else hit_density(glimpse, scene.things[row]) / missed[row]
            for glimpse, row in zip(glimpses, choice, strict=True)
        )
    return nothing + math.log(total)


def class_weights(view: View, codes: Sequence[int]) -> np.ndarray:
    """Return c_j(t), shape (n, k): one for a sure class, ones for an unknown one, else scores.

    What scores leave to any class is shared out evenly.
    """
    scores = view.class_scores()
    weights = np.ones((len(view), len(codes)))
    scored = scores[:, 0] < 1.0
    weights[scored] = scores[scored][:, list(codes)] + scores[scored, :1] / len(codes)
    return weights


def glimpses_of(view: View, codes: Sequence[int]) -> list[Glimpse]:
    """Return the detections of a view one by one."""
    assert view.bearings is not None
    blank = np.full(len(view), math.nan)
    ranges = blank if view.ranges is None else view.ranges
    errors = blank if view.range_errors is None else view.range_errors
    rough = blank if view.bearing_errors is None else view.bearing_errors
    weights = class_weights(view, codes).tolist()
    columns = (view.bearings, ranges, errors, np.nan_to_num(rough))
    return [
        Glimpse(
            bearing=bearing,
            weights=chances,
            range=metres,
            range_error=error,
            bearing_error=more,
        )
        for chances, bearing, metres, error, more in zip(
            weights, *(column.tolist() for column in columns), strict=True
        )
    ]


def fading(spec: NoiseSpec, name: str, distance: float) -> float:
    """Return the relative chance of detection at a distance."""
    points = spec.fading.get(name, spec.fading.get("all"))
    if points is None:
        return 1.0
    metres, shares = np.transpose(points)
    return float(np.interp(distance, metres, shares))


def in_range(distance: float, limit: float, sigma: float) -> float:
    """Return the chance that an object is in range of an observer with a position error."""
    return 0.5 * math.erfc((distance - limit) / (sigma * math.sqrt(2.0))) if sigma else 1.0


def scene_of(
    database: SignatureDatabase,
    cell: int,
    spec: NoiseSpec,
    table: NoiseTable,
    *,
    tails: float = math.inf,
) -> Scene:
    """Return what a cell sees by a noise model."""
    limits = database.taxonomy.ranges(database.spec.radius)
    views = visible_objects_in(database, np.array([cell]))
    row = int(table.length_rows(views.lengths)[0])
    things = []
    for code, bearing, distance in zip(
        views.codes.tolist(), views.bearings.tolist(), views.distances.tolist(), strict=True
    ):
        kind, name = int(table.row_of[code]), database.taxonomy.by_code(code).name
        metres = max(distance, 0.5 * database.reach / 255.0)  # the middle of the first unit
        turned = math.degrees(spec.position_sigma / metres)
        detected = (1.0 - float(table.missed[row, kind])) * fading(spec, name, metres)
        inside = in_range(metres, float(limits[code]), spec.position_sigma)
        things.append(
            Thing(
                chance=detected * inside,
                names=table.named(row)[kind].tolist(),
                bearing=bearing,
                bearing_sigma=min(math.hypot(float(table.sigma[kind]), turned), 180.0),
                distance=metres,
                range_sigma=spec.range_sigma_by_class.get(name, spec.range_sigma),
                distance_sigma=spec.position_sigma,
                leaving=detected * (1.0 - inside),
                tails=tails,
            )
        )
    return Scene(things=things, clutter=table.clutter.tolist(), reach=database.reach)


def turned_loglik(
    scene: Scene,
    view: View,
    codes: Sequence[int],
    headings: Iterable[Sequence[tuple[float, float]]],
    form: Callable[[Scene, Sequence[Glimpse], Photo], float] = exact_loglik,
) -> float:
    """Return the log-likelihood of all photos, given turns and their chances for each of them."""
    total = 0.0
    for part, turns in zip(view.split(), headings, strict=True):
        each = []
        for turn, chance in turns:
            turned = part.turned(turn)
            glimpses = glimpses_of(turned, codes)
            each.append(math.log(chance) + form(scene, glimpses, turned.photos[0]))
        total += float(np.logaddexp.reduce(each))
    return total


def cell_loglik(
    database: SignatureDatabase,
    query: Signature,
    noise: Noise,
    cell: int,
    *,
    headings: Iterable[Sequence[tuple[float, float]]] | None = None,
    form: Callable[[Scene, Sequence[Glimpse], Photo], float] = exact_loglik,
    tails: float = math.inf,
) -> float:
    """Return the log-likelihood of a view in a cell; `form` is `exact_loglik` or `set_loglik`.

    `headings` has for each photo the turns (degrees that are added to its bearings and sectors) and
    their chances; none by default.
    """
    view = View.of(query)
    turns = [[(0.0, 1.0)]] * len(view.photos) if headings is None else list(headings)
    codes = database.present_codes.tolist()
    each = []
    for spec, table, chance in zip(noise.specs, *database_tables(database, noise), strict=True):
        scene = scene_of(database, cell, spec, table, tails=tails)
        each.append(math.log(chance) + turned_loglik(scene, view, codes, turns, form))
    return float(np.logaddexp.reduce(each))


def random_view(
    database: SignatureDatabase, rng: np.random.Generator, *, size: int, photos: Sequence[Photo]
) -> View:
    """Return a view of random detections, half near objects of the first cell.

    A third have ranges, a third of these errors of their own, a third have scores, and a third
    rough bearings.
    """
    parts, codes = [], database.present_codes
    first = visible_objects_in(database, np.array([0]))
    for photo in photos:
        near = rng.integers(0, len(first.codes), size)
        real = rng.random(size) < 0.5
        bearings = np.where(
            real, first.bearings[near] + rng.normal(0, 4, size), rng.uniform(0, 360, size)
        )
        metres = np.maximum(first.distances[near], 1.0) * np.exp(rng.normal(0, 0.3, size))
        names = np.where(real, first.codes[near], rng.choice(np.append(codes, 0), size))
        sure, ranged, own, exact = rng.random((4, size)) > 1 / 3
        scores = np.eye(256)[names]
        for row in np.flatnonzero(~sure):
            scores[row] = 0.0
            picked = np.append(rng.choice(codes, min(2, len(codes)), replace=False), 0)
            scores[row, picked] = rng.dirichlet(np.ones(len(picked)))
        parts.append(
            View(
                names,
                bearings % 360.0,
                ranges=np.where(ranged, np.nan, metres),
                range_errors=np.where(own, np.nan, rng.uniform(0.1, 0.5, size)),
                bearing_errors=np.where(exact, np.nan, rng.uniform(2.0, 40.0, size)),
                scores=None if sure.all() else scores,
                photos=(photo,),
            )
        )
    return View.joined(parts)
