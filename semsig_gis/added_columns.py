"""Columns that are put into the files of a signature database once it is built.

What is worked out for every cell stands beside its signature, where GIS programs see it too.
Reading the signatures does not depend on it, and a database that is built or updated anew is
without it.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from semsig_gis.database_file import KIND
from semsig_gis.errors import DatabaseError
from semsig_gis.manifest import Manifest, digest, part_files, read_manifest
from semsig_gis.storage import read_geoparquet, whole_folder, write_geoparquet

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["add_columns", "built_digest", "has_added", "read_added"]

ADDED = "added"
BUILT_DIGEST = "built_digest"
GEOMETRY = "geometry"


def add_columns(
    path: str | Path,
    columns: pa.Table,
    *,
    cell_ids: NDArray[np.int64],
    name: str,
    facts: dict[str, Any],
) -> None:
    """Put columns into a database, in the place of those that were put there under this name.

    Parameters
    ----------
    path : str or Path
        File of the database, which is replaced whole, or folder of its parts, which is replaced
        as a whole.
    columns : pyarrow.Table
        A row a cell.
    cell_ids : ndarray of int64, shape (n,)
        The cells of the rows, ascending: all that the database has.
    name : str
        What the columns are, taken together.
    facts : dict
        What is to be known of them, as plain values for JSON.

    Raises
    ------
    DatabaseError
        If the database is damaged, or has other cells.
    InputError
        If it cannot be written; it is unchanged then.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.database_file import open_database, save_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> even = pa.table({"even": database.lengths % 2 == 0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.parquet"
    ...     save_database(database, path)
    ...     add_columns(path, even, cell_ids=database.cell_ids, name="parity", facts={"a": 1})
    ...     table, facts = read_added(path, name="parity")
    ...     len(open_database(path)) == len(table), facts
    (True, {'a': 1})
    """
    added = {name: {"columns": columns.column_names, "facts": facts}}
    if not os.path.isdir(path):  # noqa: PTH112 - it answers where Path.is_dir raises
        _extend(Path(path), Path(path), columns, cell_ids, added)
        return
    files, manifest = part_files(path), read_manifest(path)
    with whole_folder(path) as partial:
        parts = []
        for file, part in zip(files, manifest.parts, strict=True):
            new = partial / file.name
            _extend(file, new, columns, cell_ids, added)
            parts.append(replace(part, bytes=new.stat().st_size, sha256=digest(new)))
        Manifest(manifest.recipe, tuple(parts)).write(partial)


def read_added(
    path: str | Path, *, name: str
) -> tuple[pa.Table, dict[str, Any]] | tuple[None, None]:
    """Return columns that were put into a database.

    Parameters
    ----------
    path : str or Path
        File of the database, or folder of its parts.
    name : str
        What they were called.

    Returns
    -------
    table : pyarrow.Table or None
        ``cell_id``, ascending, and the columns; None where there are none of this name.
    facts : dict or None
        What is to be known of them.

    Raises
    ------
    DatabaseError
        If the database is missing or damaged, or they are not in all of its parts.
    """
    tables: list[pa.Table] = []
    found: list[dict[str, Any] | None] = []
    for file in _files(path):
        _, specs, _ = read_geoparquet(file, kind=KIND, columns=[])
        found.append(specs.get(ADDED, {}).get(name))
        if found[-1] is not None:
            wanted = ["cell_id", *found[-1]["columns"]]
            tables.append(read_geoparquet(file, kind=KIND, columns=wanted)[0])
    if not tables:
        return None, None
    first = found[0]
    if first is None or found.count(first) < len(found):
        msg = f"the parts of {path} do not agree on their {name}; work it out again."
        raise DatabaseError(msg)
    return pa.concat_tables(tables).sort_by("cell_id"), dict(first["facts"])


def has_added(path: str | Path) -> bool:
    """Return whether columns were put into a database.

    Parameters
    ----------
    path : str or Path
        File of the database, or folder of its parts.

    Returns
    -------
    bool
        Whether it has any.

    Raises
    ------
    DatabaseError
        If the database is missing or damaged.
    """
    _, specs, _ = read_geoparquet(_files(path)[0], kind=KIND, columns=[])
    return bool(specs.get(ADDED))


def built_digest(path: str | Path) -> str:
    """Return the SHA-256 digest that a database file had before columns were put into it.

    Parameters
    ----------
    path : str or Path
        File of the database.

    Returns
    -------
    str
        Hexadecimal digits; that of the file as it is where nothing was put into it.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    try:
        _, specs, _ = read_geoparquet(path, kind=KIND, columns=[])
    except DatabaseError:  # whatever it is, it is as it is
        specs = {}
    return str(specs[BUILT_DIGEST]) if BUILT_DIGEST in specs else digest(Path(path))


def _files(path: str | Path) -> tuple[Path, ...]:
    """Return the files of a database."""
    # os.path.isdir answers where Path.is_dir raises.
    return part_files(path) if os.path.isdir(path) else (Path(path),)  # noqa: PTH112


def _extend(
    path: Path,
    out: Path,
    columns: pa.Table,
    cell_ids: NDArray[np.int64],
    added: dict[str, Any],
) -> None:
    """Write the file of a database, or of a part of it, with columns put into it."""
    table, specs, _ = read_geoparquet(path, kind=KIND)
    cells = table["cell_id"].to_numpy()
    rows = np.minimum(np.searchsorted(cell_ids, cells), len(cell_ids) - 1)
    if not np.array_equal(cell_ids[rows], cells):
        msg = f"{path} has other cells than those that were looked at; open the database again."
        raise DatabaseError(msg)
    before = specs.get(ADDED, {})
    replaced = [name for one in before.keys() & added for name in before[one]["columns"]]
    # The geometry stays the last column.
    geometry = table[GEOMETRY]
    table = table.drop_columns([*replaced, GEOMETRY])
    for column in columns.column_names:
        table = table.append_column(column, columns[column].take(rows))
    write_geoparquet(
        table.append_column(GEOMETRY, geometry),
        out,
        geo=json.loads(table.schema.metadata[b"geo"]),
        specs={**specs, BUILT_DIGEST: built_digest(path), ADDED: before | added},
    )
