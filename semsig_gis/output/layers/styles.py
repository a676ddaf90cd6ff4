"""Styles of layers: classes of numbers, values and names, each with a label and a symbol.

A style is plain data. QGIS, web maps, figures and files of other programs are drawn from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import (
    ANSWERS,
    CELL_CHANCES,
    ERROR_BREAKS,
    FAILURES,
    FOUND_RAMP,
    GROUP_COLOURS,
    OUTCOMES,
    RANK_RAMP,
    SHADES,
    class_signs,
    codes_by_family,
    family_named,
    percent,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import ClassSign, Mark, Taxonomy


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Classes of a number, each with its label and colour ``#rrggbb``.

    ``breaks`` are the lower bounds of the classes, which belong to them, then the upper bound of
    the last. ``below`` is the label of smaller numbers, which are not drawn.
    """

    title: str
    breaks: tuple[float, ...]
    labels: tuple[str, ...]
    colours: tuple[str, ...]
    whole: bool = False  # whether it is a scale of whole numbers
    below: str = ""

    def levels(self, values: ArrayLike) -> NDArray[np.uint8]:
        """Return the class of each number, from 1; 0 for a smaller number."""
        levels: NDArray[np.uint8] = np.digitize(np.asarray(values), self.breaks[:-1]).astype("u1")
        return levels

    @property
    def ranges(self) -> list[tuple[float, float, str, str]]:
        """Lowest and highest number, label and colour of each class."""
        last = len(self.labels) - 1
        return [
            (low, high - 1 if self.whole and number < last else high, label, colour)
            for number, ((low, high), label, colour) in enumerate(
                zip(pairwise(self.breaks), self.labels, self.colours, strict=True)
            )
        ]


def _counts(title: str, colours: Mapping[int, str], *, first: str = "") -> Scale:
    """Return a scale of whole numbers by the colour of each smallest number."""
    starts = [*colours]
    labels = [f"{low:,} to {high - 1:,}" for low, high in pairwise(starts)]
    labels.append(f"{starts[-1]:,} or more")
    labels[0] = first or labels[0]
    return Scale(
        title=title,
        breaks=(*starts, 1e9),
        labels=tuple(labels),
        colours=tuple(colours.values()),
        whole=True,
    )


SEEN: Scale = _counts("objects seen", SHADES)
"""Objects seen from a cell."""

AMBIGUITY: Scale = _counts("cells with the same types", GROUP_COLOURS, first="no other")
"""Cells with the types of a cell, itself included."""

IDENTIFIABILITY: Scale = Scale(
    title="chance to be found",
    breaks=tuple(number / 10 for number in range(11)),
    labels=tuple(f"found: {10 * number} to {10 * (number + 1)} %" for number in range(10)),
    colours=FOUND_RAMP,
)
"""Chance that a query from a cell is found."""

FAILED: Scale = Scale(
    title="share of queries that fail",
    breaks=(*FAILURES, 1.0),
    labels=tuple(
        f"failed: {percent(low, 0)} to {percent(high, 0)}"
        for low, high in pairwise([*FAILURES, 1.0])
    ),
    colours=tuple(FAILURES.values()),
)
"""Share of the queries around a place that failed."""

# Larger errors are darker, in the colours of the shares that failed.
ERRORS: Scale = Scale(
    title="mean error",
    breaks=(0.0, *map(float, ERROR_BREAKS), np.inf),
    labels=(*(f"{low} to {high} m" for low, high in pairwise((0, *ERROR_BREAKS))), "farther"),
    colours=tuple(FAILURES.values()),
)
"""Mean error in metres of the queries from a cell."""

CHANCES: Scale = Scale(
    title="chance of a cell",
    breaks=(*CELL_CHANCES, 1.0),
    labels=tuple(f"{100 * chance:g} % or more" for chance in CELL_CHANCES),
    colours=tuple(CELL_CHANCES.values()),
    below=f"less than {percent(min(CELL_CHANCES), 3)}",
)
"""Chance that the place is in a cell."""

RANKS: Scale = Scale(
    title="rank",
    breaks=(1, 2, 4, 11, 1e9),
    labels=("rank 1", "rank 2 to 3", "rank 4 to 10", "rank 11 and more"),
    colours=RANK_RAMP[::-1],
    whole=True,
)
"""Rank of a place; the best is the darkest."""


@dataclass(frozen=True, kw_only=True)
class Symbol:
    """How a feature is drawn.

    A point is a ``shape`` of ``metres`` on the ground, and of at least ``least_mm`` on the screen;
    a line is so wide, or thin without metres, or ends in the shape, if there is one. ``edge`` is
    the colour of the outline, and ``sign`` the class with the pictogram or the letter that is drawn
    on the shape.
    """

    colour: str
    opacity: float = 1.0  # of the fill, the line or a square; an edge of the colour has it as well
    shape: str = ""
    metres: float = 0.0
    least_mm: float = 0.0
    edge: str = ""
    edge_mm: float = 0.1
    sign: ClassSign | None = None


