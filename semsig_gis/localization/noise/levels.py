"""A mixture of the levels at which a detector works from view to view.

Whether the things in a view are detected is not decided by each thing: a parked van, a low sun or a
narrow street hides many at once. `level_mixture` has a model for each level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from semsig_gis.localization.noise.model import NoiseMixture

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.localization.noise.model import Noise, NoiseSpec

MOST_DETECTION = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """A level of detection: its chance `weight`, and factors of a `NoiseSpec`.

    `detection` multiplies the chance of detection and the number of false objects, which are mostly
    things that are not in the map; `reach` multiplies the distances of the fading.
    """

    weight: float
    detection: float = 1.0
    reach: float = 1.0


def level_mixture(spec: NoiseSpec, levels: Sequence[Level]) -> Noise:
    """Return the noise of a detector that works at one of some levels, unknown which.

    Weights are normalised. The result of a single level is a plain model.
    """
    total = sum(level.weight for level in levels)
    specs = tuple(_at_level(spec, level) for level in levels)
    if len(specs) == 1:
        return replace(specs[0], name=spec.name)
    weights = tuple(level.weight / total for level in levels)
    return NoiseMixture(specs=specs, weights=weights, name=spec.name)


def _at_level(spec: NoiseSpec, level: Level) -> NoiseSpec:
    """Return the model of a level."""

    def scaled(chance: float) -> float:
        return min(chance * level.detection, max(chance, MOST_DETECTION))

    def stretched(points: Sequence[Sequence[float]]) -> tuple[tuple[float, float], ...]:
        return tuple((metres * level.reach, share) for metres, share in points)

    def each(values: Mapping[str, float]) -> dict[str, float]:
        return {name: scaled(value) for name, value in values.items()}

    return replace(
        spec,
        detection=scaled(spec.detection),
        detection_by_class=each(spec.detection_by_class),
        clutter=spec.clutter * level.detection,
        fading={name: stretched(points) for name, points in spec.fading.items()},
        name=f"{spec.name}, detection x {level.detection:g}, reach x {level.reach:g}",
    )
