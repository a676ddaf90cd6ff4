"""Methods by distance: the metrics of types and angles, and their fusion."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from semsig_gis.core import InputError, SemsigError
from semsig_gis.localization.distance.metrics import metric
from semsig_gis.localization.distance.metrics.edit import EditWeights

if TYPE_CHECKING:
    from semsig_gis.core import Signature


TYPES, ANGLES, BOTH = "types", "angles", "types+angles"
"""Parts of a query that a method compares."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """How the cells are ranked: a single metric, metric fusion or two-stage fusion.

    Fusion is ``alpha * D_types + (1 - alpha) * D_angles``. Two-stage fusion ranks by types, then
    ranks the best `keep` percent, and all cells that tie with the last of them, by fusion. The
    others follow in the order of the first stage (paper, section "Retrieval schemes").

    Parameters
    ----------
    types, angles : str, optional
        The metrics for the sequences of types and of angle levels (see
        `localization.distance.metrics.METRICS`); None for none.
    alpha : float
        Weight of the types in a fusion, 0 to 1; the weight of the angles is ``1 - alpha``.
    keep : float, optional
        Percentage of the cells, above 0 and up to 100, that pass the first stage of a two-stage
        fusion; None for a plain fusion.
    normalized : bool
        True to scale each distance to [0, 1] before the fusion, False for the raw scale.
    weights : EditWeights
        Costs of the edit distance.

    Raises
    ------
    InputError
        If a value is out of range, or the parts do not fit together.
    UnknownNameError
        If there is no metric of this name.

    Examples
    --------
    >>> method = Method(types="edit", angles="jaccard", keep=5)
    >>> str(method), Method.parse("edit+jaccard:5%") == method
    ('edit+jaccard:5%', True)
    """

    noise: ClassVar[None] = None  # distances assume no noise and give no probabilities
    refined: ClassVar[bool] = False

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
            raise InputError(
                "the method compares neither types nor angles; give a measure for one of them."
            )
        if not 0 <= self.alpha <= 1:
            raise InputError(
                f"the share alpha of the types is {self.alpha}; give a number from 0 to 1."
            )
        if self.keep is not None and not 0 < self.keep <= 100:  # noqa: PLR2004
            raise InputError(
                f"{self.keep} % of the cells are to be kept; give a number above 0 and up to 100."
            )
        if self.keep is not None and len(self.measures) == 1:
            raise InputError(
                "a two-stage method ranks by types and then by angles, but it has one measure; "
                "give both, or leave the percentage out."
            )

    @classmethod
    def parse(cls, text: str) -> Method:
        """Read a method from text, as `str` writes it.

        The form is ``types+angles`` (``edit+jaccard``), or one part (``types:edit``,
        ``angles:histogram``), then any of ``:5%`` (two-stage), ``:alpha=0.7``, ``:raw`` and
        ``:weights=2/1/1`` (insert, delete, substitute). Raises UnknownNameError or InputError for
        other text.
        """
        unreadable = (
            f"method {text!r} cannot be read; give two measures as 'edit+jaccard' (types, angles) "
            "or one as 'types:edit' or 'angles:histogram', optionally followed by ':5%' for two "
            "stages, ':alpha=0.7', ':raw' or ':weights=2/1/1'."
        )
        head, *options = text.strip().split(":")
        types: str | None
        angles: str | None
        if head in {TYPES, ANGLES} and options:
            name = options.pop(0)
            types, angles = (name, None) if head == TYPES else (None, name)
        elif head.count("+") == 1:
            types, angles = head.split("+")
        else:
            raise InputError(unreadable)
        values: dict[str, Any] = {}
        for option in options:
            try:
                key, value = _parse_option(option)
            except SemsigError:
                raise
            except (TypeError, ValueError) as error:
                raise InputError(unreadable) from error
            if key in values:
                raise InputError(unreadable)
            values[key] = value
        return cls(types=types, angles=angles, **values)

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        if len(self.measures) > 1:
            parts = ["+".join(self.measures.values())]
        else:
            parts = [f"{part}:{name}" for part, name in self.measures.items()]
        if self.keep is not None:
            parts.append(f"{str(self.keep).removesuffix('.0')}%")
        if self.alpha != Method.__dataclass_fields__["alpha"].default:
            parts.append(f"alpha={str(self.alpha).removesuffix('.0')}")
        if not self.normalized:
            parts.append("raw")
        if self.weights != EditWeights():
            parts.append("weights=" + "/".join(map(str, astuple(self.weights))))
        return ":".join(parts)

    @property
    def measures(self) -> dict[str, str]:
        """The metric of each compared part, by ``"types"`` and ``"angles"``."""
        parts = {TYPES: self.types, ANGLES: self.angles}
        return {part: name for part, name in parts.items() if name is not None}

    def used(self, query: Signature) -> str:
        """Return the parts of a query that the method compares: types, angles or types+angles.

        A fusion uses one part if the query has only this one. Raises InputError if the query has no
        part that the method compares.
        """
        present = {TYPES: query.codes is not None, ANGLES: query.bearings is not None}
        parts = [part for part in self.measures if present[part]]
        if not parts:
            names = {TYPES: "types", ANGLES: "bearings"}
            own, other = (TYPES, ANGLES) if self.angles is None else (ANGLES, TYPES)
            raise InputError(
                f"method '{self}' compares {names[own]}, but the query has only {names[other]}; "
                f"give its {names[own]}, or a method such as '{other}:edit'."
            )
        return "+".join(parts)


FUSION: Method = Method()
"""Metric fusion of two edit distances with equal weights."""


def _parse_option(option: str) -> tuple[str, Any]:
    """Return the field name and the value of an option in the text of a method."""
    key, _, value = option.partition("=")
    if option == "raw":
        return "normalized", False
    if option.endswith("%"):
        return "keep", float(option[:-1])
    if key == "alpha":
        return "alpha", float(value)
    if key == "weights":
        return "weights", EditWeights(*map(int, value.split("/")))
    raise ValueError(option)
