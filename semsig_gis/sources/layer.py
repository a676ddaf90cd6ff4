"""Layers as readers return them: rows, counts and notes."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Protocol

from semsig_gis.core.display import Displayed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from geopandas import GeoDataFrame

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.layer_spec import LayerSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class RowCounts:
    """How many rows a layer has, and how many of them are left out for each reason.

    Rows are `unreadable`, `filtered` (by the catalogue), `excluded` (by what the catalogue says in
    ``not``), `outside` (of the area that is fetched or clipped to), `missing` (without a
    geometry), `duplicates` (the id of an earlier row, where ids are unique), `misplaced` (off the
    Earth, far from all others, or not finite in the metric CRS), `collapsed` (at the place of
    another object of the class, or an area around it) or `conflated` (merged into an object of an
    earlier layer).
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
        """Number of the others."""
        dropped: int = sum(astuple(self)[1:])
        return self.read - dropped


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RawLayer(Displayed):
    """One layer as its reader found it.

    Parameters
    ----------
    spec : LayerSpec
        What the catalogue says of the layer.
    table : GeoDataFrame
        One row a feature: ``class_name``, ``source_id`` and ``geometry`` (of any type, empty, or
        None), in the CRS of the source; ``half_width`` (metres from the centre line, or NaN)
        where the catalogue says something about the widths of streets, and ``name``, empty where
        there is none, where it says which field holds the names of streets.
    counts : RowCounts
        Features in the source, and those that are not in the table; ``counts.kept == len(table)``.
    errors : tuple of str
        What was wrong with features that could not be read, the first ten of them.
    notes : tuple of str
        Where the source differs from what the catalogue expects of it.
    extent : Area, optional
        The box that the source says it covers, where it says so.

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
    """What a reader is: a function that reads layers from one file in one pass.

    Those of `MERGING` take several files, too, and those of `PRUNING` an `area`.
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
        """Return one layer for each of `specs`; `crs` is for a file that states none."""
