"""How maps draw the signs of the classes of street objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semsig_gis.class_signs import ClassSign

__all__ = ["OUTLINES", "sign_svg"]

OUTLINES = {
    "circle": "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z",
    "square": "M-.9,-.9H.9V.9H-.9Z",
    "diamond": "M0,-1.25L1.25,0L0,1.25L-1.25,0Z",
    "triangle": "M0,-1.2L1.2,1.2H-1.2Z",
    "hexagon": "M0,-1.15L1,-.575V.575L0,1.15L-1,.575V-.575Z",
    "triangle_down": "M0,1.2L1.2,-1.2H-1.2Z",
    "cross": "M-.6,-1.1H.6V-.6H1.1V.6H.6V1.1H-.6V.6H-1.1V-.6H-.6Z",
}
"""Path of an SVG for each shape, around (0, 0), of about the area of a circle of radius 1."""


def sign_svg(sign: ClassSign) -> str:
    """Return a sign as an element of a page."""
    return (
        '<svg class="semsig-sign" viewBox="-1.3 -1.3 2.6 2.6" aria-hidden="true">'
        f'<path d="{OUTLINES[sign.shape]}" fill="{sign.colour}"/>'
        f'<text y="{sign.drop + 0.42:.2f}" font-size="1.2" font-weight="700" '
        f'font-family="system-ui,sans-serif" text-anchor="middle" fill="{sign.ink}">'
        f"{sign.symbol}</text></svg>"
    )
