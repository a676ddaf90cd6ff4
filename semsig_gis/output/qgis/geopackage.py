"""Write GeoPackages of several layers with styles for QGIS, and read the cells back."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
from pyogrio.errors import DataLayerError, DataSourceError
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import (
    BEARING_UNITS,
    CLASS_CODE,
    COUNT,
    DISTANCE_UNITS,
    GEOMETRY,
    MERGED,
    SOURCE,
    SOURCE_ID,
    DatabaseError,
    Displayed,
    InputError,
    Taxonomy,
    crs_label,
)
from semsig_gis.database import database_of
from semsig_gis.evaluation import identifiability_of
from semsig_gis.objects import objects_of
from semsig_gis.output.features import write_errors, write_features
from semsig_gis.output.layers.model import GEOMETRY_TYPES
from semsig_gis.output.qgis.project import layer_style, project_archive, shown_layers
from semsig_gis.storage import parse_json, whole_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import DTypeLike

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability
    from semsig_gis.objects import StreetObjects
    from semsig_gis.output.layers.model import Layer, Progress


CELLS, OBJECTS = "cells", "objects"
CELL_COLUMNS = ("cell_id", "types", "bearings", "distances")
OBJECT_COLUMNS = (CLASS_CODE, SOURCE, SOURCE_ID, COUNT, MERGED)
# Prefixes of the columns of `Identifiability.table`.
IDENTIFIABILITY_COLUMNS = ("chance_", "bits_", "lookalike_", "gain_")
ROWS_A_BATCH = 1 << 16

PROJECT_NAME = "semsig"
VERSION = "1.2"  # the newest that QGIS 3.22 opens without a warning
# The table of styles as QGIS creates it, except that its dates follow the GeoPackage standard.
STYLES = """
CREATE TABLE layer_styles (
  id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
  f_table_catalog TEXT(256), f_table_schema TEXT(256), f_table_name TEXT(256),
  f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
  useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
  update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
);
INSERT INTO gpkg_contents (table_name, data_type, identifier, description, srs_id)
VALUES ('layer_styles', 'attributes', 'layer_styles', 'How QGIS draws the layers.', 0);
"""
STYLE = """
INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column,
  styleName, styleQML, styleSLD, useAsDefault, description, owner)
SELECT '', '', table_name, coalesce(column_name, ''), ?, ?, '', ?, ?, ''
FROM gpkg_contents LEFT JOIN gpkg_geometry_columns USING (table_name) WHERE table_name = ?
"""
# The tables of field names and descriptions, from the schema extension of GeoPackages.
FIELDS = """
CREATE TABLE gpkg_data_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, name TEXT, title TEXT, description TEXT,
  mime_type TEXT, constraint_name TEXT,
  CONSTRAINT pk_gdc PRIMARY KEY (table_name, column_name),
  CONSTRAINT gdc_tn UNIQUE (table_name, name)
);
CREATE TABLE gpkg_data_column_constraints (
  constraint_name TEXT NOT NULL, constraint_type TEXT NOT NULL, value TEXT, min NUMERIC,
  min_is_inclusive BOOLEAN, max NUMERIC, max_is_inclusive BOOLEAN, description TEXT,
  CONSTRAINT gdcc_ntv UNIQUE (constraint_name, constraint_type, value)
);
INSERT INTO gpkg_extensions (table_name, extension_name, definition, scope)
SELECT column1, 'gpkg_schema', 'http://www.geopackage.org/spec121/#extension_schema', 'read-write'
FROM (VALUES ('gpkg_data_columns'), ('gpkg_data_column_constraints'));
"""
FIELD = """
INSERT INTO gpkg_data_columns (table_name, column_name, name, title, description)
VALUES (?, ?, ?, ?, ?)
"""
# The table of projects as QGIS creates it; the content is a .qgz file in hexadecimal digits.
PROJECTS = "CREATE TABLE qgis_projects (name TEXT PRIMARY KEY, metadata BLOB, content BLOB)"
PROJECT = """
INSERT INTO qgis_projects VALUES (?, json_object('last_modified_time',
  strftime('%Y-%m-%dT%H:%M:%S', 'now'), 'last_modified_user', 'semsig'), ?)
