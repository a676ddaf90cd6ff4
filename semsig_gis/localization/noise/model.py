"""Noise models: how a detector fails, as the likelihood method assumes.

A detector misses objects, gives a wrong class to some, reports false objects, and has errors of a
few degrees. `NoiseSpec` has the rates; `NoiseMixture` is one of several models, unknown which.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typing_extensions import TypedDict

from semsig_gis.core import (
    HALF_TURN,
    Accepts,
    Displayed,
    Flag,  # noqa: TC001 - of fields
    InputError,
    Parsed,
    check_fields,
    length,
    number,
    percent,
    read_table,
)
from semsig_gis.storage import read_values, toml_text, whole_file

if TYPE_CHECKING:
    from collections.abc import Callable

MOST_ERROR = 3.0
MOST = 1000  # objects in a signature, and metres of the place
BY_CLASS = (
    *("detection_by_class", "misnamed_by_class"),
    *("bearing_sigma_by_class", "range_sigma_by_class"),
)
ALL = "all"
"""Name of all classes without an entry of their own."""
ROUNDING = 1e-6  # of sums of shares, and of squares of metres


class SpecRecord(TypedDict):
    """The fields of `NoiseSpec` as plain values."""

    detection: float
    detection_by_class: dict[str, float]
    misnamed: float
    misnamed_by_class: dict[str, float]
    confusion: dict[str, dict[str, float]]
    clutter: float
    clutter_shares: dict[str, float]
    bearing_sigma: float
    bearing_sigma_by_class: dict[str, float]
    position_sigma: float
    missed_each: float
    misnamed_each: float
    range_sigma: float
    range_sigma_by_class: dict[str, float]
    fading: dict[str, list[list[float]]]
    repeat: float
    general: bool
    name: str


class MixtureRecord(TypedDict):
    """The fields of `NoiseMixture` as plain values."""

    name: str
    weights: list[float]
    specs: list[SpecRecord]


def _check_shares(shares: Mapping[str, float]) -> Mapping[str, float]:
    total = math.fsum(shares.values())
    if abs(total - 1.0) > ROUNDING:
        raise InputError(f"the shares sum to {total:.6g}; give shares that sum to 1.")
    return shares


def _check_fading(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    distances = [distance for distance, _ in points]
    if any(after <= before for before, after in pairwise(distances)):
        raise ValueError
    return points


_Chance = Annotated[float, number("a chance from 0 to 1", 0, 1)]
_Weight = Annotated[float, number("a chance above 0 and up to 1", 0, 1, above=True)]
_Amount = Annotated[float, number(f"a number from 0 to {MOST:,}", 0, MOST)]
_Degrees = Annotated[float, number("degrees above 0 and up to 180", 0, HALF_TURN, above=True)]
_Error = Annotated[
    float, number(f"a number above 0 and up to {MOST_ERROR:g}", 0, MOST_ERROR, above=True)
]
_Shares = Annotated[Mapping[str, _Chance], Parsed(_check_shares)]
_SharesIfAny = Annotated[
    Mapping[str, _Chance], Parsed(lambda shares: shares and _check_shares(shares))
]
_Fading = Annotated[
    Sequence[Sequence[float]],
    Parsed(
        _check_fading,
        Annotated[tuple[tuple[Annotated[float, number("metres", 0)], _Chance], ...], length(1)],
    ),
    Accepts("pairs of metres, ascending, and a share from 0 to 1"),
]


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class NoiseSpec(Displayed):
    """How a detector fails.

    Parameters
    ----------
    detection : float, default 0.9
        Chance that an object in range is detected, 0 to 1.
    misnamed : float, default 0.05
        Share of the detected objects that are given another class, 0 to 1: seven in ten of them
        one of the other classes of the family, and the others any class, each with equal chance.
    confusion : mapping of str to mapping of str to float, optional
        For some or all classes the chance of each class that a detected object is given, the
        right one included; each row sums to one. It takes precedence over `misnamed`.
    clutter : float, default 1.0
        Expected number of false objects in a signature, 0 or more, equal in all directions.
    clutter_shares : mapping of str to float, optional
        Share of each class in the false objects; sums to one. Equal shares by default.
    bearing_sigma : float, default 5.0
        Standard deviation of a bearing in degrees, above 0 and up to 180.
    detection_by_class, misnamed_by_class, bearing_sigma_by_class : mapping of str to float
        The same for single classes or families, by name; optional. In all tables by class, an entry
        of a family is for its classes without an entry of their own, and its share is divided
        equally among them.
    position_sigma : float, default 0.0
        Standard deviation in metres of the place of the observer, in x and in y; it turns the
        bearings of near objects more than those of far objects.
    missed_each, misnamed_each : float, default 0.0
        Expected number of further objects that are missed or misnamed in every signature, short
        or long: an object among L survives m draws with chance ``(1 - 1/L) ** m`` (the source's
        distortion, section 4.2).
    range_sigma : float, default 0.25
        Relative error of a rough distance: the standard deviation of its logarithm, above 0 and up
        to 3. `range_sigma_by_class` is the same for single classes.
    fading : mapping of str to sequence of (float, float), optional
        How the chance of detection falls with the distance, for classes by name, or ``all``
        others: pairs of metres, ascending, and the remaining share of `detection` there, 0 to 1;
        linear between them, and the last share beyond. Objects that are seen from beyond the
        visibility range of a database, up to the last distance, are false objects there.
    repeat : float, default 1.0
        How much photographs of one place add to each other, 0 to 1: n of them count as
        ``n ** repeat``. What one photograph misses, the next one misses too, so their likelihoods
        do not simply multiply, as they do with 1.
    general : bool, default False
        Whether the tables by class may name classes that a database does not have.
    name : str, default "custom"
        Name to print.

    Raises
    ------
    InputError
        If a number is out of its range or a row of shares does not sum to one.

    Examples
    --------
    >>> NoiseSpec(detection=0.8, detection_by_class={"bench": 0.6}).bearing_sigma
    5.0
    >>> NoiseSpec(detection=1.2)
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.InputError: the noise has detection = 1.2; give a chance from 0 to 1.
    """

    detection: _Chance = 0.9
    detection_by_class: Mapping[str, _Chance] = field(default_factory=dict)
    misnamed: _Chance = 0.05
    misnamed_by_class: Mapping[str, _Chance] = field(default_factory=dict)
    confusion: Mapping[str, _Shares] = field(default_factory=dict)
    clutter: _Amount = 1.0
    clutter_shares: _SharesIfAny = field(default_factory=dict)
    bearing_sigma: _Degrees = 5.0
    bearing_sigma_by_class: Mapping[str, _Degrees] = field(default_factory=dict)
    position_sigma: _Amount = 0.0
    missed_each: _Amount = 0.0
    misnamed_each: _Amount = 0.0
    range_sigma: _Error = 0.25
    range_sigma_by_class: Mapping[str, _Error] = field(default_factory=dict)
    fading: Mapping[str, _Fading] = field(default_factory=dict)
    repeat: _Chance = 1.0
    general: Flag = False
    name: str = "custom"

    def __post_init__(self) -> None:  # noqa: D105
        check_fields(self, "the noise")

    def _facts(self) -> dict[str, object]:
        tables = (*BY_CLASS, "confusion", "clutter_shares", "fading")
        return {
            "name": self.name,
            "detection": f"{self.detection:.3g}",
            "misnamed": f"{self.misnamed:.3g}",
            "clutter": f"{self.clutter:.3g}",
            "bearing": f"±{self.bearing_sigma:.3g}°",
            "place": f"±{self.position_sigma:.3g} m",
            "range": f"±{100 * self.range_sigma:.3g} %",
            "missed each": f"{self.missed_each:.3g}",
            "misnamed each": f"{self.misnamed_each:.3g}",
            "repeat": f"{self.repeat:.3g}",
            "by class": ", ".join(name for name in tables if getattr(self, name)) or "nothing",
        }

    @property
    def specs(self) -> tuple[NoiseSpec, ...]:
        """The model itself, as in a mixture of one."""
        return (self,)

    @property
    def weights(self) -> tuple[float, ...]:
        """The chance of the only model, 1."""
        return (1.0,)

    def __hash__(self) -> int:  # noqa: D105 - of the tables by class is none
        return hash((self.name, self.position_sigma))

    def changed(self, change: Callable[[NoiseSpec], NoiseSpec]) -> NoiseSpec:
        """Return the model after a change; a mixture changes each of its models."""
        return change(self)

    def to_dict(self) -> SpecRecord:
        """Return plain values, ready for JSON, that `noise_from_dict` reads."""
        values: SpecRecord = _plain(asdict(self))
        return values


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class NoiseMixture(Displayed):
    """Noise of one of several models, unknown which.

    The likelihood of a cell is the weighted sum over the models.

    Parameters
    ----------
    specs, weights : tuple of NoiseSpec, and tuple of float
        The models, at least one, and the chance of each, above 0; chances sum to one.
    name : str, default "custom"
        Name to print.

    Raises
    ------
    InputError
        If there is no model, or the weights do not fit.

    Examples
    --------
    >>> from semsig_gis import named_noise
    >>> [spec.name for spec in named_noise("generic").specs]
    ['light', 'medium', 'strong']
    """

    specs: tuple[NoiseSpec, ...]
    weights: tuple[_Weight, ...]
    name: str = "custom"

    def __post_init__(self) -> None:  # noqa: D105
        check_fields(self, "the mixture of noise models")
        if not self.specs or len(self.specs) != len(self.weights):
            raise InputError(
                f"{len(self.specs)} noise models and {len(self.weights)} weights were given; "
                "give at least one model and one weight for each."
            )
        if abs(math.fsum(self.weights) - 1.0) > ROUNDING:
            raise InputError(
                f"weights of the mixture are {self.weights}; give chances that sum to 1."
            )

    def _facts(self) -> dict[str, object]:
        models = zip(self.specs, self.weights, strict=True)
        return {
            "name": self.name,
            "models": ", ".join(f"{spec.name} {percent(weight, 0)}" for spec, weight in models),
        }

    @property
    def repeat(self) -> float:
        """How much photographs of one place add to each other, the mean of the models."""
        return math.fsum(
            weight * spec.repeat for weight, spec in zip(self.weights, self.specs, strict=True)
        )

    def changed(self, change: Callable[[NoiseSpec], NoiseSpec]) -> NoiseMixture:
        """Return the mixture after a change of each of its models."""
        return replace(self, specs=tuple(map(change, self.specs)))

    def to_dict(self) -> MixtureRecord:
        """Return the mixture as plain values, ready for JSON, that `noise_from_dict` reads."""
        return {
            "name": self.name,
            "weights": list(self.weights),
            "specs": [spec.to_dict() for spec in self.specs],
        }


Noise = NoiseSpec | NoiseMixture
"""Any noise model."""


def noise_from_dict(values: Mapping[str, Any], *, where: str = "the noise") -> Noise:
    """Read a noise model from plain values, the inverse of ``to_dict``; messages name it `where`.

    Values are the fields of `NoiseSpec`, all optional, or of a mixture of plain models.
    """
    # A file may hold any value.
    if isinstance(values, Mapping) and "specs" in values:  # type: ignore[redundant-expr]
        return read_table(NoiseMixture, values, where, error=InputError)
    return read_table(NoiseSpec, values, where, error=InputError)


def cell_noise(noise: Noise, step: float) -> Noise:
    """Return a noise model for queries from anywhere in a cell, not only from its centre.

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        The model for a known place.
    step : float
        Side of the cells in metres.

    Returns
    -------
    NoiseSpec or NoiseMixture
        The model with a position uncertainty in x and y that is larger by ``step / 12 ** 0.5``
        metres, added in quadrature.

    Examples
    --------
    >>> round(cell_noise(NoiseSpec(), 10.0).position_sigma, 2)
    2.89
    """
    return _cell_noise(noise, step)


@lru_cache(maxsize=32)
def _cell_noise(noise: Noise, step: float) -> Noise:
    def widened(spec: NoiseSpec) -> NoiseSpec:
        sigma = math.hypot(spec.position_sigma, step / math.sqrt(12.0))
        return replace(spec, position_sigma=sigma)

    return noise.changed(widened)


def place_noise(noise: Noise, step: float) -> Noise:
    """Return the model without the position uncertainty of a cell, the inverse of `cell_noise`.

    The result is for queries from exactly known places; `step` is the side of a cell in metres.

    Raises `InputError` if the position uncertainty of the model is too small to subtract from.
    """
    return _place_noise(noise, step)


@lru_cache(maxsize=32)
def _place_noise(noise: Noise, step: float) -> Noise:
    def narrowed(spec: NoiseSpec) -> NoiseSpec:
        variance = spec.position_sigma**2 - step**2 / 12.0
        if variance < -ROUNDING:
            raise InputError(
                f"noise model {spec.name!r} is for queries from the centres of cells; build the "
                f"index for cell_noise(noise, {step:g}), which is for queries from anywhere in "
                "them."
            )
        return replace(spec, position_sigma=0.0 if variance < ROUNDING else math.sqrt(variance))

    return noise.changed(narrowed)


def _plain(value: Any) -> Any:  # noqa: ANN401
    """Return a copy with all mappings as dictionaries and all sequences as lists."""
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(part) for part in value]
    return value


def open_noise(path: str | Path) -> Noise:
    """Read a noise model from a JSON file, or a TOML file with the suffix ``.toml``."""
    return noise_from_dict(read_values(path, "noise"), where=f"noise file {path}")


def save_noise(noise: Noise, path: str | Path) -> None:
    """Write a noise model as TOML (suffix ``.toml``) or JSON; the file appears whole, by rename."""
    values = noise.to_dict()
    if Path(path).suffix.lower() == ".toml":
        text = toml_text(values)
    else:
        text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
