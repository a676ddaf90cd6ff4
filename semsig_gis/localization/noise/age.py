"""Noise for a map that is some years old: objects have gone, come and moved since it was made."""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import Displayed, InputError
from semsig_gis.localization.noise.fit import LEAST, MOST, drawn_rates
from semsig_gis.objects import ClassChange
from semsig_gis.sources import data_folder
from semsig_gis.storage import parse_toml, read_values

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.noise.model import Noise, NoiseSpec

MOST_YEARS = 100.0
NEAR_MOVE = 5.0  # metres; an object that moved farther has gone here and come there
MEDIAN = math.sqrt(2.0 * math.log(2.0))  # of a distance, in deviations each way


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class Drift(Displayed):
    """What changed in the street objects of a city in some years.

    Parameters
    ----------
    years : float
        How many years, above 0 and up to 100.
    classes : tuple of ClassChange
        The counts of each class, as `UpdateReport.classes` has them.

    Raises
    ------
    InputError
        If the years are out of range, or there are no objects or more changes than objects.

    Examples
    --------
    >>> named_drift().years
    1.24
    """

    years: float
    classes: tuple[ClassChange, ...]

    def __post_init__(self) -> None:  # noqa: D105
        years: object = self.years  # a file may have anything
        if type(years) not in {int, float} or not 0 < self.years <= MOST_YEARS:
            raise InputError(
                f"years of the drift is {self.years!r}; give years above 0 and up to 100."
            )
        for item in self.classes:
            counts = (item.before, item.added, item.removed, item.moved, item.gained, item.lost)
            if not all(type(count) is int and count >= 0 for count in counts):
                raise InputError(
                    f"drift of class {item.class_name!r} has counts {counts}; give whole numbers."
                )
            metres = item.moved_m
            known = isinstance(metres, (int, float)) and 0 <= metres < math.inf
            if item.moved and not known:
                raise InputError(
                    f"drift of class {item.class_name!r} has moved_m = {metres!r}; give metres."
                )
            if item.before < item.removed + item.moved + item.lost:
                raise InputError(
                    f"drift of class {item.class_name!r} has more objects removed, moved and lost "
                    f"than the {item.before} there were before; give counts that fit each other."
                )
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
    """Return the drift that is shipped, of Monaco in OpenStreetMap.

    Returns
    -------
    Drift
        What ``drift.toml`` of the data sources says.

    Examples
    --------
    >>> sum(item.added for item in named_drift().classes)
    234
    """
    text = (data_folder() / "drift.toml").read_text(encoding="utf-8")
    return _drift(parse_toml(text, "drift.toml"), "drift.toml")


