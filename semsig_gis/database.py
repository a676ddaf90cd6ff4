"""The signature database: the signature of every cell as flat arrays, in one GeoParquet file."""

from __future__ import annotations

import functools
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis import __version__
from semsig_gis.errors import CrsError, DatabaseError, EmptyResultError, SemsigError
from semsig_gis.grid import GridSpec, cell_ids, cells_near, split_ids
from semsig_gis.occlusion import Footprints, hidden
from semsig_gis.sequences import SequenceTable
from semsig_gis.signatures import Signature, SignatureSpec, clockwise_order, quantize
from semsig_gis.spatial_index import PackedIndex
from semsig_gis.storage import geo_metadata, read_geoparquet, write_geoparquet
from semsig_gis.taxonomy import Taxonomy
from semsig_gis.viewpoints import ViewpointSpec, choose_viewpoints
from semsig_gis.visibility import visible_objects

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import geopandas as gpd
    from numpy.typing import DTypeLike, NDArray
    from pyproj import CRS

    from semsig_gis.objects import StreetObjects

__all__ = ["SignatureDatabase", "build_database", "open_database", "save_database"]

_Array = TypeVar("_Array", bound="NDArray[Any]")

KIND = "signature database"
# Divisible by 8, 16, 24 and 32, so that the usual angle levels come out exactly.
BEARING_UNITS = 64_800
CELLS_A_BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class SignatureDatabase:
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
        Bearing in 1/180 degree, rounded down.
    distance_dm : ndarray of uint16, shape (m,)
        Distance in decimetres, rounded.
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
        Tolerance in metres with which buildings hide objects (see `semsig_gis.occlusion`); None
        where no building did.

    Examples
    --------
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> len(database.types(0)) == int(database.lengths[0])
    True
    """

    columns: NDArray[np.int32]
    rows: NDArray[np.int32]
    offsets: NDArray[np.int64]
    codes: NDArray[np.uint8]
    bearing_units: NDArray[np.uint16]
    distance_dm: NDArray[np.uint16]
    grid: GridSpec
    spec: SignatureSpec
    taxonomy: Taxonomy
    crs: CRS
    licenses: tuple[str, ...] = ()
    version: str = __version__
    viewpoints: ViewpointSpec = ViewpointSpec()  # noqa: RUF009 - it is frozen
    occlusion: float | None = None

    def __post_init__(self) -> None:  # noqa: D105
        for name in ("columns", "rows", "offsets", "codes", "bearing_units", "distance_dm"):
            getattr(self, name).setflags(write=False)

    def __len__(self) -> int:  # noqa: D105
        return len(self.columns)

    @property
    def cell_ids(self) -> NDArray[np.int64]:
        """Number of every cell, ``column * 10**8 + row``, shape (n,)."""
        return cell_ids(self.columns, self.rows)

    @functools.cached_property
    def xy(self) -> NDArray[np.float64]:
        """Viewpoint of every cell in metres, shape (n, 2)."""
        return _frozen(self.grid.viewpoints(self.columns, self.rows))

    @functools.cached_property
    def lengths(self) -> NDArray[np.int64]:
        """Number of objects that every cell sees, shape (n,)."""
        return _frozen(np.diff(self.offsets))

    @property
    def bearings(self) -> NDArray[np.float64]:
        """Bearing of every entry in degrees, to 1/180 degree, shape (m,)."""
        return self.bearing_units * np.float64(360.0 / BEARING_UNITS)

    @functools.cached_property
    def levels(self) -> NDArray[np.uint8]:
        """Angle level of every entry, shape (m,)."""
        if BEARING_UNITS % self.spec.levels == 0:
            levels = self.bearing_units // (BEARING_UNITS // self.spec.levels)
            return _frozen(levels.astype(np.uint8))
        return _frozen(quantize(self.bearings, self.spec.levels))

    @functools.cached_property
    def occurrences(self) -> NDArray[np.int64]:
        """How often each class code occurs over all signatures, shape (256,)."""
        return _frozen(np.bincount(self.codes, minlength=256))

    @functools.cached_property
    def present_codes(self) -> NDArray[np.uint8]:
        """Class codes that occur, ascending."""
        return _frozen(np.flatnonzero(self.occurrences).astype(np.uint8))

    @functools.cached_property
    def type_sequences(self) -> SequenceTable:
        """The distinct type sequences, and which of them every cell has."""
        return SequenceTable.from_csr(self.codes, self.offsets)

    @functools.cached_property
    def angle_sequences(self) -> SequenceTable:
        """The distinct angle-level sequences, and which of them every cell has."""
        return SequenceTable.from_csr(self.levels, self.offsets)

    @property
    def type_group_sizes(self) -> NDArray[np.int64]:
        """For every cell, how many cells have its type sequence, shape (n,)."""
        return self.type_sequences.counts[self.type_sequences.inverse]

    @property
    def angle_group_sizes(self) -> NDArray[np.int64]:
        """For every cell, how many cells have its angle-level sequence, shape (n,)."""
        return self.angle_sequences.counts[self.angle_sequences.inverse]

    def signature(self, cell: int) -> Signature:
        """Return the signature of one cell.

        Parameters
        ----------
        cell : int
            Row number in the database, 0 to n - 1.

        Returns
        -------
        Signature
            Its class codes and bearings.
        """
        part = slice(self.offsets[cell], self.offsets[cell + 1])
        bearings = self.bearing_units[part] * np.float64(360.0 / BEARING_UNITS)
        return Signature(self.codes[part], bearings)

    def types(self, cell: int) -> str:
        """Return the type sequence of one cell.

        Parameters
        ----------
        cell : int
            Row number in the database, 0 to n - 1.

        Returns
        -------
        str
            One symbol an object.
        """
        return self.taxonomy.decode(self.codes[self.offsets[cell] : self.offsets[cell + 1]])


def build_database(
    objects: StreetObjects,
    *,
    grid: GridSpec | None = None,
    spec: SignatureSpec | None = None,
    viewpoints: ViewpointSpec | None = None,
    footprints: gpd.GeoDataFrame | None = None,
    streets: gpd.GeoDataFrame | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SignatureDatabase:
    """Compute the signature of every cell that sees at least one object.

    Parameters
    ----------
    objects : StreetObjects
        The objects of a city.
    grid : GridSpec, optional
        The cells; 10 m by default.
    spec : SignatureSpec, optional
        Visibility range and angle levels; 30 m and 16 by default.
    viewpoints : ViewpointSpec, optional
        Which cells are looked from; all by default.
    footprints : GeoDataFrame, optional
        Buildings (polygons) in any CRS; what they hide is not seen.
    streets : GeoDataFrame, optional
        Centre lines in any CRS; a column ``half_width`` holds metres where it is there.
    progress : callable, optional
        Called with the number of cells done and in all.

    Returns
    -------
    SignatureDatabase
        Cells ordered by column and row.

    Raises
    ------
    EmptyResultError
        If no cell sees an object, as when the step is much larger than the range, or no cell is
        a viewpoint.
    InputError
        If footprints, streets or viewpoints cannot be used, or those that are needed are missing.
    CrsError
        If footprints or streets have no CRS.

    Notes
    -----
    Objects at most R away are sorted clockwise from north, ties nearer first (paper, section on
    semantic signatures).

    Examples
    --------
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> build_database(objects, spec=SignatureSpec(radius=20.0)).lengths.min() >= 1
    np.True_
    """
    grid = grid or GridSpec()
    spec = spec or SignatureSpec()
    index = PackedIndex(objects.xy)
    columns, rows = cells_near(objects.xy, grid=grid, radius=spec.radius)
    viewpoints = viewpoints or ViewpointSpec()
    buildings = None if footprints is None else Footprints(_moved(footprints, objects.crs))
    chosen = choose_viewpoints(
        columns,
        rows,
        grid=grid,
        spec=viewpoints,
        footprints=buildings,
        streets=None if streets is None else _moved(streets, objects.crs),
        widths=None if streets is None else streets.get("half_width"),
    )
    columns, rows = columns[chosen], rows[chosen]
    if len(columns) == 0:
        msg = (
            f"none of the {len(chosen):,} cells near an object is a viewpoint "
            f"({viewpoints.mode}); look at the area, the streets and the buildings."
        )
        raise EmptyResultError(msg)
    blocks = [
        _block(
            objects,
            index,
            grid.viewpoints(columns[part], rows[part]),
            radius=spec.radius,
            footprints=buildings,
        )
        for part in _parts(len(columns), progress)
    ]
    lengths, codes, bearing_units, distance_dm = (
        np.concatenate(parts) for parts in zip(*blocks, strict=True)
    )
    seen = lengths > 0
    if not seen.any():
        msg = (
            f"no cell sees any of the {len(objects)} objects; make the step ({grid.step:g} m) "
            f"smaller or the visibility range ({spec.radius:g} m) larger"
            + (", or leave out the buildings." if buildings else ".")
        )
        raise EmptyResultError(msg)
    return SignatureDatabase(
        columns=columns[seen].astype(np.int32),
        rows=rows[seen].astype(np.int32),
        offsets=np.concatenate([[0], np.cumsum(lengths[seen])]),
        codes=codes,
        bearing_units=bearing_units,
        distance_dm=distance_dm,
        grid=grid,
        spec=spec,
        taxonomy=objects.taxonomy,
        crs=objects.crs,
        licenses=objects.licenses,
        viewpoints=viewpoints,
        occlusion=None if buildings is None else buildings.tolerance,
    )


def _moved(table: gpd.GeoDataFrame, crs: CRS) -> NDArray[np.object_]:
    """Return the geometries of a table in a CRS."""
    if table.crs is None:
        msg = "buildings or streets have no coordinate reference system; state their crs."
        raise CrsError(msg)
    moved: NDArray[np.object_] = table.geometry.to_crs(crs).to_numpy()
    return moved


def _parts(cells: int, progress: Callable[[int, int], None] | None) -> Iterator[slice]:
    """Yield the blocks that so many cells are worked through in, and report each when done."""
    for start in range(0, cells, CELLS_A_BLOCK):
        stop = min(start + CELLS_A_BLOCK, cells)
        yield slice(start, stop)
        if progress is not None:
            progress(stop, cells)


def _block(
    objects: StreetObjects,
    index: PackedIndex,
    viewpoints: NDArray[np.float64],
    *,
    radius: float,
    footprints: Footprints | None,
) -> tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.uint16], NDArray[np.uint16]]:
    """Return lengths, codes, bearings and distances of some cells."""
    seen = visible_objects(viewpoints, objects.xy, index=index, radius=radius)
    if footprints is not None:
        ends = viewpoints[seen.viewpoint], objects.xy[seen.object]
        seen = seen.only(~hidden(*ends, footprints=footprints))
    order = clockwise_order(seen, objects.codes)
    units = np.floor(seen.bearing[order] * (BEARING_UNITS / 360.0))
    return (
        np.bincount(seen.viewpoint, minlength=len(viewpoints)),
        objects.codes[seen.object[order]],
        np.minimum(units, BEARING_UNITS - 1).astype(np.uint16),
        np.rint(seen.distance[order] * 10.0).astype(np.uint16),
    )


def save_database(database: SignatureDatabase, path: str | Path) -> None:
    """Save a database as one GeoParquet file: a row a cell, the specs in its metadata.

    Parameters
    ----------
    database : SignatureDatabase
        What to save.
    path : str or Path
        File to write; it appears whole, by rename.

    Notes
    -----
    Columns: ``cell_id`` (int64), ``types`` (symbols), ``bearings`` (binary, little-endian uint16
    in 1/180 degree), ``distances`` (binary, little-endian uint16 in decimetres), ``length``
    (int32) and ``geometry`` (the viewpoint as WKB). The metadata key ``semsig`` holds the specs,
    the classes and the licences as JSON.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(database, f"{folder}/city.parquet")
    ...     open_database(f"{folder}/city.parquet").types(0) == database.types(0)
    True
    """
    symbols = database.taxonomy.symbol_bytes[database.codes]
    table = pa.table(
        {
            "cell_id": pa.array(database.cell_ids),
            "types": _ragged(symbols, database.offsets, pa.string()),
            "bearings": _ragged(database.bearing_units, database.offsets, pa.binary()),
            "distances": _ragged(database.distance_dm, database.offsets, pa.binary()),
            "length": pa.array(database.lengths.astype(np.int32)),
            "geometry": pa.array(shapely.to_wkb(shapely.points(database.xy)), pa.binary()),
        }
    )
    bounds = (*database.xy.min(axis=0), *database.xy.max(axis=0))
    write_geoparquet(
        table,
        path,
        geo=geo_metadata(database.crs, geometry_types=["Point"], bounds=bounds),
        specs={
            "kind": KIND,
            "version": database.version,
            "grid": asdict(database.grid),
            "signature": asdict(database.spec),
            "viewpoints": database.viewpoints.to_dict(),
            "occlusion": database.occlusion,
            "taxonomy": database.taxonomy.to_list(),
            "licenses": list(database.licenses),
        },
    )


def open_database(path: str | Path) -> SignatureDatabase:
    """Open a file that `save_database` wrote.

    Parameters
    ----------
    path : str or Path
        File to read.

    Returns
    -------
    SignatureDatabase
        The database.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged, or holds something else.

    Examples
    --------
    >>> open_database("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.errors.DatabaseError: nowhere.parquet does not exist; give a signature database file.
    """
    columns = ["cell_id", "types", "bearings", "distances"]
    table, specs, crs = read_geoparquet(path, kind=KIND, columns=columns)
    try:
        grid = GridSpec(specs["grid"]["step"], tuple(specs["grid"]["origin"]))
        spec = SignatureSpec(**specs["signature"])
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        symbols, offsets = _flat(table["types"], np.uint8)
        codes_of = np.zeros(256, np.uint8)
        for item in taxonomy.classes:
            codes_of[ord(item.symbol)] = item.code
        codes = codes_of[symbols]
        bearing_units, bearing_offsets = _flat(table["bearings"], np.dtype("<u2"))
        distance_dm, distance_offsets = _flat(table["distances"], np.dtype("<u2"))
        cells = table["cell_id"].to_numpy().astype(np.int64, casting="safe")
        licenses = tuple(specs["licenses"])
        version = specs["version"]
        # Files that do not say are older: every cell was looked from, and nothing was hidden.
        chosen = specs.get("viewpoints")
        viewpoints = ViewpointSpec() if chosen is None else ViewpointSpec.from_dict(chosen)
        occlusion = None if specs.get("occlusion") is None else float(specs["occlusion"])
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        msg = f"{path} is damaged ({error}); build the database again."
        raise DatabaseError(msg) from error
    # What every signature keeps to; a sum of bytes would not find columns that were swapped.
    inside = np.ones(len(codes), bool)
    inside[offsets[:-1]] = False
    consistent = (
        np.array_equal(offsets, bearing_offsets)
        and np.array_equal(offsets, distance_offsets)
        and (np.diff(offsets) > 0).all()
        and (np.diff(cells) > 0).all()
        and codes.all()
        and (bearing_units < BEARING_UNITS).all()
        and not (inside[1:] & (bearing_units[1:] < bearing_units[:-1])).any()
        and (distance_dm <= np.rint(spec.radius * 10.0)).all()
    )
    if not consistent:
        msg = f"{path} is damaged (its columns do not fit each other); build the database again."
        raise DatabaseError(msg)
    columns_, rows = split_ids(cells)
    return SignatureDatabase(
        columns=columns_.astype(np.int32),
        rows=rows.astype(np.int32),
        offsets=offsets,
        codes=codes,
        bearing_units=bearing_units,
        distance_dm=distance_dm,
        grid=grid,
        spec=spec,
        taxonomy=taxonomy,
        crs=crs,
        licenses=licenses,
        version=version,
        viewpoints=viewpoints,
        occlusion=occlusion,
    )


def _ragged(values: NDArray[Any], offsets: NDArray[np.int64], kind: pa.DataType) -> pa.Array:
    """Wrap a flat array and offsets as an Arrow column of strings or bytes, without copying."""
    width = values.dtype.itemsize
    flat = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    ends = pa.py_buffer((offsets * width).astype(np.int32))
    return pa.Array.from_buffers(kind, len(offsets) - 1, [None, ends, pa.py_buffer(flat)])


def _flat(column: pa.ChunkedArray, dtype: DTypeLike) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the flat array and offsets of an Arrow column of strings or bytes."""
    if column.null_count or column.type not in {pa.string(), pa.binary()} or not len(column):
        msg = f"a column holds {len(column)} values of {column.type}, {column.null_count} missing"
        raise ValueError(msg)
    array = column.combine_chunks()
    _, ends, flat = array.buffers()
    width = np.dtype(dtype).itemsize
    offsets = np.frombuffer(ends, np.int32)[array.offset : array.offset + len(array) + 1]
    values = np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]].view(dtype)
    whole, rest = np.divmod((offsets - offsets[0]).astype(np.int64), width)
    if rest.any():
        msg = "a value ends in the middle of a number"
        raise ValueError(msg)
    return values, whole


def _frozen(array: _Array) -> _Array:
    """Return an array that cannot be written to."""
    array.setflags(write=False)
    return array
