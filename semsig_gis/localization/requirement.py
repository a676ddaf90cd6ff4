"""Requirements on the objects that a cell sees."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from semsig_gis.core import WILDCARD, InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import SequenceTable

_COMPARISON = re.compile(r"(\S)\s*(>=|<=|=)\s*(\d+)")
_AMOUNT = re.compile(r"(\d*)\s*(\S)")


@dataclass(frozen=True, slots=True)
class Requirement:
    """Limits on the numbers of objects that a cell sees, by class.

    Each limit is a class code (`WILDCARD` for all objects together), the minimum and the maximum.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> requirement = Requirement.parse("M,2B", paper_taxonomy())
    """

    limits: tuple[tuple[int, int, float], ...]

    @classmethod
    def parse(cls, text: str, taxonomy: Taxonomy) -> Self:
        """Read a requirement from text, such as ``M,2B,D=0,?<=10``.

        Parts are separated by commas: ``M`` for at least one bus stop, ``2B`` for at least two
        trees, or ``B>=2``, ``B<=5``, ``B=3``. The symbol ``?`` counts all objects. A symbol may be
        in several parts. Raises InputError if a part has another form or two parts exclude each
        other, and UnknownNameError if a symbol is not in the taxonomy.
        """
        limits: dict[int, tuple[int, float]] = {}
        for part in map(str.strip, text.split(",")):
            least, most = 0, math.inf
            if match := _COMPARISON.fullmatch(part):
                symbol, sign, digits = match.groups()
                least = 0 if sign == "<=" else int(digits)
                most = math.inf if sign == ">=" else int(digits)
            elif match := _AMOUNT.fullmatch(part):
                digits, symbol = match.groups()
                least = int(digits or 1)
            else:
                raise InputError(
                    f"{part!r} in requirement {text!r} cannot be read; give parts such as 'M', "
                    "'2B', 'B>=2', 'B<=5' or 'B=3' with commas between them, '?' for all objects."
                )
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
        """Return a mask of the cells that meet it, shape (n,), from their type sequences."""
        counts = sequences.histogram
        mask = np.ones(len(sequences), np.bool_)
        for code, least, most in self.limits:
            numbers = np.zeros(len(sequences), np.int64)
            if code == WILDCARD:
                numbers = sequences.lengths
            elif code < counts.shape[1]:
                numbers = counts[:, code].astype(np.int64)
            mask &= (numbers >= least) & (numbers <= most)
        return np.asarray(mask[sequences.inverse])
