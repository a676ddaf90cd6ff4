"""Scenes: viewpoints with the street objects around them, of cells and of example queries."""

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
from semsig_gis.output.figures.plots import (
    GROUND,
    INK,
    SOFT,
    blank_figure,
    draw_legend,
    label,
    saved,
)
from semsig_gis.output.report_model import Pair, Scene, SceneObject
from semsig_gis.output.tables.tables import length

with extra("plot", "a report or a figure"):
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle
    from matplotlib.path import Path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.figures.plots import Picture


# Sightings of one object from two cells differ by at most this, because of rounding.
SAME_M = 1.0


def cell_scene(database: SignatureDatabase, cell: int, *, title: str = "") -> Scene:
    """Return the scene of a cell.

    Parameters
    ----------
    database : SignatureDatabase
        The database.
    cell : int
        Row number in the database.
    title : str, optional
        Title; by default the cell's number.

    Returns
    -------
    Scene
        The objects of its signature, and the objects around it that only other cells see.

    Examples
    --------
    >>> cell_scene(demo_database, 0, title="A corner").types == demo_database.types(0)
    True
    """
    x, y = database.xy[cell].tolist()
    lon, lat = to_degrees(database.crs).transform(x, y)
    number = int(database.cell_ids[cell])
    visible = _visible_objects(database, cell)
    return Scene(
        name=f"cell-{number}",
        title=title or f"Cell {number}",
        lon=lon,
        lat=lat,
        radius=database.spec.radius,
        types=database.types(cell),
        taxonomy=database.taxonomy,
        objects=visible,
        others=_other_objects(database, cell, visible),
    )


def example_scenes(
    evaluation: Evaluation, database: SignatureDatabase, *, successful: bool, count: int = 4
) -> tuple[Scene, ...]:
    """Return scenes of the first successful or failed queries from cells of the database."""
    queries = evaluation.queries
    examples = queries[(evaluation.successful == successful) & (queries["cell"] >= 0)].head(count)
    kind = [*OUTCOMES][0 if successful else 1]
    scenes = []
    rows = zip(examples.index, examples.to_dict("records"), strict=True)
    for place, (number, row) in enumerate(rows, start=1):
        cell = int(row["cell"])
        x, y = database.xy[cell].tolist()
        offset = (float(row["best_x"]) - x, float(row["best_y"]) - y)
        title = f"{kind.capitalize()}: query {number + 1:,}"
        scenes.append(
            replace(
                cell_scene(database, cell, title=title),
                name=f"{kind}-{place}",
                answer=offset if math.isfinite(offset[0]) else None,
                error_m=float(row["error_m"]),
            )
        )
    return tuple(scenes)


def failure_pairs(
    evaluation: Evaluation, database: SignatureDatabase, *, count: int = 6
) -> tuple[Pair, ...]:
    """Return scenes of the true and the best cell of the failed queries with the largest errors.

    Only queries from cells of the database with a best place count.
    """
    queries = evaluation.queries
    placed = np.isfinite(queries["error_m"].to_numpy(np.float64)) & queries["best_cell_id"].notna()
    failed = queries[~evaluation.successful & (queries["cell"] >= 0) & placed]
    worst = failed.sort_values("error_m", ascending=False, kind="stable").head(count)
    pairs = []
    rows = zip(worst.index, worst.to_dict("records"), strict=True)
    for place, (number, row) in enumerate(rows, start=1):
        best = int(np.searchsorted(database.cell_ids, int(row["best_cell_id"])))
        bearings = map(float, filter(None, row["query_bearings"].split(",")))
        codes = database.taxonomy.encode(row["query_types"]).tolist()
        query = tuple(zip(codes, bearings, strict=True))
        true, other = (
            replace(cell_scene(database, cell, title=title), name=f"{name}-{place}", asked=query)
            for cell, title, name in (
                (int(row["cell"]), "Where it was", "true"),
                (best, "What it was mistaken for", "taken"),
            )
        )
        ties = int(row["tied"])
        note = "" if ties == 1 else f" {ties:,} cells fit it as well as the one shown."
        classes = database.taxonomy.words(codes)
        pairs.append(
            Pair(
                title=f"Query {number + 1:,}: off by {length(float(row['error_m']))}",
                text=f"The distorted query: {classes}.{note}",
                scenes=(true, other),
            )
        )
    return tuple(pairs)


