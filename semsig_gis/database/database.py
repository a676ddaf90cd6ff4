"""The signature database: the signatures of all cells as flat arrays.

Many cells of a city have the same signature. Every metric therefore measures each distinct
sequence once, and `SequenceTable.inverse` assigns the results to the cells.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import lazy_loader
import numpy as np
import pyarrow as pa
from pyproj import CRS

from semsig_gis import __version__
from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    LICENSES,
    DatabaseError,
    Displayed,
    DistanceScale,
    InputError,
    Signature,
    UnknownNameError,
    bounds_text,
    cell_ids,
    consecutive,
    crs_label,
    map_with,
    nearest_name,
    plot_with,
    quantize,
)
from semsig_gis.database.sequences import SequenceTable, read_only
from semsig_gis.database.sightings import VisibleObjects
from semsig_gis.database.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import geopandas as gpd
    import shapely
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Axes, GridSpec, MapFrame, SignatureSpec, Taxonomy
else:
    gpd = lazy_loader.load("geopandas")
    shapely = lazy_loader.load("shapely")

CellGeometry = Literal["polygon", "point"]

CODES_PER_BLOCK = 1 << 16  # counting makes a number of eight bytes of each of them
CELLS_PER_TABLE = 1 << 16  # small enough for Arrow's 32-bit list offsets
LONGEST_SETTING = 80  # letters
MOST_NAMES = 3  # of classes in a message

# Attributes that are equal in databases built in the same way, and their names in messages.
SETTINGS = {
    "crs": "coordinate reference system",
    "grid": "grid",
    "spec": "range or angle levels",
    "viewpoints": "viewpoints",
    "occlusion": "occlusion",
    "taxonomy": "classes",
    "reach": "longest visibility range",
}
CELL_ARRAYS = ("columns", "rows")
ENTRY_ARRAYS = ("codes", "bearing_units", "distance_units", "extent_units")
EXTENT_UNITS = 255  # of a full turn


@dataclass(frozen=True, eq=False, repr=False)
class SignatureDatabase(Displayed):
    """Signatures of all cells of a city from which at least one object is visible.

    The entries of cell ``i`` are ``offsets[i]:offsets[i + 1]`` of the flat arrays, clockwise from
    north.

    Parameters
    ----------
    columns, rows : ndarray of int32, shape (n,)
        Cells, ordered by column and row.
    offsets : ndarray of int64, shape (n + 1,)
        First entry of each cell.
    codes : ndarray of uint8, shape (m,)
        Class code of each visible object.
    bearing_units : ndarray of uint16, shape (m,)
        Bearing in 1/20 degree, rounded down.
    distance_units : ndarray of uint8, shape (m,)
        Distance in units of `scale`, rounded.
    grid : GridSpec
        The grid of the cells.
    spec : SignatureSpec
        Visibility range and angle levels.
    taxonomy : Taxonomy
        Classes of the codes.
    crs : pyproj.CRS
        Metric coordinate reference system.
    licenses : tuple of str
        Attribution and licence of each source.
    version : str
        Version of the package that built it.
    viewpoints : ViewpointSpec
        Which cells are viewpoints.
    occlusion : float or None
        Tolerance in metres with which buildings hide objects (see `database.occlusion`); None
        if it was built without buildings.
    notes : tuple of str
        Warnings about the data that it was built from.
    extent_units : ndarray of uint8, shape (m,), or None
        Angular width of the visible part of each extended thing, 0 for points, in 1/255 of a turn;
        None if nothing is extended.

    Examples
    --------
    >>> len(demo_database.types(0)) == int(demo_database.lengths[0])
    True
    """

    columns: NDArray[np.int32]
    rows: NDArray[np.int32]
    offsets: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearing_units: NDArray[np.uint16]
    distance_units: NDArray[np.uint8]
    grid: GridSpec
    spec: SignatureSpec
    taxonomy: Taxonomy
    crs: CRS
    licenses: tuple[str, ...] = ()
    version: str = __version__
    viewpoints: ViewpointSpec = ViewpointSpec()  # noqa: RUF009 - it is immutable
    occlusion: float | None = None
    notes: tuple[str, ...] = ()
    extent_units: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:  # noqa: D105
        for array in (self.offsets, self.columns, self.rows):
            array.setflags(write=False)
        for array in self.entry_arrays.values():
            array.setflags(write=False)

    @property
    def entry_arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays of one value an entry, by the name of the attribute."""
        arrays = {name: getattr(self, name) for name in ENTRY_ARRAYS}
        return {name: values for name, values in arrays.items() if values is not None}

    def __len__(self) -> int:  # noqa: D105
        return len(self.columns)

    def _facts(self) -> dict[str, object]:
        return {
            "cells": len(self),
            "objects seen": f"{len(self.codes) / max(len(self), 1):.1f} a cell",
            "classes": len(self.present_codes),
            "range": f"{self.spec.radius:g} m",
            "step": f"{self.grid.step:g} m",
            "CRS": crs_label(self.crs),
            "bounds": bounds_text(self.xy),
        }

    @cached_property
    def cell_ids(self) -> NDArray[np.int64]:
        """Number of every cell, ``column * 10**8 + row``, shape (n,)."""
        return read_only(cell_ids(self.columns, self.rows))

    @cached_property
    def xy(self) -> NDArray[np.float64]:
        """Viewpoint of every cell in metres, shape (n, 2)."""
        return read_only(self.grid.viewpoints(self.columns, self.rows))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the viewpoints in metres: west, south, east, north; ValueError without cells."""
        # By column, because numpy takes thirty times longer for both at once.
        x, y = self.xy.T
        return np.array([x.min(), y.min(), x.max(), y.max()])

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Number of visible objects of every cell, shape (n,)."""
        return read_only(np.diff(self.offsets))

    @property
    def bearings(self) -> NDArray[np.float64]:
        """Bearing of every entry in degrees, to 1/20 degree, shape (m,)."""
        return self.bearing_units * np.float64(360.0 / BEARING_UNITS)

    @cached_property
    def reach(self) -> float:
        """The largest visibility range of any class, in metres."""
        return self.scale.reach

    @cached_property
    def near_reach(self) -> float:
        """The largest visibility range of the classes that are not tall, in metres."""
        return self.taxonomy.near_reach(self.spec.radius)

    @cached_property
    def scale(self) -> DistanceScale:
        """The metres of the distance units; logarithmic if a class is tall."""
        return DistanceScale.of(self.taxonomy, self.spec.radius)

    @property
    def distances(self) -> NDArray[np.float64]:
        """Distance of every entry in metres, rounded to a unit of `scale`, shape (m,)."""
        return self.scale.metres[self.distance_units]

    @property
    def extents(self) -> NDArray[np.float64] | None:
        """Angular width of every entry in degrees, shape (m,); None if nothing is extended."""
        if self.extent_units is None:
            return None
        return self.extent_units * np.float64(FULL_TURN / EXTENT_UNITS)

    @cached_property
    def is_extended(self) -> bool:
        """Whether a cell sees something that is wider than a point."""
        return self.extent_units is not None and bool(self.extent_units.any())

    @cached_property
    def levels(self) -> NDArray[np.uint8]:
        """Angle level of every entry, shape (m,)."""
        if BEARING_UNITS % self.spec.levels == 0:
            levels = self.bearing_units // (BEARING_UNITS // self.spec.levels)
            return read_only(levels.astype(np.uint8))
        return read_only(quantize(self.bearings, self.spec.levels))

    @cached_property
    def occurrences(self) -> NDArray[np.int64]:
        """Number of entries of each class code in all signatures, shape (256,)."""
        starts = range(0, len(self.codes), CODES_PER_BLOCK)
        blocks = (self.codes[start : start + CODES_PER_BLOCK] for start in starts)
        counts = (np.bincount(block, minlength=256) for block in blocks)
        return read_only(np.asarray(sum(counts, np.zeros(256, np.int64))))

    @cached_property
    def present_codes(self) -> NDArray[np.uint8]:
        """Class codes that occur, ascending."""
        return read_only(np.flatnonzero(self.occurrences).astype(np.uint8))

    @cached_property
    def type_sequences(self) -> SequenceTable:
        """The distinct type sequences, and the number of that of every cell."""
        return SequenceTable.from_csr(self.codes, self.offsets)

    @cached_property
    def angle_sequences(self) -> SequenceTable:
        """The distinct angle-level sequences, and the number of that of every cell."""
        return SequenceTable.from_csr(self.levels, self.offsets)

    @cached_property
    def type_group_sizes(self) -> NDArray[np.int64]:
        """Number of cells with the type sequence of each cell, shape (n,)."""
        return read_only(self.type_sequences.counts[self.type_sequences.inverse])

    @cached_property
    def angle_group_sizes(self) -> NDArray[np.int64]:
        """Number of cells with the angle-level sequence of each cell, shape (n,)."""
        return read_only(self.angle_sequences.counts[self.angle_sequences.inverse])

    @cached_property
    def memo(self) -> list[Any]:
        """What other packages computed from the database and keep with it, such as an index."""
        return []

    def xy_of(self, cells: int | NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the viewpoint of a cell, by row, or of some, in metres, shape (..., 2)."""
        return self.grid.viewpoints(self.columns[cells], self.rows[cells])

    def cells_at(self, xy: ArrayLike) -> NDArray[np.int64]:
        """Return the rows of the cells that contain places, -1 for places in no cell, shape (p,).

        Places, shape (p, 2), are in metres.
        """
        ids = cell_ids(*self.grid.cells_at(xy))
        rows = np.minimum(np.searchsorted(self.cell_ids, ids), len(self) - 1)
        return np.where(self.cell_ids[rows] == ids, rows, -1)

    def signature(self, cell: int) -> Signature:
        """Return the signature of a cell, by its row: class codes and bearings."""
        part = slice(self.offsets[cell], self.offsets[cell + 1])
        bearings = self.bearing_units[part] * np.float64(360.0 / BEARING_UNITS)
        return Signature(self.codes[part], bearings)

    def select(self, cells: slice | NDArray[np.int64] | NDArray[np.bool_]) -> SignatureDatabase:
        """Return a database of some cells: a slice or mask of the rows, or rows in their order."""
        by_row = isinstance(cells, np.ndarray) and cells.dtype.kind == "i"
        rows = np.asarray(cells) if by_row else np.arange(len(self))[cells]
        lengths = self.offsets[rows + 1] - self.offsets[rows]
        entries = consecutive(self.offsets[rows], lengths)
        arrays: dict[str, Any] = {
            **{name: getattr(self, name)[rows] for name in CELL_ARRAYS},
            **{name: values[entries] for name, values in self.entry_arrays.items()},
        }
        return replace(self, offsets=np.append(0, np.cumsum(lengths)), **arrays)

    def types(self, cell: int) -> str:
        """Return the type sequence of a cell, by its row: one symbol per object."""
        return self.taxonomy.decode(self.codes[self.offsets[cell] : self.offsets[cell + 1]])

    def to_geodataframe(self, *, geometry: CellGeometry = "polygon") -> gpd.GeoDataFrame:
        """Return the cells as a table in the CRS of the database, squares or points.

        The columns are as in `export_database`: ``cell_id``, ``x`` and ``y``
        (viewpoint), ``length`` (objects), ``types`` (symbols), ``bearings``, ``levels`` and
        ``distances`` (text, one number per object), and ``type_group_size`` and
        ``angle_group_size`` (number of cells with the same sequence). If something is extended,
        ``extents`` has the widths in degrees.
        """
        return CellTable(self, geometry=geometry).frame()

    def plot(
        self,
        column: str | ArrayLike | None = None,
        *,
        ax: Axes | None = None,
        **look: Any,  # noqa: ANN401 - options of matplotlib
    ) -> Axes:
        """Draw the number of visible objects of every cell, or another (see `plot_database`)."""
        return plot_with("plot_database", self, column, ax=ax, **look)

    def explore(self) -> MapFrame:
        """Show the cells on a map in a notebook, by the number of cells with equal signatures."""
        return map_with("ambiguity_map", self)


def join_databases(parts: Sequence[SignatureDatabase]) -> SignatureDatabase:
    """Join databases of different cells, built in the same way; DatabaseError otherwise.

    The cells are ordered by column and row. Licences and notes of several parts appear once.
    """
    if not parts:
        raise DatabaseError("there is no database to join; give at least one.")
    first = parts[0]
    for part in parts[1:]:
        require_same(first, part)
    ids = np.concatenate([part.cell_ids for part in parts])
    order = np.argsort(ids, kind="stable")
    if (np.diff(ids[order]) == 0).any():
        raise DatabaseError(
            "two of the databases contain the same cell; join databases of different cells."
        )
    lengths = np.concatenate([part.lengths for part in parts])
    offsets = np.append(0, np.cumsum(lengths[order]))
    starts = np.empty(len(ids), np.int64)
    starts[order] = offsets[:-1]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])[order] for name in CELL_ARRAYS
    }
    # The objects of one part after the other go to their places: all at once would take several
    # times the memory of the result.
    names = dict.fromkeys(name for part in parts for name in part.entry_arrays)
    arrays |= {name: np.empty(offsets[-1], entry_values(first, name).dtype) for name in names}
    cells = 0
    for part in parts:
        places = consecutive(starts[cells : cells + len(part)], part.lengths)
        for name in names:
            arrays[name][places] = entry_values(part, name)
        cells += len(part)
    return replace(
        first,
        offsets=offsets,
        licenses=tuple(dict.fromkeys(line for part in parts for line in part.licenses)),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        **arrays,
    )


def entry_values(database: SignatureDatabase, name: str) -> NDArray[Any]:
    """Return an array of `ENTRY_ARRAYS`; zeros for extents if nothing is extended."""
    values: NDArray[Any] | None = getattr(database, name)
    return np.zeros(len(database.codes), np.uint8) if values is None else values


def require_same(
    first: SignatureDatabase, other: SignatureDatabase, *, classes: bool = True
) -> None:
    """Raise DatabaseError if two databases were built with different settings.

    Their classes may differ if `classes` is False.
    """
    for name, title in SETTINGS.items():
        ours, theirs = getattr(first, name), getattr(other, name)
        if ours != theirs and (classes or name != "taxonomy"):
            both = f"{_brief(ours)} and {_brief(theirs)}"
            raise DatabaseError(
                f"the databases differ in their {title} "
                f"({_other_classes(ours, theirs) if name == 'taxonomy' else both}); "
                "build both in the same way."
            )


def require_same_place(database: SignatureDatabase, xy: NDArray[np.float64], what: str) -> None:
    """Raise InputError if all places, in the CRS of the database, are far from its cells.

    Far means outside the box of the cells, widened by the longest visibility range. An empty array
    of places is accepted. `what` is the name of the places in the message.
    """
    low, high = database.bounds[:2] - database.reach, database.bounds[2:] + database.reach
    if len(xy) and not ((low <= xy) & (xy <= high)).all(axis=1).any():
        raise InputError(
            f"none of the {len(xy):,} {what} is where the cells are; give data of the same city."
        )


def rows_of_result(
    database: SignatureDatabase, ids: ArrayLike, types: Iterable[str], *, what: str
) -> NDArray[np.int64]:
    """Return the rows of the cells of a result; InputError if it is from another database.

    Such a result has other cell ids, or other types for a cell. `what` is the kind of result in the
    message.
    """
    cells = np.asarray(ids, np.int64)
    rows = np.searchsorted(database.cell_ids, cells)
    same = (
        rows.max(initial=-1) < len(database)
        and np.array_equal(database.cell_ids[rows], cells)
        and all(map(operator.eq, types, map(database.types, rows.tolist())))
    )
    if not same:
        raise InputError(
            f"This {what} was not made with this database; give the database that it was made "
            f"with, or make the {what} again."
        )
    return rows


def _other_classes(first: Taxonomy, other: Taxonomy) -> str:
    """Return how two taxonomies differ, in words."""
    kinds = [{item.name: item for item in part.classes} for part in (first, other)]
    text = " and ".join(f"{len(part):,}" for part in kinds)
    for mine, others, title in ((*kinds, "first"), (*kinds[::-1], "other")):
        if only := [name for name in mine if name not in others]:
            text += f"; only the {title} has {_few(only)}"
    altered = [name for name, item in kinds[0].items() if kinds[1].get(name, item) != item]
    return f"{text}; not the same in both: {_few(altered)}" if altered else text


def _few(names: Sequence[str]) -> str:
    more = len(names) - MOST_NAMES
    listed = ", ".join(names[:MOST_NAMES])
    return f"{listed} and {more:,} more" if more > 0 else listed


def _brief(value: object) -> str:
    text = value.to_string() if isinstance(value, CRS) else str(value)
    return text if len(text) <= LONGEST_SETTING else f"{text[: LONGEST_SETTING - 3]}..."


def visible_objects_in(database: SignatureDatabase, cells: NDArray[np.int64]) -> VisibleObjects:
    """Return the visible objects of some cells, by row; a cell may be repeated.

    Bearings are in the middle of their units. The rows of the objects are unknown.
    """
    part = database.select(cells)
    return VisibleObjects(
        offsets=part.offsets,
        objects=np.full(len(part.codes), -1),
        codes=part.codes,
        bearings=part.bearings + 180.0 / BEARING_UNITS,
        distances=part.distances,
        extents=part.extents,
    )


class CellTable:
    """The cells of a database as a table for people, made block by block."""

    def __init__(self, database: SignatureDatabase, *, geometry: CellGeometry = "polygon") -> None:
        if geometry not in get_args(CellGeometry):
            names = " or ".join(repr(name) for name in get_args(CellGeometry))
            hint = nearest_name(str(geometry), get_args(CellGeometry))
            raise UnknownNameError(f"{geometry!r} is not a way to draw a cell; give {names}{hint}.")
        self._database, self._geometry = database, geometry
        self._symbols = pa.array([chr(symbol) for symbol in database.taxonomy.symbol_points])
        degrees = (unit * 360 / BEARING_UNITS for unit in range(BEARING_UNITS))
        self._degrees = pa.array([f"{bearing:.2f}" for bearing in degrees])
        self._levels = pa.array([str(level) for level in range(1 << 8)])
        distances = database.scale.metres
        decimals = max(2, math.ceil(-math.log10(distances[1])))  # so that they differ
        self._metres = pa.array([f"{distance:.{decimals}f}" for distance in distances.tolist()])
        extents = np.arange(EXTENT_UNITS + 1) * (FULL_TURN / EXTENT_UNITS)
        self._extents = pa.array([f"{extent:.1f}" for extent in extents.tolist()])
        self._groups = {
            "type_group_size": database.type_group_sizes,
            "angle_group_size": database.angle_group_sizes,
        }

    def columns(self, rows: slice) -> dict[str, Any]:
        """Return the columns of some rows by name, as NumPy or Arrow arrays."""
        database = self._database
        places = database.xy[rows]
        offsets = database.offsets[rows.start : rows.stop + 1]
        extents = {}
        if database.is_extended:
            widths = entry_values(database, "extent_units")
            extents = {"extents": _joined(widths, offsets, texts=self._extents)}
        return {
            "cell_id": database.cell_ids[rows],
            "x": np.ascontiguousarray(places[:, 0]),
            "y": np.ascontiguousarray(places[:, 1]),
            "length": database.lengths[rows].astype(np.int32),
            "types": _joined(database.codes, offsets, texts=self._symbols, separator=""),
            "bearings": _joined(database.bearing_units, offsets, texts=self._degrees),
            "levels": _joined(database.levels, offsets, texts=self._levels),
            "distances": _joined(database.distance_units, offsets, texts=self._metres),
            **extents,
            **{name: sizes[rows] for name, sizes in self._groups.items()},
        }

    def shapes(self, rows: slice) -> NDArray[np.object_]:
        """Return the viewpoints or the squares of some rows; neighbours have identical corners."""
        database = self._database
        if self._geometry == "point":
            return np.asarray(shapely.points(database.xy[rows]))
        step, (west, south) = database.grid.step, database.grid.origin
        columns, lines = database.columns[rows], database.rows[rows]
        left, right = west + columns * step, west + (columns + 1) * step
        bottom, top = south + lines * step, south + (lines + 1) * step
        return np.asarray(shapely.box(left, bottom, right, top))

    def frame(self) -> gpd.GeoDataFrame:
        """Return all cells as a GeoDataFrame, with the licences in ``attrs``."""
        database, size = self._database, len(self._database)
        starts = range(0, max(size, 1), CELLS_PER_TABLE)
        blocks = [slice(start, min(start + CELLS_PER_TABLE, size)) for start in starts]
        table = pa.concat_tables([pa.table(self.columns(rows)) for rows in blocks])
        shapes = np.concatenate([self.shapes(rows) for rows in blocks])
        frame = gpd.GeoDataFrame(table.to_pandas(), geometry=shapes, crs=database.crs)
        frame.attrs[LICENSES] = list(database.licenses)
        return frame


def _joined(
    values: NDArray[Any], offsets: NDArray[np.int64], *, texts: pa.Array, separator: str = " "
) -> pa.Array:
    """Return the values of each cell as one text; `texts` has the text of every possible value."""
    entries = pa.array(values[offsets[0] : offsets[-1]])
    starts = pa.array((offsets - offsets[0]).astype(np.int32))
    lists = pa.ListArray.from_arrays(starts, texts.take(entries))
    from pyarrow.compute import binary_join  # noqa: PLC0415 - slow, and rarely needed

    return binary_join(lists, separator)
