"""Adapt a noise model to views of unknown places from one camera and detector.

The views of one detector have the same errors. A first model gives the likely places of each view,
and expectation-maximisation over these places gives the next model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import Displayed, InputError, each_in_order, percent
from semsig_gis.localization.learning.learn import Sample, learn_noise
from semsig_gis.localization.likelihood.index import build_index
from semsig_gis.localization.likelihood.locate import LikelihoodLocator
from semsig_gis.localization.likelihood.posterior import posterior
from semsig_gis.localization.noise.model import NoiseMixture, cell_noise
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Signature
    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.localization.noise.model import Noise

FEWEST_VIEWS = 20
FEWEST_DETECTIONS = 3  # of a view that is used
PLACES = 8  # likely places of each view
START_SHARE = 0.2
"""Weight of the first model in the result, so that it does not become too sure of itself."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Adaptation(Displayed):
    """A noise model that was adapted to views without known places.

    `noise` is the adapted model, or the first one if the views do not show that another is better.
    `gain` is how much larger the mean log-likelihood of a view is by a model adapted to other
    views, with the standard deviation `gain_sigma`; `views` is the number of views used.
    """

    noise: Noise
    adapted: bool
    gain: float
    gain_sigma: float
    views: int

    def _facts(self) -> dict[str, object]:
        return {
            "noise": self.noise.name,
            "adapted": self.adapted,
            "gain": f"{self.gain:.3f} ± {self.gain_sigma:.3f}",
            "views": self.views,
        }

    @property
    def sentence(self) -> str:
        """What was done, in one sentence."""
        gain = f"{self.gain:+.2f} ± {self.gain_sigma:.2f} in the log-likelihood of a view"
        if self.adapted:
            return (
                f"The noise was adapted to {self.views:,} views; held-out views gain {gain}, and "
                f"the first model keeps {percent(START_SHARE)} of the chance."
            )
        return (
            f"The {self.views:,} views do not show that another noise model is better ({gain} for "
            "held-out views), so the first one was used; give more views of this detector, or "
            "samples of known places to `semsig learn`."
        )


def adapt_noise(
    views: Sequence[Signature],
    database: SignatureDatabase,
    noise: Noise,
    *,
    store: ObjectStore,
    north_sigma: float = 0.0,
    name: str = "adapted",
) -> Adaptation:
    """Adapt a noise model to views of unknown places from one camera and detector.

    Parameters
    ----------
    views : sequence of Signature
        Views with bearings from grid north and types or scores; those of fewer than three
        detections, which say little about their place, are not used. At least 20 are needed.
    database : SignatureDatabase
        The cells that may contain the places.
    noise : NoiseSpec or NoiseMixture
        The first model, such as ``named_noise("photo")``.
    store : ObjectStore
        The street objects of the database.
    north_sigma : float, default 0
        Standard deviation of the north of the views in degrees; infinite if unknown.
    name : str, default "adapted"
        Name of the model.

    Returns
    -------
    Adaptation
        The model, and whether it is better than the first one for held-out views.

    Raises
    ------
    InputError
        If there are too few views.

    Notes
    -----
    This is a round of stochastic expectation-maximisation (Celeux and Diebolt 1985): each view
    stands at eight places, drawn by their chances under the first model, and `learn_noise` learns
    from them. More rounds would make the model too sure of itself, because wrong places that fit
    well count as right ones. A model of one half of the views must raise the likelihood of the
    other half by more than the standard deviation of the gain.

    Examples
    --------
    >>> from semsig_gis import ObjectStore, named_noise
    >>> store = ObjectStore.of(demo_objects)
    >>> adapt_noise([], demo_database, named_noise("photo"), store=store)
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: 0 views have three detections or more with bearings, which \
is too few to adapt a noise model to; give at least 20.
    """
    present = database.present_codes
    photos = [
        photo.select(photo.among(present))
        for view in views
        if view.bearings is not None
        for photo in View.of(view).split()
    ]
    photos = [photo for photo in photos if len(photo) >= FEWEST_DETECTIONS]
    if len(photos) < FEWEST_VIEWS:
        raise InputError(
            f"{len(photos)} views have three detections or more with bearings, which is too few "
            f"to adapt a noise model to; give at least {FEWEST_VIEWS}."
        )
    search = _Search(database=database, store=store, north_sigma=north_sigma)
    before, places = search.places(photos, noise)
    trial = search.fitted(photos[::2], places[::2], noise, name)
    after, _ = search.places(photos[1::2], trial)
    gains = after - before[1::2]
    gain, sigma = float(gains.mean()), float(gains.std() / math.sqrt(len(gains)))
    adapted = gain > sigma
    result = search.fitted(photos, places, noise, name) if adapted else noise
    return Adaptation(noise=result, adapted=adapted, gain=gain, gain_sigma=sigma, views=len(photos))


_Places = tuple["NDArray[np.float64]", "NDArray[np.float64]"]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Search:
    """The cells and street objects among which the places of views are looked for."""

    database: SignatureDatabase
    store: ObjectStore
    north_sigma: float

    def places(
        self, photos: Sequence[View], noise: Noise
    ) -> tuple[NDArray[np.float64], list[_Places]]:
        """Return the log evidence of each photo, and its likely places by a noise model.

        The places of a photo are coordinates and degrees to turn the photo by, drawn by their
        chances.
        """
        index = build_index(self.database, cell_noise(noise, self.database.grid.step))
        locator = LikelihoodLocator(index=index, north_sigma=self.north_sigma)

        def find(photo: View) -> tuple[float, _Places]:
            scores = locator.scores(photo)
            chances = posterior(self.database, scores.loglik)
            parts = locator.parts(photo, scores, chances, self.store)
            # Systematic sampling: one part for each equal share of the chance.
            ends = np.cumsum(parts.chances)
            shares = (np.arange(PLACES) + 0.5) / PLACES * ends[-1]
            rows = np.searchsorted(ends, shares)
            return chances.log_evidence, (parts.places[rows], parts.headings[rows])

        evidence, places = zip(*each_in_order(find, photos), strict=True)
        return np.array(evidence), list(places)

    def fitted(
        self, photos: Sequence[View], places: Sequence[_Places], noise: Noise, name: str
    ) -> Noise:
        """Return the model of photos at likely places, mixed with the first model."""
        samples = [
            Sample(signature=photo.turned(turn), xy=(x, y))
            for photo, (points, turns) in zip(photos, places, strict=True)
            for (x, y), turn in zip(points.tolist(), turns.tolist(), strict=True)
        ]
        points = np.concatenate([points for points, _ in places])
        footprints = self.store.buildings_around(
            points, distance=self.database.near_reach, occlusion=self.database.occlusion
        )
        radius = self.database.spec.radius
        objects = self.store.objects
        learnt = learn_noise(samples, objects, radius=radius, footprints=footprints).noise
        return NoiseMixture(
            specs=(*learnt.specs, *noise.specs),
            weights=tuple(
                [(1.0 - START_SHARE) * weight for weight in learnt.weights]
                + [START_SHARE * weight for weight in noise.weights]
            ),
            name=name,
        )