@dataclass(frozen=True, kw_only=True)
class StyleClass:
    """Features that are drawn in the same way: those of a value, or from ``low`` to ``high``."""

    label: str
    symbol: Symbol
    value: str = ""
    low: float = np.nan
    high: float = np.nan


@dataclass(frozen=True, kw_only=True)
class Style:
    """A style of a layer: its classes by the values of a column, or one class for all."""

    name: str
    classes: tuple[StyleClass, ...]
    column: str = ""
    last_first: bool = False  # whether the first classes are drawn last, on top
    tiled: bool = False  # whether areas lie side by side, so that none shines through another

    def class_of(self, value: object) -> StyleClass | None:
        """Return the class of a value, or None."""
        for item in self.classes:
            if item.value == str(value) or (
                isinstance(value, int | float) and item.low <= value <= item.high
            ):
                return item
        return None


# Cells are transparent, so that a background map stays visible. The colours are, not the layer, so
# that a legend shows what the map shows.
CELLS_OPACITY = 0.7


def by_class(taxonomy: Taxonomy, codes: Iterable[int]) -> Style:
    """Return a style of points by class code: the shape of the class with its pictogram.

    Classes of several families are ordered by family, which their labels name.
    """
    signs, present = class_signs(taxonomy), set(codes)
    families = codes_by_family(taxonomy, [code for code in signs if code in present])
    return Style(
        name="Classes",
        column="class_code",
        classes=tuple(
            StyleClass(
                label=f"{family_named(family).title}: {signs[code].title}"
                if len(families) > 1
                else signs[code].title,
                symbol=Symbol(colour=signs[code].colour, shape=signs[code].shape, sign=signs[code]),
                value=str(code),
            )
            for family, members in families.items()
            for code in members
        ),
    )


def by_amount(
    name: str, column: str, scale: Scale, *, geometry: str, size: float = 0.0, heading: str = ""
) -> Style:
    """Return a style of cells by a number; points are drawn as squares of `size` metres.

    Each label starts with the heading, because a legend of QGIS has no place for one above.
    """
    symbols = [
        # The thinnest outline covers the gaps that anti-aliasing leaves between cells.
        Symbol(colour=colour, opacity=CELLS_OPACITY, edge=colour, edge_mm=0.0)
        if geometry == "polygon"
        else Symbol(colour=colour, opacity=CELLS_OPACITY, shape="square", metres=size)
        for colour in scale.colours
    ]
    labels = [f"{heading}: {label}" if heading else label for label in scale.labels]
    classes = _ranges(replace(scale, labels=tuple(labels)), symbols)
    return Style(name=name, column=column, classes=classes, tiled=True)


def by_rank(column: str, *, geometry: str) -> Style:
    """Return a style of places by rank; the best is the darkest."""
    symbols = []
    for number, colour in enumerate(RANKS.colours):
        if geometry == "polygon":
            # At small scales only the edge of a region is visible; the palest colour would vanish.
            edge = RANK_RAMP[1] if colour == RANK_RAMP[0] else colour
            symbols.append(Symbol(colour=colour, opacity=2 / 3, edge=edge, edge_mm=0.4))
        else:
            # A dark edge makes pale places visible on a pale map.
            dot = Symbol(colour=colour, shape="circle", edge=RANK_RAMP[-1])
            symbols.append(replace(dot, metres=12.0 - 2.0 * number, least_mm=3.2 - 0.4 * number))
    return Style(name="Rank", column=column, classes=_ranges(RANKS, symbols), last_first=True)


def by_outcome(*, geometry: str) -> Style:
    """Return a style of queries by outcome; a line ends in a mark at the best place."""
    return _by_mark("Outcome", OUTCOMES, geometry)


def by_answer(*, geometry: str) -> Style:
    """Return a style of the best place or its ellipse, by whether it is the answer or withheld."""
    return _by_mark("Answer", ANSWERS, geometry, label="answer {}")


def _by_mark(name: str, marks: Mapping[str, Mark], geometry: str, label: str = "{}") -> Style:
    """Return a style by the column with the name of the style, in lower case."""
    classes = []
    for value, mark in marks.items():
        symbol = Symbol(colour=mark.colour, shape=mark.shape, metres=12.0, least_mm=1.8)
        symbol = replace(symbol, edge="#222222")
        if geometry == "line":
            end = replace(symbol, shape="x", metres=10.0, least_mm=1.4, edge=mark.colour)
            symbol = replace(end, opacity=0.59)
        if geometry == "polygon":
            symbol = Symbol(colour=mark.colour, opacity=0.0, edge=mark.colour, edge_mm=0.6)
        classes.append(StyleClass(label=label.format(value), symbol=symbol, value=value))
    return Style(name=name, column=name.lower(), classes=tuple(classes))


def _ranges(scale: Scale, symbols: Sequence[Symbol]) -> tuple[StyleClass, ...]:
    return tuple(
        StyleClass(label=label, symbol=symbol, low=low, high=high)
        for (low, high, label, _), symbol in zip(scale.ranges, symbols, strict=True)
    )
