"""What the legends of maps are made of: signs, ramps, and text from data made safe."""

from __future__ import annotations

import itertools
from html import escape
from typing import TYPE_CHECKING

from semsig_gis import __version__
from semsig_gis.core.signs import SHADES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.signs import ClassSign
    from semsig_gis.core.taxonomy import Taxonomy

FLIPPING = "square semsig-flip"
"""A sign whose lightness flips in the dark, as what it explains does."""

LIFTING = "square semsig-lift"
"""A sign that is brighter in the dark, as what it explains is."""

NAMED_CLASSES = 6
"""How many classes a legend names."""

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


def isolated(text: str) -> str:
    """Return text from data, in which signs of direction turn no other text."""
    return f"<bdi>{escape(text)}</bdi>"


def query_text(query: Signature, taxonomy: Taxonomy) -> str:
    """Return what was asked, a line each."""
    lines = []
    if query.codes is not None:
        lines.append(f"Types: {escape(taxonomy.decode(query.codes))}<br>")
    if query.bearings is not None:
        degrees = (round(bearing) % 360 for bearing in query.bearings.tolist())
        lines.append(f"Bearings: {' '.join(f'{value}°' for value in degrees)}<br>")
    return "".join(lines)


def swatch(colour: str, shape: str = "round") -> str:
    """Return a small sign of a colour."""
    return f'<i class="{shape}" style="background:{colour}"></i>'


def ramp_bar(colours: Iterable[str], low: str, high: str, *, sign: str = "ramp") -> str:
    """Return a bar of colours with what its ends mean."""
    gradient = f"linear-gradient(to right,{','.join(colours)})"
    return (
        f'<i class="{sign}" style="background:{gradient}"></i>'
        f'<span class="ends"><small>{low}</small><small>{high}</small></span>'
    )


def shades() -> str:
    """Return what the shades of the cells mean."""
    labels = [f"{low}-{high - 1}" for low, high in itertools.pairwise(SHADES)]
    labels.append(f"{max(SHADES)}+")
    signs = " &ensp;".join(
        f"{swatch(colour, FLIPPING)}{label}"
        for colour, label in zip(SHADES.values(), labels, strict=True)
    )
    return f"<p>Objects seen from a cell<br>{signs}</p>"


def sources(licenses: Iterable[str]) -> str:
    """Return who is to be named for the data, and under which licence."""
    lines = [f"Data: {isolated(line)}<br>" for line in licenses]
    return f"<p><small>{''.join(lines)}Made with semsig_gis {escape(__version__)}</small></p>"
