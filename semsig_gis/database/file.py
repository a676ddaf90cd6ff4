"""The files of a signature database: one GeoParquet file, or a folder of parts with a manifest."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from dataclasses import asdict, dataclass
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
    remove_abandoned,
    split_ids,
)
from semsig_gis.database.database import SignatureDatabase, join_databases, require_same
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.storage import (
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
# Raised whenever a file of before would be read wrongly.
FORMAT = 2
# Readers of Parquet folders, such as pyarrow, leave out what begins so.
MANIFEST = "_manifest.json"
# Copies of the objects, buildings and streets that a database in parts was built from.
INPUTS = "_inputs"
PARTS_KIND = "signature database in parts"
CHUNK = 1 << 20


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
    Columns: ``cell_id`` (int64), ``types`` (symbols), ``bearings`` (list of uint16, in 1/20
    degree), ``distances`` (list of uint8, in 1/255 of the largest visibility range), ``length``
    (int32) and ``geometry`` (the viewpoint as WKB). The metadata key ``semsig`` holds
    the specs, the classes and the licences as JSON.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     open_database(f"{folder}/city.parquet").types(0) == demo_database.types(0)
    True
    """
    symbols = pa.py_buffer(database.taxonomy.symbol_bytes[database.codes])
    offsets = pa.array(database.offsets).cast(pa.int32())
    table = pa.table(
        {
            "cell_id": pa.array(database.cell_ids),
            "types": pa.StringArray.from_buffers(len(database), offsets.buffers()[1], symbols),
            "bearings": pa.ListArray.from_arrays(offsets, pa.array(database.bearing_units)),
            "distances": pa.ListArray.from_arrays(offsets, pa.array(database.distance_units)),
            "length": pa.array(database.lengths.astype(np.int32)),
            "geometry": points_to_wkb(database.xy),
        }
    )
    bounds = [*database.xy.min(axis=0), *database.xy.max(axis=0)]
    write_geoparquet(
        table,
        path,
        geo=geo_metadata(database.crs, geometry_types=["Point"], bounds=bounds),
        specs=database_specs(database),
    )


def database_specs(database: SignatureDatabase) -> dict[str, Any]:
    """Return all but the cells of a database, as plain values for JSON; notes only if any."""
    notes = {NOTES: list(database.notes)} if database.notes else {}
    return {
        "kind": KIND,
        "format": FORMAT,
        "version": database.version,
        "grid": asdict(database.grid),
        "signature": asdict(database.spec),
        "viewpoints": database.viewpoints.to_dict(),
        "occlusion": database.occlusion,
        "taxonomy": database.taxonomy.to_list(),
        "licenses": list(database.licenses),
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
        If the file or a part is missing, damaged, or holds something else.

    Examples
    --------
    >>> open_database("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere.parquet does not exist;
    give a signature database file.
    """
    if is_folder(path):
        return join_databases([open_database(part) for part in part_files(path)])
    columns = ["cell_id", "types", "bearings", "distances"]
    return database_of(*read_geoparquet(path, kind=KIND, columns=columns), path=path)


def database_of(
    table: pa.Table, specs: dict[str, Any], crs: CRS, *, path: str | Path
) -> SignatureDatabase:
    """Return the database that columns (see `save_database`) and `database_specs` hold.

    Raise DatabaseError, which names `path`, if they are damaged or from another version.
    """
    if specs.get("format") != FORMAT:
        raise DatabaseError(
            f"{path} was written by another version of semsig ({specs.get('version')}); "
            "build the database again."
        )
    try:
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        codes_of = np.zeros(256, np.uint8)
        for item in taxonomy.classes:
            codes_of[ord(item.symbol)] = item.code
        symbols, offsets = _text(table["types"])
        bearing_units, bearing_offsets = _numbers(table["bearings"], pa.uint16())
        distance_units, distance_offsets = _numbers(table["distances"], pa.uint8())
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
        )
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        raise DatabaseError(f"{path} is damaged ({error}); build the database again.") from error
    # What every signature keeps to; a sum of bytes would not find columns that were swapped.
    follows = np.ones(len(symbols), bool)
    follows[offsets[:-1]] = False
    consistent = (
        np.array_equal(offsets, bearing_offsets)
        and np.array_equal(offsets, distance_offsets)
        and (np.diff(offsets) > 0).all()
        and (np.diff(cells) > 0).all()
        and database.codes.all()
        and (bearing_units < BEARING_UNITS).all()
        and not (follows[1:] & (bearing_units[1:] < bearing_units[:-1])).any()
    )
    if not consistent:
        raise DatabaseError(
            f"{path} is damaged (its columns do not match each other); build the database again."
        )
    return database


def _text(column: pa.ChunkedArray) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return the flat bytes and offsets of an Arrow column of strings."""
    array = _whole(column, pa.string())
    _, ends, flat = array.buffers()
    offsets = np.frombuffer(ends, np.int32)[array.offset : array.offset + len(array) + 1]
    return np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]], _from_zero(offsets)


