"""The signs of the classes of street objects on maps: a shape, a colour and a letter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["Sign", "class_signs"]

# Those of Okabe and Ito, and two of Tol, which colour-blind people tell apart, in the order of the
# reports, where green comes first because trees do; then a lighter or darker one of each.
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
# Outlines around (0, 0), of about the same area, and how far below it a letter stands.
SHAPES = (
    ("M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z", 0.0),  # circle
    ("M-.9,-.9H.9V.9H-.9Z", 0.0),  # square
    ("M0,-1.25L1.25,0L0,1.25L-1.25,0Z", 0.0),  # diamond
    ("M0,-1.2L1.25,.95H-1.25Z", 0.3),  # triangle
    ("M-1.15,0L-.58,-1H.58L1.15,0L.58,1H-.58Z", 0.0),  # hexagon
    ("M0,1.2L1.25,-.95H-1.25Z", -0.3),  # triangle on its tip
    ("M-.6,-1.1H.6V-.6H1.1V.6H.6V1.1H-.6V.6H-1.1V-.6H-.6Z", 0.0),  # cross
)
DARK, LIGHT = "#000000", "#ffffff"
BRIGHT = 130.0


@dataclass(frozen=True, slots=True)
class Sign:
    """What an object of a class looks like.

    Parameters
    ----------
    symbol : str
        One letter or digit.
    colour, ink : str
        Of the shape and of the letter on it, ``#rrggbb``.
    outline : str
        Path of an SVG around (0, 0), about 1 from it.
    drop : float
        How far below (0, 0) the letter stands.
    """

    symbol: str
    colour: str
    ink: str
    outline: str
    drop: float

    def svg(self) -> str:
        """Return the sign as an element of a page."""
        return (
            '<svg class="semsig-sign" viewBox="-1.3 -1.3 2.6 2.6" aria-hidden="true">'
            f'<path d="{self.outline}" fill="{self.colour}"/>'
            f'<text y="{self.drop + 0.42:.2f}" font-size="1.2" font-weight="700" '
            f'font-family="system-ui,sans-serif" text-anchor="middle" fill="{self.ink}">'
            f"{self.symbol}</text></svg>"
        )


def class_signs(taxonomy: Taxonomy) -> dict[int, Sign]:
    """Return the sign of each class code; neighbours differ in shape, colour and lightness."""
    signs = {}
    for number, item in enumerate(sorted(taxonomy.classes, key=lambda one: one.code)):
        colour = COLOURS[number % len(COLOURS)]
        red, green, blue = bytes.fromhex(colour[1:])
        ink = DARK if 0.299 * red + 0.587 * green + 0.114 * blue > BRIGHT else LIGHT
        signs[item.code] = Sign(item.symbol, colour, ink, *SHAPES[number % len(SHAPES)])
    return signs
