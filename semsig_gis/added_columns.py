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

    `columns` has a row for each of `cell_ids`, which ascend and are all cells of the database.
    `facts` describe the columns, as plain values for JSON. The file, or the folder of parts, is
    replaced as a whole. Raise DatabaseError if the database is damaged or has other cells, and
    InputError if it cannot be written; it is unchanged then.
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
    """Return ``cell_id``, ascending, with the columns of a name and their facts, or None twice.

    Raise DatabaseError if the database is missing or damaged, or its parts do not agree on them.
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
    """Return whether columns were put into a database file, or a folder of its parts."""
    _, specs, _ = read_geoparquet(_files(path)[0], kind=KIND, columns=[])
    return bool(specs.get(ADDED))


def built_digest(path: str | Path) -> str:
    """Return the SHA-256 digest that a database file had before columns were put into it.

    Without such columns it is the digest of the file as it is, even if that is damaged.
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
