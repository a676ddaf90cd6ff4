"""Layers as readers return them: rows, counts and notes."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Protocol

from semsig_gis.core import Displayed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from geopandas import GeoDataFrame

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.layer_spec import LayerSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class RowCounts:
    """Number of rows of a layer, and of rows left out for each reason.

    Rows are `unreadable`, `filtered` (by the catalogue), `excluded` (by ``not`` of the catalogue),
    `outside` (of the area that is fetched or clipped to), `missing` (without a geometry),
    `duplicates` (with the id of an earlier row, where ids are unique), `misplaced` (off the Earth,
    far from all others, or not finite in the metric CRS), `collapsed` (at the place of another
    object of the class, or an area around it) or `conflated` (merged into an object of an earlier
    layer).
    """

    read: int
    unreadable: int = 0
    filtered: int = 0
    excluded: int = 0
    outside: int = 0
    missing: int = 0
    duplicates: int = 0
    misplaced: int = 0
    collapsed: int = 0
    conflated: int = 0

    @property
    def kept(self) -> int:
        """Number of rows that are not left out."""
        dropped: int = sum(astuple(self)[1:])
        return self.read - dropped


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RawLayer(Displayed):
    """One layer as a reader returns it.

    Parameters
    ----------
    spec : LayerSpec
        Description of the layer in the catalogue.
    table : GeoDataFrame
        One row per feature: ``class_name``, ``source_id`` and ``geometry`` (of any type, empty, or
        None), in the CRS of the source. For streets also ``half_width`` (metres from the centre
        line, or NaN) and ``name`` (empty if there is none), where the catalogue gives widths or
        the field of names.
    counts : RowCounts
        Number of rows in the source and of rows left out; ``counts.kept == len(table)``.
    errors : tuple of str
        Errors of the first ten rows that could not be read.
    notes : tuple of str
        Differences between the source and the expectations of the catalogue.
    extent : Area, optional
        Bounding box that the source states.

    Examples
    --------
    >>> from semsig_gis import CitySpec, synthetic_city
    >>> layer = synthetic_city(CitySpec(size=300.0))[0]
    >>> layer.counts.kept == len(layer.table) <= len(demo_objects)
    True
    """

    spec: LayerSpec
    table: GeoDataFrame
    counts: RowCounts
    errors: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    extent: Area | None = None

    def _facts(self) -> dict[str, object]:
        return {
            "layer": self.spec.name,
            "holds": self.spec.class_name or self.spec.role,
            "rows read": self.counts.read,
            "kept": self.counts.kept,
            "unreadable": self.counts.unreadable,
            "notes": len(self.notes),
        }


class Reader(Protocol):
    """A function that reads layers from one file in one pass.

    A merging reader also takes several files, a pruning reader an `area` (see `Source`).
    """

    def __call__(
        self,
        path: Path | Sequence[Path],
        specs: Sequence[LayerSpec],
        *,
        filters: bool = True,
        crs: str | None = None,
        **within: Area | None,
    ) -> tuple[RawLayer, ...]:
        """Return one layer for each of `specs`; `crs` applies to a file that states none."""
