"""Draw plots of curves that are readable in black and white, and save figures."""

from __future__ import annotations

import bisect
import contextlib
import io
import itertools
import math
import textwrap
import unicodedata
import warnings
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np

from semsig_gis.core import extra, one_line

with extra("plot", "a report or a figure"):
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.report_model import Curve, Plot


COLOURS = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"),
    *("#333333", "#882255", "#999933"),
)
"""Colours that colour-blind people can distinguish: of Okabe and Ito, and two of Tol."""

# Colours of the foreground and the background; a letter on a sign is plain black or white.
INK: str = "#222222"
GROUND: str = "#fefefe"
AXIS, TICK, GRID, SOFT = "#777777", "#555555", "#dddddd", "#999999"
DARK: Mapping[str, str] = MappingProxyType(
    {
        INK: "#e6e6e3",
        GROUND: "#18181b",
        AXIS: "#8b8b8f",
        TICK: "#a5a5a0",
        GRID: "#3a3a3f",
        SOFT: "#7c7c80",
        "#333333": "#c9c9c4",
        "#882255": "#d77ba6",
    }
)
"""Colours that are replaced on a dark background; all others are visible on both backgrounds."""

DOTS_PER_INCH = 200
# Text stays text in an SVG, so that it can be searched and copied, in any script.
SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "semsig_gis",
    "text.parse_math": False,
    "font.size": 9.5,
    "font.sans-serif": ["DejaVu Sans"],  # an SVG names all of them with every text
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": AXIS,
    "axes.facecolor": GROUND,
    "xtick.color": TICK,
    "ytick.color": TICK,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture in two formats; ``description`` is the alternative text, also in the SVG."""

    svg: bytes = field(repr=False)
    png: bytes = field(repr=False)
    description: str

    def _repr_svg_(self) -> str:
        """Show the picture in a notebook."""
        return self.svg.decode("utf-8")


@contextlib.contextmanager
def blank_figure(width: float, height: float) -> Iterator[Figure]:
    """Yield an empty figure (inches) with fixed settings, whatever the user has set."""
    # The backend is not changed: the user may draw on a screen.
    settings: dict[Any, Any] = {**mpl.rcParamsDefault, **SETTINGS}
    del settings["backend"]
    with mpl.rc_context(settings), warnings.catch_warnings():
        # A PNG shows boxes for missing glyphs; a browser uses other fonts for an SVG.
        warnings.filterwarnings("ignore", message=r"Glyph \d+")
        yield Figure(figsize=(width, height), facecolor=GROUND)


def saved(figure: Figure, *, title: str, description: str) -> Picture:
    """Return a figure of `blank_figure` as files, without dates and program names.

    Title and description are for screen readers.
    """
    svg, png = io.BytesIO(), io.BytesIO()
    no_metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    figure.savefig(svg, format="svg", metadata=no_metadata)
    figure.savefig(png, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    # Drop the document type, which has an address on the web, and add the texts.
    _, start, rest = svg.getvalue().decode("utf-8").partition("<svg ")
    head, _, body = rest.partition(">")
    text = f"<title>{escape(one_line(title))}</title>\n<desc>{escape(one_line(description))}</desc>"
    page = f'<?xml version="1.0" encoding="utf-8"?>\n{start}role="img" {head}>\n{text}{body}'
    return Picture(page.encode("utf-8"), png.getvalue(), one_line(description))


def in_the_dark(svg: bytes) -> bytes:
    """Return an SVG of `saved` that is dark on a screen if the reader prefers dark colours."""
    rules = "".join(
        f'[style*="{part}: {light}"]{{{part}:{dark}!important}}'
        for light, dark in DARK.items()
        for part in ("fill", "stroke")
    )
    style = f"<style>@media screen and (prefers-color-scheme:dark){{{rules}}}</style>"
    head, end, body = svg.partition(b"</desc>")
    return head + end + style.encode("ascii") + body


def label(text: str, length: int) -> str:
    """Truncate text to one line of `length` columns; wide characters count twice."""
    plain = one_line(text)
    wide = (unicodedata.east_asian_width(letter) in "WF" for letter in plain)
    ends = list(itertools.accumulate(1 + is_wide for is_wide in wide))
    if not ends or ends[-1] <= length:
        return plain
    return plain[: bisect.bisect_right(ends, length - 1)].rstrip() + "…"


def cell_pixels(
    database: SignatureDatabase, values: NDArray[np.float64], *, most: int
) -> tuple[NDArray[np.float64], float]:
    """Return numbers of cells as an image, south first, NaN without a cell, and a pixel's metres.

    If a side has more than `most` cells, several cells share a pixel, which has the value of one.
    """
    columns, rows = (axis - axis.min() for axis in (database.columns, database.rows))
    merged = math.ceil((max(columns.max(), rows.max()) + 1) / most)
    columns, rows = columns // merged, rows // merged
    image = np.full((rows.max() + 1, columns.max() + 1), np.nan)
    image[rows, columns] = values
    return image, merged * database.grid.step


def draw_legend(
    figure: Figure,
    keys: Sequence[tuple[Line2D | Patch, str]],
    *,
    place: tuple[float, float, float],
    columns: int,
    size: float,
    sign_width: float,
) -> None:
    """Draw a legend in columns of equal width.

    `place` is left, top and width as shares of the figure; `size` is in points, `sign_width` in
    letters.
    """
    left, top, width = place
    rows = math.ceil(len(keys) / columns)
    for column in range(columns):
        column_keys = keys[column * rows : (column + 1) * rows]
        if column_keys:
            figure.legend(
                [sign for sign, _ in column_keys],
                # matplotlib omits labels that begin with an underscore.
                [f" {text}" if text.startswith("_") else text for _, text in column_keys],
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


# The numbers of colours, dashes and markers differ, so that their combinations do not repeat.
DASHES = ("-", (0, (5, 1.6)), (0, (6, 1.6, 1.2, 1.6)), (0, (1.4, 1.2)))
# Each marker with the size at which it looks as large as the others.
LINE_MARKERS = (("o", 5.2), ("s", 5.0), ("^", 6.4), ("D", 4.8), ("v", 6.4), ("P", 7.0), ("X", 7.0))
BAND_SHADE, MANY_BANDS = 0.16, 4
FEW_POINTS = 12
FEW_TICKS, MANY_TICKS = 6, 9
# Ticks of each decade of a logarithmic axis; the first choice that is not too many is used.
DECADE_STEPS = ((1, 2, 5), (1, 5), (1,))
RIGHT_END = 0.9  # share of the width
MARKERS_APART = 0.14  # share of the diagonal
# Inches: small enough that letters are readable on the screen of a phone.
WIDTH = 5.0
LEFT, RIGHT = 0.66, 0.2
AXES_HEIGHT = 2.8
TITLE_LINE, LEGEND_LINE = 0.22, 0.2
BELOW_AXES = 0.52
TITLE_LETTERS = 55
# Largest number of letters of a label, and the number of columns of a legend.
LEGEND_COLUMNS = ((9, 4), (14, 3), (25, 2))
LONGEST_LABEL = 54


def draw_plot(plot: Plot) -> Picture:
    """Draw a plot.

    Parameters
    ----------
    plot : Plot
        The plot; a curve of many points has a band for its intervals, one of few points has bars.

    Returns
    -------
    Picture
        The same bytes for the same plot.

    Examples
    --------
    >>> from semsig_gis.output.report_model import Curve, Plot
    >>> half = Curve(label="edit", x=(0.0, 50.0), y=(0.5, 1.0))
    >>> plot = Plot(name="a", title="Errors", x_label="m", y_label="share", curves=(half,))
    >>> draw_plot(plot).description
    'Errors. Share by m. Edit: 0.5 at 0, 1 at 50.'
    """
    titles = textwrap.wrap(label(plot.title, 2 * TITLE_LETTERS), TITLE_LETTERS)
    curves: Keys = [
        (Line2D([], [], **_line_options(number)), label(curve.label, LONGEST_LABEL))
        for number, curve in enumerate(plot.curves)
    ]
    others = _other_keys(plot)
    # The figure is as high as its titles, axes and legends need.
    heights = [LEGEND_LINE * math.ceil(len(keys) / _columns(keys)) for keys in (curves, others)]
    below = BELOW_AXES + sum(heights) + 0.08
    above = TITLE_LINE * len(titles) + 0.16
    height = above + AXES_HEIGHT + below
    with blank_figure(WIDTH, height) as figure:
        across = (WIDTH - LEFT - RIGHT) / WIDTH
        axes = figure.add_axes((LEFT / WIDTH, below / height, across, AXES_HEIGHT / height))
        draw_frame(axes, plot)
        for number, curve in enumerate(plot.curves):
            draw_curve(axes, curve, number, len(plot.curves))
        _draw_paper_points(axes, plot.paper)
        font: dict[str, Any] = {"va": "top", "weight": "bold", "size": 10.5, "linespacing": 1.25}
        figure.text(0.1 / WIDTH, 1 - 0.08 / height, "\n".join(titles), **font)
        for keys, top in ((curves, sum(heights)), (others, heights[1])):
            place = (LEFT / WIDTH, (top + 0.04) / height, (WIDTH - LEFT) / WIDTH)
            columns = _columns(keys)
            draw_legend(figure, keys, place=place, columns=columns, size=9, sign_width=3.2)
        return saved(figure, title=plot.title, description=_plot_description(plot))


def draw_frame(axes: Axes, plot: Plot) -> None:
    """Set the limits, labels, ticks and grid of the axes of a plot."""
    xs = itertools.chain(*(curve.x for curve in plot.curves), (x for x, _, _ in plot.paper))
    values = sorted({x for x in xs if math.isfinite(x)}) or [0.0, 1.0]
    left, right = values[0], values[-1]
    if plot.log:
        _draw_log_axis(axes, values)
    else:
        margin = 0.015 * (right - left) or 0.5
        axes.set_xlim(left - margin, right + margin)
    low, high = plot.y_range
    margin = 0.02 * (high - low) or 0.5
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlabel(label(plot.x_label, 60))
    axes.set_ylabel(label(plot.y_label, 40))
    axes.grid(visible=True)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if plot.ticks:
        positions = [x for x, _ in plot.ticks]
        axes.set_xticks(positions, [label(text, 20) for _, text in plot.ticks])
        axes.set_xlim(min(positions) - 0.4, max(positions) + 0.4)
    elif len(values) <= FEW_TICKS and not plot.log:
        axes.set_xticks(values, [f"{x:g}" for x in values])
    if plot.diagonal:
        axes.axline((0, 0), slope=1, color=SOFT, linewidth=1, dashes=(4, 3), zorder=1.5)


def _draw_log_axis(axes: Axes, values: Sequence[float]) -> None:
    """Make the x axis logarithmic; a 0 is shown to the left of the smallest positive x."""
    positive = [x for x in values if x > 0.0] or [1.0]
    least, most = positive[0], positive[-1]
    with_zero = values[0] <= 0.0
    if with_zero:
        axes.set_xscale("symlog", linthresh=least, linscale=0.25)
    else:
        axes.set_xscale("log")
    decades = range(math.floor(math.log10(least)), math.ceil(math.log10(most)) + 1)
    for steps in DECADE_STEPS:
        numbers = [step * 10.0**power for power in decades for step in steps]
        ticks = [0.0] * with_zero + [x for x in numbers if least <= 1.001 * x <= 1.002 * most]
        if len(ticks) < MANY_TICKS:
            break
    axes.set_xticks(ticks, [f"{tick:,g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    margin = max((most / least) ** 0.015, 1.05)
    axes.set_xlim(-0.1 * least if with_zero else least / margin, most * margin)


def draw_curve(axes: Axes, curve: Curve, number: int, curves: int) -> None:
    """Draw curve `number` of `curves`, with its band or bars; its line is the last of the axes."""
    options = _line_options(number)
    colour = options["color"]
    x, y = np.asarray(curve.x, np.float64), np.asarray(curve.y, np.float64)
    few = int((np.isfinite(x) & np.isfinite(y)).sum()) <= FEW_POINTS
    if curve.low:
        low, high = np.asarray(curve.low, np.float64), np.asarray(curve.high, np.float64)
        if few:
            axes.vlines(x, low, high, colors=colour, linewidth=1.2)
            for ends in (low, high):
                axes.plot(x, ends, linestyle="", marker="_", color=colour, markersize=6)
        else:
            shade = BAND_SHADE if curves <= MANY_BANDS else 0.6 * BAND_SHADE
            axes.fill_between(x, low, high, color=colour, alpha=shade, linewidth=0)
    # The markers of the curves are shifted, so that curves that coincide are both visible.
    every = None if few else (MARKERS_APART * number / curves, MARKERS_APART)
    axes.plot(x, y, markevery=every, zorder=3, **options)


def _line_options(number: int) -> dict[str, Any]:
    """Return options of matplotlib for the line of a curve."""
    marker, size = LINE_MARKERS[number % len(LINE_MARKERS)]
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": DASHES[number % len(DASHES)],
        "marker": marker,
        "linewidth": 1.6,
        "markersize": size,
        "markeredgecolor": GROUND,
        "markeredgewidth": 0.6,
    }


def _draw_paper_points(axes: Axes, points: Sequence[tuple[float, float, str]]) -> None:
    """Draw the points of the paper; several points are numbered, on the side with room."""
    to_shares = axes.transScale + axes.transLimits
    for number, (x, y, _) in enumerate(points, 1):
        axes.plot([x], [y], clip_on=False, zorder=5, **_PAPER_MARKER)
        if len(points) > 1:
            side = -1 if to_shares.transform((x, y))[0] > RIGHT_END else 1
            halo = {"facecolor": GROUND, "alpha": 0.8, "edgecolor": "none", "pad": 0.6}
            font: dict[str, Any] = {"va": "center", "weight": "bold", "size": 9, "bbox": halo}
            font |= {"xytext": (7 * side, -4), "ha": "left" if side > 0 else "right"}
            axes.annotate(str(number), (x, y), textcoords="offset points", **font, zorder=6)


_PAPER_MARKER: dict[str, Any] = {
    "color": INK,
    "linestyle": "",
    "marker": "D",
    "markersize": 7.5,
    "markerfacecolor": "none",  # a marker of ours is often below it
    "markeredgewidth": 1.7,
}
Keys = list[tuple[Line2D | Patch, str]]


def _other_keys(plot: Plot) -> Keys:
    """Return legend entries for all but the curves: interval, diagonal, points of the paper."""
    keys: Keys = []
    if any(curve.low for curve in plot.curves):
        keys.append((Patch(color=SOFT, alpha=0.4, linewidth=0), "interval of 95 %"))
    if plot.diagonal:
        dashes = (0, (4, 3))
        keys.append((Line2D([], [], color=SOFT, linewidth=1, linestyle=dashes), "y = x"))
    several = len(plot.paper) > 1
    for number, (_, _, text) in enumerate(plot.paper, 1):
        sign = Line2D([], [], **_PAPER_MARKER)
        source = f"paper {number}" if several else "paper"
        keys.append((sign, label(f"{source}: {text}", LONGEST_LABEL)))
    return keys


def _columns(keys: Keys) -> int:
    longest = max((len(text) for _, text in keys), default=0)
    return next((columns for letters, columns in LEGEND_COLUMNS if longest <= letters), 1)


def _plot_description(plot: Plot) -> str:
    """Return the alternative text: each curve with its ends, or with all its points by tick."""
    lines = [f"{plot.title}.", f"{_capital(plot.y_label)} by {plot.x_label}."]
    names = dict(plot.ticks)
    for curve in plot.curves:
        ends = range(len(curve.x)) if plot.ticks else [at for at in (0, -1) if curve.x]
        ends_once = dict.fromkeys((curve.x[at], curve.y[at]) for at in ends)
        points = ", ".join(f"{y:.4g} at {names.get(x, f'{x:.4g}')}" for x, y in ends_once)
        lines.append(f"{_capital(curve.label)}: {points or 'no points'}.")
    lines += [f"The paper, {text}: {y:.4g} at {x:.4g}." for x, y, text in plot.paper]
    return " ".join(lines)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
