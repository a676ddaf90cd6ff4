"""The files of a signature database: one GeoParquet file, or a folder of parts with a manifest."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from dataclasses import asdict, dataclass, field, replace
from itertools import groupby, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from semsig_gis.core import (
    BEARING_UNITS,
    NOTES,
    DatabaseError,
    Displayed,
    GridSpec,
    SemsigError,
    SignatureSpec,
    Taxonomy,
    brief,
    each_in_order,
    remove_abandoned,
    split_ids,
)
from semsig_gis.database.database import (
    CELL_ARRAYS,
    SignatureDatabase,
    join_databases,
    require_same,
)
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.storage import (
    digest,
    geo_metadata,
    parse_json,
    points_to_wkb,
    read_geoparquet,
    read_whole,
    whole_numbers,
    write_geoparquet,
    write_whole,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray
    from pyproj import CRS

KIND = "signature database"
FORMAT = 3  # increased when older files would be read incorrectly
PLAIN_FORMAT = 2  # of files that the version before can read as well
NEW_FIELDS = {"family", "shape", "tall"}  # of classes, since format 3
ASCII = 128
TWO_BYTES = 1 << 11  # first code point that has more than two bytes in UTF-8
EXTENTS = "extents"
# Readers of Parquet folders, such as pyarrow, ignore names with a leading underscore.
MANIFEST = "_manifest.json"
INPUTS = "_inputs"  # copies of the objects, buildings and streets of a database in parts
PARTS_KIND = "signature database in parts"


def save_database(database: SignatureDatabase, path: str | Path) -> None:
    """Save a database as one GeoParquet file, with one row per cell and the specs as metadata.

    Parameters
    ----------
    database : SignatureDatabase
        What to save.
    path : str or Path
        File to write; it appears complete, by rename.

    Notes
    -----
    Columns: ``cell_id`` (int64), ``types`` (symbols), ``bearings`` (list of uint16, in 1/20
    degree), ``distances`` (list of uint8, in units of `SignatureDatabase.scale`), ``length``
    (int32) and ``geometry`` (the viewpoint as WKB), and ``extents`` (list of uint8, in 1/255 turn)
    if something is extended. The metadata key ``semsig`` holds the specs, the classes and the
    licences as JSON.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     open_database(f"{folder}/city.parquet").types(0) == demo_database.types(0)
    True
    """
    offsets = pa.array(database.offsets).cast(pa.int32())
    columns = {
        "cell_id": pa.array(database.cell_ids),
        "types": type_texts(database),
        "bearings": pa.ListArray.from_arrays(offsets, pa.array(database.bearing_units)),
        "distances": pa.ListArray.from_arrays(offsets, pa.array(database.distance_units)),
        "length": pa.array(database.lengths.astype(np.int32)),
        "geometry": points_to_wkb(database.xy),
    }
    if database.is_extended:
        columns[EXTENTS] = pa.ListArray.from_arrays(offsets, pa.array(database.extent_units))
    table = pa.table(columns)
    write_geoparquet(
        table,
        path,
        geo=geo_metadata(database.crs, geometry_types=["Point"], bounds=database.bounds.tolist()),
        specs=database_specs(database),
    )


def type_texts(database: SignatureDatabase) -> pa.StringArray:
    """Return the type sequence of every cell as text."""
    points = database.taxonomy.symbol_points
    offsets = database.offsets
    if points.max() < ASCII:
        symbols = points.astype(np.uint8)[database.codes]
    else:  # a symbol beyond ASCII has two bytes
        texts = [chr(point).encode() for point in points.tolist()]
        sizes = np.array([len(text) for text in texts])[database.codes]
        offsets = np.append(0, np.cumsum(sizes))[offsets]
        table = np.frombuffer(b"".join(text.ljust(2, b"\0") for text in texts), np.uint8)
        both = table.reshape(-1, 2)[database.codes]
        symbols = both[np.arange(2) < sizes[:, None]]
    ends = pa.array(offsets).cast(pa.int32()).buffers()[1]
    return pa.StringArray.from_buffers(len(database), ends, pa.py_buffer(symbols))


def _is_plain(database: SignatureDatabase) -> bool:
    """Whether the version before can read a database: without landmarks, families and extents."""
    return not database.is_extended and all(
        item["symbol"].isascii() and NEW_FIELDS.isdisjoint(item)
        for item in database.taxonomy.to_list()
    )


def database_specs(database: SignatureDatabase) -> dict[str, Any]:
    """Return the specs of a database as plain values for JSON; notes only if there are any."""
    notes: dict[str, Any] = {NOTES: list(database.notes)} if database.notes else {}
    extents = {EXTENTS: True} if database.is_extended else {}
    return {
        "kind": KIND,
        "format": PLAIN_FORMAT if _is_plain(database) else FORMAT,
        "version": database.version,
        "grid": asdict(database.grid),
        "signature": asdict(database.spec),
        "viewpoints": database.viewpoints.to_dict(),
        "occlusion": database.occlusion,
        "taxonomy": database.taxonomy.to_list(),
        "licenses": list(database.licenses),
        **extents,
        **notes,
    }


def open_database(path: str | Path) -> SignatureDatabase:
    """Open a file that `save_database` wrote, or a folder of parts that `build_tiles` wrote.

    Parameters
    ----------
    path : str or Path
        File or folder.

    Returns
    -------
    SignatureDatabase
        The database.

    Raises
    ------
    DatabaseError
        If the file or a part is missing, damaged, or not a signature database.

    Examples
    --------
    >>> open_database("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere.parquet does not exist;
    give a signature database file.
    """
    if is_folder(path):
        return open_dataset(path).whole()
    columns = ["cell_id", "types", "bearings", "distances"]
    table, specs, crs = read_geoparquet(path, kind=KIND, columns=columns, optional=[EXTENTS])
    database = database_of(table, specs, crs, path=path)
    del table
    pa.default_memory_pool().release_unused()
    return database


def database_of(
    table: pa.Table, specs: dict[str, Any], crs: CRS, *, path: str | Path
) -> SignatureDatabase:
    """Return a database from its columns (see `save_database`) and `database_specs`.

    Raise DatabaseError, with `path`, if they are damaged or from another version.
    """
    if specs.get("format") not in (PLAIN_FORMAT, FORMAT):  # in a set, a list would be an error
        raise DatabaseError(
            f"{path} was written by another version of semsig ({specs.get('version')}); "
            "build the database again."
        )
    try:
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        codes_of = np.zeros(TWO_BYTES, np.uint8)
        for item in taxonomy.classes:
            codes_of[ord(item.symbol)] = item.code
        symbols, offsets = _text(table["types"])
        bearing_units, bearing_offsets = _numbers(table["bearings"], pa.uint16())
        distance_units, distance_offsets = _numbers(table["distances"], pa.uint8())
        extent_units, extent_offsets = None, offsets
        if specs.get(EXTENTS):
            extent_units, extent_offsets = _numbers(table[EXTENTS], pa.uint8())
        cells = whole_numbers(table["cell_id"]).astype(np.int64, casting="safe")
        columns, rows = split_ids(cells)
        database = SignatureDatabase(
            columns=columns.astype(np.int32),
            rows=rows.astype(np.int32),
            offsets=offsets,
            codes=codes_of[symbols],
            bearing_units=bearing_units,
            distance_units=distance_units,
            grid=GridSpec(specs["grid"]["step"], tuple(specs["grid"]["origin"])),
            spec=SignatureSpec(**specs["signature"]),
            taxonomy=taxonomy,
            crs=crs,
            licenses=tuple(specs["licenses"]),
            version=specs["version"],
            viewpoints=ViewpointSpec.from_dict(specs["viewpoints"]),
            occlusion=None if specs["occlusion"] is None else float(specs["occlusion"]),
            notes=tuple(map(str, specs.get(NOTES, ()))),
            extent_units=extent_units,
        )
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        raise DatabaseError(
            f"{path} is damaged ({brief(error)}); build the database again."
        ) from error
    # Properties of every signature; a checksum would not detect columns that were swapped.
    same_cell = np.ones(len(symbols), bool)
    same_cell[offsets[:-1]] = False
    consistent = (
        np.array_equal(offsets, bearing_offsets)
        and np.array_equal(offsets, distance_offsets)
        and np.array_equal(offsets, extent_offsets)
        and (np.diff(offsets) > 0).all()
        and (np.diff(cells) > 0).all()
        and database.codes.all()
        and (bearing_units < BEARING_UNITS).all()
        and not (same_cell[1:] & (bearing_units[1:] < bearing_units[:-1])).any()
    )
    if not consistent:
        raise DatabaseError(
            f"{path} is damaged (its columns do not match each other); build the database again."
        )
    return database


def _text(column: pa.ChunkedArray) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the flat code points and offsets of an Arrow column of strings.

    ValueError for letters of more than two bytes, which are no symbols.
    """
    array = _as_array(column, pa.string())
    _, ends, flat = array.buffers()
    offsets = np.frombuffer(ends, np.int32)[array.offset : array.offset + len(array) + 1]
    text = np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]]
    offsets = offsets.astype(np.int64) - offsets[0]
    if text.max(initial=0) < ASCII:
        return text, offsets
    points = np.frombuffer(text.tobytes().decode().encode("utf-32-le"), "<u4")
    if points.max() >= TWO_BYTES:
        raise ValueError(f"symbol {chr(points.max())!r} is no letter of a class")
    first = (text & 0xC0) != 0x80  # noqa: PLR2004 - all other bytes begin a letter
    return points, np.append(0, np.cumsum(first))[offsets]


