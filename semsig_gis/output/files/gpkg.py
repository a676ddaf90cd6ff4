"""GeoPackage: many layers, with their styles and a project for QGIS."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import InputError
from semsig_gis.output.features import write_errors, write_features
from semsig_gis.output.files import writer
from semsig_gis.output.layers.model import GEOMETRY_TYPES
from semsig_gis.output.qgis.project import layer_style, project_archive, shown_layers
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.output.layers.model import Layer, Progress


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


@writer("layers")
def write_geopackage(
    layers: Sequence[Layer], path: str | Path, *, progress: Progress = None
) -> None:
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
