"""What a report is made of: numbers beside the paper's, curves, scenes, in sections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.taxonomy import Taxonomy

__all__ = ["Curve", "Number", "Plot", "Report", "Scene", "SceneObject", "Section"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number of ours, beside the paper's where it prints one.

    Parameters
    ----------
    row, column : str
        What it tells.
    ours : float or None
        Our figure; None where it could not be worked out.
    low, high : float or None
        Ends of its interval of 95 %, where it has one.
    paper : float or None
        The paper's figure, where it prints one.
    unit : str, default ""
        Unit of all of them; ``""`` for a share or a pure number.
    decimals : int, default 4
        With how many it is shown.

    Examples
    --------
    >>> Number(row="R = 30 m", column="P(error <= 50 m)", ours=0.37, paper=0.3733).difference
    -0.0033
    """

    row: str
    column: str
    ours: float | None
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
    low, high : tuple of float
        Ends of the intervals of 95 % of each y; empty where there are none.
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
    diagonal : bool, default False
        Whether the line y = x is drawn, on which chances come true.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    paper: tuple[tuple[float, float, str], ...] = ()
    y_range: tuple[float, float] = (0.0, 1.0)
    diagonal: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneObject:
    """A street object of a scene.

    Parameters
    ----------
    code : int
        Code of its class.
    east, north : float
        Metres from the viewpoint.
    """

    code: int
    east: float
    north: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A viewpoint with the street objects around it.

    Parameters
    ----------
    name : str
        Letters, digits and ``-``: what its files are called.
    title : str
        What it is an example of.
    lon, lat : float
        The viewpoint in degrees (WGS 84).
    radius : float
        Visibility range in metres.
    types : str
        Symbols of its signature, clockwise from north.
    objects : tuple of SceneObject
        The objects of the signature.
    others : tuple of SceneObject
        Objects around that are not seen from there.
    answer : tuple of float or None
        Metres east and north to the place that was answered, if near enough to be drawn.
    error_m : float, optional
        By how much the answer was off, in metres; None where nothing was asked.
    """

    name: str
    title: str
    lon: float
    lat: float
    radius: float
    types: str
    objects: tuple[SceneObject, ...]
    others: tuple[SceneObject, ...] = ()
    answer: tuple[float, float] | None = None
    error_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report.

    Parameters
    ----------
    name : str
        Letters, digits and ``-``.
    title : str
        Its heading.
    text : tuple of str
        Paragraphs.
    numbers : tuple of Number
        Its table: rows and columns as they come first.
    plots : tuple of Plot
        Its plots.
    scenes : tuple of Scene
        Its examples.
    """

    name: str
    title: str
    text: tuple[str, ...] = ()
    numbers: tuple[Number, ...] = ()
    plots: tuple[Plot, ...] = ()
    scenes: tuple[Scene, ...] = ()

    @property
    def drawn(self) -> tuple[Plot | Scene, ...]:
        """Everything of which there is a picture."""
        return (*self.plots, *self.scenes)


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """A report.

    Parameters
    ----------
    title : str
        Its title.
    text : tuple of str
        Paragraphs that come first.
    settings : tuple of (str, str)
        What was run on what, as names and values.
    sections : tuple of Section
        Its parts.
    taxonomy : Taxonomy
        The classes of the street objects in the scenes.
    facts : mapping
        Specs, versions and machine as plain values for JSON.
    """

    title: str
    text: tuple[str, ...] = ()
    settings: tuple[tuple[str, str], ...] = ()
    sections: tuple[Section, ...]
    taxonomy: Taxonomy
    facts: Mapping[str, Any] = field(default_factory=dict)
