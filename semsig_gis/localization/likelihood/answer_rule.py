"""The rule by which a place is given as an answer or not, and its calibration.

A place is the answer if the chance that the true place is near reaches a threshold. It is
calibrated on queries with a known true place.
"""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import InputError, binomial_tail, check_fields, number, read_table
from semsig_gis.storage import parse_json, read_whole, whole_file

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike

    from semsig_gis.localization.likelihood.posterior import Places, Posterior

STARTS = 4
"""Starting points of the thresholds that are tried, from strict to loose."""
STEPS = 100  # thresholds that are tried at most


class RuleRecord(TypedDict):
    """A rule as plain values; the threshold is None if nothing is answered."""

    threshold: float | None
    radius: float
    precision: float
    confidence: float
    queries: int
    answered: int
    wrong: int
    coverage: float


_Share = Annotated[
    float, number("a share above 0 and below 1", 0, math.nextafter(1, 0), above=True)
]
_Count = Annotated[int, number("a whole number of queries, 0 or more", 0, whole=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerRule:
    """When to answer.

    Parameters
    ----------
    threshold : float
        Least chance that the place is within `radius` of the best one; above 1 for never.
    radius : float, default 50
        Metres that count as right.
    precision, confidence : float, default 0.98 and 0.95
        Share of the answers that must be right, and the confidence with which this was shown.
    queries, answered, wrong : int, default 0
        Queries, answers and wrong answers of the calibration.

    Examples
    --------
    >>> AnswerRule(threshold=0.9).answers(0.95)
    True
    """

    threshold: Annotated[float, number("a chance, 0 or more", 0)]
    radius: Annotated[float, number("metres above 0", 0, sys.float_info.max, above=True)] = 50.0
    precision: _Share = 0.98
    confidence: _Share = 0.95
    queries: _Count = 0
    answered: _Count = 0
    wrong: _Count = 0

    def __post_init__(self) -> None:  # noqa: D105
        check_fields(self, "the answer rule")
        if not 0 <= self.wrong <= self.answered <= self.queries:
            raise InputError(
                f"{self.wrong} wrong of {self.answered} answers to {self.queries} queries were "
                "given; give counts that fit each other."
            )

    @property
    def coverage(self) -> float:
        """Share of the queries of the calibration that were answered; NaN without any."""
        return self.answered / self.queries if self.queries else math.nan

    def to_dict(self) -> RuleRecord:
        """Return plain values for JSON, with the coverage of the calibration."""
        return {
            "threshold": self.threshold if math.isfinite(self.threshold) else None,
            "radius": self.radius,
            "precision": self.precision,
            "confidence": self.confidence,
            "queries": self.queries,
            "answered": self.answered,
            "wrong": self.wrong,
            "coverage": self.coverage,
        }

    def answers(self, mass: float) -> bool:
        """Whether to answer, by the chance that the place is near the best one."""
        return bool(mass >= self.threshold)

    def decide(self, posterior: Posterior, *, places: Places | None = None) -> Decision:
        """Return the best place, its chance, and whether it is the answer.

        The `places` of the posterior are computed if not given.
        """
        best = posterior.places(1, radius=self.radius) if places is None else places
        cell, mass = int(best.centres[0]), round(float(best.chances[0]), 9)
        x, y = posterior.database.xy_of(cell).tolist()
        return Decision(cell=cell, x=x, y=y, mass=mass, given=self.answers(mass))


DEFAULT_RULE: AnswerRule = AnswerRule(threshold=0.9)
"""Answer if the place is within 50 m of the best one with a chance of 0.9 by the model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A cell (row number) with its viewpoint in metres, and whether it is the answer.

    `mass` is the chance that the place is near it; `given` is False for "cannot tell".
    """

    cell: int
    x: float
    y: float
    mass: float
    given: bool


def calibrate(
    masses: ArrayLike,
    correct: ArrayLike,
    *,
    precision: float = 0.98,
    confidence: float = 0.95,
    radius: float = 50.0,
) -> AnswerRule:
    """Choose the threshold that answers the most queries with the required precision.

    Parameters
    ----------
    masses, correct : array_like, shape (q,)
        For each query, the chance that the place is near the best one, and whether it was.
    precision, confidence, radius : float
        As of `AnswerRule`; the confidence is over queries like these.

    Returns
    -------
    AnswerRule
        The rule; its threshold is infinite if the queries do not show any to be good enough.

    Raises
    ------
    InputError
        If the numbers do not fit or are out of range.

    Notes
    -----
    A threshold passes if answers that are wrong as often as allowed would have had at most this
    number of errors with a chance of at most ``1 - confidence`` (Clopper and Pearson). Thresholds
    are tried from strict to loose until one fails, from four starting points that share the allowed
    chance, so that the best of many does not profit from luck (Angelopoulos et al., "Learn then
    test", 2021, fixed-sequence testing with several starts). Without errors, 98 % at 95 % need 217
    answers.

    Examples
    --------
    >>> masses = np.linspace(0.0, 1.0, 1001)
    >>> 0.38 < calibrate(masses, masses > 0.4).threshold < 0.42
    True
    """
    rule = AnswerRule(threshold=math.inf, radius=radius, precision=precision, confidence=confidence)
    chances = np.asarray(masses, dtype=np.float64)
    right = np.asarray(correct)
    if chances.shape != right.shape or chances.ndim != 1 or not np.isfinite(chances).all():
        raise InputError(
            f"{chances.size} chances and {right.size} outcomes were given; give one finite chance "
            "and one outcome for each query."
        )
    order = np.argsort(-chances, kind="stable")
    ranked = chances[order]
    errors = np.cumsum(~right[order].astype(bool))
    # Equal chances are answered together or not at all.
    ends = np.flatnonzero(np.append(ranked[1:] != ranked[:-1], True))
    allowed = (1.0 - confidence) / STARTS
    fewest = math.log(allowed) / math.log(precision)
    ends = ends[ends + 1 >= fewest]
    if len(ends):
        ends = ends[np.unique(np.linspace(0, len(ends) - 1, STEPS).astype(int))]
    # From each start, the loosest threshold before the first that fails.
    best = -1
    for start in range(STARTS):
        for end in ends[start * len(ends) // (2 * STARTS) :].tolist():
            if binomial_tail(int(errors[end]), end + 1, 1.0 - precision) > allowed:
                break
            best = max(best, end)
    return replace(
        rule,
        threshold=float(ranked[best]) if best >= 0 else math.inf,
        queries=len(ranked),
        answered=best + 1,
        wrong=int(errors[best]) if best >= 0 else 0,
    )


def save_rule(rule: AnswerRule, path: str | Path) -> None:
    """Write a rule to a JSON file.

    Parameters
    ----------
    rule : AnswerRule
        The rule.
    path : str or Path
        File to write; it appears whole, by rename.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_rule(AnswerRule(threshold=0.9), f"{folder}/rule.json")
    ...     open_rule(f"{folder}/rule.json").threshold
    0.9
    """
    values = asdict(rule)
    if math.isinf(rule.threshold):
        values["threshold"] = None  # JSON has no infinity
    with whole_file(path) as partial:
        partial.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def open_rule(path: str | Path) -> AnswerRule:
    """Read a rule from a JSON file.

    Parameters
    ----------
    path : str or Path
        File that `save_rule` wrote.

    Returns
    -------
    AnswerRule
        The rule.

    Raises
    ------
    InputError
        If the file cannot be read or does not hold a rule.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_rule(AnswerRule(threshold=0.9), f"{folder}/rule.json")
    ...     open_rule(f"{folder}/rule.json").threshold
    0.9
    """
    try:
        values = parse_json(read_whole(path), finite=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error).rstrip(".")
        raise InputError(
            f"answer rule {path} cannot be read ({reason}); give a file that save_rule wrote."
        ) from error
    if isinstance(values, dict) and values.get("threshold", 0) is None:
        values["threshold"] = math.inf  # which JSON does not have
    return read_table(AnswerRule, values, f"answer rule {path}", error=InputError)