def _numbers(column: pa.ChunkedArray, kind: pa.DataType) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the flat array and offsets of an Arrow column of lists of numbers."""
    array = _whole(column, pa.list_(kind))
    return whole_numbers(array.flatten()), _from_zero(whole_numbers(array.offsets))


def _whole(column: pa.ChunkedArray, kind: pa.DataType) -> pa.Array:
    """Return a column of some type as one array without missing values."""
    if column.null_count or column.type != kind or not len(column):
        raise ValueError(
            f"a column contains {len(column)} values of {column.type}, {column.null_count} missing"
        )
    return column.combine_chunks()


def _from_zero(offsets: NDArray[Any]) -> NDArray[np.int64]:
    return offsets.astype(np.int64) - np.int64(offsets[0])


def digest(*paths: Path) -> str:
    """Return the SHA-256 digest, in hexadecimal, of the content of files one after the other."""
    total = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                total.update(chunk)
    return total.hexdigest()


def damaged_files(folder: Path, digests: Mapping[str, str]) -> list[str]:
    """Return the names of the files that are not in a folder with such a digest."""
    damaged = []
    for name, expected in digests.items():
        try:
            whole = digest(folder / name) == expected
        except OSError:
            whole = False
        if not whole:
            damaged.append(name)
    return damaged


def read_specs(path: str | Path) -> dict[str, Any]:
    """Return what a database file, or a part file, says of itself."""
    return read_geoparquet(path, kind=KIND, columns=[])[1]


def is_folder(path: str | Path) -> bool:
    """Return whether a path is that of a folder, as of a database in parts.

    One that a killed run had put aside is put back.
    """
    if not os.path.lexists(path):
        remove_abandoned(Path(path).parent)
    return os.path.isdir(path)  # noqa: PTH112 - it answers where Path.is_dir raises


def require_file(path: str | Path) -> None:
    """Raise DatabaseError if a path is not that of a file."""
    if not os.path.isfile(path):  # noqa: PTH113 - it answers where Path.is_file raises
        raise DatabaseError(f"{path} does not exist; give a signature database file.")


@dataclass(frozen=True, slots=True, order=True)
class Part:
    """One part file, which holds the cells of one tile.

    `tile` is its column and row, counted in tiles from grid column 0 and row 0. `entries` is the
    sum of the lengths of all signatures; `bytes` and `sha256` are the size and digest of the file.
    """

    tile: tuple[int, int]
    cells: int
    entries: int
    bytes: int
    sha256: str

    @property
    def file(self) -> str:
        """Name of the file in the folder."""
        return part_name(self.tile)


@dataclass(frozen=True, slots=True)
class Manifest:
    """A signature database in parts, ordered by tile.

    `recipe` says how it was built: the specs and the digests of the inputs, as JSON values.
    """

    recipe: dict[str, Any]
    parts: tuple[Part, ...]

    @property
    def cells(self) -> int:
        """Number of cells in all parts."""
        return sum(part.cells for part in self.parts)

    @property
    def entries(self) -> int:
        """Sum of the lengths of all signatures."""
        return sum(part.entries for part in self.parts)

    def write(self, folder: Path) -> None:
        """Write the manifest into the folder of the parts; it appears whole, by rename."""
        content: dict[str, Any] = {
            "kind": PARTS_KIND,
            "recipe": self.recipe,
            "parts": [{"file": part.file, **asdict(part)} for part in self.parts],
        }
        content["sum"] = _sum(content)
        write_whole(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def _sum(content: dict[str, Any]) -> int:
    """Return the CRC-32 of values for JSON."""
    return zlib.crc32(json.dumps(content).encode())


def part_name(tile: tuple[int, int]) -> str:
    """Return the name of the part file of a tile, such as ``tile_12_-3.parquet``."""
    return f"tile_{tile[0]}_{tile[1]}.parquet"


def read_manifest(folder: str | Path) -> Manifest:
    """Read what a database in parts consists of; DatabaseError without a whole manifest."""
    path = Path(folder) / MANIFEST
    try:
        content = parse_json(read_whole(path), finite=True)
        if "sum" in content and content.pop("sum") != _sum(content):  # those of before have none
            raise ValueError(path)  # noqa: TRY301
        parts = tuple(
            Part(
                tile=(int(one["tile"][0]), int(one["tile"][1])),
                cells=int(one["cells"]),
                entries=int(one["entries"]),
                bytes=int(one["bytes"]),
                sha256=str(one["sha256"]),
            )
            for one in content["parts"]
        )
        recipe = dict(content["recipe"])
        kind = content["kind"]
    except (FileNotFoundError, NotADirectoryError) as error:
        raise DatabaseError(
            f"{folder} is not a signature database in parts (it has no {MANIFEST}); give a "
            "folder that `semsig build --tile` wrote."
        ) from error
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise DatabaseError(
            f"{path} is damaged or cannot be read; build the database again."
        ) from error
    if kind != PARTS_KIND:
        raise DatabaseError(
            f"{path} does not belong to a signature database; give a folder that `semsig build "
            "--tile` wrote."
        )
    return Manifest(recipe, parts)


def part_files(folder: str | Path) -> tuple[Path, ...]:
    """Return the part files of a database, ordered by tile; DatabaseError if it is not whole."""
    manifest = read_manifest(folder)
    folder = Path(folder)
    for part in manifest.parts:
        path = folder / part.file
        if not path.is_file():
            raise DatabaseError(
                f"{path} is missing; put the part back or build the database again."
            )
        if path.stat().st_size != part.bytes or digest(path) != part.sha256:
            raise DatabaseError(
                f"{path} is not the part that was built; put it back or build the database again."
            )
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
    """A signature database of which one part at a time is in memory.

    Parameters
    ----------
    files : tuple of Path
        The part files; no cell is in two of them.
    cells : int
        Number of cells in all parts.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import build_tiles, save_objects
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(demo_objects, f"{folder}/objects.parquet")
    ...     tiles = build_tiles(f"{folder}/objects.parquet", f"{folder}/town")
    ...     database = open_dataset(f"{folder}/town")
    >>> len(database) == len(demo_database)
    True
    """

    files: tuple[Path, ...]
    cells: int

    def __len__(self) -> int:  # noqa: D105
        return self.cells

    def _facts(self) -> dict[str, object]:
        return {"cells": self.cells, "parts": len(self.files)}

    def parts(self) -> Iterator[SignatureDatabase]:
        """Open the parts one after the other; DatabaseError where they were made differently."""
        first = None
        for file in self.files:
            part = open_database(file)
            if first is None:
                first = part.select(slice(0))
            require_same(first, part)
            yield part

    @property
    def taxonomy(self) -> Taxonomy:
        """The classes that the parts know."""
        return next(self.parts()).taxonomy

    @property
    def spec(self) -> SignatureSpec:
        """How the signatures of the parts were made."""
        return next(self.parts()).spec

    @property
    def crs(self) -> CRS:
        """The metric coordinate reference system of the parts."""
        return next(self.parts()).crs

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Box of the viewpoints of all parts in metres: west, south, east and north."""
        boxes = np.stack([part.bounds for part in self.parts() if len(part)])
        return np.concatenate([boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)])

    def row_numbers(self, cell_ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the rows that cells have in the database that `open_database` returns."""
        rows = np.zeros(len(cell_ids), np.int64)
        for file in self.files:
            table, _, _ = read_geoparquet(file, kind=KIND, columns=["cell_id"])
            rows += np.searchsorted(whole_numbers(table["cell_id"]), cell_ids)
        return rows


def open_dataset(folder: str | Path) -> PartitionedDatabase:
    """Open a folder that holds a database in parts, without reading the parts into memory.

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
        If it is no such folder, or a part is missing or is not the one that was built.

    Examples
    --------
    >>> open_dataset("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere is not a signature database in parts (it has no \
    _manifest.json); give a folder that `semsig build --tile` wrote.
    """
    return PartitionedDatabase(part_files(folder), read_manifest(folder).cells)
