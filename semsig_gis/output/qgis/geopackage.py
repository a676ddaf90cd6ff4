"""Read a database back from a GeoPackage that was exported."""

from __future__ import annotations

import os
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
    FULL_TURN,
    GEOMETRY,
    MERGED,
    SOURCE,
    SOURCE_ID,
    DatabaseError,
    Displayed,
    DistanceScale,
    Taxonomy,
    crs_label,
)
from semsig_gis.database import EXTENT_UNITS, EXTENTS, cells_checksum, database_of
from semsig_gis.evaluation import identifiability_of
from semsig_gis.objects import objects_of
from semsig_gis.output.layers.model import CHECKSUM, EXPORTED
from semsig_gis.storage import parse_json, sqlite_fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Identifiability
    from semsig_gis.objects import StreetObjects


CELLS, OBJECTS = "cells", "objects"
CELL_COLUMNS = ("cell_id", "types", "bearings", "distances")
OBJECT_COLUMNS = (CLASS_CODE, SOURCE, SOURCE_ID, COUNT, MERGED)
# Prefixes of the columns of `Identifiability.table`.
IDENTIFIABILITY_COLUMNS = ("chance_", "bits_", "lookalike_", "gain_")
ROWS_A_BATCH = 1 << 16


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
        Omitted contents and the reasons, and how cells and objects differ from those that were
        exported, one sentence each.

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
    if fault := sqlite_fault(Path(path)):
        raise DatabaseError(
            f"{path} is damaged, or was not written by semsig export ({fault}); export the "
            "database again."
        )
    try:
        names = pyogrio.list_layers(path)[:, 0].tolist()
        if CELLS not in names:
            raise DatabaseError(
                f"{path} has no layer {CELLS!r}; give a GeoPackage with the cells of a database."
            )
        specs, crs, fields = _read_specs(path, CELLS)
        chances = [name for name in fields if name.startswith(IDENTIFIABILITY_COLUMNS)]
        columns = [
            *CELL_COLUMNS,
            *([EXTENTS] if specs.get(EXTENTS) else []),
            *(chances if specs["identifiability"] else []),
        ]
        cells = _read_columns(path, CELLS, columns).sort_by("cell_id")
        # Degrees and metres become the integer units of a database again.
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        scale = DistanceScale.of(taxonomy, specs["signature"]["radius"])
        far = scale.reach + scale.unit / 2.0
        signatures = {
            "cell_id": cells["cell_id"],
            "types": cells["types"],
            "bearings": _units(cells["bearings"], _bearing_units, most=FULL_TURN),
            "distances": _units(cells["distances"], scale.units, most=far),
        }
        if EXTENTS in columns:
            signatures[EXTENTS] = _units(cells[EXTENTS], _extent_units, most=FULL_TURN)
        database = database_of(pa.table(signatures), specs, crs, path=path)
        identifiability = None
        if specs["identifiability"]:
            try:
                identifiability = identifiability_of(
                    database, cells.select(chances), specs["identifiability"], path
                )
            except DatabaseError as error:
                notes.append(str(error))
        notes += _changes(path, specs, CELLS, len(database), checksum=cells_checksum(database))
        objects = None
        if OBJECTS in names:
            objects, object_specs = _read_objects(path)
            if EXPORTED in specs:
                notes += _changes(path, object_specs, OBJECTS, len(objects))
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


def _changes(
    path: str | Path, specs: dict[str, Any], layer: str, rows: int, *, checksum: str | None = None
) -> list[str]:
    """Return a note on how a layer differs from what was exported; none if it is the same.

    Rows may be deleted and changed on purpose, but not without a word.
    """
    if EXPORTED not in specs:
        older = "was written by an older version, which did not count its rows"
        return [f"{path} {older}, so it is not known whether some are lost"]
    again = "if that is not on purpose, export the database again"
    if fewer := int(specs[EXPORTED]) - rows:
        more = f"{fewer:,} fewer" if fewer > 0 else f"{-fewer:,} more"
        return [f"the layer {layer} of {path} has {rows:,} rows, {more} than exported; {again}"]
    if checksum is not None and checksum != specs[CHECKSUM]:
        return [f"the layer {layer} of {path} was changed after it was exported; {again}"]
    return []


def _read_objects(path: str | Path) -> tuple[StreetObjects, dict[str, Any]]:
    """Return the street objects, and the specs of their layer."""
    specs, crs, fields = _read_specs(path, OBJECTS)
    table = _read_columns(path, OBJECTS, [name for name in OBJECT_COLUMNS if name in fields])
    columns = {name: table[name] for name in table.column_names}
    columns[CLASS_CODE] = columns[CLASS_CODE].cast(pa.uint8())
    # Features added in QGIS have no source and no count.
    columns[COUNT] = pc.fill_null(columns[COUNT].cast(pa.int32()), 1)
    columns |= {name: pc.fill_null(columns[name], "") for name in (SOURCE, SOURCE_ID)}
    if pc.min(columns[COUNT]).as_py() < 1:
        raise ValueError("a count of objects is below 1")
    return objects_of(pa.table(columns), specs, crs, path=path), specs


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
    # Where geoarrow is imported, geometry has a type of its own, which is stored as binary.
    kinds = [getattr(kind, "storage_type", kind) for kind in table.schema.types]
    table = table.cast(pa.schema(zip(table.column_names, kinds, strict=True)))
    return table.rename_columns(
        [GEOMETRY if name == metadata["geometry_name"] else name for name in table.column_names]
    )


def _bearing_units(bearings: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Return bearings in degrees as units of a database."""
    return np.rint(bearings * (BEARING_UNITS / FULL_TURN)).astype(np.uint16)


def _extent_units(degrees: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return widths in degrees as units of a database."""
    return np.rint(degrees * (EXTENT_UNITS / FULL_TURN)).astype(np.uint8)


def _units(
    texts: pa.ChunkedArray,
    units_of: Callable[[NDArray[np.float64]], NDArray[np.uint8 | np.uint16]],
    *,
    most: float,
) -> pa.ChunkedArray:
    """Parse numbers separated by spaces; return a list of the units of each text.

    Numbers are 0 to `most`.
    """
    lists = []
    for chunk in texts.chunks:
        parts = pc.split_pattern(chunk, " ")
        values = parts.flatten().cast(pa.float64()).to_numpy()
        if not ((values >= 0) & (values <= most)).all():
            raise ValueError(f"a number is out of range among {len(values)}")
        starts = parts.offsets.to_numpy()
        units = pa.array(units_of(values))
        lists.append(pa.ListArray.from_arrays(pa.array(starts - starts[0]), units))
    return pa.chunked_array(lists)
