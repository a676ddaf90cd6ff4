"""Learn how a detector fails from detections whose true place is known.

Which detection is which object is not known, so the chances of all one-to-one associations under
the present model weigh what is counted, and the counts give the next model, until nothing changes
(expectation-maximisation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from semsig_gis.database import SignatureDatabase
from semsig_gis.errors import InputError
from semsig_gis.grid import cell_ids
from semsig_gis.noise import NoiseSpec
from semsig_gis.noise_fit import (
    expected_counts,
    gather_evidence,
    model_change,
    next_model,
    starting_model,
)
from semsig_gis.noise_rates import ALL, estimated_rates
from semsig_gis.spatial_index import ObjectIndex
from semsig_gis.views import views_at, views_in

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.noise_fit import Evidence
    from semsig_gis.noise_table import NoiseTable
    from semsig_gis.objects import StreetObjects
    from semsig_gis.occlusion import Footprints
    from semsig_gis.samples import Sample
    from semsig_gis.views import Views

__all__ = ["NoiseEstimate", "learn_noise"]

MOST_ROUNDS = 500
SETTLED = 1e-4  # largest change of a log-odds or logarithm


@dataclass(frozen=True, eq=False, kw_only=True)
class NoiseEstimate:
    """A noise model that was learnt, and how well it is known.

    `rates` has one row for each quantity (``detection``, ``misnamed``, ``clutter`` in false objects
    per signature, ``bearing_sigma`` in degrees) and each class, and ``"all"`` together: ``value``
    as in the model; ``own``, what the samples of the class alone say, with its intervals
    ``low_90``, ``high_90``, ``low_95``, ``high_95``; and ``samples``, how many objects, detected
    objects, signatures or detected objects it rests on.

    `confusion` holds the expected number of detected objects by true class (rows) and given class
    (columns). `skipped` samples were left out, as nothing is in sight of their place. `rounds` says
    how many it took to settle, and `log_likelihood` is of all detections under the model.
    """

    spec: NoiseSpec
    rates: pd.DataFrame
    confusion: pd.DataFrame
    samples: int
    objects: int
    detections: int
    skipped: int
    rounds: int
    log_likelihood: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; ``confusion`` is by true class, then given class."""
        return {
            "spec": self.spec.to_dict(),
            "rates": self.rates.to_dict("records"),
            "confusion": self.confusion.to_dict("index"),
            "samples": self.samples,
            "objects": self.objects,
            "detections": self.detections,
            "skipped": self.skipped,
            "rounds": self.rounds,
            "log_likelihood": self.log_likelihood,
        }


def learn_noise(
    samples: Sequence[Sample],
    city: SignatureDatabase | StreetObjects,
    *,
    radius: float = 30.0,
    position_sigma: float = 0.0,
    footprints: Footprints | None = None,
    name: str = "learned",
) -> NoiseEstimate:
    """Estimate a noise model from detections whose true place is known.

    Parameters
    ----------
    samples : sequence of Sample
        The detections; some hundred signatures serve well.
    city : SignatureDatabase or StreetObjects
        What there is to see. With a database a sample is looked up by its cell, and seen from
        the middle of it; with street objects it is seen from where it was.
    radius : float, default 30
        Visibility range in metres, with street objects; a database has its own.
    position_sigma : float, default 0
        Known standard deviation in metres, each way, of the true places given (with a database,
        of the place in its cell: ``step / 12 ** 0.5`` for places anywhere in it). What it turns
        the bearings by is not counted as bearing noise.
    footprints : Footprints, optional
        Buildings, with street objects; what they hide is not seen.
    name : str, default "learned"
        Name of the model.

    Returns
    -------
    NoiseEstimate
        The model with intervals.

    Raises
    ------
    InputError
        If there are no samples, none can be used, or there is nothing to see or no detection.

    Notes
    -----
    A class with n samples and the rate r of its own is given
    ``(n * r + 8 * overall) / (n + 8)``, that is, the overall rate counts for eight samples; the
    squares of deviations likewise, and a row of the confusion is filled up with eight samples
    that are misnamed as often as all are, each other class alike. See
    `semsig_gis.noise_rates` for the intervals.
    """
    if not (math.isfinite(position_sigma) and position_sigma >= 0):
        msg = f"the deviation of the places is {position_sigma} m; give metres, 0 or more."
        raise InputError(msg)
    views, used = _true_views(samples, city, radius, footprints)
    detected = [samples[row].signature for row in used]
    evidence = gather_evidence(views, detected, taxonomy=city.taxonomy)
    model = starting_model(evidence, position_sigma=position_sigma)
    rounds, change = 0, math.inf
    while change >= SETTLED and rounds < MOST_ROUNDS:
        old, model = model, next_model(evidence, expected_counts(evidence, model), model)
        change = model_change(old, model)
        rounds += 1
    counts = expected_counts(evidence, model)
    rates = estimated_rates(evidence, counts, model)
    return NoiseEstimate(
        spec=_spec(evidence, rates, model, name),
        rates=rates,
        confusion=pd.DataFrame(counts.named, index=evidence.names, columns=evidence.names),
        samples=len(used),
        objects=len(evidence.kinds),
        detections=len(evidence.given),
        skipped=len(samples) - len(used),
        rounds=rounds,
        log_likelihood=counts.log_likelihood,
    )


