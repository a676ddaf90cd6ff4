"""Places with what is seen there: cells, and examples of queries that were found or not."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    OUTCOMES,
    ClassSign,
    InputError,
    class_signs,
    extra,
    one_line,
    to_degrees,
)
from semsig_gis.evaluation import Sight
from semsig_gis.reports.plots import GROUND, INK, SOFT, blank_figure, draw_legend, label, saved
from semsig_gis.reports.report_model import Pair, Scene, SceneObject
from semsig_gis.reports.tables import length

with extra("plot", "a report or a figure"):
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle
    from matplotlib.path import Path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from semsig_gis.core import Taxonomy
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.reports.plots import Picture


SAME_M = 1.0  # how far apart two cells may see one object: bearings and distances are rounded


def cell_scene(database: SignatureDatabase, cell: int, *, title: str = "") -> Scene:
    """Return what is seen from a cell.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    cell : int
        Row number in the database.
    title : str, optional
        What to call it; the cell's number by default.

    Returns
    -------
    Scene
        The objects of its signature, and those around that only other cells see.

    Examples
    --------
    >>> cell_scene(demo_database, 0, title="A corner").types == demo_database.types(0)
    True
    """
    x, y = database.xy[cell].tolist()
    lon, lat = to_degrees(database.crs).transform(x, y)
    number = int(database.cell_ids[cell])
    own = _seen_from(database, cell)
    return Scene(
        name=f"cell-{number}",
        title=title or f"Cell {number}",
        lon=lon,
        lat=lat,
        radius=database.spec.radius,
        types=database.types(cell),
        taxonomy=database.taxonomy,
        objects=own,
        others=_seen_around(database, cell, own),
    )


def example_scenes(
    evaluation: Evaluation, database: SignatureDatabase, *, successful: bool, count: int = 4
) -> tuple[Scene, ...]:
    """Return the first queries from cells of the database that were answered well, or not."""
    queries = evaluation.queries
    examples = queries[(evaluation.successful == successful) & (queries["cell"] >= 0)].head(count)
    kind = [*OUTCOMES][0 if successful else 1]
    scenes = []
    rows = zip(examples.index, examples.to_dict("records"), strict=True)
    for place, (number, row) in enumerate(rows, start=1):
        cell = int(row["cell"])
        x, y = database.xy[cell].tolist()
        aside = (float(row["best_x"]) - x, float(row["best_y"]) - y)
        title = f"{kind.capitalize()}: query {number + 1:,}"
        scenes.append(
            replace(
                cell_scene(database, cell, title=title),
                name=f"{kind}-{place}",
                answer=aside if math.isfinite(aside[0]) else None,
                error_m=float(row["error_m"]),
            )
        )
    return tuple(scenes)


def failure_pairs(
    evaluation: Evaluation, database: SignatureDatabase, *, count: int = 6
) -> tuple[Pair, ...]:
    """Return the failed queries with the largest errors: the true cell and what it was taken for.

    They are of queries from cells of the database that were answered at all.
    """
    queries = evaluation.queries
    told = np.isfinite(queries["error_m"].to_numpy(np.float64)) & queries["best_cell_id"].notna()
    failed = queries[~evaluation.successful & (queries["cell"] >= 0) & told]
    worst = failed.sort_values("error_m", ascending=False, kind="stable").head(count)
    pairs = []
    rows = zip(worst.index, worst.to_dict("records"), strict=True)
    for place, (number, row) in enumerate(rows, start=1):
        taken = int(np.searchsorted(database.cell_ids, int(row["best_cell_id"])))
        bearings = map(float, filter(None, row["query_bearings"].split(",")))
        codes = database.taxonomy.encode(row["query_types"]).tolist()
        asked = tuple(zip(codes, bearings, strict=True))
        true, other = (
            replace(cell_scene(database, cell, title=title), name=f"{name}-{place}", asked=asked)
            for cell, title, name in (
                (int(row["cell"]), "Where it was", "true"),
                (taken, "What it was mistaken for", "taken"),
            )
        )
        equals = int(row["tied"])
        alike = "" if equals == 1 else f" {equals:,} cells fit it as well as the one shown."
        pairs.append(
            Pair(
                title=f"Query {number + 1:,}: off by {length(float(row['error_m']))}",
                text=f"The distorted query: {_told(codes, database.taxonomy)}.{alike}",
                scenes=(true, other),
            )
        )
    return tuple(pairs)


def _told(codes: list[int], taxonomy: Taxonomy) -> str:
    """Return classes in words, each with its symbol and how often it comes."""
    known = {code: taxonomy.by_code(code) for code in codes}
    return ", ".join(
        f"{known[code].title} ({known[code].symbol}{f', {count}' * (count > 1)})"
        for code, count in Counter(codes).items()
    )


def _seen_from(database: SignatureDatabase, cell: int) -> tuple[SceneObject, ...]:
    """Return what is seen from a cell, clockwise from north."""
    sight = Sight.of_cell(database, cell)
    turned = np.radians(sight.bearings)
    east, north = sight.distances * np.sin(turned), sight.distances * np.cos(turned)
    seen = zip(sight.codes.tolist(), east.tolist(), north.tolist(), strict=True)
    return tuple(SceneObject(code=code, east=x, north=y) for code, x, y in seen)


def _seen_around(
    database: SignatureDatabase, cell: int, own: tuple[SceneObject, ...]
) -> tuple[SceneObject, ...]:
    """Return what the cells around see, but not the cell itself, each thing once."""
    reach = int(np.ceil(database.spec.radius / database.grid.step))
    columns, rows = database.columns, database.rows
    near = (abs(columns - columns[cell]) <= reach) & (abs(rows - rows[cell]) <= reach)
    others: list[SceneObject] = []
    for other in np.flatnonzero(near).tolist():
        dx, dy = (database.xy[other] - database.xy[cell]).tolist()
        for one in _seen_from(database, other):
            moved = SceneObject(code=one.code, east=one.east + dx, north=one.north + dy)
            if not any(
                math.hypot(moved.east - known.east, moved.north - known.north) <= SAME_M
                for known in (*own, *others)
                if known.code == moved.code
            ):
                others.append(moved)
    return tuple(others)


# A cross with wider arms than matplotlib's own, so that a letter has room on it.
CROSS = Path(
    [
        *((-6, 11), (6, 11), (6, 6), (11, 6), (11, -6), (6, -6)),
        *((6, -11), (-6, -11), (-6, -6), (-11, -6), (-11, 6), (-6, 6)),
        (-6, 11),
    ],
    closed=True,
)
# The marker of each shape, and its size where that of a circle is 1.
MARKERS = {
    "circle": ("o", 1.0),
    "square": ("s", 0.9),
    "diamond": ("D", 0.88),
    "triangle": ("^", 1.2),
    "hexagon": ("h", 1.15),
    "triangle_down": ("v", 1.2),
    "cross": (CROSS, 1.1),
}
UNKNOWN = ClassSign("?", "unknown class", "circle", "#777777")
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
RIM = 1.13  # where letters stand of what a query told, in visibility ranges
HALO = {"facecolor": GROUND, "alpha": 0.85, "edgecolor": "none", "pad": 1}  # behind letters
_IN_FRONT: dict[str, Any] = {"ha": "center", "bbox": HALO}


def draw_scene(scene: Scene) -> Picture:
    """Draw a scene, north up.

    Parameters
    ----------
    scene : Scene
        A viewpoint and what is around. The answer is a cross, or an arrow to it at the edge.

    Returns
    -------
    Picture
        The same bytes for the same scene.

    Examples
    --------
    >>> draw_scene(cell_scene(demo_database, 0, title="A corner")).description
    'A corner. Signature DB, seen from 2.997619, 48.751799: alignment tree (1), street light (1).'
    """
    return draw_scenes([scene])


def draw_scenes(scenes: Sequence[Scene]) -> Picture:
    """Draw scenes side by side in one picture, north up.

    Parameters
    ----------
    scenes : sequence of Scene
        Viewpoints, at least one, each with what is around; see `cell_scene`. A class looks the same
        in all of them.

    Returns
    -------
    Picture
        The same bytes for the same scenes.

    Raises
    ------
    InputError
        If there is no scene.

    Examples
    --------
    >>> here, there = (cell_scene(demo_database, cell) for cell in (0, 9))
    >>> draw_scenes([here, there]).description.count("Signature")
    2
    """
    if not scenes:
        raise InputError("there is no scene to draw; give at least one.")
    columns = [_Column.of(scene) for scene in scenes]
    above, below = (max(sizes) for sizes in zip(*(one.sizes for one in columns), strict=True))
    width, height = WIDTH * len(columns), above + MAP + below
    with blank_figure(width, height) as figure:
        for number, column in enumerate(columns):
            left = number * WIDTH + MARGIN
            axes = figure.add_axes((left / width, below / height, MAP / width, MAP / height))
            _draw_map(axes, column.scene, column.signs)
            top = 1 - 0.07 / height
            titles, lines = "\n".join(column.titles), "\n".join(column.lines)
            figure.text(left / width, top, titles, va="top", weight="bold", size=10)
            top = (below - 0.1) / height
            figure.text(left / width, top, lines, va="top", size=9, linespacing=1.3)
            top = (below - 0.2 - LINE * len(column.lines)) / height
            place = (left / width, top, WIDTH / width)
            draw_legend(figure, column.keys, place=place, columns=2, size=8.5, sign_width=1)
        return saved(
            figure,
            title="; ".join(scene.title for scene in scenes),
            description=" ".join(_described(one.scene, one.signs) for one in columns),
        )


@dataclass(frozen=True, slots=True)
class _Column:
    """A scene with what is written above and below its map."""

    scene: Scene
    signs: dict[int, ClassSign]
    titles: list[str]
    lines: list[str]
    keys: list[tuple[Line2D, str]]

    @classmethod
    def of(cls, scene: Scene) -> _Column:
        signs = class_signs(scene.taxonomy)
        titles = textwrap.wrap(label(scene.title, 2 * TITLE_LETTERS), TITLE_LETTERS)
        return cls(scene, signs, titles, _lines(scene), _keys(scene, signs))

    @property
    def sizes(self) -> tuple[float, float]:
        """Inches above and below the map."""
        rows = len(self.lines) + math.ceil(len(self.keys) / 2)
        return LINE * len(self.titles) + 0.14, LINE * rows + 0.3


def _draw_map(axes: Axes, scene: Scene, signs: dict[int, ClassSign]) -> None:
    away = math.hypot(*scene.answer) if scene.answer else 0.0
    near = away if away < FARTHEST * scene.radius else 0.0
    farthest = max((math.hypot(item.east, item.north) for item in scene.objects), default=0.0)
    reach = max(AROUND * scene.radius, 1.08 * farthest, 1.12 * near)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xticks=[], yticks=[], aspect="equal")
    axes.add_patch(Circle((0, 0), scene.radius, facecolor=GROUND, edgecolor=SOFT, linestyle="--"))
    lines = [[(0.0, 0.0), (item.east, item.north)] for item in scene.objects]
    axes.add_collection(LineCollection(lines, colors=SOFT, linewidths=0.5, zorder=2))
    for item in scene.others:
        look = _shape(signs.get(item.code, UNKNOWN), 5)
        axes.plot(item.east, item.north, **look, alpha=0.25, markeredgewidth=0, zorder=1.5)
    size = 8 if len(scene.objects) > MANY_OBJECTS else 10
    # The nearest last, so that they lie on top.
    for item in sorted(scene.objects, key=lambda one: -math.hypot(one.east, one.north)):
        _draw_object(axes, item, signs.get(item.code, UNKNOWN), size)
    edge: dict[str, Any] = {"markeredgecolor": GROUND, "markeredgewidth": 1.5}
    axes.plot(0, 0, color=INK, marker="o", markersize=7, **edge, zorder=6)
    for code, bearing in scene.asked:
        _draw_asked(axes, signs.get(code, UNKNOWN), bearing, scene.radius)
    if scene.answer:
        _draw_answer(axes, scene.answer, away, reach)
    draw_north(axes)
    draw_scale(axes, reach)


def _shape(sign: ClassSign, size: float) -> dict[str, Any]:
    marker, share = MARKERS[sign.shape]
    return {"marker": marker, "markersize": share * size, "color": sign.colour}


def _draw_object(axes: Axes, item: SceneObject, sign: ClassSign, size: float) -> None:
    edge: dict[str, Any] = {"markeredgecolor": GROUND, "markeredgewidth": 0.7}
    axes.plot(item.east, item.north, **_shape(sign, size), **edge, zorder=4)
    axes.annotate(
        sign.symbol,
        (item.east, item.north),
        xytext=(0, -sign.drop * size / 2),
        textcoords="offset points",
        size=0.62 * size,
        color=sign.ink,
        weight="bold",
        ha="center",
        va="center_baseline",
        zorder=4,
        clip_on=True,
    )


def _draw_asked(axes: Axes, sign: ClassSign, bearing: float, radius: float) -> None:
    """Draw what a query told as a letter outside of what is in range, where it was told to be."""
    turn = math.radians(bearing)
    ends = [(share * math.sin(turn), share * math.cos(turn)) for share in (1.0, 1.06, RIM)]
    inner, outer, place = ((radius * east, radius * north) for east, north in ends)
    axes.plot(*zip(inner, outer, strict=True), color=INK, linewidth=1.2, zorder=3)
    look: dict[str, Any] = {"size": 8.5, "weight": "bold", "color": INK}
    axes.text(*place, sign.symbol, ha="center", va="center", **look, zorder=5, clip_on=True)


def _draw_answer(axes: Axes, answer: tuple[float, float], away: float, reach: float) -> None:
    east, north = answer
    if max(abs(east), abs(north)) < reach:
        axes.plot([0, east], [0, north], color=ANSWER, linewidth=1, linestyle=":", zorder=3)
        axes.plot(east, north, **_ANSWER_LOOK, zorder=7)
        return
    share = 0.96 * reach / max(abs(east), abs(north))
    tip = (share * east, share * north)
    arrow = {"arrowstyle": "-|>", "color": ANSWER, "linewidth": 1.6}
    axes.annotate("", tip, xytext=(0.84 * tip[0], 0.84 * tip[1]), arrowprops=arrow, zorder=7)
    look: dict[str, Any] = {"color": ANSWER, "size": 8.5, "va": "center", **_IN_FRONT}
    axes.text(0.78 * tip[0], 0.78 * tip[1], f"{away:,.0f} m", **look, zorder=7)


_ANSWER_LOOK: dict[str, Any] = {
    "color": ANSWER,
    "linestyle": "",
    "marker": "X",
    "markersize": 9.5,
    "markeredgecolor": GROUND,
    "markeredgewidth": 1,
}


def draw_north(axes: Axes) -> None:
    """Draw an arrow to the north in the upper right corner."""
    share = dict.fromkeys(("xycoords", "textcoords"), "axes fraction")
    arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "shrinkB": 0}
    look: dict[str, Any] = {"va": "center", "weight": "bold", "size": 9, **share, **_IN_FRONT}
    axes.annotate("N", (0.955, 0.985), xytext=(0.955, 0.885), arrowprops=arrow, **look, zorder=8)


def draw_scale(axes: Axes, reach: float) -> None:
    """Draw a scale bar in the lower left corner of a map that reaches so many metres each way."""
    metres = _round_length(0.5 * reach)
    start = 0.03
    end = start + metres / (2 * reach)
    look: dict[str, Any] = {"color": INK, "linewidth": 1.4, "solid_capstyle": "butt", "zorder": 8}
    ends = [start, start, end, end], [0.045, 0.03, 0.03, 0.045]
    axes.plot(*ends, transform=axes.transAxes, **look)
    text: dict[str, Any] = {"va": "bottom", "size": 8.5, "transform": axes.transAxes, **_IN_FRONT}
    axes.text((start + end) / 2, 0.045, length(metres), **text, zorder=8)


def _round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, 50... that is not longer."""
    power = 10 ** math.floor(math.log10(longest))  # half an ulp below it, log10 rounds up
    return next(float(power * step) for step in (5, 2, 1, 0.5) if power * step <= longest)


