"""Layers as readers return them: rows, counts and notes."""

from __future__ import annotations

import functools
from dataclasses import astuple, dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
import pyarrow as pa
import shapely
from pyproj import CRS, Transformer

from semsig_gis.core import CLASS_NAME, SOURCE_ID, CrsError, Displayed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from geopandas import GeoDataFrame
    from numpy.typing import NDArray

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


@dataclass(frozen=True, eq=False, repr=False, init=False)
class RawLayer(Displayed):
    """One layer as a reader returns it.

    Parameters
    ----------
    spec : LayerSpec
        Description of the layer in the catalogue.
    counts : RowCounts
        Number of rows in the source and of rows left out; ``counts.kept`` rows are in the layer.
    columns : pyarrow.Table, optional
        One row per feature: ``class_name`` and ``source_id``. For streets also ``half_width``
        (metres from the centre line, or NaN) and ``name`` (empty if there is none), where the
        catalogue gives widths or the field of names. For objects also the texts, empty if there is
        none, ``group`` where the catalogue has its field, and for objects and buildings ``height``
        (metres, or NaN), if any row has one.
    geometry : array of shapely.Geometry, optional
        The geometry of every row, shape (n,): of any type, empty, or None.
    crs : pyproj.CRS, optional
        CRS of the source.
    table : GeoDataFrame, optional
        Columns, geometry and CRS together, instead of the three before it. A layer has this
        attribute in any case.
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
    >>> layer.counts.kept == len(layer) <= len(demo_objects)
    True
    """

    spec: LayerSpec
    counts: RowCounts
    columns: pa.Table
    geometry: NDArray[np.object_]
    crs: CRS | None
    errors: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    extent: Area | None = None

    def __init__(
        self,
        *,
        spec: LayerSpec,
        counts: RowCounts,
        columns: pa.Table | None = None,
        geometry: NDArray[np.object_] | None = None,
        crs: CRS | None = None,
        table: GeoDataFrame | None = None,
        errors: tuple[str, ...] = (),
        notes: tuple[str, ...] = (),
        extent: Area | None = None,
    ) -> None:
        if table is not None:
            plain = table.drop(columns=table.geometry.name)
            columns = pa.Table.from_pandas(plain, preserve_index=False).replace_schema_metadata()
            geometry, crs = table.geometry.to_numpy(), table.crs
            vars(self)["table"] = table
        vars(self).update(spec=spec, counts=counts, columns=columns, geometry=geometry, crs=crs,
                          errors=errors, notes=notes, extent=extent)  # fmt: skip

    def __len__(self) -> int:  # noqa: D105
        return len(self.geometry)

    @functools.cached_property
    def table(self) -> GeoDataFrame:
        """The columns and the geometry as a GeoDataFrame."""
        import geopandas as gpd  # noqa: PLC0415 - 0.7 s

        return gpd.GeoDataFrame(self.columns.to_pandas(), geometry=self.geometry, crs=self.crs)

    def select(self, rows: NDArray[np.bool_], **changes: Any) -> Self:  # noqa: ANN401
        """Return the layer with only some rows, and with other changes to its attributes."""
        columns = self.columns.filter(pa.array(rows))
        return replace(self, columns=columns, geometry=self.geometry[rows], **changes)

    @property
    def known_crs(self) -> CRS:
        """The CRS; CrsError if there is none."""
        if self.crs is None:
            raise CrsError(
                f"layer {self.spec.name!r} has no coordinate reference system; "
                "state its crs in the catalogue."
            )
        return self.crs

    def _facts(self) -> dict[str, object]:
        return {
            "layer": self.spec.name,
            "holds": self.spec.class_name or self.spec.role,
            "rows read": self.counts.read,
            "kept": self.counts.kept,
            "unreadable": self.counts.unreadable,
            "notes": len(self.notes),
        }


def derived_layer(spec: LayerSpec) -> RawLayer:
    """Return a layer without rows, for objects that `assemble` computes."""
    texts = pa.array([], pa.string())
    return RawLayer(
        spec=spec,
        counts=RowCounts(read=0),
        columns=pa.table({CLASS_NAME: texts, SOURCE_ID: texts}),
        geometry=np.empty(0, object),
        crs=CRS.from_epsg(4326),
    )


def transformed(geometry: NDArray[np.object_], old: CRS, new: CRS) -> NDArray[np.object_]:
    """Return geometries in another CRS, without a third dimension."""
    if old.is_exact_same(new):
        return geometry
    return np.asarray(shapely.transform(geometry, lambda xy: transform_points(xy, old, new)))


def transform_points(xy: NDArray[np.float64], old: CRS, new: CRS) -> NDArray[np.float64]:
    """Return coordinates in another CRS, shape (n, 2); longitude comes before latitude."""
    return np.column_stack(_transformer(old, new).transform(xy[:, 0], xy[:, 1]))


@functools.lru_cache(maxsize=16)  # 20 ms each
def _transformer(old: CRS, new: CRS) -> Transformer:
    return Transformer.from_crs(old, new, always_xy=True)


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
