"""Learn a noise model from detections at known places."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from semsig_gis.core import WILDCARD, Displayed, InputError, ObjectIndex, cell_ids
from semsig_gis.database import SignatureDatabase, visible_objects_at, visible_objects_in
from semsig_gis.localization.learning.fit import (
    ALL,
    KNOTS,
    LEAST,
    PRIOR_SAMPLES,
    detection_falls,
    estimated_rates,
    expected_counts,
    fading_at_knots,
    gather_evidence,
    model_change,
    next_model,
)
from semsig_gis.localization.learning.headings import turned_evidence
from semsig_gis.localization.learning.level_weights import detection_levels
from semsig_gis.localization.noise.levels import level_mixture
from semsig_gis.localization.noise.model import MixtureRecord, NoiseSpec, SpecRecord
from semsig_gis.observation import RADIUS_M, SEEN, View, check_north, parse_view
from semsig_gis.storage import read_rows, row_value

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.core import Signature, Taxonomy
    from semsig_gis.database import Footprints, VisibleObjects
    from semsig_gis.localization.learning.fit import Evidence
    from semsig_gis.localization.noise.levels import Level
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.noise.table import NoiseTable
    from semsig_gis.objects import StreetObjects
    from semsig_gis.storage import Row

REPEAT = 0.5  # of photographs of one place (see `NoiseSpec.repeat`)
MOST_ROUNDS = 500
# Samples suffice if the 90 % interval of a quantity is within a factor, or as narrow as this.
NARROW_FACTOR, NARROW = 1.5, 0.05
SCAN_ROUNDS = 20  # of the fit after each scan but the last
SCANS = 4  # for the headings of photos of uncertain north, each with a better model
CONVERGED = 1e-5  # largest change of a log-odds or logarithm in the last round
MEMORY = 8  # earlier rounds from which totals are extrapolated
LARGEST_FALL = 0.01  # of the log-likelihood from one round to the next


@dataclass(frozen=True, eq=False, kw_only=True)
class Sample:
    """The detections, perhaps none, at a known place.

    The place is either `xy`, in metres in the CRS of the city, or `cell_id` (see
    `core.geometry.cell_ids`). The signature, which may be a `View`, must have types, all known, or
    scores, and bearings. The north of its photos may be uncertain or unknown.
    """

    signature: Signature
    xy: tuple[float, float] | None = None
    cell_id: int | None = None

    def __post_init__(self) -> None:  # noqa: D105
        if (self.xy is None) == (self.cell_id is None):
            raise InputError(
                "a sample needs its true place; give either its x and y or its cell_id."
            )
        if self.xy is not None and not np.isfinite(self.xy).all():
            raise InputError(
                f"the place of a sample is {self.xy}; give two finite coordinates in metres."
            )
        view = View.of(self.signature)
        if (view.codes is None and view.scores is None) or view.bearings is None:
            raise InputError(
                "a sample needs the types and the bearings of its detections; give both."
            )
        if (view.class_scores()[:, WILDCARD] == 1).any():
            raise InputError(
                "a sample has a detection of unknown class; give its class, or leave it out."
            )


def read_samples(path: str | Path, *, taxonomy: Taxonomy, radius: float = RADIUS_M) -> list[Sample]:
    r"""Read detections with their true places.

    Parameters
    ----------
    path : str or Path
        A CSV file with the columns ``types`` (symbols such as ``DDB``), ``bearings`` (degrees,
        with blanks, commas or semicolons between them) and either ``x`` and ``y`` or
        ``cell_id``; or JSON lines with the same names (suffix ``.jsonl``, ``.ndjson`` or
        ``.json``), where bearings may be a list. All other columns that `parse_view` reads are
        accepted as well. Further columns are ignored; a row without detections is also a sample.
    taxonomy : Taxonomy
        Classes of the symbols.
    radius : float, default 30
        Visibility range of the city in metres; near, middle and far are thirds of it.

    Returns
    -------
    list of Sample
        One per row.

    Raises
    ------
    InputError
        If the file cannot be read, has no rows, or a row cannot be used; with its number.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from semsig_gis import paper_taxonomy
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "seen.csv")
    ...     _ = path.write_text("x,y,types,bearings\n500000,5400000,DB,200 -10\n")
    ...     sample = read_samples(path, taxonomy=paper_taxonomy())[0]
    >>> sample.xy, sample.signature.bearings.tolist()
    ((500000.0, 5400000.0), [200.0, 350.0])
    """
    rows = read_rows(path, lambda row: _sample(row, taxonomy, radius), what="sample")
    return [sample for _, sample in rows]


def _sample(row: Row, taxonomy: Taxonomy, radius: float) -> Sample:
    columns = {name for name in SEEN if row.get(name) is not None}
    for name in ("types", "bearings"):
        if columns <= {"types", "bearings"} - {name}:
            raise InputError(f"it has no {name}")
    signature = parse_view(row, taxonomy=taxonomy, radius=radius)
    x, y, cell = (row_value(row, name) for name in ("x", "y", "cell_id"))
    if x is not None and y is not None:
        return Sample(signature=signature, xy=(float(x), float(y)))
    return Sample(signature=signature, cell_id=None if cell is None else int(cell))


RateRecord = TypedDict(
    "RateRecord",
    {
        "quantity": str,
        "class": str,
        "distance": float | None,
        "value": float,
        "own": float | None,
        "low_90": float | None,
        "high_90": float | None,
        "low_95": float | None,
        "high_95": float | None,
        "samples": float,
    },
)
"""A row of `NoiseEstimate.rates` as plain values."""


class VerdictRecord(TypedDict):
    """Whether the samples suffice for a quantity, and the classes with few of their own."""

    enough: bool
    few: list[str]


class LearntRecord(TypedDict):
    """A noise model that was learnt, as plain values."""

    spec: SpecRecord
    levels: list[dict[str, float]]
    rates: list[RateRecord]
    confusion: dict[str, dict[str, float]]
    samples: int
    objects: int
    detections: int
    skipped: int
    rounds: int
    log_likelihood: float
    verdicts: dict[str, VerdictRecord]


LearnRecord = LearntRecord | SpecRecord | MixtureRecord
"""What is learnt: with the intervals from known places, else only the noise model."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class NoiseEstimate(Displayed):
    """A learnt noise model with its uncertainty.

    `rates` has a row for each quantity (``detection``, ``misnamed``, ``clutter`` in false objects a
    full turn, ``bearing_sigma`` in degrees and, with ranges, ``range_sigma``) and each class, and
    for ``"all"`` together: ``value`` as in the model, ``own`` from only the samples of the class,
    with the intervals ``low_90`` to ``high_95``, and the number of ``samples``. If detection falls
    with distance, it is the chance at ``distance`` metres, with rows ``fading`` for the chances
    farther away. `confusion` is the expected number of detected objects by true class (rows) and
    given class (columns). No object is visible from the places of `skipped` samples.
    `log_likelihood` is that of all detections under the model. `levels` are those at which the
    detector works from view to view (see `level_mixture`); `noise` is the model with these levels.
    """

    spec: NoiseSpec
    levels: tuple[Level, ...]
    rates: pd.DataFrame
    confusion: pd.DataFrame
    samples: int
    objects: int
    detections: int
    skipped: int
    rounds: int
    log_likelihood: float

    def _facts(self) -> dict[str, object]:
        return {
            "samples": self.samples,
            "objects": self.objects,
            "detections": self.detections,
            "skipped": self.skipped,
            "detection": f"{self.spec.detection:.3g}",
            "misnamed": f"{self.spec.misnamed:.3g}",
            "clutter": f"{self.spec.clutter:.3g}",
            "bearing": f"±{self.spec.bearing_sigma:.3g}°",
        }

    @property
    def verdicts(self) -> dict[str, VerdictRecord]:
        """Whether the samples suffice, by quantity.

        They are ``enough`` if the 90 % interval of all classes together is within a factor of 1.5,
        or at most 0.05 wide; ``few`` are the classes with fewer than 8 samples of their own, which
        depend more on the rate of all classes than on these.
        """
        verdicts: dict[str, VerdictRecord] = {}
        for quantity, rows in self.rates.groupby("quantity", sort=False):
            low, high = rows.loc[rows["class"] == ALL, ["low_90", "high_90"]].to_numpy().T
            narrow = (high <= NARROW_FACTOR * low) | (high - low <= NARROW)
            own = rows[rows["class"] != ALL].groupby("class", sort=False)["samples"].sum()
            few = own.index[own < PRIOR_SAMPLES].tolist()
            verdicts[str(quantity)] = {"enough": bool(narrow.all()), "few": few}
        return verdicts

    @property
    def noise(self) -> Noise:
        """The model with its levels: a mixture, or `spec` if the levels explain hardly more."""
        return level_mixture(self.spec, self.levels)

    def to_dict(self) -> LearntRecord:
        """Return plain values for JSON; ``confusion`` is by true class, then given class."""
        rates: Any = self.rates.astype(object).where(self.rates.notna(), None).to_dict("records")
        confusion: Any = self.confusion.to_dict("index")
        return {
            "spec": self.spec.to_dict(),
            "levels": [asdict(level) for level in self.levels],
            "rates": rates,
            "confusion": confusion,
            "samples": self.samples,
            "objects": self.objects,
            "detections": self.detections,
            "skipped": self.skipped,
            "rounds": self.rounds,
            "log_likelihood": self.log_likelihood,
            "verdicts": self.verdicts,
        }


