"""What a cell must see to be a candidate."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.taxonomy import WILDCARD

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SequenceTable

_COMPARISON = re.compile(r"(\S)\s*(>=|<=|=)\s*(\d+)")
_AMOUNT = re.compile(r"(\d*)\s*(\S)")


@dataclass(frozen=True, slots=True)
class Requirement:
    """How many objects of some classes a cell must see.

    Each limit is a class code, or `WILDCARD` for all objects together, the fewest and the most.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> requirement = Requirement.parse("M,2B", paper_taxonomy())
    """

    limits: tuple[tuple[int, int, float], ...]

    @classmethod
    def parse(cls, text: str, taxonomy: Taxonomy) -> Self:
        """Read a requirement from text, such as ``M,2B,D=0,?<=10``.

        Parts stand between commas: ``M`` for at least one bus stop, ``2B`` for at least two trees,
        or ``B>=2``, ``B<=5``, ``B=3``. The symbol ``?`` counts all objects. A symbol may stand in
        several parts. Raise InputError if a part does not have that form or two parts exclude each
        other, and UnknownNameError if a symbol is not in the taxonomy.
        """
        limits: dict[int, tuple[int, float]] = {}
        for part in map(str.strip, text.split(",")):
            symbol, least, most = _read(part, text)
            code = WILDCARD if symbol == "?" else taxonomy.by_symbol(symbol).code
            low, high = limits.get(code, (0, math.inf))
            limits[code] = low, high = max(low, least), min(high, most)
            if low > high:
                raise InputError(
                    f"requirement {text!r} wants at least {low} and at most {high} of "
                    f"{symbol!r}; give numbers that a cell can meet."
                )
        return cls(tuple((code, low, high) for code, (low, high) in limits.items()))

    def met(self, sequences: SequenceTable) -> NDArray[np.bool_]:
        """Tell which cells meet it, shape (n,), by their distinct type sequences."""
        counts = sequences.histogram
        met = np.ones(len(sequences), np.bool_)
        for code, least, most in self.limits:
            seen = np.zeros(len(sequences), np.int64)
            if code == WILDCARD:
                seen = sequences.lengths
            elif code < counts.shape[1]:
                seen = counts[:, code].astype(np.int64)
            met &= (seen >= least) & (seen <= most)
        return np.asarray(met[sequences.inverse])


def _read(part: str, text: str) -> tuple[str, int, float]:
    """Return the symbol, the fewest and the most of one part of a requirement."""
    if found := _COMPARISON.fullmatch(part):
        symbol, sign, digits = found.groups()
        number = int(digits)
        return symbol, 0 if sign == "<=" else number, math.inf if sign == ">=" else number
    if found := _AMOUNT.fullmatch(part):
        digits, symbol = found.groups()
        return symbol, int(digits or 1), math.inf
    raise InputError(
        f"{part!r} in requirement {text!r} cannot be read; give parts such as 'M', '2B', 'B>=2', "
        "'B<=5' or 'B=3' with commas between them, '?' for all objects."
    )
