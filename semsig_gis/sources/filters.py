"""What a catalogue accepts of a tag or a field: values, patterns, comparisons, or nothing there."""

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
# What is accepted of each of several tags or fields.
Rules = tuple[tuple[str, tuple[Value, ...]], ...]
# Stands for every value but "no".
ANY_VALUE = "*"
# Stands for a tag or a field that is absent or empty.
NO_VALUE = "none"
# A value that a catalogue writes between slashes is a pattern.
BETWEEN_SLASHES = re.compile(r"/(.+)/")
SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
NUMBER = r"(-?\d+(?:\.\d+)?)"
COMPARISON = re.compile(rf"(<=?|>=?)\s*{NUMBER}")
# What begins so is meant as a comparison.
COMPARES = re.compile(r"[<>=≤≥≠]|!=")
# The lowest and highest of several numbers, as in "0-2".
RANGE = re.compile(rf"\s*{NUMBER}\s*-\s*{NUMBER}\s*")


@dataclass(frozen=True, slots=True)
class Condition:
    """The alternatives that a catalogue accepts of a tag or a field.

    `values` are accepted exactly, or as patterns; `comparisons` are signs and numbers; `nothing`
    says whether the tag or field may be absent or empty.
    """

    values: tuple[Value, ...]
    comparisons: tuple[tuple[str, float], ...] = ()
    nothing: bool = False

    @classmethod
    def parse(cls, accepted: Iterable[Value]) -> Condition:
        """Return what a catalogue writes, as ``">=0 or none"``; CatalogError says what is wrong."""
        values: list[Value] = []
        comparisons = []
        parts = [part for value in accepted for part in _alternatives(value)]
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
                pattern_of(text)  # which refuses one that is none
                values.append(part)
        return cls(tuple(values), tuple(comparisons), nothing=NO_VALUE in parts)

    def accepts(self, value: object, *, every: bool = False) -> bool:
        """Tell whether a value is among the alternatives.

        A value may list several numbers, as the levels ``"-1;0"`` or ``"0-2"``; one that passes a
        comparison is enough, unless `every` of them has to.
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


def _alternatives(value: Value) -> list[Value]:
    """Return the parts of a text that is several alternatives, else the value itself."""
    if not isinstance(value, str) or BETWEEN_SLASHES.fullmatch(value):
        return [value]
    parts = [part.strip() for part in re.split(r"\sor\s", value)]
    special = any(part == NO_VALUE or COMPARES.match(part) for part in parts)
    return [*parts] if special else [value]


def _numbers(value: object) -> list[float]:
    """Return the numbers that a value lists, NaN for a part that is none."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [float(value)]
    return [number for part in str(value).split(";") for number in _numbers_of(part)]


def _numbers_of(part: str) -> list[float]:
    several = RANGE.fullmatch(part)
    if several:
        return [float(number) for number in several.groups()]
    try:
        return [decimal(part)]
    except ValueError:
        return [math.nan]


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
    """Tell whether a field value is the one a catalogue names.

    Text compares as text and numbers as numbers, so that 3 is found in a text field and "3" in a
    numeric one. A text between slashes is a regular expression for the whole value.
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
    """Return the pattern that a text between slashes is; CatalogError if it is not valid."""
    inner = BETWEEN_SLASHES.fullmatch(accepted)
    try:
        return re.compile(inner[1]) if inner else None
    except re.error as error:
        raise CatalogError(
            f"pattern {accepted} is not a regular expression ({error}); correct it."
        ) from error