def learn_noise(
    samples: Sequence[Sample],
    city: SignatureDatabase | StreetObjects,
    *,
    radius: float = 30.0,
    position_sigma: float = 0.0,
    north_sigma: float = 0.0,
    footprints: Footprints | None = None,
    name: str = "learned",
) -> NoiseEstimate:
    """Estimate a noise model from detections at known places.

    Parameters
    ----------
    samples : sequence of Sample
        The detections; some hundred signatures are enough.
    city : SignatureDatabase or StreetObjects
        The visible objects. With a database, a sample is at the centre of its cell; with street
        objects, it is at its own place.
    radius : float, default 30
        Visibility range in metres for street objects; a database has its own.
    position_sigma : float, default 0
        Known standard deviation of the true places in metres, in x and y (with a database, of the
        place in its cell: ``step / 12 ** 0.5`` for places anywhere in it). The differences of
        bearings that it causes are not counted as bearing noise.
    north_sigma : float, default 0
        Standard deviation of the north of photos without one of their own, in degrees, infinite if
        unknown. Errors of north are not counted as bearing noise either.
    footprints : Footprints, optional
        Buildings that hide objects, for street objects.
    name : str, default "learned"
        Name of the model.

    Returns
    -------
    NoiseEstimate
        The model with intervals.

    Raises
    ------
    InputError
        If there are no samples, none can be used, there is no visible object or no detection, or a
        deviation is out of range.

    Notes
    -----
    The rate of a class with n samples and its own rate r is
    ``(n * r + 8 * overall) / (n + 8)``, so the overall rate counts for eight samples; the same
    holds for squares of deviations. If the classes are of several families, the rate of a class is
    shrunk to that of its family in this way, and that of the family to the overall one. A row of
    the confusion has eight samples added that are misnamed at this rate, as in `NoiseSpec`. See
    `localization.learning.fit` for the intervals.

    Examples
    --------
    >>> from semsig_gis.localization.learning.learn import Sample
    >>> cells = demo_database.cell_ids[:50].tolist()
    >>> seen = [
    ...     Sample(signature=demo_database.signature(row), cell_id=cell)
    ...     for row, cell in enumerate(cells)
    ... ]
    >>> learned = learn_noise(seen, demo_database).spec
    >>> learned.detection > 0.95, learned.clutter < 0.1
    (True, True)
    """
    if not (math.isfinite(position_sigma) and position_sigma >= 0):
        raise InputError(
            f"the deviation of the places is {position_sigma} m; give metres, 0 or more."
        )
    check_north(north_sigma)
    views, used = _true_views(samples, city, radius, footprints)
    detected = [samples[row].signature for row in used]
    reach = city.spec.radius if isinstance(city, SignatureDatabase) else radius
    evidence = gather_evidence(
        views, detected, taxonomy=city.taxonomy, radius=reach, position_sigma=position_sigma
    )
    first, model, rounds = evidence, evidence.start, 0
    looks = [photo for view in detected for photo in View.of(view).photos]
    uncertain = any(
        north_sigma if photo.north_sigma is None else photo.north_sigma for photo in looks
    )
    # The headings of all scans but the last are only a beginning.
    limits = [SCAN_ROUNDS] * (SCANS - 1) if uncertain else []
    for most_rounds in (*limits, MOST_ROUNDS):
        if uncertain:
            evidence = turned_evidence(first, detected, model, north_sigma=north_sigma)
        model, more = fit_model(evidence, model, fading=False, most_rounds=most_rounds)
        rounds += more
    counts = expected_counts(evidence, model)
    fading = detection_falls(evidence, counts)
    if fading:
        model, more = fit_model(evidence, model, fading=True)
        counts, rounds = expected_counts(evidence, model), rounds + more
    rates = estimated_rates(evidence, counts, model, fading=fading)
    return NoiseEstimate(
        spec=_spec(evidence, rates, model, name, radius=reach, fading=fading),
        rates=rates,
        levels=detection_levels(evidence, model, fading=fading),
        confusion=pd.DataFrame(counts.named, index=evidence.names, columns=evidence.names),
        samples=len(used),
        objects=len(views.codes),
        detections=sum(map(len, detected)),
        skipped=len(samples) - len(used),
        rounds=rounds,
        log_likelihood=counts.log_likelihood,
    )


