"""What a result shows of itself: its main facts, on one line and as a small table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING, Any

from semsig_gis.core.text import one_line

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

LONGEST_FACT = 60  # letters

# What the packages of pictures and of maps alone import, for readers of a signature.
Axes = Any  # of matplotlib
MapFrame = Any  # of `maps.page`


class Displayed(ABC):
    """Something that shows its main facts, in a terminal and in a notebook.

    A dataclass keeps this form with ``repr=False``.
    """

    __slots__ = ()

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """Return the main facts by what they are called, without looking into files."""

    @property
    def _public_name(self) -> str:
        kinds = (kind.__name__ for kind in type(self).__mro__)
        return next(name for name in kinds if not name.startswith("_"))

    def __repr__(self) -> str:
        """Return the facts on one line."""
        facts = "; ".join(f"{name} {_brief(fact)}" for name, fact in self._facts().items())
        return f"<{self._public_name}: {facts}>"

    def _repr_html_(self) -> str:
        """Return the facts as a table, with texts from data escaped."""
        rows = "".join(
            f'<tr><th style="text-align: left">{escape(name)}</th>'
            f'<td style="text-align: left">{escape(_brief(fact))}</td></tr>'
            for name, fact in self._facts().items()
        )
        title = f'<caption style="text-align: left">{self._public_name}</caption>'
        return f"<table>{title}<tbody>{rows}</tbody></table>"


def _brief(fact: object) -> str:
    """Return a fact as a short text on one line."""
    text = one_line(f"{fact:,}" if isinstance(fact, int) else str(fact))
    return text if len(text) <= LONGEST_FACT else f"{text[: LONGEST_FACT - 1]}…"


def bounds_text(xy: NDArray[np.float64]) -> str:
    """Return between which metres places lie, shape (n, 2); of none there is nothing to say."""
    if not len(xy):
        return "none"
    (west, south), (east, north) = xy.min(axis=0).tolist(), xy.max(axis=0).tolist()
    return f"x {west:,.0f} to {east:,.0f}, y {south:,.0f} to {north:,.0f}"
