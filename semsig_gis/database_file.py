"""The files of a signature database."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.database import BEARING_UNITS, SignatureDatabase
from semsig_gis.errors import DatabaseError, SemsigError
from semsig_gis.grid import GridSpec, split_ids
from semsig_gis.signatures import SignatureSpec
from semsig_gis.storage import geo_metadata, read_geoparquet, write_geoparquet
from semsig_gis.taxonomy import Taxonomy
from semsig_gis.viewpoints import ViewpointSpec

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import DTypeLike, NDArray

__all__ = ["open_database", "save_database"]

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
    Columns: ``cell_id`` (int64), ``types`` (symbols), ``bearings`` (binary, little-endian uint16
    in 1/20 degree), ``distances`` (binary, uint8 in 1/255 of the largest visibility range),
    ``length`` (int32) and ``geometry`` (the viewpoint as WKB). The metadata key ``semsig`` holds
    the specs, the classes and the licences as JSON.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.building import build_database
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
            "distances": _ragged(database.distance_units, database.offsets, pa.binary()),
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
            "format": FORMAT,
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
        symbols, offsets = _flat(table["types"], np.uint8)
        codes_of = np.zeros(256, np.uint8)
        for item in taxonomy.classes:
            codes_of[ord(item.symbol)] = item.code
        codes = codes_of[symbols]
        bearing_units, bearing_offsets = _flat(table["bearings"], np.dtype("<u2"))
        distance_units, distance_offsets = _flat(table["distances"], np.uint8)
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