def fit_model(
    evidence: Evidence, model: NoiseTable, *, fading: bool, most_rounds: int = MOST_ROUNDS
) -> tuple[NoiseTable, int]:
    """Return the model after convergence, or after the most rounds, and the number of rounds.

    Anderson's method speeds up expectation-maximisation: each round starts from totals that are
    extrapolated from those before and after the last rounds. If the likelihood falls, the round
    starts from the last totals as they are.
    """
    before: list[NDArray[np.float64]] = []
    after: list[NDArray[np.float64]] = []
    totals, last, highest = None, np.zeros(0), -math.inf
    near, sigma = evidence, np.zeros(0)
    rounds, change = 0, math.inf
    while change >= CONVERGED and rounds < most_rounds:
        rounds += 1
        if not len(sigma) or np.abs(np.log2(model.sigma / sigma)).max() > 1.0:
            near, sigma = evidence.near(2.0 * model.sigma), model.sigma
        counts = expected_counts(near, model)
        if counts.log_likelihood < highest - LARGEST_FALL:
            before, after, totals, highest = [], [], last, -math.inf
        else:
            last, highest = counts.totals, counts.log_likelihood
            plain = next_model(evidence, counts.totals, model, fading=fading)
            change = model_change(model, plain)
            if totals is not None:
                before, after = [*before[-MEMORY:], totals], [*after[-MEMORY:], last]
            totals = extrapolated(before, after) if before else last
        model = next_model(evidence, totals, model, fading=fading)
    return plain, rounds