def open_drift(path: str | Path) -> Drift:
    r"""Read a drift: what ``semsig update --years N --json`` prints, or TOML of that form.

    Parameters
    ----------
    path : str or Path
        A JSON file, or a TOML file with the suffix ``.toml``, with ``years`` and a list
        ``classes``; of a class are needed ``class_name`` and ``before``, other counts are 0.

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
    return _drift(read_values(path, "drift"), str(path))


def _drift(values: Any, where: str) -> Drift:  # noqa: ANN401 - as a file has it
    """Return the drift of plain values."""
    if not isinstance(values, Mapping) or not isinstance(values.get("classes"), list):
        raise InputError(
            f"{where} has no list of classes; give what `semsig update --json` prints."
        )
    if "years" not in values:
        raise InputError(
            f"{where} does not say over how many years the city changed; add years, or write the "
            "report with `semsig update --years N --json`."
        )
    names = {field.name for field in fields(ClassChange)}
    plain = dict.fromkeys(names - {"class_name", "before", "moved_m"}, 0) | {"moved_m": None}
    classes = []
    for item in values["classes"]:
        known = isinstance(item, Mapping) and {"class_name", "before"} <= set(item) <= names
        if not known or not isinstance(item["class_name"], str):
            raise InputError(
                f"{where} has a class {item!r}; give class_name, before and any of "
                f"{', '.join(sorted(plain))}."
            )
        classes.append(ClassChange(**{**plain, **item}))
    return Drift(years=values["years"], classes=tuple(classes))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Ageing:
    """How each class of a database, `names`, changes in some years.

    `seen` is the mean number of objects in a signature. `gone` and `moved` are the shares that
    are gone, or have moved a little, by `variances` in square metres each way; `come` is
    the number of new objects per signature.
    """

    names: list[str]
    seen: NDArray[np.float64]
    gone: NDArray[np.float64]
    come: NDArray[np.float64]
    moved: NDArray[np.float64]
    variances: NDArray[np.float64]

    @classmethod
    def of(cls, drift: Drift, years: float, database: SignatureDatabase) -> _Ageing:
        """Return the changes in some years; classes of few objects are drawn to the mean."""
        codes = database.present_codes
        names = [database.taxonomy.by_code(code).name for code in codes.tolist()]
        counts: dict[str, Counter[str]] = {name: Counter() for name in names}
        variances = dict.fromkeys(names, 0.0)
        for item in drift.classes:
            far = item.moved_m is not None and item.moved_m > NEAR_MOVE
            leap, near = (item.moved, 0) if far else (0, item.moved)
            counts.setdefault(item.class_name, Counter()).update(
                before=item.before,
                gone=item.removed + item.lost + leap,
                come=item.added + item.gained + leap,
                moved=near,
            )
            if near:
                variances[item.class_name] = ((item.moved_m or 0.0) / MEDIAN) ** 2
        before = np.array([own["before"] for own in counts.values()], np.float64)

        def rates(what: str) -> NDArray[np.float64]:
            hits = np.array([own[what] for own in counts.values()], np.float64)
            return drawn_rates(hits, before)[: len(names)]

        spans = years / drift.years
        gone, moved = (1.0 - (1.0 - rates(what)) ** spans for what in ("gone", "moved"))
        seen = np.bincount(database.codes, minlength=256)[codes] / len(database)
        return cls(
            names=names,
            seen=seen,
            gone=gone,
            come=rates("come") * spans * seen,
            moved=moved,
            variances=np.array([variances[name] for name in names]),
        )

    @property
    def variance(self) -> float:
        """Mean variance of the place of an object in each direction, in square metres."""
        return float(np.average(self.moved * self.variances, weights=self.seen))

    def detection(self, spec: NoiseSpec) -> NDArray[np.float64]:
        """Return the chance of detection of each class by a model."""
        special = spec.detection_by_class
        return np.array([special.get(name, spec.detection) for name in self.names], np.float64)

    def clutter(self, spec: NoiseSpec) -> NDArray[np.float64]:
        """Return the false objects of each class per signature, by a model."""
        shares = spec.clutter_shares or dict.fromkeys(self.names, 1.0 / len(self.names))
        return spec.clutter * np.array([shares.get(name, 0.0) for name in self.names], np.float64)

    def spec(
        self, spec: NoiseSpec, detection: NDArray[np.float64], clutter: NDArray[np.float64]
    ) -> NoiseSpec:
        """Return a model with other chances and false objects."""
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
    """Return a noise model for queries that are younger than the map of a database.

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        The model for a map of today.
    years : float
        Age of the map, 0 to 100; 0 leaves the model as it is.
    database : SignatureDatabase
        The cells, for the classes that there are and how many objects a cell sees.
    drift : Drift, optional
        How fast such objects change; `named_drift` by default.

    Returns
    -------
    NoiseSpec or NoiseMixture
        The model: what has gone is missed, what has come is false, and what has moved a little
        makes the place uncertain.

    Raises
    ------
    InputError
        If the age is out of its range.

    Notes
    -----
    Of n objects of a class, h of which changed, the rate is ``(h + 8 * overall) / (n + 8)``, as in
    `learn_noise`. With the rates g of the gone, c of the come and m of the moved in the years of
    the drift, after k times as many the detection is multiplied by ``(1 - g) ** k``, the false
    objects rise by ``c * k`` times those that a cell sees in the mean, and the variance of the
    place by that of the moves times ``1 - (1 - m) ** k``. Moves of more than 5 m (the median of
    the class) count as gone and come.

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
        detection = ageing.detection(spec) * (1.0 - ageing.gone)
        sigma = math.sqrt(spec.position_sigma**2 + ageing.variance)
        changed = ageing.spec(spec, detection, ageing.clutter(spec) + ageing.come)
        return replace(changed, position_sigma=sigma)

    return replace(noise.changed(older), name=f"{years:g}-year-old map with {noise.name}")


def fresh_noise(
    spec: NoiseSpec, years: float, *, database: SignatureDatabase, drift: Drift | None = None
) -> NoiseSpec:
    """Return what is left of a model that was learnt against an old map, without its age.

    It is the inverse of `aged_noise` for misses and false objects: what the age explains of them is
    not the detector's.

    Parameters
    ----------
    spec : NoiseSpec
        The model that was learnt.
    years : float
        Age of the map, as of `aged_noise`.
    database : SignatureDatabase
        The cells.
    drift : Drift, optional
        How fast such objects change; `named_drift` by default.

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
    stays = np.maximum(1.0 - ageing.gone, LEAST)
    detection = np.minimum(ageing.detection(spec) / stays, MOST)
    clutter = np.maximum(ageing.clutter(spec) - ageing.come, LEAST / len(ageing.names))
    overall = float(np.average(detection, weights=ageing.seen))
    return replace(ageing.spec(spec, detection, clutter), detection=overall)


def check_map_age(years: float) -> None:
    """Refuse an age of a map, in years, that is out of its range."""
    if not 0 <= years <= MOST_YEARS:
        raise InputError(f"the age of the map is {years:g} years; give years from 0 to 100.")
