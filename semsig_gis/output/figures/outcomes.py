"""A small map of successful and failed queries."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import OUTCOMES, WHITE, extra
from semsig_gis.output.figures.plots import (
    SOFT,
    blank_figure,
    cell_pixels,
    draw_legend,
    label,
    saved,
)
from semsig_gis.output.figures.scenes import MARKERS, draw_north, draw_scale
from semsig_gis.output.report_model import OutcomeMap

with extra("plot", "a report or a figure"):
    from matplotlib.colors import to_rgba
    from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from semsig_gis.core import Mark
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.output.figures.plots import Picture

MOST_SQUARES = 400  # along a side
MANY_PLACES = 2000  # queries beyond this number are drawn as pixels
# Inches.
WIDTH, MARGIN = 5.0, 0.1
LEAST_HEIGHT, MOST_HEIGHT = 2.0, 3.4
TITLE_LETTERS, TITLE_LINE, LEGEND = 55, 0.22, 0.34


def outcome_map(
    evaluation: Evaluation, database: SignatureDatabase, *, name: str, title: str
) -> OutcomeMap:
    """Return a map of the queries of an evaluation on the cells of the database."""
    pixels, step = cell_pixels(database, np.ones(len(database)), most=MOST_SQUARES)
    corner = database.xy.min(axis=0) - database.grid.step / 2
    points = evaluation.queries.geometry
    return OutcomeMap(
        name=name,
        title=title,
        step=step,
        ground=~np.isnan(pixels),
        places=np.column_stack([points.x, points.y]) - corner,
        successful=evaluation.successful,
    )


def draw_map(shown: OutcomeMap) -> Picture:
    """Draw a map, north up; the same map gives the same bytes."""
    # The extent of the cells and of the queries, with a margin.
    extent = shown.step * np.array(shown.ground.shape[::-1])
    low = np.minimum(shown.places.min(axis=0, initial=0.0), 0.0)
    high = np.maximum(shown.places.max(axis=0, initial=0.0), extent)
    margin = 0.03 * (high - low).max()
    across, up = (high - low + 2 * margin).tolist()
    # The height of the map follows its shape, within limits; the map is centred in it.
    titles = textwrap.wrap(label(shown.title, 2 * TITLE_LETTERS), TITLE_LETTERS)
    above = TITLE_LINE * len(titles) + 0.12
    inside = WIDTH - 2 * MARGIN
    tall = min(max(inside * up / across, LEAST_HEIGHT), MOST_HEIGHT)
    reach = np.array([inside, tall]) / 2 * max(across / inside, up / tall)
    (left, bottom), (right, top) = (low + high) / 2 - reach, (low + high) / 2 + reach
    height = above + tall + LEGEND
    rows = dict(zip(OUTCOMES, (shown.successful, ~shown.successful), strict=True))
    options = {
        outcome: _outcome_marker(mark, len(shown.places)) for outcome, mark in OUTCOMES.items()
    }
    with blank_figure(WIDTH, height) as figure:
        place = (MARGIN / WIDTH, LEGEND / height, inside / WIDTH, tall / height)
        axes = figure.add_axes(place)
        axes.spines[:].set_visible(False)
        pixels = np.where(shown.ground[..., None], to_rgba(SOFT, 0.35), to_rgba(SOFT, 0.0))
        ends = (0.0, extent[0], 0.0, extent[1])
        axes.imshow(pixels, origin="lower", extent=ends, interpolation="nearest", aspect="auto")
        axes.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[])
        many = len(shown.places) > MANY_PLACES
        for outcome, selected in reversed(rows.items()):
            axes.plot(*shown.places[selected].T, **options[outcome], rasterized=many)
        draw_north(axes)
        draw_scale(axes, float(reach[0]))
        heading: dict[str, Any] = {"va": "top", "weight": "bold", "size": 10.5}
        figure.text(MARGIN / WIDTH, 1 - 0.08 / height, "\n".join(titles), **heading)
        counts = {name: f"{name}: {int(selected.sum()):,}" for name, selected in rows.items()}
        keys = [
            (Line2D([], [], **{**options[outcome], "markersize": 7.0}), text)
            for outcome, text in counts.items()
        ]
        place_of_keys = (MARGIN / WIDTH, 0.24 / height, (WIDTH - MARGIN) / WIDTH)
        draw_legend(figure, keys, place=place_of_keys, columns=2, size=9, sign_width=1)
        description = f"{shown.title}. North is up. Queries {', '.join(counts.values())}."
        return saved(figure, title=shown.title, description=description)


def _outcome_marker(mark: Mark, places: int) -> dict[str, Any]:
    """Return options of matplotlib for the markers of an outcome; many places are smaller."""
    marker, share = MARKERS[mark.shape]
    size = 5.0 if places <= MANY_PLACES / 4 else 3.5 if places <= MANY_PLACES else 2.5
    return {
        "linestyle": "",
        "marker": marker,
        "color": mark.colour,
        "markersize": share * size,
        # White edges make dark markers visible on the dark background, too.
        "markeredgecolor": WHITE,
        "markeredgewidth": 0.1 * size,
    }