def extrapolated(
    before: Sequence[NDArray[np.float64]], after: Sequence[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return where a round would likely change nothing, given values before and after rounds.

    The values are 0 or more. It is Anderson's method, of square roots, which have about the same
    error for all counts: the combination of the rounds with the least change.
    """
    results = np.sqrt([value.ravel() for value in after])
    changes = results - np.sqrt([value.ravel() for value in before])
    weights, *_ = np.linalg.lstsq(np.diff(changes, axis=0).T, changes[-1])
    new = results[-1] - weights @ np.diff(results, axis=0)
    return np.asarray(np.maximum(new, 0.0) ** 2).reshape(after[-1].shape)


def _true_views(
    samples: Sequence[Sample],
    city: SignatureDatabase | StreetObjects,
    radius: float,
    footprints: Footprints | None,
) -> tuple[VisibleObjects, list[int]]:
    """Return the visible objects in the photos of usable samples, and the rows of these samples.

    All photos of a sample have the same visible objects.
    """
    if not samples:
        raise InputError(
            "there are no samples to learn from; give detections with their true places."
        )
    photos = np.array([len(View.of(sample.signature).photos) for sample in samples])
    if isinstance(city, SignatureDatabase):
        true_ids = np.array(
            [
                cell_ids(*city.grid.cells_at(np.array([sample.xy])))[0]
                if sample.cell_id is None
                else sample.cell_id
                for sample in samples
            ]
        )
        cells = np.minimum(np.searchsorted(city.cell_ids, true_ids), len(city) - 1)
        used = np.flatnonzero(city.cell_ids[cells] == true_ids)
        views = visible_objects_in(city, np.repeat(cells[used], photos[used]))
    else:
        xy = np.array([sample.xy for sample in samples if sample.xy is not None])
        if len(xy) < len(samples):
            raise InputError(
                "a sample gives only its cell; give x and y, or a database instead of objects."
            )
        index = ObjectIndex(city.xy)
        looks = np.repeat(xy, photos, axis=0)
        views = visible_objects_at(city, looks, index=index, radius=radius, footprints=footprints)
        # Places without objects are left out, as cells without objects are not in a database.
        full = np.flatnonzero(views.lengths)
        used = np.unique(np.repeat(np.arange(len(samples)), photos)[full])
        views = replace(views, offsets=np.append(0, views.offsets[full + 1]))
    if len(used) == 0:
        raise InputError(
            f"none of the {len(samples)} samples lies where an object of the city is in sight; "
            f"give places in its coordinate reference system ({city.crs.to_string()}), or its "
            "cell ids."
        )
    return views, used.tolist()


def _spec(
    evidence: Evidence,
    rates: pd.DataFrame,
    model: NoiseTable,
    name: str,
    *,
    radius: float,
    fading: bool,
) -> NoiseSpec:
    """Return the model as a specification; `radius` is the default range of a class."""
    pooled = rates[rates["class"] == ALL].drop_duplicates("quantity")
    overall = pooled.set_index("quantity")["value"].to_dict()

    def by_class(values: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(evidence.names, values.tolist(), strict=True))

    def with_families(values: NDArray[np.float64], quantity: str) -> dict[str, float]:
        # Classes that no sample has are like the others of their family.
        return _family_means(evidence, values, rates, quantity) | by_class(values)

    clutter = float(model.clutter.sum())
    trials = rates[(rates["class"] != ALL) & (rates["quantity"] == "detection")]["samples"]
    weights = np.maximum(trials.to_numpy(), LEAST)
    near = np.average(1.0 - model.missed[0], weights=weights)
    spec = NoiseSpec(
        detection=float(near) if fading else overall["detection"],
        detection_by_class=with_families(1.0 - model.missed[0], "detection"),
        misnamed=overall["misnamed"],
        misnamed_by_class=_family_means(evidence, model.misnamed[0], rates, "misnamed"),
        confusion={
            name: by_class(row / row.sum())
            for name, row in zip(evidence.names, model.named(0), strict=True)
        },
        clutter=clutter,
        clutter_shares=by_class(model.clutter / clutter),
        bearing_sigma=overall["bearing_sigma"],
        bearing_sigma_by_class=with_families(model.sigma, "bearing_sigma"),
        position_sigma=model.position_sigma,
        repeat=REPEAT if (evidence.detections.turns < 1.0).any() else 1.0,
        name=name,
    )
    if "range_sigma" in overall:
        errors = with_families(model.range_sigma, "range_sigma")
        spec = replace(spec, range_sigma=overall["range_sigma"], range_sigma_by_class=errors)
    if fading:
        shares = fading_at_knots(model)
        mean = np.minimum(np.average(shares, axis=0, weights=weights), 1.0)
        tables = {ALL: (radius, mean)}
        tables |= dict(zip(evidence.names, zip(model.ranges, shares, strict=True), strict=True))
        points = {
            name: tuple(zip((KNOTS * limit).tolist(), row.tolist(), strict=True))
            for name, (limit, row) in tables.items()
        }
        spec = replace(spec, fading=points)
    return spec


def _family_means(
    evidence: Evidence, values: NDArray[np.float64], rates: pd.DataFrame, quantity: str
) -> dict[str, float]:
    """Return the mean value of the classes of each family, weighted by their samples."""
    rows = rates[(rates["class"] != ALL) & (rates["quantity"] == quantity)]
    weights = np.maximum(rows["samples"].to_numpy(), LEAST)
    names = np.array(evidence.families)
    return {
        family: float(np.average(values[names == family], weights=weights[names == family]))
        for family in dict.fromkeys(evidence.families)
        if family
    }
