"""Pictures as files: drawn the same on every run, whatever a user has set up for matplotlib."""

from __future__ import annotations

import bisect
import contextlib
import io
import itertools
import math
import unicodedata
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import matplotlib as mpl
from matplotlib.figure import Figure

from semsig_gis.tables import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

__all__ = [
    "COLOURS",
    "INK",
    "WHITE",
    "Picture",
    "blank_figure",
    "draw_legend",
    "label",
    "saved",
]

COLOURS = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
    "#333333",
    "#882255",
    "#999933",
)
"""Colours that colour-blind people tell apart: those of Okabe and Ito, and two of Tol."""

INK, WHITE = "#222222", "#ffffff"

DOTS_PER_INCH = 200

# Text stays text in an SVG: a reader can search it, copy it and read it in any script.
SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "semsig_gis",
    "text.parse_math": False,
    "font.size": 9.5,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": "#777777",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.7,
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture in two formats; ``description`` tells what is seen to those who cannot see it."""

    svg: bytes
    png: bytes
    description: str

    def _repr_svg_(self) -> str:
        """Show the picture in a notebook."""
        return self.svg.decode("utf-8")


@contextlib.contextmanager
def blank_figure(width: float, height: float) -> Iterator[Figure]:
    """Give an empty white figure (inches) with settings of our own, until the block ends."""
    # The backend stays as it is: it is the one of whoever draws on a screen.
    settings: dict[Any, Any] = {**mpl.rcParamsDefault, **SETTINGS}
    del settings["backend"]
    with mpl.rc_context(settings), warnings.catch_warnings():
        # A PNG shows boxes for what its font does not have; a browser has fonts of its own.
        warnings.filterwarnings("ignore", message=r"Glyph \d+")
        yield Figure(figsize=(width, height), facecolor=WHITE)


def saved(figure: Figure, *, title: str, description: str) -> Picture:
    """Return a figure as files; call it in the block of `blank_figure`.

    The files hold no dates and no names of programs. Title and description are what a screen reader
    says.
    """
    svg, png = io.BytesIO(), io.BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(svg, format="svg", metadata=nothing)
    figure.savefig(png, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    # Without the document type, which names an address on the web.
    _, opened, rest = svg.getvalue().decode("utf-8").partition("<svg ")
    head, _, body = rest.partition(">")
    told = f"<title>{escape(one_line(title))}</title>\n<desc>{escape(one_line(description))}</desc>"
    text = f'<?xml version="1.0" encoding="utf-8"?>\n{opened}role="img" {head}>\n{told}{body}'
    return Picture(text.encode("utf-8"), png.getvalue(), one_line(description))


def label(text: str, length: int) -> str:
    """Return text from data on one line, cut where it does not fit into a picture.

    ``length`` is the most letters; a Chinese one, say, counts as two.
    """
    plain = one_line(text)
    ends = list(itertools.accumulate(map(_letter_width, plain)))
    if not ends or ends[-1] <= length:
        return plain
    return plain[: bisect.bisect_right(ends, length - 1)].rstrip() + "…"


def _letter_width(letter: str) -> int:
    """Return 2 for a letter as wide as the Chinese, else 1."""
    return 2 if unicodedata.east_asian_width(letter) in "WF" else 1


def draw_legend(
    figure: Figure,
    keys: Sequence[tuple[Line2D | Patch, str]],
    *,
    place: tuple[float, float, float],
    columns: int,
    size: float,
    sign_width: float,
) -> None:
    """Draw a legend in columns of one width.

    ``place`` is left, top and width as shares of the figure's; ``size`` is in points,
    ``sign_width`` in letters.
    """
    left, top, width = place
    rows = math.ceil(len(keys) / columns)
    for column in range(columns):
        part = keys[column * rows : (column + 1) * rows]
        if part:
            figure.legend(
                [sign for sign, _ in part],
                # matplotlib leaves out what begins with an underscore.
                [f" {text}" if text.startswith("_") else text for _, text in part],
                loc="upper left",
                bbox_to_anchor=(left + column * width / columns, top),
                frameon=False,
                borderaxespad=0,
                borderpad=0,
                handlelength=sign_width,
                handletextpad=0.6,
                fontsize=size,
                labelspacing=0.45,
            )
