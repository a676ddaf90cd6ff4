"""GeoPackages: cells, street objects, an evaluation and an answer as layers that QGIS colours."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyogrio
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from semsig_gis import __version__
from semsig_gis.errors import InputError
from semsig_gis.exports._layers import GEOMETRY_TYPES
from semsig_gis.schema import GEOMETRY
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from semsig_gis.exports._layers import Layer

__all__ = ["write_layers"]

# The newest version that QGIS 3.22 opens without a warning.
VERSION = "1.2"
# As QGIS makes it, but for the dates, which it leaves to the rules of GeoPackages.
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
SELECT '', '', table_name, column_name, ?, ?, '', ?, ?, '' FROM gpkg_geometry_columns
WHERE table_name = ?
"""


def write_layers(
    layers: Sequence[Layer],
    path: str | Path,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write at least one layer as one GeoPackage 1.2, which appears whole, by rename.

    The table ``layer_styles`` holds the styles with which QGIS draws the layers. The metadata of
    each layer holds the specs, the classes and the licences as JSON; its description holds the
    licences as text. The rows are written in blocks, so that memory stays flat; ``progress`` is
    called with the rows written and in all. Raises `InputError` if the file is open in another
    program.
    """
    target = Path(path)
    if target.suffix.lower() != ".gpkg":
        msg = f"{target} does not end in .gpkg; give the name of a GeoPackage file."
        raise InputError(msg)
    _require_closed(target)
    rows = sum(layer.rows for layer in layers)
    with whole_file(target) as partial:
        try:
            blocks = (_write_layer(layer, partial) for layer in layers)
            for done in itertools.accumulate(itertools.chain.from_iterable(blocks)):
                if progress is not None:
                    progress(done, rows)
            _add_styles(layers, partial)
            _check_indexes(layers, partial)
        except (DataSourceError, DataLayerError, FeatureError, sqlite3.Error) as error:
            # GDAL's own words are pages of SQL; they stay with the cause.
            msg = (
                f"{target} could not be written whole, so what was there before is unchanged; "
                "free some space or choose another folder."
            )
            raise InputError(msg) from error
        _require_closed(target)


def _write_layer(layer: Layer, path: Path) -> Iterator[int]:
    """Write one layer block by block, and yield the number of rows of each block."""
    code = layer.crs.to_epsg()
    told = {
        **layer.facts,
        "licenses": list(layer.licenses),
        "written_by": f"semsig_gis {__version__}",
    }
    # Of the layer and not of the file: for that, GDAL leaves a copy beside the file whenever the
    # file is read.
    once: dict[str, Any] = {
        "layer_metadata": {
            name: json.dumps(value, allow_nan=False) for name, value in told.items()
        },
        "layer_options": {
            "IDENTIFIER": layer.title,
            "DESCRIPTION": "\n".join([layer.description, *layer.licenses]),
        },
    }
    for number, block in enumerate(layer.blocks()):
        pyogrio.write_arrow(
            block,
            path,
            layer=layer.name,
            driver="GPKG",
            geometry_name=GEOMETRY,
            geometry_type=GEOMETRY_TYPES[layer.geometry],
            crs=layer.crs.to_wkt() if code is None else f"EPSG:{code}",
            append=number > 0,
            dataset_options={"VERSION": VERSION},
            **(once if number == 0 else {}),
        )
        yield len(block)


def _add_styles(layers: Sequence[Layer], path: Path) -> None:
    """Write how QGIS draws the layers."""
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(STYLES)
        for layer in layers:
            for number, style in enumerate(layer.styles):
                values = (style.name, style.qml, number == 0, layer.title, layer.name)
                connection.execute(STYLE, values)


def _check_indexes(layers: Sequence[Layer], path: Path) -> None:
    """Check that all rows are in the spatial indexes.

    They are the last to be written, when a layer is closed, and GDAL keeps quiet if that fails.
    """
    with contextlib.closing(sqlite3.connect(path)) as connection:
        for layer in layers:
            count = f"SELECT count(*) FROM rtree_{layer.name}_geom"  # noqa: S608 - our own names
            if connection.execute(count).fetchone()[0] != layer.rows:
                msg = "the spatial indexes are not complete"
                raise sqlite3.DatabaseError(msg)


def _require_closed(path: Path) -> None:
    """Refuse to replace a GeoPackage that another program has open.

    Its log would be taken for that of the new file, and what it writes would be lost.
    """
    real = Path(os.path.realpath(path))
    logs = [real.with_name(f"{real.name}-{kind}") for kind in ("wal", "journal")]
    # os.path answers where Path raises.
    if any(map(os.path.exists, logs)) or (os.path.isfile(real) and _is_locked(real)):  # noqa: PTH113
        msg = (
            f"{path} is open in another program, such as QGIS, or was left half-written by one; "
            "close it there, or give another name."
        )
        raise InputError(msg)


def _is_locked(path: Path) -> bool:
    """Return whether another program reads from or writes to an SQLite file just now."""
    place = f"{path.as_uri()}?mode=rw"
    try:
        with contextlib.closing(sqlite3.connect(place, uri=True, timeout=0)) as connection:
            connection.execute("BEGIN EXCLUSIVE").connection.rollback()
    except sqlite3.Error as error:
        # Whatever else it is, it may be replaced.
        return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY
    return False
