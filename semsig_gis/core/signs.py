"""What the classes of street objects look like, the same on maps, in QGIS and in reports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semsig_gis.core.taxonomy import Taxonomy

# Those of Okabe and Ito, and two of Tol, which colour-blind people tell apart; then a lighter or
# darker one of each. Green comes first because trees do.
COLOURS = (
    "#009e73",
    "#0072b2",
    "#e69f00",
    "#cc79a7",
    "#d55e00",
    "#56b4e9",
    "#666666",
    "#aa4499",
    "#999933",
    "#8fdcc0",
    "#6a4fd8",
    "#8a5a00",
    "#f4b6d2",
    "#8c2d04",
    "#b8e1f5",
    "#b4b4b4",
    "#e3b5e3",
    "#dddd99",
)
SHAPES = ("circle", "square", "diamond", "triangle", "hexagon", "triangle_down", "cross")
"""Names of the shapes, all with room for a letter; who draws a sign knows how each looks."""

# Triangles have more room where they are wider.
DROPS = {"triangle": 0.4, "triangle_down": -0.4}

BLACK, WHITE = "#000000", "#ffffff"
DARK = 0.04045


@dataclass(frozen=True, slots=True)
class ClassSign:
    """What an object of a class looks like: its symbol on one of `SHAPES`, coloured ``#rrggbb``."""

    symbol: str
    title: str
    shape: str
    colour: str

    @property
    def ink(self) -> str:
        """Colour of the letter: black or white, whichever contrasts more with the shape."""
        return max(BLACK, WHITE, key=lambda ink: _contrast(ink, self.colour))

    @property
    def drop(self) -> float:
        """How far below the middle the letter stands, in radii of a circle of the same size."""
        return DROPS.get(self.shape, 0.0)


def class_signs(taxonomy: Taxonomy) -> dict[int, ClassSign]:
    """Return the sign of each class.

    Parameters
    ----------
    taxonomy : Taxonomy
        The classes, in any order.

    Returns
    -------
    dict of int to ClassSign
        By class code. Up to 18 classes differ in colour, and up to 126 in colour or shape.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> class_signs(paper_taxonomy())[3]
    ClassSign(symbol='D', title='Street light', shape='diamond', colour='#e69f00')
    """
    ordered = sorted(taxonomy.classes, key=lambda item: item.code)
    return {
        item.code: ClassSign(
            item.symbol,
            item.title,
            SHAPES[number % len(SHAPES)],
            COLOURS[number % len(COLOURS)],
        )
        for number, item in enumerate(ordered)
    }


def _contrast(one: str, other: str) -> float:
    """Return the contrast of two colours as WCAG 2 defines it: 1 to 21; text needs 4.5."""
    darker, lighter = sorted((_luminance(one), _luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


def _luminance(colour: str) -> float:
    """Return the relative luminance of a colour of sRGB, which is a line in the dark."""
    shares = [part / 255 for part in bytes.fromhex(colour[1:])]
    red, green, blue = (
        share / 12.92 if share <= DARK else ((share + 0.055) / 1.055) ** 2.4 for share in shares
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
