"""Results drawn into axes of matplotlib have the right places, colours and legends."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from map_pages import HOSTILE, hostile_taxonomy
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar
from sentences import refused
from worlds import random_town

from semsig_gis import Method, build_index, evaluate, identify, localize, locate, named_noise
from semsig_gis.core import (
    CELL_CHANCES,
    GROUP_COLOURS,
    SHADES,
    EmptyResultError,
    InputError,
    UnknownNameError,
    class_signs,
)
from semsig_gis.output import MapFrame
from semsig_gis.output.figures import axes as drawing

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    from semsig_gis.evaluation import PlotKind

TOWN = random_town()
CITY, OBJECTS = TOWN.database, TOWN.street_objects
BETTER, WORSE = (
    evaluate(CITY, queries=40, method=Method(), distortion=level) for level in ("light", "strong")
)
INDEX = build_index(CITY, named_noise("light"))


@pytest.fixture(autouse=True)
def ax() -> Iterator[Axes]:
    yield plt.subplots()[1]
    plt.close("all")


def colour_at(ax: Axes, x: float, y: float) -> str:
    """Return the colour of the last image at a place."""
    image = ax.images[-1]
    west, _, south, _ = image.get_extent()
    step = CITY.grid.step
    pixel = pixels(image)[int((y - south) // step), int((x - west) // step)]
    return to_hex(image.to_rgba(np.array([pixel]))[0])


def pixels(image: AxesImage) -> NDArray[np.float64]:
    array = image.get_array()
    assert array is not None
    return array


def bar_of(ax: Axes) -> Axes:
    """Return the axes of the colour bar of the last image."""
    bar = ax.images[-1].colorbar
    assert bar is not None
    return bar.ax


@pytest.mark.parametrize(
    ("column", "numbers", "colours"),
    [
        (None, CITY.lengths, SHADES),
        ("length", CITY.lengths, SHADES),
        ("type_group_size", CITY.type_group_sizes, GROUP_COLOURS),
        ("angle_group_size", CITY.angle_group_sizes, GROUP_COLOURS),
    ],
)
def test_cells_have_the_colours_of_the_maps(
    ax: Axes, column: str | None, numbers: np.ndarray, colours: dict[int, str]
) -> None:
    assert CITY.plot(column, ax=ax) is ax
    for (x, y), number in zip(CITY.xy[::37].tolist(), numbers[::37].tolist(), strict=True):
        expected = next(look for low, look in reversed(colours.items()) if number >= low)
        assert colour_at(ax, x, y) == expected
    labels = [text.get_text() for text in bar_of(ax).get_yticklabels()]
    assert len(labels) == len(colours)
    assert labels[-1].endswith(" or more")
    assert bar_of(ax).get_ylabel() in ax.get_title()


def test_numbers_and_options_of_a_user_are_drawn(ax: Axes) -> None:
    share = pd.Series(CITY.lengths / CITY.lengths.max(), name="share of $most$")
    CITY.plot(share, ax=ax, cmap="magma", vmax=1)
    assert bar_of(ax).get_ylabel() == r"share of \$most\$"
    assert ax.images[-1].get_clim() == (share.min(), 1)
    assert CITY.plot("length", ax=ax, cmap="magma").images[-1].get_cmap().name == "magma"
    assert CITY.plot(ax=ax, legend=False).images[-1].colorbar is None
    # Maps in the same axes share one scale bar.
    assert sum(isinstance(artist, AnchoredSizeBar) for artist in ax.artists) == 1
    ax.figure.canvas.draw()


def test_image_of_a_large_city_has_few_pixels(ax: Axes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "MOST_PIXELS", 10)
    CITY.plot(ax=ax)
    assert max(pixels(ax.images[-1]).shape) <= 10
    west, east, south, north = ax.images[-1].get_extent()
    assert (CITY.xy > (west, south)).all()
    assert (CITY.xy < (east, north)).all()


def test_unknown_columns_wrong_numbers_and_empty_cities_are_refused() -> None:
    with refused(UnknownNameError, "'lenght'", "length, type_group_size", "'length'"):
        CITY.plot("lenght")
    with refused(InputError, "2 numbers", f"{len(CITY)} cells"):
        CITY.plot([1.0, 2.0])
    with refused(EmptyResultError, "no cells"):
        CITY.select(slice(0)).plot()
    nothing = replace(OBJECTS, table=OBJECTS.table.iloc[:0])
    with refused(EmptyResultError, "no street object"):
        nothing.plot()


def test_objects_have_the_signs_of_their_classes(ax: Axes) -> None:
    assert OBJECTS.plot(ax=ax) is ax
    signs, counts = class_signs(OBJECTS.taxonomy), OBJECTS.class_counts
    assert [line.get_color() for line in ax.lines] == [signs[code].colour for code in counts]
    assert [len(line.get_xdata()) for line in ax.lines] == [*counts.values()]
    for line, code in zip(ax.lines, counts, strict=True):
        assert np.array_equal(line.get_xydata(), OBJECTS.xy[OBJECTS.codes == code])
    keys = ax.get_legend()
    assert keys is not None
    labels = [f"{signs[code].symbol} {signs[code].title} ({n})" for code, n in counts.items()]
    (legend,) = OBJECTS.plot().figure.legends
    for key in (keys, legend):
        assert [text.get_text() for text in key.get_texts()] == labels
    assert OBJECTS.plot(legend=False).figure.legends == []


def test_hostile_titles_are_drawn(ax: Axes) -> None:
    harmful = replace(OBJECTS, taxonomy=hostile_taxonomy(OBJECTS.taxonomy, f"$\\frac{{$ {HOSTILE}"))
    harmful.plot(ax=ax).figure.canvas.draw()


@pytest.mark.parametrize("cell", [int(CITY.lengths.argmax()), int(CITY.type_group_sizes.argmax())])
def test_plot_of_a_likelihood_answer_shows_chances_and_the_place(ax: Axes, cell: int) -> None:
    location = locate(INDEX, CITY.signature(cell))
    assert location.plot(ax=ax) is ax
    assert ax.get_title().startswith("The answer" if location.answer.given else "Cannot tell")
    best = int(location.chances.argmax())
    expected = next(
        look for low, look in reversed([*CELL_CHANCES.items()]) if location.chances[best] >= low
    )
    assert colour_at(ax, *CITY.xy[best]) == expected
    place = (location.estimate.x, location.estimate.y)
    ellipse, mark = (line.get_xydata() for line in ax.lines[-2:])
    assert mark.tolist() == [[*place]]
    # The bearing of the longer axis is clockwise from north.
    longer, _, bearing = location.estimate.ellipse()
    turn = np.radians(bearing)
    end = place + longer * np.array([np.sin(turn), np.cos(turn)])
    assert ellipse[0] == pytest.approx(end)
    west, east = ax.get_xlim()
    assert west < place[0] < east
    ax.figure.canvas.draw()


def test_plot_of_a_distance_answer_shows_the_candidates(ax: Axes) -> None:
    localization = localize(CITY, CITY.signature(3), top=7, method=Method())
    localization.plot(ax=ax)
    points = np.asarray(ax.collections[0].get_offsets())[::-1]
    assert np.array_equal(points, localization.candidates[["x", "y"]])
    assert ax.get_title() == f"The best 7 of {len(CITY):,} cells"
    assert localization.plot(legend=False) is not ax


def test_colours_of_identifiability_range_from_0_to_1(ax: Axes) -> None:
    identify(INDEX, trials=5, class_trials=2).plot(ax=ax)
    assert ax.images[-1].get_clim() == (0, 1)


@pytest.mark.parametrize("kind", ["errors", "recall"])
def test_curves_of_evaluations_share_axes(ax: Axes, kind: PlotKind) -> None:
    for evaluation, label in ((BETTER, None), (WORSE, "wor$e")):
        assert evaluation.plot(kind, ax=ax, label=label) is ax
    _, labels = ax.get_legend_handles_labels()
    assert labels == ["edit+edit, light", r"wor\$e"]
    first, second = (line for line in ax.lines if not str(line.get_label()).startswith("_"))
    assert first.get_color() != second.get_color()
    for line, evaluation in ((first, BETTER), (second, WORSE)):
        at = dict(np.asarray(line.get_xydata()).tolist())
        share = evaluation.cdf([50])[0] if kind == "errors" else evaluation.recall(10)
        assert at[50 if kind == "errors" else 10] == pytest.approx(share)
    ax.figure.canvas.draw()


def test_map_of_an_evaluation_shows_failed_and_successful_queries(ax: Axes) -> None:
    assert BETTER.plot("map", ax=ax) is ax
    lines = {str(line.get_label()).split(" ")[0]: line for line in ax.lines}
    for name, rows in (("failed", ~BETTER.successful), ("successful", BETTER.successful)):
        places = BETTER.queries.geometry[rows]
        assert np.array_equal(lines[name].get_xydata(), np.column_stack([places.x, places.y]))
    assert len({line.get_marker() for line in lines.values()}) == 2
    assert len({line.get_color() for line in lines.values()}) == 2
    with refused(UnknownNameError, "'error'", "errors, recall, map", "'errors'"):
        BETTER.plot("error")  # type: ignore[arg-type]


@pytest.mark.usefixtures("map_files")
def test_results_are_shown_on_maps() -> None:
    location, localization = (
        locate(INDEX, CITY.signature(3)),
        localize(CITY, CITY.signature(3), method=Method()),
    )
    chances = identify(INDEX, trials=5, class_trials=2)
    for frame, title in (
        (CITY.explore(), "Cells that look the same"),
        (OBJECTS.explore(), "Street objects"),
        (location.explore(), "Where it was seen"),
        (localization.explore(CITY), "Candidates"),
        (BETTER.explore(CITY), "Localization errors"),
        (chances.explore(), "Where a query can be placed"),
    ):
        assert isinstance(frame, MapFrame)
        assert title in frame.page
