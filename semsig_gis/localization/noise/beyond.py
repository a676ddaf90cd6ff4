"""Objects that are seen from beyond the visibility range of a database."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.localization.noise.families import noise_by_class
from semsig_gis.localization.noise.model import ALL

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.noise.model import Noise, NoiseSpec

STEP_M = 1.0  # of the sum over distances, in metres


def noise_with_objects_beyond(noise: Noise, database: SignatureDatabase) -> Noise:
    """Return the noise for a database, with the objects seen from beyond its range as clutter.

    The chance of detection of a class falls to the last distance of its `NoiseSpec.fading`. The
    signatures end at the visibility range of the class; what is seen between the two distances is
    clutter, with the mean density of the class in the signatures. The fading of the result ends at
    the range, so that a second call changes nothing.
    """
    present = database.present_codes
    classes = [database.taxonomy.by_code(code) for code in present.tolist()]
    ranges = database.taxonomy.ranges(database.spec.radius)[present]
    counts = database.occurrences[present] / len(database)
    densities = counts / (np.pi * ranges**2)

    def change(spec: NoiseSpec) -> NoiseSpec:
        if not any(points[-1][0] > ranges.max() for points in spec.fading.values()):
            return spec
        shares = spec.clutter_shares or {item.name: 1.0 / len(classes) for item in classes}
        clutter = {item.name: spec.clutter * shares.get(item.name, 0.0) for item in classes}
        fading = dict(spec.fading)
        for item, limit, density in zip(classes, ranges.tolist(), densities.tolist(), strict=True):
            points = spec.fading.get(item.name, spec.fading.get(ALL, ((limit, 1.0),)))
            metres, remaining = np.array(points, dtype=np.float64).T
            if metres[-1] <= limit:
                continue
            beyond = np.arange(limit, metres[-1], STEP_M) + STEP_M / 2.0
            amounts = np.interp(beyond, metres, remaining) * 2.0 * np.pi * beyond * STEP_M
            detection = spec.detection_by_class.get(item.name, spec.detection)
            clutter[item.name] += float(density * detection * amounts.sum())
            inside = metres < limit
            fading[item.name] = (
                *zip(metres[inside].tolist(), remaining[inside].tolist(), strict=True),
                (limit, float(np.interp(limit, metres, remaining))),
            )
        total = sum(clutter.values())
        return replace(
            spec,
            clutter=total,
            clutter_shares={name: value / total for name, value in clutter.items()}
            if total
            else {},
            fading={name: fading[name] for name in fading if name != ALL},
        )

    plain = noise_by_class(noise, database.taxonomy, set(present.tolist()))
    return plain.changed(change)
