"""Conditions of catalogues on tags and fields: values, patterns, comparisons, absence."""

from __future__ import annotations

import functools
import math
import operator
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.core import CatalogError
from semsig_gis.sources.numbers import decimal

if TYPE_CHECKING:
    from collections.abc import Iterable


Value = str | int | float | bool
# Tags or fields, each with its accepted values.
Rules = tuple[tuple[str, tuple[Value, ...]], ...]
# Accepts every value except "no".
ANY_VALUE = "*"
# Accepts an absent or empty tag or field.
NO_VALUE = "none"
# A value between slashes is a regular expression.
BETWEEN_SLASHES = re.compile(r"/(.+)/")
SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
NUMBER = r"(-?\d+(?:\.\d+)?)"
COMPARISON = re.compile(rf"(<=?|>=?)\s*{NUMBER}")
# A text that starts like this is meant as a comparison.
COMPARES = re.compile(r"[<>=≤≥≠]|!=")
# The lowest and highest of several numbers, as in "0-2".
RANGE = re.compile(rf"\s*{NUMBER}\s*-\s*{NUMBER}\s*")


@dataclass(frozen=True, slots=True)
class Condition:
    """Alternatives that a catalogue accepts for a tag or a field.

    `values` are exact values or patterns, `comparisons` are signs and numbers, and `nothing` is
    whether the tag or field may be absent or empty.
    """

    values: tuple[Value, ...]
    comparisons: tuple[tuple[str, float], ...] = ()
    nothing: bool = False

    @classmethod
    def parse(cls, accepted: Iterable[Value]) -> Condition:
        """Parse the values of a catalogue, such as ``">=0 or none"``; CatalogError if not valid."""
        values: list[Value] = []
        comparisons = []
        parts: list[Value] = []
        for value in accepted:
            texts = []
            if isinstance(value, str) and not BETWEEN_SLASHES.fullmatch(value):
                texts = [part.strip() for part in re.split(r"\sor\s", value)]
            # Only a text with a comparison or with "none" lists alternatives.
            special = any(part == NO_VALUE or COMPARES.match(part) for part in texts)
            parts += texts if special else [value]
        for part in parts:
            text = part if isinstance(part, str) else ""
            comparison = COMPARISON.fullmatch(text)
            if comparison:
                comparisons.append((comparison[1], float(comparison[2])))
            elif COMPARES.match(text):
                raise CatalogError(
                    f"{text!r} is not a comparison; write one such as '>=0' or '>=0 or none', or "
                    f"'/{re.escape(text)}/' for that very text."
                )
            elif part != NO_VALUE:
                pattern_of(text)  # raises if the pattern is not valid
                values.append(part)
        return cls(tuple(values), tuple(comparisons), nothing=NO_VALUE in parts)

    def accepts(self, value: object, *, every: bool = False) -> bool:
        """Whether a value is among the alternatives.

        Of a value with several numbers, such as the levels ``"-1;0"`` or ``"0-2"``, one must pass
        a comparison, or with `every` all of them.
        """
        if value is None:
            return self.nothing
        if _is_blank(value) and self.nothing:
            return True
        if ANY_VALUE in self.values and not _is_blank(value) and as_text(value) != "no":
            return True
        if any(matches(value, accepted) for accepted in self.values):
            return True
        if not self.comparisons:
            return False
        passed = (
            any(SIGNS[sign](number, limit) for sign, limit in self.comparisons)
            for number in _numbers(value)
        )
        return all(passed) if every else any(passed)


def _numbers(value: object) -> list[float]:
    """Return the numbers of a value, NaN for a part that is not a number."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [float(value)]
    numbers: list[float] = []
    for part in str(value).split(";"):
        if limits := RANGE.fullmatch(part):
            numbers += map(float, limits.groups())
            continue
        try:
            numbers.append(decimal(part))
        except ValueError:
            numbers.append(math.nan)
    return numbers


def _is_blank(value: object) -> bool:
    if isinstance(value, str):
        return not value.strip()
    return value is None or (isinstance(value, float) and math.isnan(value))


def as_text(value: object) -> str:
    """Return a field value as text; a whole number has no decimals."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def matches(value: object, accepted: Value) -> bool:
    """Whether a field value matches a value of a catalogue.

    A text is compared as text and a number as a number, so that 3 matches in a text field and "3"
    in a numeric field. A text between slashes is a regular expression for the whole value.
    """
    if value is None:
        return False
    if isinstance(accepted, str):
        pattern = pattern_of(accepted)
        text = as_text(value)
        return text == accepted if pattern is None else pattern.fullmatch(text) is not None
    if isinstance(accepted, bool) or isinstance(value, bool):
        return as_text(value) == as_text(accepted)
    try:
        return float(value) == accepted  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False


@functools.lru_cache
def pattern_of(accepted: str) -> re.Pattern[str] | None:
    """Return the pattern of a text between slashes, else None; CatalogError if not valid."""
    inner = BETWEEN_SLASHES.fullmatch(accepted)
    try:
        return re.compile(inner[1]) if inner else None
    except re.error as error:
        raise CatalogError(
            f"pattern {accepted} is not a regular expression ({error}); correct it."
        ) from error
