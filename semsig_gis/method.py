"""What a method is: which measures it takes and how it joins them, or the likelihood."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from semsig_gis.errors import InputError, SemsigError, UnknownNameError, nearest_name
from semsig_gis.metrics import EditWeights, metric
from semsig_gis.noise import NOISES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.noise import Noise
    from semsig_gis.signatures import Signature

__all__ = [
    "ANGLES",
    "BOTH",
    "DEFAULT_METHOD",
    "TYPES",
    "LikelihoodMethod",
    "Method",
    "parse_method",
]

TYPES, ANGLES, BOTH = "types", "angles", "types+angles"
"""Parts of a query that a method may compare."""

LIKELIHOOD = "likelihood"  # what the text of a likelihood method begins with


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """How the cells are ranked: a single metric, metric fusion or two-stage fusion.

    Parameters
    ----------
    types : str, optional
        The measure for the type sequences (see `semsig_gis.metrics.METRICS`); None for none.
    angles : str, optional
        The measure for the sequences of angle levels; None for none.
    alpha : float
        Share of the types in a fusion, 0 to 1; the angles get the rest.
    keep : float, optional
        Percent of the cells, above 0 and up to 100, that the types pass on to the second stage
        of a two-stage fusion; None for a plain fusion.
    normalized : bool
        True to bring each distance to [0, 1] before the fusion, False for the raw scale.
    weights : EditWeights
        Costs of the edit distance.

    Raises
    ------
    InputError
        If a value is out of range, or the parts do not fit together.
    UnknownNameError
        If there is no measure of that name.

    Notes
    -----
    Fusion: ``alpha * D_types + (1 - alpha) * D_angles``. Two-stage fusion ranks by the types,
    keeps the best `keep` percent and every cell that ties with the last of them, and ranks those
    by the fusion; the rest follows in the order of the first stage (paper, section
    "Retrieval schemes").

    Examples
    --------
    >>> method = Method(types="edit", angles="jaccard", keep=5)
    >>> str(method)
    'edit+jaccard:5%'
    >>> Method.parse("edit+jaccard:5%") == method
    True
    """

    types: str | None = "edit"
    angles: str | None = "edit"
    alpha: float = 0.5
    keep: float | None = None
    normalized: bool = True
    weights: EditWeights = field(default_factory=EditWeights)

    def __post_init__(self) -> None:  # noqa: D105
        for name in self.measures.values():
            metric(name)
        if not self.measures:
            msg = "the method compares neither types nor angles; give a measure for one of them."
            raise InputError(msg)
        if not 0 <= self.alpha <= 1:
            msg = f"the share alpha of the types is {self.alpha}; give a number from 0 to 1."
            raise InputError(msg)
        if self.keep is not None and not 0 < self.keep <= 100:  # noqa: PLR2004
            msg = f"{self.keep} % of the cells are to be kept; give a number above 0 and up to 100."
            raise InputError(msg)
        if self.keep is not None and len(self.measures) == 1:
            msg = (
                "a two-stage method ranks by types and then by angles, but it has one measure; "
                "give both, or leave the percentage out."
            )
            raise InputError(msg)

    @classmethod
    def parse(cls, text: str) -> Method:
        """Read a method from the text that `str` writes.

        Parameters
        ----------
        text : str
            ``types+angles`` (``edit+jaccard``), or one part (``types:edit``,
            ``angles:histogram``), then any of ``:5%`` (two-stage), ``:alpha=0.7``, ``:raw`` and
            ``:weights=2/1/1`` (insert, delete, substitute).

        Returns
        -------
        Method
            The method.

        Raises
        ------
        InputError
            If the text does not have that form, or a value is out of range.
        UnknownNameError
            If there is no measure of that name.

        Examples
        --------
        >>> Method.parse("angles:histogram").types is None
        True
        >>> Method.parse("edit+edit:5%:alpha=0.7").alpha
        0.7
        """
        head, *options = text.strip().split(":")
        types: str | None
        angles: str | None
        if head in {TYPES, ANGLES} and options:
            name = options.pop(0)
            types, angles = (name, None) if head == TYPES else (None, name)
        elif head.count("+") == 1:
            types, angles = head.split("+")
        else:
            raise InputError(_misread(text))
        values: dict[str, Any] = {}
        for option in options:
            key, value = _parse_option(option, text)
            if key in values:
                raise InputError(_misread(text))
            values[key] = value
        return cls(types=types, angles=angles, **values)

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        if len(self.measures) > 1:
            parts = ["+".join(self.measures.values())]
        else:
            parts = [f"{part}:{name}" for part, name in self.measures.items()]
        if self.keep is not None:
            parts.append(f"{_plain(self.keep)}%")
        if self.alpha != Method.__dataclass_fields__["alpha"].default:
            parts.append(f"alpha={_plain(self.alpha)}")
        if not self.normalized:
            parts.append("raw")
        if self.weights != EditWeights():
            parts.append("weights=" + "/".join(map(str, self.weights.as_tuple())))
        return ":".join(parts)

    @property
    def measures(self) -> dict[str, str]:
        """The measure of each part that is compared, by ``"types"`` and ``"angles"``."""
        parts = {TYPES: self.types, ANGLES: self.angles}
        return {part: name for part, name in parts.items() if name is not None}

    def used(self, query: Signature) -> str:
        """Return which parts of a query the method compares.

        Parameters
        ----------
        query : Signature
            A query, perhaps without types or without bearings.

        Returns
        -------
        str
            ``"types"``, ``"angles"`` or ``"types+angles"``. A fusion falls back to the part that
            the query has.

        Raises
        ------
        InputError
            If the query has no part that the method compares.
        """
        given = {TYPES: query.codes is not None, ANGLES: query.bearings is not None}
        parts = [part for part in self.measures if given[part]]
        if not parts:
            said = {TYPES: "types", ANGLES: "bearings"}
            wanted, other = (TYPES, ANGLES) if self.angles is None else (ANGLES, TYPES)
            msg = (
                f"method '{self}' compares {said[wanted]}, but the query has only {said[other]}; "
                f"give its {said[wanted]}, or a method such as '{other}:edit'."
            )
            raise InputError(msg)
        return "+".join(parts)


DEFAULT_METHOD = Method()
"""Metric fusion of two edit distances in equal shares."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelihoodMethod:
    """The likelihood method with all its steps (see `semsig_gis.locating`).

    Parameters
    ----------
    noise : NoiseSpec or NoiseMixture
        How detectors fail, at a place that is known.
    refined : bool, default False
        Whether the place is looked for between the viewpoints, too, with the street objects.
    on_grid : bool, default False
        Whether queries are from the very viewpoints, as in the paper, not from anywhere in a cell.
    north_sigma : float, default 0
        Standard deviation in degrees of the north of a query; infinite where it is not known.

    Raises
    ------
    InputError
        If the deviation is negative, or a place on the grid is to be refined.

    Examples
    --------
    >>> from semsig_gis.noise import named_noise
    >>> str(LikelihoodMethod(noise=named_noise("medium"), refined=True))
    'likelihood:medium:refined'
    >>> LikelihoodMethod.parse("likelihood:generic:heading=10").north_sigma
    10.0
    """

    noise: Noise
    refined: bool = False
    on_grid: bool = False
    north_sigma: float = 0.0

    def __post_init__(self) -> None:  # noqa: D105
        if not self.north_sigma >= 0:
            msg = f"the deviation of north is {self.north_sigma} degrees; give 0 or more."
            raise InputError(msg)
        if self.refined and self.on_grid:
            msg = "a place on the grid is not to be refined; leave out refined or on_grid."
            raise InputError(msg)

    @classmethod
    def parse(cls, text: str, *, noises: Mapping[str, Noise] = NOISES) -> LikelihoodMethod:
        """Read a method from the text that `str` writes.

        Parameters
        ----------
        text : str
            ``likelihood``, or ``likelihood:NOISE``, then any of ``:refined``, ``:on_grid`` and
            ``:heading=DEGREES`` or ``:heading=unknown``. Without a noise model, it is generic.
        noises : mapping of str to Noise, optional
            The noise models by name.

        Returns
        -------
        LikelihoodMethod
            The method.

        Raises
        ------
        UnknownNameError
            If there is no noise model of that name.
        InputError
            If the text does not have that form.
        """
        _, *options = text.strip().split(":")
        said = options.pop(0) if options else "generic"
        if said not in noises:
            known = ", ".join(noises)
            hint = nearest_name(said, noises)
            msg = f"method {text!r} has a noise model that is not known{hint}; give one of {known}."
            raise UnknownNameError(msg)
        values: dict[str, Any] = {}
        for option in options:
            key, _, value = option.partition("=")
            if option in {"refined", "on_grid"}:
                values[option] = True
            elif key == "heading" and value:
                values["north_sigma"] = _north_sigma(value, text)
            else:
                raise InputError(_misread_likelihood(text))
        return cls(noise=noises[said], **values)

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        parts = [LIKELIHOOD, self.noise.name]
        parts += [name for name in ("refined", "on_grid") if getattr(self, name)]
        if self.north_sigma:
            known = math.isfinite(self.north_sigma)
            parts.append(f"heading={_plain(self.north_sigma) if known else 'unknown'}")
        return ":".join(parts)