def _visible_objects(database: SignatureDatabase, cell: int) -> tuple[SceneObject, ...]:
    """Return the objects that a cell sees, clockwise from north."""
    sight = Sight.of_cell(database, cell)
    bearings = np.radians(sight.bearings)
    east, north = sight.distances * np.sin(bearings), sight.distances * np.cos(bearings)
    rows = zip(sight.codes.tolist(), east.tolist(), north.tolist(), strict=True)
    return tuple(SceneObject(code=code, east=x, north=y) for code, x, y in rows)


def _other_objects(
    database: SignatureDatabase, cell: int, visible: tuple[SceneObject, ...]
) -> tuple[SceneObject, ...]:
    """Return objects that only the surrounding cells see, each object once."""
    reach = int(np.ceil(database.spec.radius / database.grid.step))
    columns, rows = database.columns, database.rows
    near = (abs(columns - columns[cell]) <= reach) & (abs(rows - rows[cell]) <= reach)
    others: list[SceneObject] = []
    for neighbour in np.flatnonzero(near).tolist():
        dx, dy = (database.xy[neighbour] - database.xy[cell]).tolist()
        for item in _visible_objects(database, neighbour):
            shifted = SceneObject(code=item.code, east=item.east + dx, north=item.north + dy)
            if not any(
                math.hypot(shifted.east - other.east, shifted.north - other.north) <= SAME_M
                for other in (*visible, *others)
                if other.code == shifted.code
            ):
                others.append(shifted)
    return tuple(others)


# A cross with wider arms than matplotlib's, which hold a letter.
CROSS = Path(
    [
        *((-6, 11), (6, 11), (6, 6), (11, 6), (11, -6), (6, -6)),
        *((6, -11), (-6, -11), (-6, -6), (-11, -6), (-11, 6), (-6, 6)),
        (-6, 11),
    ],
    closed=True,
)
# The marker of each shape, and its size relative to a circle.
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
# In visibility ranges: the smallest extent around the viewpoint, and the largest for an answer.
AROUND, FARTHEST = 1.25, 2.5
# Inches.
WIDTH, MAP, MARGIN = 4.4, 4.2, 0.1
LINE = 0.19
TITLE_LETTERS = 46
TYPE_LETTERS, TYPE_LINES = 42, 3
CLASS_LETTERS = 21
MANY_OBJECTS, MANY_KEYS = 40, 24
EDGE = 0.93  # farthest place of a landmark, in halves of the width of a map
LABEL_TURN = 0.2  # radians, in which only one landmark has its distance
RIM = 1.13  # radius of the letters of a query, in visibility ranges
HALO = {"facecolor": GROUND, "alpha": 0.85, "edgecolor": "none", "pad": 1}  # behind letters
_IN_FRONT: dict[str, Any] = {"ha": "center", "bbox": HALO}


def draw_scene(scene: Scene) -> Picture:
    """Draw a scene, north up.

    Parameters
    ----------
    scene : Scene
        The scene. The answer is drawn as a cross, or beyond the edge as an arrow.

    Returns
    -------
    Picture
        The same bytes for the same scene.

    Examples
    --------
    >>> draw_scene(cell_scene(demo_database, 0, title="A corner")).description
    'A corner. Seen from 48.751799, 2.997619: street light, tree.'
    """
    return draw_scenes([scene])


def draw_scenes(scenes: Sequence[Scene]) -> Picture:
    """Draw scenes side by side in one picture, north up.

    Parameters
    ----------
    scenes : sequence of Scene
        At least one scene; see `cell_scene`. A class has the same sign in all of them.

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
    >>> draw_scenes([here, there]).description.count("Seen from")
    2
    """
    if not scenes:
        raise InputError("there is no scene to draw; give at least one.")
    columns = [_Column.of(scene) for scene in scenes]
    sizes = zip(*(column.sizes for column in columns), strict=True)
    above, below = (max(heights) for heights in sizes)
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
            description=" ".join(_scene_description(column.scene) for column in columns),
        )