def _numbers(column: pa.ChunkedArray, kind: pa.DataType) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the flat array and offsets of an Arrow column of lists of numbers."""
    array = _as_array(column, pa.list_(kind))
    offsets = whole_numbers(array.offsets).astype(np.int64)
    values = whole_numbers(array.values)  # `flatten` would load all of pyarrow.compute
    return values[offsets[0] : offsets[-1]], offsets - offsets[0]


def _as_array(column: pa.ChunkedArray, kind: pa.DataType) -> pa.Array:
    """Return a column as one array; ValueError for another type, missing values or no rows."""
    if column.null_count or column.type != kind or not len(column):
        raise ValueError(
            f"a column contains {len(column)} values of {column.type}, {column.null_count} missing"
        )
    return column.combine_chunks()


def cells_checksum(database: SignatureDatabase) -> str:
    """Return 16 hexadecimal digits that change with any cell or signature."""
    checksum = hashlib.blake2b(digest_size=8)
    extents = [] if database.extent_units is None else [database.extent_units]
    entries = (database.codes, database.bearing_units, database.distance_units, *extents)
    for array in (database.columns, database.rows, database.offsets, *entries):
        checksum.update(np.ascontiguousarray(array).data)
    return checksum.hexdigest()


def damaged_files(folder: Path, digests: Mapping[str, str]) -> list[str]:
    """Return the names of the files of a folder that are missing or have another digest."""
    damaged = []
    for name, expected in digests.items():
        try:
            intact = digest(folder / name) == expected
        except OSError:
            intact = False
        if not intact:
            damaged.append(name)
    return damaged


def read_specs(path: str | Path) -> dict[str, Any]:
    """Return the specs in the metadata of a database file or part file."""
    return read_geoparquet(path, kind=KIND, columns=[])[1]


def is_folder(path: str | Path) -> bool:
    """Whether a path is a folder, for example of a database in parts.

    A folder that a killed run had moved away is moved back.
    """
    if not os.path.lexists(path):
        remove_abandoned(Path(path).parent)
    return os.path.isdir(path)  # noqa: PTH112 - Path.is_dir may raise


def require_file(path: str | Path) -> None:
    """Raise DatabaseError if a path is not a file."""
    if not os.path.isfile(path):  # noqa: PTH113 - Path.is_file may raise
        raise DatabaseError(f"{path} does not exist; give a signature database file.")


@dataclass(frozen=True, slots=True, order=True)
class PartFile:
    """A part file of a database: the cells of one tile.

    `tile` is its column and row, counted in tiles from grid column 0 and row 0. `entries` is the
    total length of the signatures; `bytes` and `sha256` are the size and digest of the file.
    """

    tile: tuple[int, int]
    cells: int
    entries: int
    bytes: int
    sha256: str

    @property
    def file(self) -> str:
        """Name of the file."""
        return part_name(self.tile)


@dataclass(frozen=True, slots=True)
class Manifest:
    """The contents of a signature database in parts, ordered by tile.

    `recipe` has the specs and the digests of the inputs, as JSON values. `inputs` are the digests
    of their copies by file name, empty in a database of an older version.
    """

    recipe: dict[str, Any]
    parts: tuple[PartFile, ...]
    inputs: dict[str, str] = field(default_factory=dict)

    @property
    def cells(self) -> int:
        """Number of cells in all parts."""
        return sum(part.cells for part in self.parts)

    @property
    def entries(self) -> int:
        """Total length of the signatures in all parts."""
        return sum(part.entries for part in self.parts)

    def write(self, folder: Path) -> None:
        """Write the manifest to the folder of the parts; it appears complete, by rename."""
        content: dict[str, Any] = {
            "kind": PARTS_KIND,
            "recipe": self.recipe,
            **({"inputs": self.inputs} if self.inputs else {}),
            "parts": [{"file": part.file, **asdict(part)} for part in self.parts],
        }
        content["sum"] = _checksum(content)
        write_whole(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def _checksum(content: dict[str, Any]) -> int:
    """Return the CRC-32 of values for JSON."""
    return zlib.crc32(json.dumps(content).encode())


def part_name(tile: tuple[int, int]) -> str:
    """Return the name of the part file of a tile, such as ``tile_12_-3.parquet``."""
    return f"tile_{tile[0]}_{tile[1]}.parquet"


def read_manifest(folder: str | Path) -> Manifest:
    """Read the manifest of a database in parts; DatabaseError if it is missing or damaged."""
    path = Path(folder) / MANIFEST
    try:
        content = parse_json(read_whole(path), finite=True)
        # Manifests of older versions have no checksum.
        if "sum" in content and content.pop("sum") != _checksum(content):
            raise ValueError(path)  # noqa: TRY301
        parts = tuple(
            PartFile(
                tile=(int(part["tile"][0]), int(part["tile"][1])),
                cells=int(part["cells"]),
                entries=int(part["entries"]),
                bytes=int(part["bytes"]),
                sha256=str(part["sha256"]),
            )
            for part in content["parts"]
        )
        recipe = dict(content["recipe"])
        inputs = {str(name): str(value) for name, value in content.get("inputs", {}).items()}
        kind = content["kind"]
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatabaseError(
            f"{folder} is not a signature database in parts (it has no {MANIFEST}); give a "
            "folder that `semsig build --tile` wrote."
        ) from error
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise DatabaseError(
            f"{path} is damaged or cannot be read; build the database again."
        ) from error
    if kind != PARTS_KIND:
        raise DatabaseError(
            f"{path} does not belong to a signature database; give a folder that `semsig build "
            "--tile` wrote."
        )
    return Manifest(recipe, parts, inputs)


def part_files(folder: str | Path) -> tuple[Path, ...]:
    """Return the part files of a database, ordered by tile; DatabaseError if it is incomplete."""
    manifest = read_manifest(folder)
    folder = Path(folder)

    def require_part(part: PartFile) -> None:
        path = folder / part.file
        if not path.is_file():
            raise DatabaseError(
                f"{path} is missing; put the part back or build the database again."
            )
        if path.stat().st_size != part.bytes or digest(path) != part.sha256:
            raise DatabaseError(
                f"{path} is not the part that was built; put it back or build the database again."
            )

    for _ in each_in_order(require_part, manifest.parts):
        pass
    others = {path.name for path in folder.glob("*.parquet")} - {p.file for p in manifest.parts}
    if others:
        raise DatabaseError(
            f"{folder / min(others)} is not part of the database in {folder}; move it elsewhere."
        )
    if not manifest.parts:
        raise DatabaseError(f"{folder / MANIFEST} lists no parts; build the database again.")
    return tuple(folder / part.file for part in manifest.parts)


@dataclass(frozen=True, repr=False, slots=True)
class PartitionedDatabase(Displayed):
    """A signature database in parts, with only one part at a time in memory.

    Parameters
    ----------
    files : tuple of Path
        The part files; they have no common cell.
    cells : int
        Number of cells in all parts.
    tiles : tuple of PartFile, optional
        The parts as in the manifest, ordered by tile, if they are tiles.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_objects
    >>> from semsig_gis.database import build_tiles
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(demo_objects, f"{folder}/objects.parquet")
    ...     tiles = build_tiles(f"{folder}/objects.parquet", f"{folder}/town")
    ...     database = open_dataset(f"{folder}/town")
    >>> len(database) == len(demo_database)
    True
    """

    files: tuple[Path, ...]
    cells: int
    tiles: tuple[PartFile, ...] = ()

    def __len__(self) -> int:  # noqa: D105
        return self.cells

    def _facts(self) -> dict[str, object]:
        return {"cells": self.cells, "parts": len(self.files)}

    def whole(self) -> SignatureDatabase:
        """Return all cells at once; DatabaseError if the parts do not fit together.

        The cells of a column of tiles follow those of the column before, so that only one column is
        in memory twice.
        """
        if not self.tiles:
            return join_databases(list(self.parts()))
        arrays: dict[str, Any] = {name: np.empty(self.cells, np.int32) for name in CELL_ARRAYS}
        offsets = np.zeros(self.cells + 1, np.int64)
        size, strips = sum(part.entries for part in self.tiles), []
        parts, cells, entries = map(open_database, self.files), 0, 0
        for _, tiles in groupby(self.tiles, key=lambda part: part.tile[0]):
            column = list(tiles)
            strip = join_databases(list(islice(parts, len(column))))
            strips.append(strip.select(slice(0)))
            require_same(strips[0], strip)
            end, last = cells + len(strip), entries + len(strip.codes)
            listed = sum(part.cells for part in column), sum(part.entries for part in column)
            follows = cells == 0 or arrays["columns"][cells - 1] < strip.columns[0]
            if not follows or listed != (len(strip), len(strip.codes)):
                raise DatabaseError(
                    f"{self.files[0].parent} has other cells than its manifest lists; build the "
                    "database again."
                )
            for name in CELL_ARRAYS:
                arrays[name][cells:end] = getattr(strip, name)
            for name, values in strip.entry_arrays.items():
                # Parts without extents have none of these values: zeros.
                if name not in arrays:
                    arrays[name] = np.zeros(size, values.dtype)
                arrays[name][entries:last] = values
            offsets[cells + 1 : end + 1] = strip.offsets[1:] + entries
            cells, entries = end, last
        return replace(
            strips[0],
            offsets=offsets,
            licenses=tuple(dict.fromkeys(line for strip in strips for line in strip.licenses)),
            notes=tuple(dict.fromkeys(note for strip in strips for note in strip.notes)),
            **arrays,
        )

    def parts(self) -> Iterator[SignatureDatabase]:
        """Yield the parts one by one; DatabaseError if they were built with different settings."""
        first = None
        for file in self.files:
            part = open_database(file)
            if first is None:
                first = part.select(slice(0))
            require_same(first, part)
            yield part

    @property
    def taxonomy(self) -> Taxonomy:
        """The classes of the parts."""
        return next(self.parts()).taxonomy

    @property
    def spec(self) -> SignatureSpec:
        """Visibility range and angle levels of the parts."""
        return next(self.parts()).spec

    @property
    def crs(self) -> CRS:
        """Metric coordinate reference system of the parts."""
        return next(self.parts()).crs

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the viewpoints of all parts in metres: west, south, east and north."""
        boxes = np.stack([part.bounds for part in self.parts() if len(part)])
        return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])

    def row_numbers(self, cell_ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the rows of cells in the database that `open_database` returns."""
        rows = np.zeros(len(cell_ids), np.int64)
        for file in self.files:
            table, _, _ = read_geoparquet(file, kind=KIND, columns=["cell_id"])
            rows += np.searchsorted(whole_numbers(table["cell_id"]), cell_ids)
        return rows


def open_dataset(folder: str | Path) -> PartitionedDatabase:
    """Open a database in parts without reading the parts into memory.

    Parameters
    ----------
    folder : str or Path
        Folder of the database.

    Returns
    -------
    PartitionedDatabase
        The parts. For all cells at once, use `open_database`.

    Raises
    ------
    DatabaseError
        If the folder is not a database in parts, or a part is missing or has changed.

    Examples
    --------
    >>> open_dataset("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere is not a signature database in parts (it has no \
    _manifest.json); give a folder that `semsig build --tile` wrote.
    """
    files, manifest = part_files(folder), read_manifest(folder)
    return PartitionedDatabase(files, manifest.cells, manifest.parts)
