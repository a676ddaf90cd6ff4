"""Examples as small maps: a viewpoint, the street objects seen from it, and what was answered."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from semsig_gis.pictures import COLOURS, INK, WHITE, blank_figure, draw_legend, label, saved
from semsig_gis.tables import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from semsig_gis.pictures import Picture
    from semsig_gis.report_parts import Scene, SceneObject
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["draw_scene"]

# Shapes with room for a letter. Green comes first because trees do.
MARKERS = ("o", "s", "D", "p", "8")
CLASS_COLOURS = (COLOURS[2], COLOURS[0], *COLOURS[4:2:-1], COLOURS[1], *COLOURS[5:])
ANSWER = "#cc0000"

# In visibility ranges: what is drawn around the viewpoint, and at most.
AROUND, FARTHEST = 1.25, 2.5

# Inches.
WIDTH, MAP, MARGIN = 4.4, 4.2, 0.1
LINE = 0.19

TITLE_LETTERS = 46
TYPE_LETTERS, TYPE_LINES = 42, 3
CLASS_LETTERS = 21
MANY_OBJECTS = 40


class _Look(NamedTuple):
    """How a class is drawn."""

    symbol: str
    title: str
    marker: str
    colour: str


def draw_scene(scene: Scene, taxonomy: Taxonomy) -> Picture:
    """Draw a scene, north up.

    Parameters
    ----------
    scene : Scene
        A viewpoint and what is around.
    taxonomy : Taxonomy
        The classes of its objects; a class looks the same in all scenes.

    Returns
    -------
    Picture
        The same bytes for the same scene.

    Notes
    -----
    The answer is a cross; an arrow at the edge points to one that is farther away.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.report_parts import Scene, SceneObject
    >>> lamp = SceneObject(code=3, east=10.0, north=0.0)
    >>> scene = Scene(name="a", title="A lamp", lon=2.3, lat=48.8, radius=30.0, types="D",
    ...               objects=(lamp,), error_m=12.0)
    >>> draw_scene(scene, paper_taxonomy()).description
    'A lamp. Signature D, seen from 2.300000, 48.800000: street light (1). Error 12.0 m.'
    """
    looks = _looks(taxonomy)
    titles = textwrap.wrap(label(scene.title, 2 * TITLE_LETTERS), TITLE_LETTERS)
    told = _told(scene)
    keys = _keys(scene, looks)
    above = LINE * len(titles) + 0.14
    below = LINE * (len(told) + math.ceil(len(keys) / 2)) + 0.3
    height = above + MAP + below
    with blank_figure(WIDTH, height) as figure:
        axes = figure.add_axes((MARGIN / WIDTH, below / height, MAP / WIDTH, MAP / height))
        _draw_map(axes, scene, looks)
        figure.text(
            MARGIN / WIDTH,
            1 - 0.07 / height,
            "\n".join(titles),
            va="top",
            weight="bold",
            size=10,
        )
        figure.text(
            MARGIN / WIDTH,
            (below - 0.1) / height,
            "\n".join(told),
            va="top",
            size=9,
            linespacing=1.3,
        )
        draw_legend(
            figure,
            keys,
            place=(MARGIN / WIDTH, (below - 0.2 - LINE * len(told)) / height, 1.0),
            columns=2,
            size=8.5,
            sign_width=1,
        )
        return saved(figure, title=scene.title, description=_described(scene, looks))


def _looks(taxonomy: Taxonomy) -> dict[int, _Look]:
    classes = sorted(taxonomy.classes, key=lambda item: item.code)
    return {
        item.code: _Look(
            item.symbol,
            item.title,
            MARKERS[number % len(MARKERS)],
            CLASS_COLOURS[number % len(CLASS_COLOURS)],
        )
        for number, item in enumerate(classes)
    }


def _look(looks: dict[int, _Look], code: int) -> _Look:
    return looks.get(code, _Look("?", "unknown class", "o", "#777777"))


def _draw_map(axes: Axes, scene: Scene, looks: dict[int, _Look]) -> None:
    away = math.hypot(*scene.answer) if scene.answer else 0.0
    drawn = away if away < FARTHEST * scene.radius else 0.0
    farthest = max((math.hypot(item.east, item.north) for item in scene.objects), default=0.0)
    reach = max(AROUND * scene.radius, 1.08 * farthest, 1.12 * drawn)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xticks=[], yticks=[], aspect="equal")
    axes.set_facecolor("#fafaf8")
    axes.add_patch(
        Circle((0, 0), scene.radius, facecolor=WHITE, edgecolor="#999999", linestyle="--")
    )
    lines = [[(0.0, 0.0), (item.east, item.north)] for item in scene.objects]
    axes.add_collection(LineCollection(lines, colors="#999999", linewidths=0.5, zorder=2))
    for item in scene.others:
        look = _look(looks, item.code)
        axes.plot(
            [item.east],
            [item.north],
            marker=look.marker,
            markersize=5,
            color=look.colour,
            alpha=0.25,
            markeredgewidth=0,
            zorder=1.5,
        )
    size = 8 if len(scene.objects) > MANY_OBJECTS else 10
    # The nearest last, so that they lie on top.
    for item in sorted(scene.objects, key=lambda one: -math.hypot(one.east, one.north)):
        _draw_object(axes, item, _look(looks, item.code), size)
    axes.plot(
        [0],
        [0],
        marker="o",
        markersize=7,
        color=INK,
        markeredgecolor=WHITE,
        markeredgewidth=1.5,
        zorder=6,
    )
    if scene.answer:
        _draw_answer(axes, scene.answer, away, reach)
    _draw_north(axes)
    _draw_scale(axes, reach)


def _draw_object(axes: Axes, item: SceneObject, look: _Look, size: float) -> None:
    axes.plot(
        [item.east],
        [item.north],
        marker=look.marker,
        markersize=size,
        color=look.colour,
        markeredgecolor=WHITE,
        markeredgewidth=0.7,
        zorder=4,
    )
    axes.text(
        item.east,
        item.north,
        look.symbol,
        size=0.62 * size,
        color=_over(look.colour),
        weight="bold",
        ha="center",
        va="center_baseline",
        zorder=4,
        clip_on=True,
    )


def _over(colour: str) -> str:
    """Return black or white, whichever reads better on a colour."""
    red, green, blue = (int(colour[at : at + 2], 16) for at in (1, 3, 5))
    bright = 140
    return "#000000" if 0.299 * red + 0.587 * green + 0.114 * blue > bright else WHITE


def _draw_answer(axes: Axes, answer: tuple[float, float], away: float, reach: float) -> None:
    east, north = answer
    if max(abs(east), abs(north)) < reach:
        axes.plot([0, east], [0, north], color=ANSWER, linewidth=1, linestyle=":", zorder=3)
        axes.plot([east], [north], **_ANSWER_LOOK, zorder=7)
        return
    share = 0.96 * reach / max(abs(east), abs(north))
    tip = (share * east, share * north)
    axes.annotate(
        "",
        tip,
        xytext=(0.84 * tip[0], 0.84 * tip[1]),
        arrowprops={"arrowstyle": "-|>", "color": ANSWER, "linewidth": 1.6},
        zorder=7,
    )
    axes.text(
        0.78 * tip[0],
        0.78 * tip[1],
        f"{away:,.0f} m",
        color=ANSWER,
        size=8.5,
        ha="center",
        va="center",
        zorder=7,
        bbox={"facecolor": WHITE, "alpha": 0.85, "edgecolor": "none", "pad": 1},
    )


_ANSWER_LOOK: dict[str, Any] = {
    "color": ANSWER,
    "linestyle": "",
    "marker": "X",
    "markersize": 9.5,
    "markeredgecolor": WHITE,
    "markeredgewidth": 1,
}


def _draw_north(axes: Axes) -> None:
    axes.annotate(
        "N",
        (0.955, 0.985),
        xytext=(0.955, 0.885),
        xycoords="axes fraction",
        textcoords="axes fraction",
        ha="center",
        va="center",
        weight="bold",
        size=9,
        arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkB": 0},
        bbox={"facecolor": WHITE, "alpha": 0.85, "edgecolor": "none", "pad": 1},
        zorder=8,
    )


def _draw_scale(axes: Axes, reach: float) -> None:
    metres = _round_length(0.5 * reach)
    start = 0.03
    end = start + metres / (2 * reach)
    axes.plot(
        [start, start, end, end],
        [0.045, 0.03, 0.03, 0.045],
        transform=axes.transAxes,
        color=INK,
        linewidth=1.4,
        solid_capstyle="butt",
        zorder=8,
    )
    axes.text(
        (start + end) / 2,
        0.045,
        f"{metres:g} m",
        transform=axes.transAxes,
        ha="center",
        va="bottom",
        size=8.5,
        bbox={"facecolor": WHITE, "alpha": 0.85, "edgecolor": "none", "pad": 1},
        zorder=8,
    )


def _round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, 50... that is not longer."""
    power = 10 ** math.floor(math.log10(longest))  # half an ulp below it, log10 rounds up
    return next(float(power * step) for step in (5, 2, 1, 0.5) if power * step <= longest)