@dataclass(frozen=True, slots=True)
class _Column:
    """A scene with the texts above and below its map."""

    scene: Scene
    signs: dict[int, ClassSign]
    titles: list[str]
    lines: list[str]
    keys: list[tuple[Line2D, str]]

    @classmethod
    def of(cls, scene: Scene) -> _Column:
        signs = class_signs(scene.taxonomy)
        titles = textwrap.wrap(label(scene.title, 2 * TITLE_LETTERS), TITLE_LETTERS)
        classes = label(_seen(scene), TYPE_LETTERS * TYPE_LINES)
        lines = textwrap.wrap(f"sees {classes}", TYPE_LETTERS)
        if scene.asked:
            lines.append("around the circle: the query")
        place = f"{scene.lat:.6f}°, {scene.lon:.6f}°"
        lines.append(" · ".join(filter(None, (place, _error_text(scene)))))
        return cls(scene, signs, titles, lines, _legend_keys(scene, signs))

    @property
    def sizes(self) -> tuple[float, float]:
        """Inches above and below the map."""
        rows = len(self.lines) + math.ceil(len(self.keys) / 2)
        return LINE * len(self.titles) + 0.14, LINE * rows + 0.3


def _draw_map(axes: Axes, scene: Scene, signs: dict[int, ClassSign]) -> None:
    # The map reaches as far as the range, the objects and an answer that is near.
    away = math.hypot(*scene.answer) if scene.answer else 0.0
    near = away if away < FARTHEST * scene.radius else 0.0
    # Landmarks far away stand at the edge, with their distance.
    tall = {item.code for item in scene.taxonomy.classes if item.tall}
    things = (item for item in scene.objects if item.code not in tall)
    farthest = max((math.hypot(item.east, item.north) for item in things), default=0.0)
    reach = max(AROUND * scene.radius, 1.08 * farthest, 1.12 * near)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xticks=[], yticks=[], aspect="equal")
    axes.add_patch(Circle((0, 0), scene.radius, facecolor=GROUND, edgecolor=SOFT, linestyle="--"))
    # Lines of sight, the other objects, then the visible objects from the farthest to the nearest.
    objects = [_at_edge(item, EDGE * reach) for item in scene.objects]
    lines = [[(0.0, 0.0), (item.east, item.north)] for item in objects]
    axes.add_collection(LineCollection(lines, colors=SOFT, linewidths=0.5, zorder=2))
    for item in scene.others:
        marker = _class_marker(signs.get(item.code, UNKNOWN), 5)
        axes.plot(item.east, item.north, **marker, alpha=0.25, markeredgewidth=0, zorder=1.5)
    size = 8 if len(scene.objects) > MANY_OBJECTS else 10
    for item in sorted(objects, key=lambda item: -math.hypot(item.east, item.north)):
        _draw_object(axes, item, signs.get(item.code, UNKNOWN), size)
    far = {
        round(math.atan2(shown.north, shown.east) / LABEL_TURN): (shown, item)
        for item, shown in zip(scene.objects, objects, strict=True)
        if shown is not item
    }
    for shown, item in far.values():
        font: dict[str, Any] = {"size": 6.5, "color": INK, "ha": "center", "va": "center"}
        axes.annotate(
            length(math.hypot(item.east, item.north)),
            (shown.east, shown.north),
            xytext=(0, -size),
            textcoords="offset points",
            zorder=5,
            **font,
        )
    edge: dict[str, Any] = {"markeredgecolor": GROUND, "markeredgewidth": 1.5}
    axes.plot(0, 0, color=INK, marker="o", markersize=7, **edge, zorder=6)
    for code, bearing in scene.asked:
        _draw_query_object(axes, signs.get(code, UNKNOWN), bearing, scene.radius)
    if scene.answer:
        _draw_answer(axes, scene.answer, away, reach)
    draw_north(axes)
    draw_scale(axes, reach)


def _at_edge(item: SceneObject, edge: float) -> SceneObject:
    """Return an object at most `edge` metres away, in its direction."""
    away = math.hypot(item.east, item.north)
    share = edge / away if away > edge else 1.0
    return item if share == 1.0 else replace(item, east=share * item.east, north=share * item.north)


def _class_marker(sign: ClassSign, size: float) -> dict[str, Any]:
    """Return options of matplotlib for the marker of a class."""
    marker, share = MARKERS[sign.shape]
    return {"marker": marker, "markersize": share * size, "color": sign.colour}


def _draw_object(axes: Axes, item: SceneObject, sign: ClassSign, size: float) -> None:
    edge: dict[str, Any] = {"markeredgecolor": GROUND, "markeredgewidth": 0.7}
    axes.plot(item.east, item.north, **_class_marker(sign, size), **edge, zorder=4)
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