def _true_views(
    samples: Sequence[Sample],
    city: SignatureDatabase | StreetObjects,
    radius: float,
    footprints: Footprints | None,
) -> tuple[Views, list[int]]:
    """Return what there was to see in the samples that can be used, and which these are."""
    if not samples:
        msg = "there are no samples to learn from; give detections with their true places."
        raise InputError(msg)
    if not isinstance(city, SignatureDatabase):
        places = [sample.xy for sample in samples if sample.xy is not None]
        if len(places) < len(samples):
            msg = "a sample gives its cell alone; give x and y, or a database instead of objects."
            raise InputError(msg)
        index = ObjectIndex(city.xy)
        xy = np.array(places)
        views = views_at(city, xy, index=index, radius=radius, footprints=footprints)
        found = np.flatnonzero(views.lengths)
        if len(found) < len(places):  # as a cell that sees nothing is not in a database
            _require_some(len(found), len(places), city.crs)
            views = views_at(city, xy[found], index=index, radius=radius, footprints=footprints)
        return views, found.tolist()
    wanted = np.array(
        [
            sample.cell_id
            if sample.cell_id is not None
            else int(cell_ids(*city.grid.cells_at(np.array([sample.xy])))[0])
            for sample in samples
        ]
    )
    ids = city.cell_ids
    cells = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
    found = np.flatnonzero(ids[cells] == wanted)
    _require_some(len(found), len(samples), city.crs)
    return views_in(city, cells[found]), found.tolist()


def _require_some(found: int, samples: int, crs: CRS) -> None:
    if found == 0:
        msg = (
            f"none of the {samples} samples lies where an object of the city is in sight; give "
            f"places in its coordinate reference system ({crs.to_string()}), or its cell ids."
        )
        raise InputError(msg)


def _spec(evidence: Evidence, rates: pd.DataFrame, model: NoiseTable, name: str) -> NoiseSpec:
    """Return the model as a specification."""
    overall = rates[rates["class"] == ALL].set_index("quantity")["value"].to_dict()

    def by_class(values: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(evidence.names, values.tolist(), strict=True))

    named = model.named[0]
    clutter = float(model.clutter.sum())
    return NoiseSpec(
        detection=overall["detection"],
        detection_by_class=by_class(1.0 - model.missed[0]),
        misnamed=overall["misnamed"],
        confusion={
            kind: by_class(row / row.sum()) for kind, row in zip(evidence.names, named, strict=True)
        },
        clutter=clutter,
        clutter_shares=by_class(model.clutter / clutter),
        bearing_sigma=overall["bearing_sigma"],
        bearing_sigma_by_class=by_class(model.sigma),
        position_sigma=model.position_sigma,
        name=name,
    )