def _lines(scene: Scene) -> list[str]:
    """Return the lines below the map."""
    types = label(scene.types, TYPE_LETTERS * TYPE_LINES)
    signature = textwrap.wrap(types, TYPE_LETTERS) or ["sees nothing"]
    place = f"{scene.lon:.6f}°, {scene.lat:.6f}°"
    rim = ["around the circle: the query"] if scene.asked else []
    return [*signature, *rim, " · ".join(part for part in (place, _error(scene)) if part)]


def _error(scene: Scene) -> str:
    if scene.error_m is None:
        return ""
    return f"error {scene.error_m:,.1f} m" if math.isfinite(scene.error_m) else "not localized"


def _keys(scene: Scene, signs: dict[int, ClassSign]) -> list[tuple[Line2D, str]]:
    seen = Counter(item.code for item in scene.objects)
    keys = []
    for code in sorted({*seen, *(item.code for item in scene.others)}):
        sign = signs.get(code, UNKNOWN)
        # An empty count is of a class that is only around.
        count = f" ({seen[code]})" if seen[code] else ""
        key = Line2D([], [], linestyle="", markeredgewidth=0, **_shape(sign, 8))
        key.set_alpha(None if seen[code] else 0.25)
        keys.append((key, f"{sign.symbol} {label(sign.title, CLASS_LETTERS)}{count}"))
    if scene.answer:
        keys.append((Line2D([], [], **_ANSWER_LOOK), "answer"))
    return keys


def _described(scene: Scene, signs: dict[int, ClassSign]) -> str:
    told = "".join(signs.get(code, UNKNOWN).symbol for code, _ in scene.asked)
    seen = Counter(item.code for item in scene.objects)
    counts = ", ".join(
        f"{one_line(signs.get(code, UNKNOWN).title).lower()} ({number})"
        for code, number in sorted(seen.items())
    )
    types = f"Signature {scene.types}, seen" if scene.types else "Nothing is seen"
    place = f"from {scene.lon:.6f}, {scene.lat:.6f}"
    parts = (
        scene.title,
        f"{types} {place}{f': {counts}' if counts else ''}",
        f"The query had {told}" if told else "",
        _error(scene),
    )
    return " ".join(f"{part[:1].upper()}{part[1:]}." for part in parts if part)
