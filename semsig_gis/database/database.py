"""The signature database: the signature of every cell as flat arrays.

Many cells of a city share their signature. Every measure therefore looks at each distinct
sequence once, and `SequenceTable.inverse` spreads the results over the cells.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa
from pyproj import CRS

from semsig_gis import __version__
from semsig_gis.core.display import Displayed, bounds_text
from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.core.geometry import cell_ids, consecutive, crs_label
from semsig_gis.core.presentation import map_with, plot_with
from semsig_gis.core.signature import BEARING_UNITS, DISTANCE_UNITS, Signature, quantize
from semsig_gis.database.sightings import ViewpointSpec, Views
from semsig_gis.storage.geoparquet import whole_numbers

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import geopandas as gpd
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core.display import Axes, MapFrame
    from semsig_gis.core.geometry import GridSpec
    from semsig_gis.core.signature import SignatureSpec
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.table import CellGeometry

    _Array = TypeVar("_Array", bound="NDArray[Any]")

WORD_BITS = 64
HISTOGRAM_BLOCK = 1 << 22  # counters in one step of the histogram: 32 MB of temporaries
CODES_A_BLOCK = 1 << 16  # as counting makes each of them a number of eight bytes
LONGEST_VALUE = 80

# What two databases that were made in the same way have in common, and what it is called.
MADE = {
    "crs": "coordinate reference system",
    "grid": "grid",
    "spec": "range or angle levels",
    "viewpoints": "viewpoints",
    "occlusion": "occlusion",
    "taxonomy": "classes",
    "reach": "longest visibility range",
}
CELL_ARRAYS = ("columns", "rows")
ENTRY_ARRAYS = ("codes", "bearing_units", "distance_units")


@dataclass(frozen=True, eq=False, repr=False)
class SignatureDatabase(Displayed):
    """The signatures of all cells of a city that see at least one object.

    Cell i owns the entries ``offsets[i]:offsets[i + 1]`` of the flat arrays, clockwise from north.

    Parameters
    ----------
    columns, rows : ndarray of int32, shape (n,)
        Cells, ordered by column and row.
    offsets : ndarray of int64, shape (n + 1,)
        Where each cell's entries begin.
    codes : ndarray of uint8, shape (m,)
        Class code of each object seen.
    bearing_units : ndarray of uint16, shape (m,)
        Bearing in 1/20 degree, rounded down.
    distance_units : ndarray of uint8, shape (m,)
        Distance in 1/255 of `reach`, rounded.
    grid : GridSpec
        The cells.
    spec : SignatureSpec
        How the signatures were made.
    taxonomy : Taxonomy
        Classes of the codes.
    crs : pyproj.CRS
        Metric coordinate reference system.
    licenses : tuple of str
        Attribution and licence of each source.
    version : str
        Version of the package that built it.
    viewpoints : ViewpointSpec
        Which cells were looked from.
    occlusion : float or None
        Tolerance in metres with which buildings hide objects (see `database.occlusion`); None
        where no building did.
    notes : tuple of str
        Warnings about what it was built from.

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
    viewpoints: ViewpointSpec = ViewpointSpec()  # noqa: RUF009 - it is frozen
    occlusion: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:  # noqa: D105
        for name in ("offsets", *CELL_ARRAYS, *ENTRY_ARRAYS):
            getattr(self, name).setflags(write=False)

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
        return frozen(cell_ids(self.columns, self.rows))

    @cached_property
    def xy(self) -> NDArray[np.float64]:
        """Viewpoint of every cell in metres, shape (n, 2)."""
        return frozen(self.grid.viewpoints(self.columns, self.rows))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the viewpoints in metres: west, south, east and north; not of no cells."""
        return np.concatenate([self.xy.min(axis=0), self.xy.max(axis=0)])

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Number of objects that every cell sees, shape (n,)."""
        return frozen(np.diff(self.offsets))

    @property
    def bearings(self) -> NDArray[np.float64]:
        """Bearing of every entry in degrees, to 1/20 degree, shape (m,)."""
        return self.bearing_units * np.float64(360.0 / BEARING_UNITS)

    @cached_property
    def reach(self) -> float:
        """The largest visibility range of any class, in metres."""
        ranges = (item.range_m or 0.0 for item in self.taxonomy.classes)
        return float(max([self.spec.radius, *ranges]))

    @property
    def distances(self) -> NDArray[np.float64]:
        """Distance of every entry in metres, to 1/255 of `reach`, shape (m,)."""
        return self.distance_units * np.float64(self.reach / DISTANCE_UNITS)

    @cached_property
    def levels(self) -> NDArray[np.uint8]:
        """Angle level of every entry, shape (m,)."""
        if BEARING_UNITS % self.spec.levels == 0:
            levels = self.bearing_units // (BEARING_UNITS // self.spec.levels)
            return frozen(levels.astype(np.uint8))
        return frozen(quantize(self.bearings, self.spec.levels))

    @cached_property
    def occurrences(self) -> NDArray[np.int64]:
        """How often each class code occurs over all signatures, shape (256,)."""
        starts = range(0, len(self.codes), CODES_A_BLOCK)
        blocks = (self.codes[start : start + CODES_A_BLOCK] for start in starts)
        counts = (np.bincount(block, minlength=256) for block in blocks)
        return frozen(np.asarray(sum(counts, np.zeros(256, np.int64))))

    @cached_property
    def present_codes(self) -> NDArray[np.uint8]:
        """Class codes that occur, ascending."""
        return frozen(np.flatnonzero(self.occurrences).astype(np.uint8))

    @cached_property
    def type_sequences(self) -> SequenceTable:
        """The distinct type sequences, and which of them every cell has."""
        return SequenceTable.from_csr(self.codes, self.offsets)

    @cached_property
    def angle_sequences(self) -> SequenceTable:
        """The distinct angle-level sequences, and which of them every cell has."""
        return SequenceTable.from_csr(self.levels, self.offsets)

    @cached_property
    def type_group_sizes(self) -> NDArray[np.int64]:
        """For every cell, how many cells have its type sequence, shape (n,)."""
        return frozen(self.type_sequences.counts[self.type_sequences.inverse])

    @cached_property
    def angle_group_sizes(self) -> NDArray[np.int64]:
        """For every cell, how many cells have its angle-level sequence, shape (n,)."""
        return frozen(self.angle_sequences.counts[self.angle_sequences.inverse])

    def cells_at(self, xy: ArrayLike) -> NDArray[np.int64]:
        """Return the rows of the cells in which places lie, -1 where there is none, shape (p,).

        Places, shape (p, 2), are in metres.
        """
        ids = cell_ids(*self.grid.cells_at(xy))
        rows = np.minimum(np.searchsorted(self.cell_ids, ids), len(self) - 1)
        return np.where(self.cell_ids[rows] == ids, rows, -1)

    def signature(self, cell: int) -> Signature:
        """Return the signature of the cell in a row: its class codes and bearings."""
        part = slice(self.offsets[cell], self.offsets[cell + 1])
        bearings = self.bearing_units[part] * np.float64(360.0 / BEARING_UNITS)
        return Signature(self.codes[part], bearings)

    def select(self, cells: slice | NDArray[np.int64] | NDArray[np.bool_]) -> SignatureDatabase:
        """Return a database of some of the cells, by rows in their order or by True for each."""
        rows = isinstance(cells, np.ndarray) and cells.dtype.kind == "i"
        kept = cells if rows else np.arange(len(self))[cells]
        lengths = self.lengths[kept]
        entries = consecutive(self.offsets[kept], lengths)
        return replace(
            self,
            offsets=np.append(0, np.cumsum(lengths)),
            **{name: getattr(self, name)[kept] for name in CELL_ARRAYS},
            **{name: getattr(self, name)[entries] for name in ENTRY_ARRAYS},
        )

    def types(self, cell: int) -> str:
        """Return the type sequence of the cell in a row, one symbol an object."""
        return self.taxonomy.decode(self.codes[self.offsets[cell] : self.offsets[cell + 1]])

    def to_geodataframe(self, *, geometry: CellGeometry = "polygon") -> gpd.GeoDataFrame:
        """Return the cells as a table in the CRS of the database, squares or points.

        ``cell_id``, ``x`` and ``y`` (viewpoint), ``length`` (objects), ``types`` (symbols),
        ``bearings``, ``levels`` and ``distances`` (as text, a number an object), and
        ``type_group_size`` and ``angle_group_size`` (cells that look the same), as
        `export_database` writes them.
        """
        from semsig_gis.database.table import CellTable  # noqa: PLC0415 - it loads slowly

        return CellTable(self, geometry=geometry).frame()

    def plot(
        self,
        column: str | ArrayLike | None = None,
        *,
        ax: Axes | None = None,
        **look: Any,  # noqa: ANN401 - whatever matplotlib takes
    ) -> Axes:
        """Draw the objects that every cell sees, or another number (see `plot_database`)."""
        return plot_with("plot_database", self, column, ax=ax, **look)

    def explore(self) -> MapFrame:
        """Show the cells on a map in a notebook, by how many look the same."""
        return map_with("ambiguity_map", self)


