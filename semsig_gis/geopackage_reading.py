"""Read a database back from a GeoPackage that `semsig_gis.exports.geopackage` wrote.

Nothing is lost: the texts of the cells are exact to the unit, and the metadata holds the rest.
Cells and objects that were deleted or added in between, in QGIS say, are read as they are.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
from pyogrio.errors import DataLayerError, DataSourceError
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.database import BEARING_UNITS, DISTANCE_UNITS
from semsig_gis.database_file import database_of
from semsig_gis.errors import DatabaseError
from semsig_gis.identifiability_file import identifiability_of
from semsig_gis.objects import objects_of
from semsig_gis.schema import CLASS_CODE, COUNT, GEOMETRY, MERGED, SOURCE, SOURCE_ID
from semsig_gis.taxonomy import Taxonomy

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import DTypeLike

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.identifiability import Identifiability
    from semsig_gis.objects import StreetObjects

__all__ = ["GeopackageContents", "read_geopackage"]

CELLS, OBJECTS = "cells", "objects"
CELL_COLUMNS = ("cell_id", "types", "bearings", "distances")
OBJECT_COLUMNS = (CLASS_CODE, SOURCE, SOURCE_ID, COUNT, MERGED)
# How the columns of `Identifiability.table` begin.
TOLD = ("chance_", "bits_", "lookalike_", "gain_")
ROWS_A_BATCH = 1 << 16


@dataclass(frozen=True, eq=False, kw_only=True)
class GeopackageContents:
    """What a GeoPackage holds of a city.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    objects : StreetObjects or None
        The street objects, where they were exported too.
    identifiability : Identifiability or None
        What is known of the cells before any query, where that was exported too and still fits.
    notes : tuple of str
        What was left out, and why, a sentence each.
    """

    database: SignatureDatabase
    objects: StreetObjects | None
    identifiability: Identifiability | None
    notes: tuple[str, ...]


def read_geopackage(path: str | Path) -> GeopackageContents:
    """Read a GeoPackage that holds the cells of a city.

    Parameters
    ----------
    path : str or Path
        File that `semsig_gis.exports.export_database` wrote.

    Returns
    -------
    GeopackageContents
        The database, and what was exported with it, as they were.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged, or holds something else.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.exports import export_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_database(database, f"{folder}/city.gpkg")
    ...     again = read_geopackage(f"{folder}/city.gpkg").database
    >>> bool((again.bearing_units == database.bearing_units).all())
    True
    """
    if not os.path.isfile(path):  # noqa: PTH113 - it answers where Path.is_file raises
        what = "is a folder" if os.path.isdir(path) else "does not exist"  # noqa: PTH112
        msg = f"{path} {what}; give a GeoPackage that semsig export wrote."
        raise DatabaseError(msg)
    notes: list[str] = []
    try:
        names = pyogrio.list_layers(path)[:, 0].tolist()
        if CELLS not in names:
            msg = f"{path} has no layer {CELLS!r}; give a GeoPackage with the cells of a database."
            raise DatabaseError(msg)
        specs, crs, fields = _facts(path, CELLS)
        told_fields = [name for name in fields if name.startswith(TOLD)]
        wanted = [*CELL_COLUMNS, *(told_fields if specs["identifiability"] else [])]
        cells = _read(path, CELLS, wanted).sort_by("cell_id")
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
        told = None
        if specs["identifiability"]:
            try:
                columns = cells.select(told_fields)
                told = identifiability_of(database, columns, specs["identifiability"], path)
            except DatabaseError as error:
                notes.append(str(error))
        objects = _objects(path) if OBJECTS in names else None
    except (
        *(DataSourceError, DataLayerError, CRSError, pa.ArrowException),
        *(OSError, ValueError, LookupError, TypeError),
    ) as error:
        msg = f"{path} is damaged, or was not written by semsig export; export the database again."
        raise DatabaseError(msg) from error
    return GeopackageContents(
        database=database, objects=objects, identifiability=told, notes=tuple(notes)
    )


def _objects(path: str | Path) -> StreetObjects:
    specs, crs, fields = _facts(path, OBJECTS)
    table = _read(path, OBJECTS, [name for name in OBJECT_COLUMNS if name in fields])
    kinds = {CLASS_CODE: pa.uint8(), COUNT: pa.int32()}
    columns = {
        name: table[name].cast(kinds[name]) if name in kinds else table[name]
        for name in table.column_names
    }
    # What was drawn in QGIS tells neither its source nor how often it was listed.
    unknown: dict[str, str | int] = {SOURCE: "", SOURCE_ID: "", COUNT: 1}
    columns |= {name: pc.fill_null(columns[name], value) for name, value in unknown.items()}
    if pc.min(columns[COUNT]).as_py() < 1:
        msg = "an object stands for fewer than one"
        raise ValueError(msg)
    return objects_of(pa.table(columns), specs, crs, path=path)


def _facts(path: str | Path, layer: str) -> tuple[dict[str, Any], CRS, list[str]]:
    """Return the specs of a layer, its CRS and the names of its fields."""
    info = pyogrio.read_info(path, layer=layer)
    told = info["layer_metadata"] or {}
    # GDAL's own are in capital letters.
    specs = {name: json.loads(text) for name, text in told.items() if name.islower()}
    return specs, CRS.from_user_input(specs.pop("crs")), list(info["fields"])


def _read(path: str | Path, layer: str, columns: list[str]) -> pa.Table:
    """Return columns of a layer, and its geometry if it is that of objects."""
    with pyogrio.open_arrow(
        path,
        layer=layer,
        columns=columns,
        read_geometry=layer == OBJECTS,
        batch_size=ROWS_A_BATCH,
        use_pyarrow=True,
    ) as (facts, reader):
        table = reader.read_all()
    return table.rename_columns(
        [GEOMETRY if name == facts["geometry_name"] else name for name in table.column_names]
    )


def _units(texts: pa.ChunkedArray, units: float, kind: DTypeLike) -> pa.ChunkedArray:
    """Return numbers that stand in texts as lists of whole units."""
    lists = []
    for chunk in texts.chunks:
        parts = pc.split_pattern(chunk, " ")
        values = np.rint(parts.flatten().cast(pa.float64()).to_numpy() * units)
        if not ((values >= 0) & (values <= np.iinfo(kind).max)).all():
            msg = f"a number is out of range among {len(values)}"
            raise ValueError(msg)
        starts = parts.offsets.to_numpy()
        units_of_cells = pa.array(values.astype(kind))
        lists.append(pa.ListArray.from_arrays(pa.array(starts - starts[0]), units_of_cells))
    return pa.chunked_array(lists)
