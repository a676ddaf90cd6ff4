"""A city: a signature database with its object store and added columns, opened together."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pyarrow as pa

from semsig_gis.core import (
    DatabaseError,
    Displayed,
    InputError,
    brief,
    export_with,
    map_with,
    place_locked,
)
from semsig_gis.database.database import SignatureDatabase
from semsig_gis.database.file import (
    INPUTS,
    KIND,
    Manifest,
    PartitionedDatabase,
    is_folder,
    open_database,
    open_dataset,
    part_files,
    read_manifest,
    read_specs,
    require_file,
)
from semsig_gis.database.store import (
    BUILT_DIGEST,
    SQUARE_M,
    built_digest,
    current_store,
    file_state,
    ground_licenses,
    names_in,
    open_store,
)
from semsig_gis.storage import digest, read_geoparquet, whole_folder, write_geoparquet

if TYPE_CHECKING:
    from collections.abc import Callable

    import geopandas as gpd
    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Axes, MapFrame
    from semsig_gis.database.database import CellGeometry
    from semsig_gis.database.place_names import PlaceNames
    from semsig_gis.database.store import ObjectStore
    from semsig_gis.objects import StreetObjects


ADDED = "added"
GEOMETRY = "geometry"


_Value = TypeVar("_Value")


class City(Displayed):
    """A signature database with its object store and added columns, by `open_city` or `build`.

    Each of them is read at the first access; the database keeps what questions compute from it.

    Parameters
    ----------
    path : str or Path, optional
        File of the database, or folder of its parts; None for a city only in memory.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import open_city, save_database
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     city = open_city(f"{folder}/city.parquet")
    ...     len(city.database) == len(demo_database)
    True
    """

    def __init__(self, path: str | Path | None = None) -> None:
        self._path = None if path is None else Path(path)
        self._read_state: tuple[int, ...] | None = None
        self._names: dict[tuple[int, int], PlaceNames] = {}

    def _facts(self) -> dict[str, object]:
        file = "none, in memory" if self._path is None else self._path
        is_read = "database" in vars(self)
        return {"file": file, **({"cells": len(self.database)} if is_read else {})}

    @property
    def path(self) -> Path:
        """The file or folder; DatabaseError if the city is only in memory."""
        if self._path is None:
            raise DatabaseError(
                "the city is only in memory; give `build` a file to write, or write it with "
                "save_with_store(city.database, city.store, 'city.parquet')."
            )
        return self._path

    @property
    def _in_parts(self) -> bool:
        return self._path is not None and self._path.is_dir()

    @cached_property
    def database(self) -> SignatureDatabase:
        """The whole database (see `open_database`)."""
        dataset = self.dataset if self._in_parts else None
        if isinstance(dataset, PartitionedDatabase):
            return self._read(lambda _: dataset.whole())
        return self._read(open_database)

    @cached_property
    def dataset(self) -> SignatureDatabase | PartitionedDatabase:
        """The database; if it is in parts, without reading them all (see `open_dataset`)."""
        return self._read(open_dataset) if self._in_parts else self.database

    @property
    def licenses(self) -> tuple[str, ...]:
        """Attribution and licence of each source, also of what only names places and is on maps."""
        return tuple(dict.fromkeys((*self.database.licenses, *self.ground_licenses)))

    @cached_property
    def ground_licenses(self) -> tuple[str, ...]:
        """Attribution and licence of the buildings and streets; empty without a store.

        Of a database in parts, no building or street is read.
        """
        try:
            in_parts = self._in_parts and "store" not in vars(self)
            return ground_licenses(self.path) if in_parts else self.store.ground_licenses
        except DatabaseError:
            return ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of the database, or the files of its parts; DatabaseError if one is missing."""
        if self.path.is_dir():
            return part_files(self.path)
        require_file(self.path)
        return (self.path,)

    @property
    def bytes(self) -> int:
        """Size of the file, or of the manifest and the parts."""
        files = self.path.iterdir() if self.path.is_dir() else [self.path]
        return sum(file.stat().st_size for file in files if file.is_file())

    @property
    def digest(self) -> str:
        """SHA-256 digest of the database; columns added to a single file do not change it."""
        files = self.files
        return built_digest(*files) if len(files) == 1 else digest(*files)

    @property
    def store_path(self) -> Path:
        """The folder of the object store, which may not exist."""
        return self.path / INPUTS if self.path.is_dir() else current_store(self.path)

    @property
    def has_store(self) -> bool:
        """Whether the database has an object store."""
        return "store" in vars(self) or self.store_path.is_dir()

    @cached_property
    def store(self) -> ObjectStore:
        """The object store; DatabaseError if it is missing or cannot be used."""
        return self._read(open_store)

    def _read(self, read: Callable[[Path], _Value]) -> _Value:
        """Read from the path; DatabaseError if the file has been replaced since the first read."""
        before = self._read_state or file_state(self.path)
        value = read(self.path)
        if file_state(self.path) != before:
            raise DatabaseError(
                f"another program has changed {self.path} in the meantime; run the same command "
                "again."
            )
        self._read_state = before
        return value

    @property
    def objects(self) -> StreetObjects | None:
        """The objects that the database was built from; None if its store cannot be used."""
        try:
            return self.store.objects
        except DatabaseError:
            return None

    def place_name(self, x: float, y: float) -> str:
        """Return a place in words (see `ObjectStore.place_name`); empty without a store.

        Of a database in parts, only what is near the place is read.
        """
        try:
            if not self._in_parts or "store" in vars(self):
                return self.store.place_name(x, y)
            square = int(x // SQUARE_M), int(y // SQUARE_M)
            if square not in self._names:
                self._names[square] = names_in(self.path, square)
            return self._names[square].of(x, y)
        except DatabaseError:
            return ""

    def ground_around(self, xy: NDArray[np.float64]) -> dict[str, Any]:
        """Return the ground of cells as `ObjectStore.ground_around` does; empty without a store."""
        try:
            return self.store.ground_around(xy)
        except DatabaseError:
            return {}

    @property
    def object_counts(self) -> dict[int, int] | None:
        """Number of objects by class code; None if the store cannot be used."""
        return None if self.objects is None else self.objects.class_counts

    @property
    def has_columns(self) -> bool:
        """Whether columns were added to the file or a part."""
        return self._path is not None and any(read_specs(file).get(ADDED) for file in self.files)

    def to_geodataframe(self, *, geometry: CellGeometry = "polygon") -> gpd.GeoDataFrame:
        """Return the cells as a table (see `SignatureDatabase.to_geodataframe`)."""
        return self.database.to_geodataframe(geometry=geometry)

    def plot(
        self,
        column: str | ArrayLike | None = None,
        *,
        ax: Axes | None = None,
        **look: Any,  # noqa: ANN401 - options of matplotlib
    ) -> Axes:
        """Draw the cells (see `plot_database`)."""
        return self.database.plot(column, ax=ax, **look)

    def explore(self) -> MapFrame:
        """Show the cells on a map in a notebook, by the number of cells with equal signatures."""
        ground = self.ground_around(self.database.xy)
        return map_with("ambiguity_map", self.database, ground=ground)

    def export(self, path: str | Path) -> None:
        """Write the cells and the street objects in the format of a suffix (`export_database`).

        DatabaseError if there is an object store that cannot be used, for example because another
        program has changed it.
        """
        inputs = {"objects": self.store.objects, **self.store.ground} if self.has_store else {}
        export_with("export_database", self.database, path, **inputs)

    def columns(self, name: str) -> tuple[pa.Table, dict[str, Any]] | None:
        """Return the columns that were added to the database under a name, and their facts.

        The table has ``cell_id``, ascending, and the columns. DatabaseError if the parts differ.
        """
        if self._path is None:
            return None
        files = self.files
        entries = [read_specs(file).get(ADDED, {}).get(name) for file in files]
        if not any(entries):
            return None
        if any(entry != entries[0] for entry in entries):
            raise DatabaseError(
                f"the parts of {self.path} do not agree on their {name}; compute it again."
            )
        try:
            names, facts = ["cell_id", *map(str, entries[0]["columns"])], dict(entries[0]["facts"])
        except (KeyError, TypeError, ValueError) as error:
            raise DatabaseError(
                f"the {name} in {self.path} is damaged ({brief(error)}); compute it again."
            ) from error
        tables = [read_geoparquet(file, kind=KIND, columns=names)[0] for file in files]
        return pa.concat_tables(tables).sort_by("cell_id"), facts

    def put_columns(
        self, name: str, columns: pa.Table, *, cell_ids: NDArray[np.int64], facts: dict[str, Any]
    ) -> None:
        """Add columns to the database, replacing columns stored under the same name.

        `columns` has a row for each of `cell_ids`, ascending, which are all cells of the database;
        `facts` describe the columns, as plain values for JSON. The file, or the folder of parts, is
        replaced as a whole. DatabaseError if the database has other cells.
        """
        added = {name: {"columns": columns.column_names, "facts": facts}}
        with place_locked(Path(os.path.realpath(self.path))):
            self._read(file_state)
            self._write_columns(columns, cell_ids, added)
            self._read_state = None

    def _write_columns(
        self, columns: pa.Table, cell_ids: NDArray[np.int64], added: dict[str, Any]
    ) -> None:
        if not self.path.is_dir():
            _write_with_columns(self.path, self.path, columns, cell_ids, added)
            return
        files, manifest = self.files, read_manifest(self.path)
        with whole_folder(self.path) as partial:
            parts = []
            for file, part in zip(files, manifest.parts, strict=True):
                new = partial / file.name
                _write_with_columns(file, new, columns, cell_ids, added)
                parts.append(replace(part, bytes=new.stat().st_size, sha256=digest(new)))
            Manifest(manifest.recipe, tuple(parts), manifest.inputs).write(partial)
            if self.has_store:
                shutil.copytree(self.store_path, partial / INPUTS)


def whole_database(cells: SignatureDatabase | City | str | Path) -> SignatureDatabase:
    """Return the database at a path or of a city, or a database as it is; InputError for others."""
    if isinstance(cells, City):
        return cells.database
    if isinstance(cells, str | Path):
        return open_database(cells)
    if not isinstance(cells, SignatureDatabase):
        raise InputError(
            f"a {type(cells).__name__} was given as the database; give a path, a city such as "
            "build makes of street objects or open_city returns, or a signature database."
        )
    return cells


def open_city(path: str | Path) -> City:
    """Open a signature database with its object store and added columns.

    Parameters
    ----------
    path : str or Path
        File of the database, or folder of its parts.

    Returns
    -------
    City
        The city; its database, store and columns are read at the first access.

    Raises
    ------
    DatabaseError
        If there is no such file or folder.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import ObjectStore, save_with_store
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_with_store(demo_database, ObjectStore.of(demo_objects), f"{folder}/city.parquet")
    ...     city = open_city(f"{folder}/city.parquet")
    ...     len(city.database) == len(demo_database), len(city.store.objects) == len(demo_objects)
    (True, True)
    """
    if not is_folder(path):
        require_file(path)
    return City(path)


def _write_with_columns(
    path: Path, out: Path, columns: pa.Table, cell_ids: NDArray[np.int64], added: dict[str, Any]
) -> None:
    """Copy the file of a database or of a part with added columns."""
    table, specs, _ = read_geoparquet(path, kind=KIND)
    cells = table["cell_id"].to_numpy()
    rows = np.minimum(np.searchsorted(cell_ids, cells), len(cell_ids) - 1)
    if not np.array_equal(cell_ids[rows], cells):
        raise DatabaseError(
            f"the cells of {path} have changed since it was opened; open the database again."
        )
    before = specs.get(ADDED, {})
    replaced = [name for key in before.keys() & added for name in before[key]["columns"]]
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
