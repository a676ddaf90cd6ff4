"""Records of arrays that the kernels take: numba reads named tuples without a conversion."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

BINS = 512
"""Bearing steps of an object."""
DISTANCE_LEVELS = 64
"""Distances at which errors are computed."""
COARSE_BINS, COARSE_LEVELS = 128, 16
"""Bearing and distance steps of `kernels.scan_gains`."""
LANES = 8
"""Detections that `kernels.scan` adds up together."""


class BinnedObjects(NamedTuple):
    """What is seen from n places (cells or points in them), for `kernels.scan`.

    Place i sees the objects ``offsets[i]:offsets[i + 1]``: their class rows are `kinds`, their
    `bins` are ``level of the distance * bins of a turn + bin of the bearing``.
    """

    offsets: NDArray[np.int64]
    kinds: NDArray[np.uint8]
    bins: NDArray[np.uint16]


class LevelModel(NamedTuple):
    """The mean noise model at some distance levels, for `kernels.scan`.

    `group_of` is the group of a class row; classes of a group have the same errors. `detected`,
    shape (lengths, k), is the chance of detection of a near object, `remaining` and `leaving`,
    shape (k, levels), are the shares of it that remain at a distance and that are out of range.
    """

    group_of: NDArray[np.int64]
    detected: NDArray[np.float32]
    remaining: NDArray[np.float32]
    leaving: NDArray[np.float32]


class PhotoRows(NamedTuple):
    """A photo of n detections against all that an object may be, for `kernels.scan`.

    `rows` are the densities of `kernels.profile_rows`, `masses` those of
    `association_kernels.mass_rows`, empty if the photo is a full turn. `naming`, shape
    (lengths, k, n), is the chance of a name over the density of such false detections, `disc` (n,)
    the factor of their range, per degree. `width` is the share of the turn that the photo shows,
    `base` the score of a place without objects. `kernels.scan` takes n in whole blocks of `LANES`.
    """

    rows: NDArray[np.float32]
    masses: NDArray[np.float32]
    naming: NDArray[np.float32]
    disc: NDArray[np.float32]
    width: float
    base: float


class PhotoGains(NamedTuple):
    """A photo of at most `LANES` detections of known north, for `kernels.scan_gains`.

    `gains`, shape (lengths, kinds, levels, bins, LANES), are the logarithms, in eighths of an
    octave, of 1 plus what an object adds to the sum of each detection. Lengths of signatures with
    about the same chances share a row, `length_of`, and so do classes that the photo does not
    distinguish, `kind_of`. `missed`, by length, class row and level, is the logarithm that an
    object adds because it may be missed, and `inside`, shape (lengths, kinds, levels, bins), takes
    its place if the photo is not a full turn. `base` is the score of a place without objects.
    """

    gains: NDArray[np.uint8]
    length_of: NDArray[np.uint64]
    kind_of: NDArray[np.uint64]
    missed: NDArray[np.float32]
    inside: NDArray[np.float32]
    base: float


class TurnedPhoto(NamedTuple):
    """A photo of uncertain north with n detections of classes, for `kernels.scan_profiles`.

    `rows`, shape (groups, levels, steps, 2 * turns), are densities by bearing for objects at each
    step inside a turn. `own` and `other`, shape (lengths, k), are the chances of the right name and
    of a likely other one over the density of such false detections. `profile_of` is the profile of
    a class row, 0 for classes that are not in the photo; `profiles` and `sectors` (n,) are those of
    the detections. `chances` are those of the turns, `base` the score of a place without objects.
    """

    rows: NDArray[np.float32]
    own: NDArray[np.float32]
    other: NDArray[np.float32]
    profile_of: NDArray[np.int64]
    profiles: NDArray[np.int64]
    sectors: NDArray[np.int64]
    chances: NDArray[np.float32]
    base: float


class PlaceObjects(NamedTuple):
    """What is seen from n places, for `association_kernels.sum_associations`.

    Place i sees the objects ``offsets[i]:offsets[i + 1]``, with class rows `kinds`, in units of the
    database. Some are `beyond` the range: seen only by an observer elsewhere in the cell.
    `extent_sigma` is the deviation in degrees of bearings because objects are extended; it is empty
    if none are.
    """

    offsets: NDArray[np.int64]
    kinds: NDArray[np.int64]
    bearing_units: NDArray[np.uint16]
    distance_units: NDArray[np.uint8]
    beyond: NDArray[np.bool_]
    extent_sigma: NDArray[np.float64]


class PhotoArrays(NamedTuple):
    """A photo of n detections, for `association_kernels.sum_associations`.

    `bearing_errors` are added to those of the models, 0 for none. `ranges` are NaN where unknown,
    `range_sigma`, shape (models, k, n), their relative errors. The
    score of a name is `own`, shape (k, n), if the class is right, and `other`, shape (models, k,
    n), if the object is misnamed; `density`, shape (models, n), is that of false detections, in
    which `disc` (n,) is the factor of the range. `sectors`, shape (s, 2), are empty if the photo
    is a full turn; `width` is the share of the turn that it shows.
    """

    bearings: NDArray[np.float64]
    bearing_errors: NDArray[np.float64]
    ranges: NDArray[np.float64]
    range_sigma: NDArray[np.float64]
    own: NDArray[np.float64]
    other: NDArray[np.float64]
    density: NDArray[np.float64]
    disc: NDArray[np.float64]
    sectors: NDArray[np.float64]
    width: float


class TurnGrid(NamedTuple):
    """Turns of a photo at n places in degrees, shape (n, turns), and the log of their priors."""

    degrees: NDArray[np.float64]
    log_prior: NDArray[np.float64]
