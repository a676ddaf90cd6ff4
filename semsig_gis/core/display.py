"""Text and HTML representations of results: the main facts on one line or in a small table."""

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

# Names for type hints: these classes belong to packages that core does not import.
Axes = Any  # matplotlib.axes.Axes
MapFrame = Any  # semsig_gis.output.html.page.MapFrame


class Displayed(ABC):
    """Base class of results with a short text (``repr``) and HTML form for notebooks.

    A dataclass needs ``repr=False`` to inherit them.
    """

    __slots__ = ()

    @abstractmethod
    def _facts(self) -> Mapping[str, object]:
        """Return the main facts by name, without reading files."""

    @property
    def _public_name(self) -> str:
        names = (base.__name__ for base in type(self).__mro__)
        return next(name for name in names if not name.startswith("_"))

    def __repr__(self) -> str:
        """Return the facts on one line."""
        facts = "; ".join(f"{name} {_brief(fact)}" for name, fact in self._facts().items())
        return f"<{self._public_name}: {facts}>"

    def _repr_html_(self) -> str:
        """Return the facts as an HTML table; text from data is escaped."""
        rows = "".join(
            f'<tr><th style="text-align: left">{escape(name)}</th>'
            f'<td style="text-align: left">{escape(_brief(fact))}</td></tr>'
            for name, fact in self._facts().items()
        )
        title = f'<caption style="text-align: left">{self._public_name}</caption>'
        return f"<table>{title}<tbody>{rows}</tbody></table>"


def _brief(fact: object) -> str:
    """Return a fact on one line, truncated to `LONGEST_FACT` characters."""
    text = one_line(f"{fact:,}" if isinstance(fact, int) else str(fact))
    return text if len(text) <= LONGEST_FACT else f"{text[: LONGEST_FACT - 1]}…"


def bounds_text(xy: NDArray[np.float64]) -> str:
    """Return the bounds of places in metres, shape (n, 2), as text; 'none' without places."""
    if not len(xy):
        return "none"
    (west, south), (east, north) = xy.min(axis=0).tolist(), xy.max(axis=0).tolist()
    return f"x {west:,.0f} to {east:,.0f}, y {south:,.0f} to {north:,.0f}"