"""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GeopackageContents(Displayed):
    """Contents of a GeoPackage of a city.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    objects : StreetObjects or None
        The objects, if they were exported.
    identifiability : Identifiability or None
        The identifiability, if it was exported and its cells have not been changed.
    notes : tuple of str
        Omitted contents and the reasons, one sentence each.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import export_database
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_database(demo_database, f"{folder}/city.gpkg", objects=demo_objects)
    ...     contents = read_geopackage(f"{folder}/city.gpkg")
    >>> len(contents.objects) == len(demo_objects), contents.identifiability
    (True, None)
    """

    database: SignatureDatabase
    objects: StreetObjects | None
    identifiability: Identifiability | None
    notes: tuple[str, ...]

    def _facts(self) -> dict[str, object]:
        return {
            "cells": len(self.database),
            "objects": "none" if self.objects is None else len(self.objects),
            "identifiability": "no" if self.identifiability is None else "yes",
            "CRS": crs_label(self.database.crs),
            "notes": len(self.notes),
        }


def read_geopackage(path: str | Path) -> GeopackageContents:
    """Read a GeoPackage that holds the cells of a city.

    Parameters
    ----------
    path : str or Path
        File that `export_database` wrote.

    Returns
    -------
    GeopackageContents
        The database, and the objects and the identifiability that were exported with it.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged, or has other contents.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import export_database
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_database(demo_database, f"{folder}/city.gpkg")
    ...     again = read_geopackage(f"{folder}/city.gpkg").database
    >>> bool((again.bearing_units == demo_database.bearing_units).all())
    True
    """
    if not os.path.isfile(path):  # noqa: PTH113 - it returns False where Path.is_file raises
        what = "is a folder" if os.path.isdir(path) else "does not exist"  # noqa: PTH112
        raise DatabaseError(f"{path} {what}; give a GeoPackage that semsig export wrote.")
    notes: list[str] = []
    try:
        names = pyogrio.list_layers(path)[:, 0].tolist()
        if CELLS not in names:
            raise DatabaseError(
                f"{path} has no layer {CELLS!r}; give a GeoPackage with the cells of a database."
            )
        specs, crs, fields = _read_specs(path, CELLS)
        chances = [name for name in fields if name.startswith(IDENTIFIABILITY_COLUMNS)]
        columns = [*CELL_COLUMNS, *(chances if specs["identifiability"] else [])]
        cells = _read_columns(path, CELLS, columns).sort_by("cell_id")
        # Degrees and metres become the integer units of a database again.
        reach = Taxonomy.from_list(specs["taxonomy"]).ranges(specs["signature"]["radius"]).max()
        signatures = pa.table(
            {
                "cell_id": cells["cell_id"],
                "types": cells["types"],
                "bearings": _units(cells["bearings"], BEARING_UNITS / 360.0, np.uint16),
                "distances": _units(cells["distances"], DISTANCE_UNITS / float(reach), np.uint8),
            }
        )
        database = database_of(signatures, specs, crs, path=path)
        identifiability = None
        if specs["identifiability"]:
            try:
                identifiability = identifiability_of(
                    database, cells.select(chances), specs["identifiability"], path
                )
            except DatabaseError as error:
                notes.append(str(error))
        objects = _read_objects(path) if OBJECTS in names else None
    except (
        *(DataSourceError, DataLayerError, CRSError, pa.ArrowException),
        *(OSError, ValueError, LookupError, TypeError),
    ) as error:
        raise DatabaseError(
            f"{path} is damaged, or was not written by semsig export; export the database again."
        ) from error
    return GeopackageContents(
        database=database, objects=objects, identifiability=identifiability, notes=tuple(notes)
    )


def _read_objects(path: str | Path) -> StreetObjects:
    specs, crs, fields = _read_specs(path, OBJECTS)
    table = _read_columns(path, OBJECTS, [name for name in OBJECT_COLUMNS if name in fields])
    columns = {name: table[name] for name in table.column_names}
    columns[CLASS_CODE] = columns[CLASS_CODE].cast(pa.uint8())
    # Features added in QGIS have no source and no count.
    columns[COUNT] = pc.fill_null(columns[COUNT].cast(pa.int32()), 1)
    columns |= {name: pc.fill_null(columns[name], "") for name in (SOURCE, SOURCE_ID)}
    if pc.min(columns[COUNT]).as_py() < 1:
        raise ValueError("a count of objects is below 1")
    return objects_of(pa.table(columns), specs, crs, path=path)


def _read_specs(path: str | Path, layer: str) -> tuple[dict[str, Any], CRS, list[str]]:
    """Return the specs of a layer, its CRS and the names of its fields."""
    info = pyogrio.read_info(path, layer=layer)
    metadata = info["layer_metadata"] or {}
    # GDAL adds entries with names in capital letters.
    specs = {
        name: parse_json(text, finite=True) for name, text in metadata.items() if name.islower()
    }
    return specs, CRS.from_user_input(specs.pop("crs")), list(info["fields"])


def _read_columns(path: str | Path, layer: str, columns: list[str]) -> pa.Table:
    """Return columns of a layer; for objects, also the geometry."""
    with pyogrio.open_arrow(
        path,
        layer=layer,
        columns=columns,
        read_geometry=layer == OBJECTS,
        batch_size=ROWS_A_BATCH,
        use_pyarrow=True,
    ) as (metadata, reader):
        table = reader.read_all()
    return table.rename_columns(
        [GEOMETRY if name == metadata["geometry_name"] else name for name in table.column_names]
    )


def _units(texts: pa.ChunkedArray, units: float, kind: DTypeLike) -> pa.ChunkedArray:
    """Parse numbers separated by spaces; return a list of whole units for each text."""
    lists = []
    for chunk in texts.chunks:
        parts = pc.split_pattern(chunk, " ")
        values = np.rint(parts.flatten().cast(pa.float64()).to_numpy() * units)
        if not ((values >= 0) & (values <= np.iinfo(kind).max)).all():
            raise ValueError(f"a number is out of range among {len(values)}")
        starts = parts.offsets.to_numpy()
        units_of_cells = pa.array(values.astype(kind))
        lists.append(pa.ListArray.from_arrays(pa.array(starts - starts[0]), units_of_cells))
    return pa.chunked_array(lists)


def write_layers(layers: Sequence[Layer], path: str | Path, *, progress: Progress = None) -> None:
    """Write at least one layer as one GeoPackage 1.2, atomically.

    The table ``layer_styles`` holds the styles of QGIS; the metadata of each layer hold the specs,
    the classes and the licences as JSON. The rows are written in blocks to limit the memory.
    Raises `InputError` if the file is open in another program.
    """
    target = Path(path)
    _require_closed(target)
    rows, written = sum(layer.rows for layer in layers), 0

    def advance(count: int, _: int) -> None:
        if progress is not None:
            progress(written + count, rows)

    with whole_file(target) as partial:
        with write_errors(target):
            for layer in layers:
                # The metadata belong to the layer: for metadata of the file, GDAL would write a
                # copy into the folder whenever the file is read.
                write_features(
                    layer,
                    partial,
                    "GPKG",
                    advance,
                    append=partial.exists() and partial.stat().st_size > 0,
                    dataset_options={"VERSION": VERSION},
                    layer_metadata=layer.metadata_texts,
                    layer_options={"IDENTIFIER": layer.title, "DESCRIPTION": layer.abstract},
                )
                written += layer.rows
            _write_styles(layers, partial, target.name)
            _check_indexes(layers, partial)
        # Another program may have opened the old file in the meantime.
        _require_closed(target)


def _write_styles(layers: Sequence[Layer], path: Path, file: str) -> None:
    """Write the styles and field names of the layers for QGIS, and a project of the file `file`."""
    shown = shown_layers(layers, file)
    by_name = {item.layer.name: item for item in shown}
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(STYLES + FIELDS + PROJECTS)
        for layer in layers:
            # A table without geometry has only the style of its field names.
            for number, style in enumerate(layer.styles or (None,)):
                name = "Fields" if style is None else style.name
                qml = layer_style(by_name[layer.name], style)
                connection.execute(STYLE, (name, qml, number == 0, layer.title, layer.name))
            for column in layer.columns:
                row = (layer.name, column.name, column.alias, column.alias, column.about)
                connection.execute(FIELD, row)
        archive = project_archive(layers, shown, Path(file).stem)
        connection.execute(PROJECT, (PROJECT_NAME, archive.hex()))


def _check_indexes(layers: Sequence[Layer], path: Path) -> None:
    """Check that all rows are in the spatial indexes.

    GDAL writes the indexes last, when it closes a layer, and reports no error if that fails.
    """
    with contextlib.closing(sqlite3.connect(path)) as connection:
        for layer in layers:
            if layer.geometry not in GEOMETRY_TYPES:
                continue
            count = f"SELECT count(*) FROM rtree_{layer.name}_geom"  # noqa: S608 - our own names
            if connection.execute(count).fetchone()[0] != layer.rows:
                raise sqlite3.DatabaseError("the spatial indexes are not complete")


def _require_closed(path: Path) -> None:
    """Raise if another program has the GeoPackage open.

    SQLite would apply its log to the new file, and what it writes would be lost.
    """
    real = Path(os.path.realpath(path))
    logs = [real.with_name(f"{real.name}-{kind}") for kind in ("wal", "journal")]
    # os.path returns False where Path raises.
    if any(map(os.path.exists, logs)) or (os.path.isfile(real) and _is_locked(real)):  # noqa: PTH113
        raise InputError(
            f"{path} is open in another program, such as QGIS, or was left half-written by one; "
            "close it there, or give another name."
        )


def _is_locked(path: Path) -> bool:
    """Return whether another program holds a lock on an SQLite file."""
    uri = f"{path.as_uri()}?mode=rw"
    try:
        with contextlib.closing(sqlite3.connect(uri, uri=True, timeout=0)) as connection:
            connection.execute("BEGIN EXCLUSIVE").connection.rollback()
    except sqlite3.Error as error:
        # A file with any other error, such as one that is no database, may be replaced.
        return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY
    return False