def join_databases(parts: Sequence[SignatureDatabase]) -> SignatureDatabase:
    """Join databases of different cells that were made in the same way; DatabaseError otherwise.

    The cells are ordered by column and row, and licences and notes that stand in several parts
    appear once.
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
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("lengths", *CELL_ARRAYS, *ENTRY_ARRAYS)
    }
    joined = replace(
        first,
        offsets=np.append(0, np.cumsum(arrays.pop("lengths"))),
        licenses=tuple(dict.fromkeys(line for part in parts for line in part.licenses)),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        **arrays,
    )
    return joined if (np.diff(order) == 1).all() else joined.select(order)


def require_same(
    first: SignatureDatabase, other: SignatureDatabase, *, classes: bool = True
) -> None:
    """Raise DatabaseError where two databases were not made in the same way.

    Without `classes`, these may differ.
    """
    for name, title in MADE.items():
        ours, theirs = getattr(first, name), getattr(other, name)
        if ours != theirs and (classes or name != "taxonomy"):
            raise DatabaseError(
                f"the databases differ in their {title} ({_brief(ours)} and {_brief(theirs)}); "
                "build both in the same way."
            )


def require_same_place(database: SignatureDatabase, xy: NDArray[np.float64], what: str) -> None:
    """Raise InputError if all places, in the CRS of the database, lie elsewhere than the cells.

    Elsewhere is outside of the box of the cells widened by the longest visibility range; an empty
    array of places is accepted. `what` names the places in the message.
    """
    low = database.xy.min(axis=0) - database.reach
    high = database.xy.max(axis=0) + database.reach
    if len(xy) and not ((low <= xy) & (xy <= high)).all(axis=1).any():
        raise InputError(
            f"none of the {len(xy):,} {what} is where the cells are; give those of the same city."
        )


def rows_of_result(
    database: SignatureDatabase, ids: ArrayLike, types: Iterable[str], *, what: str
) -> NDArray[np.int64]:
    """Return the rows of the cells that a result names, and refuse one of another database.

    It has other cell ids or types seen from a cell. `what` names the kind of result.
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


