"""Noise for an old map: since then, objects were removed, added and moved."""

from __future__ import annotations

import functools
import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from semsig_gis.core import Displayed, InputError, check_fields, number, read_table
from semsig_gis.localization.learning.fit import LEAST, MOST, shrunk_rates
from semsig_gis.localization.noise.families import noise_by_class
from semsig_gis.objects import ClassChange  # noqa: TC001 - of fields
from semsig_gis.sources import data_folder
from semsig_gis.storage import parse_toml, read_values

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.noise.model import Noise, NoiseSpec

MOST_YEARS = 100.0
NEAR_MOVE = 5.0  # metres; an object that moved farther counts as removed and added
MEDIAN = math.sqrt(2.0 * math.log(2.0))  # of a distance, in standard deviations of x and y


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class Drift(Displayed):
    """What changed among the street objects of a city within a number of years.

    Parameters
    ----------
    years : float
        Number of years, above 0 and up to 100.
    classes : tuple of ClassChange
        The counts of each class, as in `UpdateReport.classes`.

    Raises
    ------
    InputError
        If the years are out of range, or there are no objects or more changes than objects.

    Examples
    --------
    >>> named_drift().years
    1.24
    """

    years: Annotated[float, number("years above 0 and up to 100", 0, MOST_YEARS, above=True)]
    classes: tuple[ClassChange, ...]

    def __post_init__(self) -> None:  # noqa: D105
        check_fields(self, "the drift")
        for item in self.classes:
            if item.before < item.removed + item.moved + item.lost:
                raise InputError(
                    f"drift of class {item.class_name!r} has more objects removed, moved and lost "
                    f"than the {item.before} there were before; give counts that fit each other."
                )
            if item.moved and item.moved_m is None:
                raise InputError(f"drift of class {item.class_name!r} lacks moved_m; give metres.")
        if not sum(item.before for item in self.classes):
            raise InputError(
                "the drift report has no objects from before the change; give the report of a "
                "city that had some."
            )

    def _facts(self) -> dict[str, object]:
        counts = {
            name: sum(getattr(item, name) for item in self.classes)
            for name in ("before", "added", "removed", "moved")
        }
        return {"years": f"{self.years:g}", "classes": len(self.classes), **counts}


@functools.cache
def named_drift() -> Drift:
    """Return the built-in drift, of Monaco in OpenStreetMap.

    Returns
    -------
    Drift
        The drift in ``drift.toml`` of the data sources.

    Examples
    --------
    >>> sum(item.added for item in named_drift().classes)
    234
    """
    text = (data_folder() / "drift.toml").read_text(encoding="utf-8")
    return read_table(Drift, parse_toml(text, "drift.toml"), "drift.toml")


def open_drift(path: str | Path) -> Drift:
    r"""Read a drift: the output of ``semsig update --years N --json``, or TOML of that form.

    Parameters
    ----------
    path : str or Path
        A JSON file, or a TOML file with the suffix ``.toml``, with ``years`` and a list
        ``classes``; a class requires ``class_name`` and ``before``, and its other counts are 0 by
        default.

    Returns
    -------
    Drift
        The drift.

    Raises
    ------
    InputError
        If the file cannot be read or does not hold a drift.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "drift.toml")
    ...     text = "years = 2\nclasses = [{class_name = 'bench', before = 50, removed = 3}]"
    ...     _ = file.write_text(text)
    ...     open_drift(file).classes[0].removed
    3
    """
    values = read_values(path, "drift")
    if isinstance(values, dict):  # a report has more
        values = {key: values[key] for key in ("years", "classes") if key in values}
    return read_table(Drift, values, f"drift {path}", error=InputError)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Ageing:
    """The changes of the classes of a database, `names`, in some years.

    `counts` are the mean numbers of objects in a signature. `removals` and `moves` are the shares
    of objects that are removed or move a little, by `variances` in square metres in x and y;
    `additions` are the numbers of new objects per signature.
    """

    names: list[str]
    counts: NDArray[np.float64]
    removals: NDArray[np.float64]
    additions: NDArray[np.float64]
    moves: NDArray[np.float64]
    variances: NDArray[np.float64]

    @classmethod
    def of(cls, drift: Drift, years: float, database: SignatureDatabase) -> _Ageing:
        """Return the changes in some years; rates of small classes are shrunk towards the mean."""
        codes = database.present_codes
        names = [database.taxonomy.by_code(code).name for code in codes.tolist()]
        counts: dict[str, Counter[str]] = {name: Counter() for name in names}
        variances = dict.fromkeys(names, 0.0)
        for item in drift.classes:
            far = item.moved_m is not None and item.moved_m > NEAR_MOVE
            leap, near = (item.moved, 0) if far else (0, item.moved)
            counts.setdefault(item.class_name, Counter()).update(
                before=item.before,
                removals=item.removed + item.lost + leap,
                additions=item.added + item.gained + leap,
                moves=near,
            )
            if near:
                variances[item.class_name] = ((item.moved_m or 0.0) / MEDIAN) ** 2
        before = np.array([own["before"] for own in counts.values()], np.float64)

        def rates(change: str) -> NDArray[np.float64]:
            hits = np.array([own[change] for own in counts.values()], np.float64)
            return shrunk_rates(hits, before)[: len(names)]

        spans = years / drift.years
        removals, moves = (1.0 - (1.0 - rates(name)) ** spans for name in ("removals", "moves"))
        means = np.bincount(database.codes, minlength=256)[codes] / len(database)
        return cls(
            names=names,
            counts=means,
            removals=removals,
            additions=rates("additions") * spans * means,
            moves=moves,
            variances=np.array([variances[name] for name in names]),
        )

    @property
    def variance(self) -> float:
        """Mean variance of x and of y of an object, in square metres."""
        return float(np.average(self.moves * self.variances, weights=self.counts))

    def detection(self, spec: NoiseSpec) -> NDArray[np.float64]:
        """Return the chance of detection of each class by a model."""
        special = spec.detection_by_class
        return np.array([special.get(name, spec.detection) for name in self.names], np.float64)

    def clutter(self, spec: NoiseSpec) -> NDArray[np.float64]:
        """Return the number of false objects of each class per signature, by a model."""
        shares = spec.clutter_shares or dict.fromkeys(self.names, 1.0 / len(self.names))
        return spec.clutter * np.array([shares.get(name, 0.0) for name in self.names], np.float64)

    def spec(
        self, spec: NoiseSpec, detection: NDArray[np.float64], clutter: NDArray[np.float64]
    ) -> NoiseSpec:
        """Return a model with the given chances of detection and numbers of false objects."""
        total = float(clutter.sum())
        shares = clutter / total if total else clutter
        by_class = dict(zip(self.names, detection.tolist(), strict=True))
        return replace(
            spec,
            detection_by_class={**spec.detection_by_class, **by_class},
            clutter=total,
            clutter_shares=dict(zip(self.names, shares.tolist(), strict=True)) if total else {},
        )


