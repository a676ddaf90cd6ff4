"""The files of a signature database."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from semsig_gis.core.errors import DatabaseError, SemsigError
from semsig_gis.core.grid import GridSpec, split_ids
from semsig_gis.core.signature import SignatureSpec
from semsig_gis.core.taxonomy import Taxonomy
from semsig_gis.database.database import BEARING_UNITS, SignatureDatabase, join_databases
from semsig_gis.database.parts import digest, part_files, read_manifest
from semsig_gis.database.viewpoints import ViewpointSpec
from semsig_gis.storage.geoparquet import (
    geo_metadata,
    points_to_wkb,
    read_geoparquet,
    write_geoparquet,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray
    from pyproj import CRS


KIND = "signature database"


# Raised whenever a file of before would be read wrongly.
FORMAT = 2


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
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.database.build import build_database
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(database, f"{folder}/city.parquet")
    ...     open_database(f"{folder}/city.parquet").types(0) == database.types(0)
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
    corners = [(part.min(), part.max()) for part in (database.columns, database.rows)]
    bounds = database.grid.viewpoints(*corners).ravel().tolist()
    write_geoparquet(
        table,
        path,
        geo=geo_metadata(database.crs, geometry_types=["Point"], bounds=bounds),
        specs=database_specs(database),
    )


def database_specs(database: SignatureDatabase) -> dict[str, Any]:
    """Return all but the cells of a database, as plain values for JSON."""
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
    }


def open_database(path: str | Path) -> SignatureDatabase:
    """Open a file that `save_database` wrote, or a folder of parts.

    Parameters
    ----------
    path : str or Path
        File to read, or the folder of a database that was built in tiles.

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
    if os.path.isdir(path):  # noqa: PTH112 - it answers where Path.is_dir raises
        return join_databases([open_database(part) for part in part_files(path)])
    columns = ["cell_id", "types", "bearings", "distances"]
    return database_of(*read_geoparquet(path, kind=KIND, columns=columns), path=path)


def database_of(
    table: pa.Table, specs: dict[str, Any], crs: CRS, *, path: str | Path
) -> SignatureDatabase:
    """Return the database that columns and the values of `database_specs` hold.

    The columns are ``cell_id``, ``types``, ``bearings`` and ``distances`` (see `save_database`).
    Raise DatabaseError, which names `path`, if they are damaged or from another version.
    """
    if specs.get("format") != FORMAT:
        msg = (
            f"{path} was written by another version of semsig ({specs.get('version')}); "
            "build the database again."
        )
        raise DatabaseError(msg)
    try:
        grid = GridSpec(specs["grid"]["step"], tuple(specs["grid"]["origin"]))
        spec = SignatureSpec(**specs["signature"])
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        symbols, offsets = _text(table["types"])
        codes_of = np.zeros(256, np.uint8)
        for item in taxonomy.classes:
            codes_of[ord(item.symbol)] = item.code
        codes = codes_of[symbols]
        bearing_units, bearing_offsets = _numbers(table["bearings"], pa.uint16())
        distance_units, distance_offsets = _numbers(table["distances"], pa.uint8())
        cells = table["cell_id"].to_numpy().astype(np.int64, casting="safe")
        licenses = tuple(specs["licenses"])
        version = specs["version"]
        viewpoints = ViewpointSpec.from_dict(specs["viewpoints"])
        occlusion = None if specs["occlusion"] is None else float(specs["occlusion"])
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
        distance_units=distance_units,
        grid=grid,
        spec=spec,
        taxonomy=taxonomy,
        crs=crs,
        licenses=licenses,
        version=version,
        viewpoints=viewpoints,
        occlusion=occlusion,
    )


def _text(column: pa.ChunkedArray) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Return the flat bytes and offsets of an Arrow column of strings."""
    array = _whole(column, pa.string())
    _, ends, flat = array.buffers()
    offsets = np.frombuffer(ends, np.int32)[array.offset : array.offset + len(array) + 1]
    return np.frombuffer(flat, np.uint8)[offsets[0] : offsets[-1]], _from_zero(offsets)


def _numbers(column: pa.ChunkedArray, kind: pa.DataType) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the flat array and offsets of an Arrow column of lists of numbers."""
    array = _whole(column, pa.list_(kind))
    return array.flatten().to_numpy(), _from_zero(array.offsets.to_numpy())


def _whole(column: pa.ChunkedArray, kind: pa.DataType) -> pa.Array:
    """Return a column of some type as one array without missing values."""
    if column.null_count or column.type != kind or not len(column):
        msg = f"a column holds {len(column)} values of {column.type}, {column.null_count} missing"
        raise ValueError(msg)
    return column.combine_chunks()


def _from_zero(offsets: NDArray[np.int32]) -> NDArray[np.int64]:
    return offsets.astype(np.int64) - np.int64(offsets[0])


BUILT_DIGEST = "built_digest"


def built_digest(path: str | Path) -> str:
    """Return the SHA-256 digest that a database file had before columns were put into it.

    Without such columns it is the digest of the file as it is, even if that is damaged.
    """
    try:
        _, specs, _ = read_geoparquet(path, kind=KIND, columns=[])
    except DatabaseError:  # whatever it is, it is as it is
        specs = {}
    return str(specs[BUILT_DIGEST]) if BUILT_DIGEST in specs else digest(Path(path))


@dataclass(frozen=True, slots=True)
class PartitionedDatabase:
    """A signature database of which one part at a time is in memory.

    Parameters
    ----------
    files : tuple of Path
        The part files; no cell is in two of them.
    cells : int
        Number of cells in all parts.
    """

    files: tuple[Path, ...]
    cells: int

    def __len__(self) -> int:  # noqa: D105
        return self.cells

    def parts(self) -> Iterator[SignatureDatabase]:
        """Open the parts one after the other.

        Yields
        ------
        SignatureDatabase
            A part.

        Raises
        ------
        DatabaseError
            If a part is damaged, or was made in another way than the first.
        """
        none = None
        for file in self.files:
            part = open_database(file)
            if none is None:
                none = part.select(slice(0))
            yield join_databases([none, part])  # refuses a part that differs

    @property
    def taxonomy(self) -> Taxonomy:
        """The classes that the parts know."""
        return next(self.parts()).taxonomy

    def row_numbers(self, cell_ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row that each cell has in the database that `open_database` returns.

        Parameters
        ----------
        cell_ids : ndarray of int64, shape (n,)
            Numbers of cells of the database.

        Returns
        -------
        ndarray of int64, shape (n,)
            Rows from 0.
        """
        rows = np.zeros(len(cell_ids), np.int64)
        for file in self.files:
            table, _, _ = read_geoparquet(file, kind=KIND, columns=["cell_id"])
            rows += np.searchsorted(table["cell_id"].to_numpy(), cell_ids)
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
        The parts. For all cells at once, use `database.file.open_database`.

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