def parse_method(text: str, *, noises: Mapping[str, Noise] = NOISES) -> Method | LikelihoodMethod:
    """Read a method of either kind from text.

    Parameters
    ----------
    text : str
        What `Method.parse` or `LikelihoodMethod.parse` reads.
    noises : mapping of str to Noise, optional
        The noise models by name.

    Returns
    -------
    Method or LikelihoodMethod
        The method.

    Raises
    ------
    SemsigError
        If the text cannot be read.

    Examples
    --------
    >>> str(parse_method("edit+edit:5%")), str(parse_method("likelihood"))
    ('edit+edit:5%', 'likelihood:generic')
    """
    if text.strip().partition(":")[0] == LIKELIHOOD:
        return LikelihoodMethod.parse(text, noises=noises)
    return Method.parse(text)


def _north_sigma(value: str, text: str) -> float:
    """Return the deviation of north that a method says."""
    if value == "unknown":
        return math.inf
    try:
        return float(value)
    except ValueError as error:
        raise InputError(_misread_likelihood(text)) from error


def _misread_likelihood(text: str) -> str:
    return (
        f"method {text!r} cannot be read; give 'likelihood:NOISE' and, if wanted, ':refined', "
        "':on_grid', ':heading=10' (degrees) or ':heading=unknown'."
    )


def _plain(number: float) -> str:
    """Write a number so that it reads back the same, without a needless decimal point."""
    return str(int(number)) if number == int(number) else repr(float(number))


def _parse_option(option: str, text: str) -> tuple[str, Any]:
    """Return the field of a method that an option of its text sets, and the value."""
    key, _, value = option.partition("=")
    try:
        if option == "raw":
            return "normalized", False
        if option.endswith("%"):
            return "keep", float(option[:-1])
        if key == "alpha":
            return "alpha", float(value)
        if key == "weights":
            return "weights", EditWeights(*(int(one) for one in value.split("/")))
    except (TypeError, ValueError) as error:
        if isinstance(error, SemsigError):
            raise
        raise InputError(_misread(text)) from error
    raise InputError(_misread(text))


def _misread(text: str) -> str:
    """Return what to say of a method that cannot be read."""
    return (
        f"method {text!r} cannot be read; give two measures as 'edit+jaccard' (types, angles) or "
        "one as 'types:edit' or 'angles:histogram', then, if wanted, ':5%' for two stages, "
        "':alpha=0.7', ':raw' or ':weights=2/1/1'."
    )