def _told(scene: Scene) -> list[str]:
    """Return the lines below the map."""
    types = label(scene.types, TYPE_LETTERS * TYPE_LINES)
    signature = textwrap.wrap(types, TYPE_LETTERS) or ["sees nothing"]
    place = f"{scene.lon:.6f}°, {scene.lat:.6f}°"
    return [*signature, " · ".join(part for part in (place, _error(scene)) if part)]


def _error(scene: Scene) -> str:
    if scene.error_m is None:
        return ""
    return f"error {scene.error_m:,.1f} m" if math.isfinite(scene.error_m) else "not localized"


def _keys(scene: Scene, looks: dict[int, _Look]) -> list[tuple[Line2D, str]]:
    seen = Counter(item.code for item in scene.objects)
    keys = []
    for code in sorted({*seen, *(item.code for item in scene.others)}):
        look = _look(looks, code)
        # An empty count is of a class that is only around.
        count = f" ({seen[code]})" if seen[code] else ""
        sign = Line2D([], [], linestyle="", marker=look.marker, color=look.colour, markersize=7)
        sign.set_alpha(None if seen[code] else 0.25)
        keys.append((sign, f"{look.symbol} {label(look.title, CLASS_LETTERS)}{count}"))
    if scene.answer:
        keys.append((Line2D([], [], **_ANSWER_LOOK), "answer"))
    return keys


def _described(scene: Scene, looks: dict[int, _Look]) -> str:
    seen = Counter(item.code for item in scene.objects)
    counts = ", ".join(
        f"{one_line(_look(looks, code).title).lower()} ({number})"
        for code, number in sorted(seen.items())
    )
    types = f"Signature {scene.types}, seen" if scene.types else "Nothing is seen"
    place = f"from {scene.lon:.6f}, {scene.lat:.6f}"
    told = (scene.title, f"{types} {place}{f': {counts}' if counts else ''}", _error(scene))
    return " ".join(f"{part[:1].upper()}{part[1:]}." for part in told if part)
