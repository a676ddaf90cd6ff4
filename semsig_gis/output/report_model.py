"""Data model of a report: sections with numbers, plots, maps and scenes."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

from semsig_gis.core import Displayed

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy


@dataclass(frozen=True, slots=True)
class Number:
    """A number of ours, with the paper's number for comparison if the paper has it.

    ``ours`` is None if it could not be computed; ``low`` and ``high`` are the ends of its
    interval of 95 %. The unit is ``""`` for a share or a pure number.
    """

    row: str
    column: str
    ours: float | None
    _: KW_ONLY
    low: float | None = None
    high: float | None = None
    paper: float | None = None
    unit: str = ""
    decimals: int = 4

    @property
    def difference(self) -> float | None:
        """Our number minus the paper's, to `decimals` places; None if one is missing."""
        if self.ours is None or self.paper is None:
            return None
        return round(self.ours - self.paper, self.decimals)


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A line of a plot.

    Parameters
    ----------
    label : str
        Text in the legend.
    x, y : tuple of float
        Points, x ascending.
    low, high : tuple of float, optional
        Ends of the intervals of 95 % of each y.

    Examples
    --------
    >>> Curve(label="ours", x=(1.0, 2.0), y=(0.5, 0.75)).label
    'ours'
    """

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A plot of curves, with points from the paper.

    Parameters
    ----------
    name : str
        Name of its files: letters, digits and ``-``.
    title : str
        Title.
    x_label, y_label : str
        Labels of the axes, with units.
    curves : tuple of Curve
        The lines.
    paper : tuple of (float, float, str)
        Points x, y from the paper's text, each with a description.
    y_range : tuple of float
        Ends of the y axis.
    log : bool, default False
        Whether the x axis is logarithmic, from the smallest positive x.
    ticks : tuple of (float, str), optional
        Positions and texts of the ticks of the x axis, instead of numbers.
    diagonal : bool, default False
        Whether to draw the line y = x, on which predicted chances equal observed shares.

    Examples
    --------
    >>> curve = Curve(label="ours", x=(1.0, 2.0), y=(0.5, 0.75))
    >>> Plot(name="error", title="Error", x_label="m", y_label="share", curves=(curve,)).name
    'error'
    """

    name: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    paper: tuple[tuple[float, float, str], ...] = ()
    y_range: tuple[float, float] = (0.0, 1.0)
    log: bool = False
    ticks: tuple[tuple[float, str], ...] = ()
    diagonal: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneObject:
    """A street object of a scene: the code of its class, and metres from the viewpoint."""

    code: int
    east: float
    north: float


@dataclass(frozen=True, repr=False, slots=True, kw_only=True)
class Scene(Displayed):
    """A viewpoint with the street objects around it; ``name`` is the name of its files.

    ``lon`` and ``lat`` are in degrees (WGS 84), ``radius`` in metres; ``types`` are the symbols of
    the signature, clockwise from north, and ``taxonomy`` has their classes. ``others`` are objects
    that are not visible from the viewpoint. ``asked`` has the class code and the bearing of each
    object of the query. ``answer`` is metres east and north to the estimated place; ``error_m`` is
    None without a query.
    """

    name: str
    title: str
    lon: float
    lat: float
    radius: float
    types: str
    taxonomy: Taxonomy
    objects: tuple[SceneObject, ...]
    others: tuple[SceneObject, ...] = ()
    asked: tuple[tuple[int, float], ...] = ()
    answer: tuple[float, float] | None = None
    error_m: float | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "title": self.title,
            "types": self.types or "none",
            "place": f"{self.lat:.6f}°, {self.lon:.6f}°",
            "radius": f"{self.radius:g} m",
            "error": "not asked" if self.error_m is None else f"{self.error_m:,.1f} m",
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two scenes to compare, with a heading and a sentence about both."""

    title: str
    text: str
    scenes: tuple[Scene, Scene]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class OutcomeMap:
    """A map of successful and failed queries; ``name`` is the name of its files.

    ``ground`` is True for each square of ``step`` metres that has cells, the first row in the
    south; ``places`` are metres east and north of its south-west corner, shape (n, 2);
    ``successful``, shape (n,), is the outcome of each query.
    """

    name: str
    title: str
    step: float
    ground: NDArray[np.bool_]
    places: NDArray[np.float64]
    successful: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report; ``name`` consists of letters, digits and ``-``.

    Its table has the rows and columns of ``numbers`` in order of first occurrence.
    """

    name: str
    title: str
    text: tuple[str, ...] = ()
    numbers: tuple[Number, ...] = ()
    plots: tuple[Plot, ...] = ()
    maps: tuple[OutcomeMap, ...] = ()
    scenes: tuple[Scene, ...] = ()
    pairs: tuple[Pair, ...] = ()

    @property
    def drawings(self) -> tuple[Plot | OutcomeMap | Scene, ...]:
        """All plots, maps and scenes."""
        paired = (scene for pair in self.pairs for scene in pair.scenes)
        return (*self.plots, *self.maps, *self.scenes, *paired)


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """A report; `output.pages.page.write_report` writes it.

    ``headline`` is the result in one sentence. ``settings`` are the names and values of the
    settings, ``command`` is the command line; ``taxonomy`` has the classes of the objects in the
    scenes; ``credits`` are the attribution lines of the data; ``facts`` are specs, versions and
    machine as plain values for JSON.
    """

    title: str
    headline: str = ""
    text: tuple[str, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()
    command: str = ""
    sections: tuple[Section, ...]
    taxonomy: Taxonomy
    credits: tuple[str, ...] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