def _brief(value: object) -> str:
    text = value.to_string() if isinstance(value, CRS) else str(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."


@dataclass(frozen=True, eq=False)
class SequenceTable:
    """The distinct sequences of a list of n sequences, short ones first; made by `from_csr`.

    Sequences of one length stand in order of first appearance. Of the d distinct sequences, number
    ``i`` is ``values[offsets[i]:offsets[i + 1]]``, which may be empty. `inverse`, shape (n,), tells
    which one each row of the list holds; `counts`, shape (d,), how many rows hold each one (the
    sizes of the signature groups). All arrays are read-only.
    """

    values: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    inverse: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def from_csr(cls, values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> SequenceTable:
        """Find the distinct sequences of a list given as flat values and offsets.

        Row ``i`` is ``values[offsets[i]:offsets[i + 1]]``; the arrays are copied. Raise InputError
        if the values are not bytes, or the offsets do not divide them.
        """
        flat = np.ascontiguousarray(checked_sequence(values))
        ends = np.ascontiguousarray(offsets, dtype=np.int64)
        whole = ends.ndim == 1 and len(ends) > 0 and ends[0] == 0 and ends[-1] == len(flat)
        # Arrow trusts the offsets: decreasing ones would read outside the values.
        if not whole or bool((np.diff(ends) < 0).any()):
            raise InputError(
                f"the offsets of the sequences do not divide their {len(flat)} values; give one "
                "offset more than there are sequences, from 0 up to the number of values, none "
                "smaller than the one before."
            )
        rows = pa.LargeBinaryArray.from_buffers(
            pa.large_binary(), len(ends) - 1, [None, pa.py_buffer(ends), pa.py_buffer(flat)]
        )
        encoded = rows.dictionary_encode()
        distinct = len(encoded.dictionary)
        import pyarrow.compute as pc  # noqa: PLC0415 - it loads slowly

        lengths = whole_numbers(pc.binary_length(encoded.dictionary))
        order = np.argsort(lengths, kind="stable")
        rank = np.empty(distinct, np.int64)
        rank[order] = np.arange(distinct)
        distinct_offsets = np.append(0, np.cumsum(lengths[order]))
        # An Arrow array without values may come without buffers.
        # As `pa.array` loads pandas.
        taken = pa.Array.from_buffers(pa.int64(), distinct, [None, pa.py_buffer(order)])
        buffer = encoded.dictionary.take(taken).buffers()[2] or b""
        distinct_values = np.frombuffer(buffer, np.uint8)[: distinct_offsets[-1]].copy()
        # int64: NumPy gathers with a native index without converting it at every query.
        inverse = rank[whole_numbers(encoded.indices)]
        counts = np.bincount(inverse, minlength=distinct).astype(np.int64, copy=False)
        return cls(*map(frozen, (distinct_values, distinct_offsets, inverse, counts)))

    def __len__(self) -> int:
        """Return the number of distinct sequences."""
        return len(self.counts)

    def __getitem__(self, index: int) -> NDArray[np.uint8]:
        """Return one distinct sequence."""
        return self.values[self.offsets[index] : self.offsets[index + 1]]

    @cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Length of each distinct sequence, shape (d,)."""
        return frozen(np.diff(self.offsets))

    @cached_property
    def strings(self) -> list[str]:
        """Each distinct sequence as text, one character of that code point a value."""
        text = self.values.tobytes().decode("latin-1")
        bounds = self.offsets.tolist()
        return [text[low:high] for low, high in pairwise(bounds)]

    @cached_property
    def histogram(self) -> NDArray[np.uint16 | np.uint32]:
        """How often each value occurs in each distinct sequence, shape (d, largest value + 1).

        A column is contiguous in memory, because the measures read it value by value.
        """
        size = int(self.values.max()) + 1 if len(self.values) else 0
        longest = int(self.lengths.max()) if len(self) else 0
        kind = np.uint16 if longest <= np.iinfo(np.uint16).max else np.uint32
        counts: NDArray[np.uint16 | np.uint32] = np.zeros((len(self), size), kind, order="F")
        step = max(1, HISTOGRAM_BLOCK // max(1, size))
        for low in range(0, len(self), step):
            high = min(low + step, len(self))
            rows = np.repeat(np.arange(high - low), self.lengths[low:high])
            values = self.values[self.offsets[low] : self.offsets[high]]
            bins = np.bincount(rows * size + values, minlength=(high - low) * size)
            counts[low:high] = bins.reshape(high - low, size)
        return frozen(counts)

    @cached_property
    def value_sets(self) -> NDArray[np.uint64]:
        """The set of values of each distinct sequence as bits, shape (d, ceil(k / 64))."""
        present = self.histogram > 0
        words = -(-present.shape[1] // WORD_BITS)
        sets = np.zeros((len(self), words), np.uint64)
        for value in range(present.shape[1]):
            word, bit = divmod(value, WORD_BITS)
            sets[:, word] |= present[:, value].astype(np.uint64) << np.uint64(bit)
        return frozen(sets)

    @cached_property
    def value_set_sizes(self) -> NDArray[np.int16]:
        """How many different values each distinct sequence has, shape (d,)."""
        return frozen(np.bitwise_count(self.value_sets).sum(axis=1, dtype=np.int16))

    def overlap(
        self, query: NDArray[np.uint8], *, only: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Count the different values that a query and each distinct sequence share, in any order.

        Return how many are in both and how many in at least one of them, for the distinct sequences
        `only`, or for all.
        """
        sets = self.value_sets if only is None else self.value_sets[only]
        values = np.unique(query)
        words = [0] * sets.shape[1]
        for value in values.tolist():
            word, bit = divmod(value, WORD_BITS)
            if word < len(words):  # a value past the last word is in no sequence of the table
                words[word] |= 1 << bit
        both = np.zeros(len(sets), np.int16)
        for word, bits in enumerate(words):
            both += np.bitwise_count(sets[:, word] & np.uint64(bits))
        sizes = self.value_set_sizes if only is None else self.value_set_sizes[only]
        return both, sizes + np.int16(len(values)) - both


def checked_sequence(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a sequence as it is, or raise InputError if it is not a flat uint8 array."""
    array = np.asarray(values)
    if array.dtype != np.uint8 or array.ndim != 1:
        raise InputError(
            f"a sequence contains {array.dtype} values in {array.ndim} dimensions; give its "
            "class codes or angle levels (0 to 255) as a one-dimensional uint8 array."
        )
    return array


def frozen(array: _Array) -> _Array:
    """Return the array, made read-only."""
    array.setflags(write=False)
    return array


def views_in(database: SignatureDatabase, cells: NDArray[np.int64]) -> Views:
    """Return what a database says is seen from some of its cells; one may stand there twice.

    Bearings are in the middle of their units, and the rows of the objects are not known.
    """
    part = database.select(cells)
    return Views(
        offsets=part.offsets,
        objects=np.full(len(part.codes), -1),
        codes=part.codes,
        bearings=part.bearings + 180.0 / BEARING_UNITS,
        distances=part.distances,
    )
