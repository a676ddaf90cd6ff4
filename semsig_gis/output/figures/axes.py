"""Draw results into axes of matplotlib.

Maps are in metres of the CRS of their data, so that a geopandas table in the same CRS can be
plotted into the same axes.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np

from semsig_gis.core import (
    ANSWERS,
    CANDIDATE_RAMP,
    OUTCOMES,
    WHITE,
    EmptyResultError,
    InputError,
    UnknownNameError,
    class_signs,
    codes_by_family,
    extra,
    family_named,
    nearest_name,
    percent,
)
from semsig_gis.evaluation import PlotKind, chain_text
from semsig_gis.localization import Location
from semsig_gis.output.figures.plots import INK, cell_pixels, draw_curve, draw_frame, label
from semsig_gis.output.figures.scenes import MARKERS
from semsig_gis.output.figures.shares import curve_of, plot_of
from semsig_gis.output.layers.styles import AMBIGUITY, CHANCES, IDENTIFIABILITY, SEEN

with extra("plot", "a report or a figure"):
    from matplotlib.colors import LinearSegmentedColormap, ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Mark
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation, Identifiability
    from semsig_gis.localization import Answer
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.layers.styles import Scale

SIZE = (7.5, 6.0)  # inches of a new figure
MOST_PIXELS = 4000  # of an image along a side
KILOMETRE = 1000
LONGEST_LABEL = 40


# Columns of the cells, with their names in files.
CELL_COLUMNS: Mapping[str, Scale] = {
    "length": SEEN,
    "type_group_size": AMBIGUITY,
    "angle_group_size": replace(AMBIGUITY, title="cells with the same angle levels"),
}
COLOUR_OPTIONS = {"cmap", "norm", "vmin", "vmax"}


def plot_database(
    database: SignatureDatabase,
    column: str | ArrayLike | None = None,
    *,
    ax: Axes | None = None,
    legend: bool = True,
    **look: Any,  # noqa: ANN401 - whatever matplotlib takes
) -> Axes:
    """Draw a number of every cell.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    column : str or array_like, shape (n,), optional
        ``"length"`` (objects seen, the default), ``"type_group_size"`` or ``"angle_group_size"``
        (cells that look the same), or a number for each cell, NaN for cells to omit.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into; by default those of a new figure.
    legend : bool, default True
        Whether to add a colour bar.
    **look
        Options of `matplotlib.axes.Axes.imshow`, such as ``cmap`` or ``vmax``. Without an option
        for colours, a named column has the colours of the maps.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, in metres of the CRS of the database.

    Raises
    ------
    InputError
        If there is no such column (`UnknownNameError`), or not one number for each cell.
    EmptyResultError
        If there is no cell.

    Examples
    --------
    >>> ax = plot_database(demo_database, "type_group_size")
    >>> plot_database(demo_database, demo_database.lengths > 9, ax=ax, legend=False) is ax
    True
    """
    if column is None or isinstance(column, str):
        name = column or "length"
        if name not in CELL_COLUMNS:
            raise UnknownNameError(
                f"{name!r} is not a column of the cells; give {', '.join(CELL_COLUMNS)} or a "
                f"number for each cell{nearest_name(name, CELL_COLUMNS)}."
            )
        # The attributes of the database have the names of the columns in plural.
        values = getattr(database, f"{name}s").astype(np.float64)
        title = CELL_COLUMNS[name].title
        if not COLOUR_OPTIONS & look.keys():
            axes = map_axes(ax)
            _draw_scale(axes, database, values, CELL_COLUMNS[name], legend=legend, **look)
            axes.set_title(f"{len(database):,} cells, by {title}")
            _frame(axes)
            return axes
    else:
        values, title = np.asarray(column, np.float64), str(getattr(column, "name", None) or "")
        if values.shape != (len(database),):
            raise InputError(
                f"{values.size} numbers were given for {len(database)} cells; give one for each."
            )
    axes = map_axes(ax)
    image = _draw_cells(axes, database, values, **look)
    if legend:
        _add_colour_bar(axes, image, title)
    _frame(axes)
    return axes


def plot_identifiability(
    identifiability: Identifiability,
    *,
    ax: Axes | None = None,
    legend: bool = True,
) -> Axes:
    """Draw the chance that a query from each cell will be found.

    Parameters
    ----------
    identifiability : Identifiability
        The chances of the cells.
    ax, legend : optional
        As in `plot_database`.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, in metres of the CRS of the database.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> ax = plot_identifiability(identify(index, trials=20, class_trials=5))
    >>> ax.get_title()
    'Chance to be found within 50 m'
    """
    cmap = LinearSegmentedColormap.from_list("found", IDENTIFIABILITY.colours)
    database, chances = identifiability.database, identifiability.found
    axes = plot_database(database, chances, ax=ax, legend=legend, cmap=cmap, vmin=0, vmax=1)
    axes.set_title(f"Chance to be found within {identifiability.radius:g} m")
    return axes


def plot_objects(objects: StreetObjects, *, ax: Axes | None = None, legend: bool = True) -> Axes:
    """Draw street objects with the shapes and colours of their classes.

    Parameters
    ----------
    objects : StreetObjects
        The objects.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into; by default those of a new figure.
    legend : bool, default True
        Whether to add a legend of the classes: next to the map, or in a corner if `ax` is given.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, in metres of the CRS of the objects.

    Raises
    ------
    EmptyResultError
        If there is no object.

    Examples
    --------
    >>> ax = plot_objects(demo_objects)
    >>> ax.figure.legends[0].get_texts()[0].get_text()
    'B Tree (120)'
    """
    if not len(objects):
        raise EmptyResultError("there is no street object to show; look at what was loaded.")
    axes = map_axes(ax)
    signs, counts = class_signs(objects.taxonomy), objects.class_counts
    # Markers are smaller, and without edges, where there are many objects.
    smaller = min(max(CROWD / len(objects), 1 / 16), 1.0) ** 0.5
    with_room = smaller == 1.0
    keys = []
    for code, count in counts.items():
        marker, share = MARKERS[signs[code].shape]
        title = plain(f"{signs[code].symbol} {signs[code].title} ({count:,})")
        edge = 0.5 if count < MANY and with_room else 0.0
        style: dict[str, Any] = {"linestyle": "", "marker": marker, "color": signs[code].colour}
        style |= {"markeredgecolor": WHITE, "markeredgewidth": edge}
        size = smaller * share * next(size for least, size in SIZES if count >= least)
        # Rare classes are drawn on top of frequent classes.
        order: dict[str, Any] = {"zorder": 3 - count / len(objects), "rasterized": count >= MANY}
        axes.plot(*objects.xy[objects.codes == code].T, markersize=size, **style, **order)
        keys.append(Line2D([], [], markersize=7 * share, label=title, **style))
    families = codes_by_family(objects.taxonomy, counts)
    if len(keys) > KEYS and len(families) > 1:
        keys = [
            _family_key(family, sum(counts[code] for code in codes))
            for family, codes in families.items()
        ]
    axes.set_title(f"{len(objects):,} street objects")
    _frame(axes)
    if legend and ax is None:
        cast("Figure", axes.figure).legend(handles=keys, loc="outside right upper", frameon=False)
    elif legend:
        axes.legend(handles=keys, loc="upper right", fontsize="small")
    return axes


def _family_key(name: str, count: int) -> Line2D:
    """Return the key of the classes of a family."""
    family = family_named(name)
    style: dict[str, Any] = {"linestyle": "", "marker": "o", "color": family.colour}
    return Line2D([], [], markersize=7, label=f"{family.title} ({count:,})", **style)


KEYS = 40  # of classes in a legend; more are shown by family
MANY, CROWD = 2000, 10_000  # numbers of objects of a class, and of all, with smaller markers
SIZES = ((MANY, 2.0), (200, 3.5), (0, 6.5))  # of markers, by the least number of objects


def plot_answer(answer: Answer, *, ax: Axes | None = None, legend: bool = True) -> Axes:
    """Draw the possible places of a query.

    Parameters
    ----------
    answer : Location or Localization
        The answer. For the likelihood method, the chance of every cell in the region of 90 %, the
        place and its ellipse of 90 % are drawn; for other methods, the candidates by rank.
    ax, legend : optional
        As in `plot_database`.

    Returns
    -------
    matplotlib.axes.Axes
        The axes, in metres of the CRS of the database.

    Examples
    --------
    >>> from semsig_gis import localize
    >>> answer = localize(demo_database, demo_database.signature(0), method="edit+edit", top=5)
    >>> plot_answer(answer).get_title()
    'The best 5 of 955 cells'
    """
    if isinstance(answer, Location):
        return _draw_location(answer, ax=ax, legend=legend)
    axes = map_axes(ax)
    columns = answer.columns
    ranks = np.arange(1, len(columns["cell"]) + 1)
    # The best candidate is drawn last, on top.
    points = axes.scatter(
        columns["x"][::-1],
        columns["y"][::-1],
        c=ranks[::-1],
        cmap=LinearSegmentedColormap.from_list("ranks", CANDIDATE_RAMP).reversed(),
        edgecolors=INK,
        linewidths=0.5,
        zorder=3,
    )
    axes.plot(columns["x"][:1], columns["y"][:1], **_place_marker(ANSWERS["given"]))
    axes.set_title(f"The best {len(ranks):,} of {answer.cells:,} cells")
    _frame(axes)
    if legend:
        _add_colour_bar(axes, points, "rank")
    return axes


def plot_evaluation(
    evaluation: Evaluation,
    kind: PlotKind = "errors",
    *,
    ax: Axes | None = None,
    label: str | None = None,
) -> Axes:
    """Draw the results of an evaluation.

    Parameters
    ----------
    evaluation : Evaluation
        The evaluation.
    kind : {"errors", "recall", "map"}
        ``errors``: the share of the queries by largest error in metres. ``recall``: the share of
        the queries by the best per cent of the cells that contain the true cell. Both have bands of
        95 %. ``map``: the places of successful and failed queries.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into; by default those of a new figure. Several curves may share axes.
    label : str, optional
        Name of a curve in the legend; by default the method and the distortion.

    Returns
    -------
    matplotlib.axes.Axes
        The axes; of a map, in metres of the CRS of the database.

    Raises
    ------
    UnknownNameError
        If the kind is unknown.

    Examples
    --------
    >>> from semsig_gis import evaluate
    >>> evaluation = evaluate(demo_database, queries=20)
    >>> ax = plot_evaluation(evaluation, "recall", label="20 queries")
    >>> ax.get_legend().get_texts()[0].get_text()
    '20 queries'
    """
    if kind not in get_args(PlotKind):
        kinds = ", ".join(get_args(PlotKind))
        raise UnknownNameError(
            f"{kind!r} is not a plot of an evaluation; give {kinds}{nearest_name(kind, CURVES)}."
        )
    if kind == "map":
        return _draw_outcomes(evaluation, map_axes(ax))
    axes = new_axes(CURVE_SIZE) if ax is None else ax
    distortions = chain_text(evaluation.asked.distortions) or "no distortion"
    name = f"{evaluation.method}, {distortions}" if label is None else label
    curve = curve_of(evaluation, name, CURVES[kind])
    number = len(axes.get_legend_handles_labels()[0])  # of the curves that the axes already have
    draw_frame(axes, plot_of(kind, "", CURVES[kind], [curve]))
    draw_curve(axes, curve, number, MOST_CURVES)
    axes.lines[-1].set_label(plain(name))
    axes.legend(frameon=False, loc="lower right")
    return axes


CURVES = {"errors": "error", "recall": "recall"}
CURVE_SIZE = (6.2, 4.2)  # inches
MOST_CURVES = 7  # with shifted markers


def _draw_outcomes(evaluation: Evaluation, axes: Axes) -> Axes:
    places = evaluation.queries.geometry
    many = len(places) >= MANY
    for name, rows in (("failed", ~evaluation.successful), ("successful", evaluation.successful)):
        axes.plot(
            places.x[rows],
            places.y[rows],
            linestyle="",
            marker=MARKERS[OUTCOMES[name].shape][0],
            color=OUTCOMES[name].colour,
            markersize=2.5 if many else 6.0,
            markeredgecolor=WHITE,
            markeredgewidth=0.0 if many else 0.5,
            label=f"{name} ({int(rows.sum()):,})",
        )
    within = f"{evaluation.success_metres} m"
    axes.set_title(f"{len(places):,} queries: successful are those placed within {within}")
    _frame(axes)
    axes.legend(loc="upper right", fontsize="small")
    return axes


DOT = 4.0  # square points
AROUND_M = 150.0  # margin around the region of an answer
CELL_GROUND = "#ececea"  # colour of cells outside the region


def _draw_location(location: Location, *, ax: Axes | None, legend: bool) -> Axes:
    database, place = location.posterior.database, location.estimate
    axes = map_axes(ax)
    _draw_cells(axes, database, np.ones(len(database)), cmap=ListedColormap([CELL_GROUND]))
    _draw_scale(axes, database, location.chances, CHANCES, legend=legend)
    # Dots make single cells visible at small scales; the most probable are drawn last, on top.
    levels = CHANCES.levels(location.chances)
    cells = location.region[levels[location.region] > 0][::-1]
    x, y = database.xy[cells].T
    colours = np.array(CHANCES.colours)[levels[cells] - 1]
    axes.scatter(x, y, c=colours, s=DOT, linewidths=0, marker="s", zorder=2)
    mark = ANSWERS["given" if location.answer.given else "withheld"]
    axes.plot(*place.outline().T, color=mark.colour, linewidth=1.5)
    axes.plot(place.x, place.y, **_place_marker(mark))
    # The map shows the region and the place, with a margin.
    region = np.vstack([database.xy[location.region], [[place.x, place.y]]])
    low, high = region.min(axis=0) - AROUND_M, region.max(axis=0) + AROUND_M
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    chance = f"within {location.rule.radius:g} m with a chance of {percent(location.answer.mass)}"
    if location.answer.given:
        axes.set_title(f"The answer\n{chance}")
    else:
        lines = "Cannot tell", location.region_text, f"Best place: {chance}"
        axes.set_title("\n".join(lines), fontsize="medium")
    axes.set_xlabel(location.doubt, wrap=True)
    _frame(axes)
    return axes


def _place_marker(mark: Mark) -> dict[str, Any]:
    """Return options of matplotlib for the marker of the estimated place."""
    marker, share = MARKERS[mark.shape]
    edge = {"markeredgecolor": mark.colour, "markeredgewidth": 2.5, "markerfacecolor": "none"}
    return {"linestyle": "", "marker": marker, "markersize": 16 * share, "zorder": 4, **edge}


def _draw_scale(
    axes: Axes,
    database: SignatureDatabase,
    values: NDArray[np.float64],
    scale: Scale,
    *,
    legend: bool,
    **look: Any,  # noqa: ANN401 - whatever matplotlib takes
) -> None:
    """Draw numbers of cells in the colours of their classes."""
    levels = np.where(scale.levels(values) > 0, scale.levels(values) - 1.0, np.nan)
    ends = {"vmin": -0.5, "vmax": len(scale.colours) - 0.5}
    image = _draw_cells(axes, database, levels, cmap=ListedColormap(scale.colours), **ends, **look)
    if legend:
        bar = _add_colour_bar(axes, image, scale.title)
        bar.set_ticks(range(len(scale.labels)), labels=scale.labels)
        bar.ax.tick_params(length=0)


def _add_colour_bar(axes: Axes, mappable: ScalarMappable, title: str) -> Colorbar:
    """Add a colour bar next to axes."""
    figure = cast("Figure", axes.figure)
    return figure.colorbar(mappable, ax=axes, shrink=0.7, label=plain(title))


def _draw_cells(
    axes: Axes,
    database: SignatureDatabase,
    values: NDArray[np.float64],
    **look: Any,  # noqa: ANN401 - whatever matplotlib takes
) -> AxesImage:
    """Draw numbers of cells as an image; in a large city, several cells may share a pixel."""
    if not len(database):
        raise EmptyResultError(
            "the database has no cells to show; give one with at least one cell."
        )
    image, side = cell_pixels(database, values, most=MOST_PIXELS)
    west, south = (database.xy.min(axis=0) - database.grid.step / 2).tolist()
    box = (west, west + side * image.shape[1], south, south + side * image.shape[0])
    # A pixel of the screen that shows several cells has the mean of their colours.
    options = {"origin": "lower", "extent": box, "interpolation_stage": "rgba", **look}
    return axes.imshow(image, **options)


def map_axes(ax: Axes | None) -> Axes:
    """Return `ax`, or the axes of a new figure."""
    return new_axes(SIZE) if ax is None else ax


def new_axes(size: tuple[float, float]) -> Axes:
    """Return the axes of a new figure with a width and a height in inches."""
    from matplotlib import pyplot as plt  # noqa: PLC0415 - it selects a backend for the screen

    return plt.subplots(figsize=size, layout="constrained")[1]


def _frame(axes: Axes) -> None:
    """Give axes of a map equal scales and a scale bar instead of coordinates."""
    axes.set(aspect="equal", xticks=[], yticks=[])
    if any(isinstance(artist, AnchoredSizeBar) for artist in axes.artists):
        return
    west, east = axes.get_xlim()
    metres = MaxNLocator(nbins=6, steps=[1, 2, 5, 10]).tick_values(0, abs(east - west))[1]
    text = f"{metres / KILOMETRE:g} km" if metres >= KILOMETRE else f"{metres:g} m"
    bar = AnchoredSizeBar(axes.transData, metres, text, "lower left", borderpad=0.4, color=INK)
    bar.patch.set(facecolor=WHITE, alpha=0.8, edgecolor="none")
    axes.add_artist(bar)


def plain(text: str) -> str:
    """Return text from data as a short label, without formulas of matplotlib."""
    return label(text, LONGEST_LABEL).replace("$", r"\$")