def aged_noise(
    noise: Noise, years: float, *, database: SignatureDatabase, drift: Drift | None = None
) -> Noise:
    """Return a noise model for queries that are newer than the map of a database.

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        The model for a map of today.
    years : float
        Age of the map, 0 to 100; 0 leaves the model as it is.
    database : SignatureDatabase
        The cells, for the classes and the mean number of objects by class.
    drift : Drift, optional
        The rates of change of objects; `named_drift` by default.

    Returns
    -------
    NoiseSpec or NoiseMixture
        The model: removed objects are missed, added objects are false, and small moves make the
        place uncertain.

    Raises
    ------
    InputError
        If the age is out of its range.

    Notes
    -----
    If h of n objects of a class changed, the rate is ``(h + 8 * overall) / (n + 8)``, as in
    `learn_noise`. With the rates r of removals, a of additions and m of moves in the years of the
    drift, after k times as many years the detection is multiplied by ``(1 - r) ** k``, the number
    of false objects rises by ``a * k`` times the mean number of objects of a cell, and the variance
    of the place by that of the moves times ``1 - (1 - m) ** k``. Moves of more than 5 m (the median
    of the class) count as removals and additions.

    Examples
    --------
    >>> from semsig_gis import NoiseSpec
    >>> aged = aged_noise(NoiseSpec(), 3.0, database=demo_database)
    >>> aged.detection_by_class["bench"] < 0.9, aged.clutter > 1.0, aged.name
    (True, True, '3-year-old map with custom')
    """
    check_map_age(years)
    if years == 0:
        return noise
    ageing = _Ageing.of(drift or named_drift(), years, database)

    def older(spec: NoiseSpec) -> NoiseSpec:
        detection = ageing.detection(spec) * (1.0 - ageing.removals)
        sigma = math.sqrt(spec.position_sigma**2 + ageing.variance)
        changed = ageing.spec(spec, detection, ageing.clutter(spec) + ageing.additions)
        return replace(changed, position_sigma=sigma)

    by_class = noise_by_class(noise, database.taxonomy, set(database.present_codes.tolist()))
    return replace(by_class.changed(older), name=f"{years:g}-year-old map with {noise.name}")


def fresh_noise(
    spec: NoiseSpec, years: float, *, database: SignatureDatabase, drift: Drift | None = None
) -> NoiseSpec:
    """Return the model for a map of today from one that was learnt with an old map.

    It is the inverse of `aged_noise` for misses and false objects: those that are due to the age of
    the map are not due to the detector.

    Parameters
    ----------
    spec : NoiseSpec
        The learnt model.
    years : float
        Age of the map, as of `aged_noise`.
    database : SignatureDatabase
        The cells.
    drift : Drift, optional
        The rates of change of objects; `named_drift` by default.

    Returns
    -------
    NoiseSpec
        The model for a map of today.

    Raises
    ------
    InputError
        If the age is out of its range.

    Examples
    --------
    >>> from semsig_gis import NoiseSpec
    >>> learnt = NoiseSpec(detection=0.8, clutter=2.0)
    >>> fresh_noise(learnt, 3.0, database=demo_database).detection_by_class["bench"] > 0.8
    True
    """
    check_map_age(years)
    if years == 0:
        return spec
    ageing = _Ageing.of(drift or named_drift(), years, database)
    (spec,) = noise_by_class(spec, database.taxonomy, set(database.present_codes.tolist())).specs
    remaining = np.maximum(1.0 - ageing.removals, LEAST)
    detection = np.minimum(ageing.detection(spec) / remaining, MOST)
    clutter = np.maximum(ageing.clutter(spec) - ageing.additions, LEAST / len(ageing.names))
    overall = float(np.average(detection, weights=ageing.counts))
    return replace(ageing.spec(spec, detection, clutter), detection=overall)


def check_map_age(years: float) -> None:
    """Raise InputError if the age of a map, in years, is out of its range."""
    if not 0 <= years <= MOST_YEARS:
        raise InputError(f"the age of the map is {years:g} years; give years from 0 to 100.")