def _draw_query_object(axes: Axes, sign: ClassSign, bearing: float, radius: float) -> None:
    """Draw an object of the query as a letter outside the range circle, at its bearing."""
    turn = math.radians(bearing)
    ends = [(share * math.sin(turn), share * math.cos(turn)) for share in (1.0, 1.06, RIM)]
    inner, outer, place = ((radius * east, radius * north) for east, north in ends)
    axes.plot(*zip(inner, outer, strict=True), color=INK, linewidth=1.2, zorder=3)
    font: dict[str, Any] = {"size": 8.5, "weight": "bold", "color": INK}
    axes.text(*place, sign.symbol, ha="center", va="center", **font, zorder=5, clip_on=True)


def _draw_answer(axes: Axes, answer: tuple[float, float], away: float, reach: float) -> None:
    """Draw the answer as a cross, or beyond the edge as an arrow with its distance."""
    east, north = answer
    if max(abs(east), abs(north)) < reach:
        axes.plot([0, east], [0, north], color=ANSWER, linewidth=1, linestyle=":", zorder=3)
        axes.plot(east, north, **_ANSWER_MARKER, zorder=7)
        return
    share = 0.96 * reach / max(abs(east), abs(north))
    tip = (share * east, share * north)
    arrow = {"arrowstyle": "-|>", "color": ANSWER, "linewidth": 1.6}
    axes.annotate("", tip, xytext=(0.84 * tip[0], 0.84 * tip[1]), arrowprops=arrow, zorder=7)
    font: dict[str, Any] = {"color": ANSWER, "size": 8.5, "va": "center", **_IN_FRONT}
    axes.text(0.78 * tip[0], 0.78 * tip[1], f"{away:,.0f} m", **font, zorder=7)


_ANSWER_MARKER: dict[str, Any] = {
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
    font: dict[str, Any] = {"va": "center", "weight": "bold", "size": 9, **share, **_IN_FRONT}
    axes.annotate("N", (0.955, 0.985), xytext=(0.955, 0.885), arrowprops=arrow, **font, zorder=8)


def draw_scale(axes: Axes, reach: float) -> None:
    """Draw a scale bar in the lower left corner of a map; `reach` is half its width in metres."""
    metres = _round_length(0.5 * reach)
    start = 0.03
    end = start + metres / (2 * reach)
    line: dict[str, Any] = {"color": INK, "linewidth": 1.4, "solid_capstyle": "butt", "zorder": 8}
    corners = [start, start, end, end], [0.045, 0.03, 0.03, 0.045]
    axes.plot(*corners, transform=axes.transAxes, **line)
    text: dict[str, Any] = {"va": "bottom", "size": 8.5, "transform": axes.transAxes, **_IN_FRONT}
    axes.text((start + end) / 2, 0.045, length(metres), **text, zorder=8)


def _round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, 50... that is not above `longest`."""
    power = 10 ** math.floor(math.log10(longest))  # too large if log10 rounds up, hence 0.5 below
    return next(float(power * step) for step in (5, 2, 1, 0.5) if power * step <= longest)


def _error_text(scene: Scene) -> str:
    if scene.error_m is None:
        return ""
    return f"error {scene.error_m:,.1f} m" if math.isfinite(scene.error_m) else "not localized"


def _legend_keys(scene: Scene, signs: dict[int, ClassSign]) -> list[tuple[Line2D, str]]:
    """Return a key for each class, with its count, or pale if no object of it is visible."""
    counts = Counter(item.code for item in scene.objects)
    keys = []
    codes = {*counts, *(item.code for item in scene.others)}
    if len(codes) > MANY_KEYS:  # only those that are seen
        codes = {*counts}
    for code in sorted(codes):
        sign = signs.get(code, UNKNOWN)
        count = f" ({counts[code]})" if counts[code] else ""
        key = Line2D([], [], linestyle="", markeredgewidth=0, **_class_marker(sign, 8))
        key.set_alpha(None if counts[code] else 0.25)
        keys.append((key, f"{sign.symbol} {label(sign.title, CLASS_LETTERS)}{count}"))
    if scene.answer:
        keys.append((Line2D([], [], **_ANSWER_MARKER), "answer"))
    return keys


def _seen(scene: Scene) -> str:
    """Return what is seen in words."""
    return one_line(scene.taxonomy.words([item.code for item in scene.objects]))


def _scene_description(scene: Scene) -> str:
    """Return the alternative text of a scene."""
    query = one_line(scene.taxonomy.words([code for code, _ in scene.asked]))
    place = f"from {scene.lat:.6f}, {scene.lon:.6f}"
    sentences = (
        scene.title,
        f"Seen {place}: {_seen(scene)}",
        f"The query had {query}" if scene.asked else "",
        _error_text(scene),
    )
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in sentences if text)
