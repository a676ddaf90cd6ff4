"""What a report is made of: numbers beside the paper's, curves, maps, scenes, in sections."""

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
    """A number of ours, beside the paper's where it prints one.

    ``ours`` is None where it could not be worked out; ``low`` and ``high`` are the ends of its
    interval of 95 %. The unit of all is ``""`` for a share or a pure number.
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
        """Ours less the paper's, rounded as it is shown."""
        if self.ours is None or self.paper is None:
            return None
        return round(self.ours - self.paper, self.decimals)


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A line of a plot.

    Parameters
    ----------
    label : str
        What the legend says.
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
    """A plot of curves, with points that the paper tells.

    Parameters
    ----------
    name : str
        Letters, digits and ``-``: what its files are called.
    title : str
        What it shows.
    x_label, y_label : str
        What the axes show, with units.
    curves : tuple of Curve
        The lines.
    paper : tuple of (float, float, str)
        Points x, y that the paper's text tells, each with what it is of.
    y_range : tuple of float
        Ends of the y axis.
    log : bool, default False
        Whether the x axis is logarithmic, from the least x above 0 on.
    ticks : tuple of (float, str), optional
        What stands at which x, in place of numbers.
    diagonal : bool, default False
        Whether the line y = x is drawn, on which chances come true.

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
    """A viewpoint with the street objects around it; its files are called ``name``.

    ``lon`` and ``lat`` are in degrees (WGS 84), ``radius`` in metres; ``types`` are the symbols of
    the signature, clockwise from north, and ``taxonomy`` has their classes. ``others`` are not seen
    from there. ``asked`` are class and bearing of what a query told. ``answer`` is metres east and
    north to the place that was answered; ``error_m`` is None where nothing was asked.
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
            "place": f"{self.lon:.6f}°, {self.lat:.6f}°",
            "radius": f"{self.radius:g} m",
            "error": "not asked" if self.error_m is None else f"{self.error_m:,.1f} m",
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two scenes to look at side by side, with a heading and a sentence about both."""

    title: str
    text: str
    scenes: tuple[Scene, Scene]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class OutcomeMap:
    """A map of where queries were asked, and which were successful; its files are called ``name``.

    ``ground`` tells which squares of ``step`` metres have cells, the first row in the south;
    ``places`` are metres east and north of its south-west corner, shape (n, 2), and ``successful``
    (n,) tells the outcome of each.
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

    Its table has the rows and columns of ``numbers`` in the order in which they first come.
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
    def drawn(self) -> tuple[Plot | OutcomeMap | Scene, ...]:
        """Everything of which there is a picture."""
        paired = (scene for pair in self.pairs for scene in pair.scenes)
        return (*self.plots, *self.maps, *self.scenes, *paired)


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """A report, which `reports.page.write_report` writes.

    ``headline`` is the result in one sentence. ``settings`` tells what was run on what, as names
    and values, and ``command`` how; ``taxonomy`` has the classes of the objects in the scenes;
    ``facts`` holds specs, versions and machine as plain values for JSON.
    """

    title: str
    headline: str = ""
    text: tuple[str, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()
    command: str = ""
    sections: tuple[Section, ...]
    taxonomy: Taxonomy
    facts: Mapping[str, Any] = field(default_factory=dict)
