"""Hand a database on: one GeoPackage with its cells and street objects, for QGIS and the like."""

from __future__ import annotations

import contextlib
import itertools
import json
import sqlite3
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyogrio
import shapely
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from semsig_gis import __version__
from semsig_gis.database import BEARING_UNITS, DISTANCE_UNITS
from semsig_gis.errors import InputError, UnknownNameError, nearest_name
from semsig_gis.schema import CLASS_CODE, CLASS_NAME, COUNT, GEOMETRY, SOURCE, SOURCE_ID
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.identifiability import Identifiability
    from semsig_gis.objects import StreetObjects

__all__ = ["CellGeometry", "export_geopackage"]

CellGeometry = Literal["polygon", "point"]

# The newest version that QGIS 3.22 opens without a warning.
_VERSION = "1.2"
_ROWS_A_BLOCK = 1 << 16


def export_geopackage(
    database: SignatureDatabase,
    path: str | Path,
    *,
    objects: StreetObjects | None = None,
    identifiability: Identifiability | None = None,
    geometry: CellGeometry = "polygon",
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write the cells, and the street objects if given, as one GeoPackage 1.2.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    path : str or Path
        File to write, ending in ``.gpkg``; it appears whole, by rename.
    objects : StreetObjects, optional
        The objects that the cells see, for a second layer.
    identifiability : Identifiability, optional
        What is known of the cells before any query, for more columns of the cells.
    geometry : {"polygon", "point"}, default "polygon"
        Whether a cell is drawn as its square or as its viewpoint.
    progress : callable, optional
        Called with the number of rows written and in all.

    Raises
    ------
    InputError
        If the file does not end in ``.gpkg`` or cannot be written, or the identifiability is that
        of other cells.
    UnknownNameError
        If there is no such geometry.

    Notes
    -----
    Layer ``cells``, in the CRS of the database: ``cell_id``, ``x`` and ``y`` (viewpoint, metres),
    ``length`` (objects seen), ``types`` (symbols), ``bearings`` (degrees to 0.01), ``levels``
    (angle levels) and ``distances`` (metres to 0.1), each of these four clockwise from north and
    the numbers separated by spaces; ``type_group_size`` and ``angle_group_size`` (cells that have
    the same types or the same angle levels, 1 where the cell is alone); and, where given, the
    columns of `semsig_gis.identifiability.Identifiability.table`.

    Layer ``objects``, in the CRS of the objects: ``class_code``, ``symbol``, ``class_name``,
    ``title``, ``source``, ``source_id``, ``count``.

    The metadata of the file and of each layer holds the specs, the classes and the licences as
    JSON; the description of each layer holds the licences as text. The rows are written in
    blocks, so that memory stays flat.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_geopackage(build_database(objects), f"{folder}/city.gpkg", objects=objects)
    ...     pyogrio.list_layers(f"{folder}/city.gpkg").tolist()
    [['cells', 'Polygon'], ['objects', 'Point']]
    """
    target = Path(path)
    if target.suffix.lower() != ".gpkg":
        msg = f"{target} does not end in .gpkg; give the name of a GeoPackage file."
        raise InputError(msg)
    if geometry not in get_args(CellGeometry):
        names = " or ".join(repr(name) for name in get_args(CellGeometry))
        hint = nearest_name(str(geometry), get_args(CellGeometry))
        msg = f"{geometry!r} is no geometry of a cell; give {names}{hint}."
        raise UnknownNameError(msg)
    if identifiability is not None and not np.array_equal(
        identifiability.database.cell_ids, database.cell_ids
    ):
        msg = (
            "the identifiability is that of other cells; give that of the database to be exported."
        )
        raise InputError(msg)
    rows = len(database) + (0 if objects is None else len(objects))
    with whole_file(target) as partial:
        try:
            written = _write_cells(database, partial, geometry, identifiability)
            if objects is not None:
                written = itertools.chain(written, _write_objects(objects, partial))
            for done in itertools.accumulate(written):
                if progress is not None:
                    progress(done, rows)
            _check_indexes(partial, rows)
        except (DataSourceError, DataLayerError, FeatureError, sqlite3.Error) as error:
            # GDAL's own words are pages of SQL; they stay with the cause.
            msg = (
                f"{target} could not be written whole, so what was there before is unchanged; "
                "free some space or choose another folder."
            )
            raise InputError(msg) from error


def _write_cells(
    database: SignatureDatabase,
    path: Path,
    geometry: CellGeometry,
    identifiability: Identifiability | None,
) -> Iterator[int]:
    """Write the cells, and yield the number of rows of each block."""
    facts = {
        "semsig_version": database.version,
        "grid": json.dumps(asdict(database.grid)),
        "signature": json.dumps(asdict(database.spec)),
        "taxonomy": json.dumps(database.taxonomy.to_list()),
        "licenses": json.dumps(database.licenses),
    }
    symbols = pa.array([chr(symbol) for symbol in database.taxonomy.symbol_bytes])
    degrees = pa.array([f"{unit * 360 / BEARING_UNITS:.2f}" for unit in range(BEARING_UNITS)])
    whole_numbers = pa.array([str(level) for level in range(1 << 8)])
    metres = pa.array(
        [f"{unit * database.reach / DISTANCE_UNITS:.2f}" for unit in range(DISTANCE_UNITS + 1)]
    )
    type_groups, angle_groups = database.type_group_sizes, database.angle_group_sizes

    def block(rows: slice) -> pa.Table:
        places = database.xy[rows]
        offsets = database.offsets[rows.start : rows.stop + 1]
        shapes = _squares(database, rows) if geometry == "polygon" else shapely.points(places)
        more = {}
        if identifiability is not None:
            told = identifiability.table(rows)
            more = dict(zip(told.column_names, told.columns, strict=True))
        return pa.table(
            {
                "cell_id": database.cell_ids[rows],
                "x": np.ascontiguousarray(places[:, 0]),
                "y": np.ascontiguousarray(places[:, 1]),
                "length": database.lengths[rows].astype(np.int32),
                "types": _joined(database.codes, offsets, texts=symbols, separator=""),
                "bearings": _joined(database.bearing_units, offsets, texts=degrees),
                "levels": _joined(database.levels, offsets, texts=whole_numbers),
                "distances": _joined(database.distance_units, offsets, texts=metres),
                "type_group_size": type_groups[rows],
                "angle_group_size": angle_groups[rows],
                **more,
                GEOMETRY: shapely.to_wkb(shapes),
            }
        )

    description = (
        f"Cells of {database.grid.step:g} m with the street objects that are seen within "
        f"{database.spec.radius:g} m of their centre, clockwise from north."
    )
    return _write_layer(
        path,
        (block(rows) for rows in _blocks(len(database))),
        layer="cells",
        geometry_type=geometry.capitalize(),
        crs=database.crs,
        dataset_metadata=facts | {"written_by": f"semsig_gis {__version__}"},
        layer_metadata=facts,
        layer_options={
            "IDENTIFIER": "Signature cells",
            "DESCRIPTION": "\n".join([description, *database.licenses]),
        },
    )


def _write_objects(objects: StreetObjects, path: Path) -> Iterator[int]:
    """Write the objects, and yield the number of rows of each block."""
    classes = {item.code: item for item in objects.taxonomy.classes}

    def block(rows: slice) -> pa.Table:
        table = objects.table.iloc[rows]
        kinds = [classes[code] for code in objects.codes[rows].tolist()]
        return pa.table(
            {
                CLASS_CODE: objects.codes[rows],
                "symbol": [item.symbol for item in kinds],
                CLASS_NAME: [item.name for item in kinds],
                "title": [item.title for item in kinds],
                SOURCE: pa.array(table[SOURCE].tolist(), pa.string()),
                SOURCE_ID: pa.array(table[SOURCE_ID].tolist(), pa.string()),
                COUNT: table[COUNT].to_numpy(np.int32),
                GEOMETRY: shapely.to_wkb(table.geometry.array),
            }
        )

    description = f"The {len(objects)} street objects that are seen from the cells."
    return _write_layer(
        path,
        (block(rows) for rows in _blocks(len(objects))),
        layer="objects",
        geometry_type="Point",
        crs=objects.crs,
        layer_metadata={
            "taxonomy": json.dumps(objects.taxonomy.to_list()),
            "licenses": json.dumps(objects.licenses),
        },
        layer_options={
            "IDENTIFIER": "Street objects",
            "DESCRIPTION": "\n".join([description, *objects.licenses]),
        },
    )


def _write_layer(
    path: Path,
    blocks: Iterable[pa.Table],
    *,
    layer: str,
    geometry_type: str,
    crs: CRS,
    **first: Any,  # noqa: ANN401 - what pyogrio takes when a layer is made
) -> Iterator[int]:
    """Write one layer block by block, and yield the number of rows of each block."""
    code = crs.to_epsg()
    for number, block in enumerate(blocks):
        pyogrio.write_arrow(
            block,
            path,
            layer=layer,
            driver="GPKG",
            geometry_name=GEOMETRY,
            geometry_type=geometry_type,
            crs=crs.to_wkt() if code is None else f"EPSG:{code}",
            append=number > 0,
            dataset_options={"VERSION": _VERSION},
            **(first if number == 0 else {}),
        )
        yield len(block)


def _check_indexes(path: Path, rows: int) -> None:
    """Check that all rows are in the spatial indexes.

    They are the last to be written, when a layer is closed, and GDAL keeps quiet if that fails.
    """
    with contextlib.closing(sqlite3.connect(path)) as connection:
        layers = [name for (name,) in connection.execute("SELECT table_name FROM gpkg_contents")]
        counts = (
            connection.execute(f"SELECT count(*) FROM rtree_{name}_geom").fetchone()[0]  # noqa: S608
            for name in layers
        )
        if sum(counts) != rows:
            msg = "the spatial indexes are not complete"
            raise sqlite3.DatabaseError(msg)


def _blocks(rows: int) -> list[slice]:
    return [slice(low, low + _ROWS_A_BLOCK) for low in range(0, rows, _ROWS_A_BLOCK)]


def _squares(database: SignatureDatabase, rows: slice) -> NDArray[np.object_]:
    """Return the squares of some cells; neighbours share their corners to the last bit."""
    step = database.grid.step
    (left, right), (bottom, top) = (
        (start + numbers[rows] * step, start + (numbers[rows] + 1) * step)
        for start, numbers in zip(
            database.grid.origin, (database.columns, database.rows), strict=True
        )
    )
    return np.asarray(shapely.box(left, bottom, right, top))


def _joined(
    values: NDArray[Any], offsets: NDArray[np.int64], *, texts: pa.Array, separator: str = " "
) -> pa.Array:
    """Return the values of each cell as one text; `texts` holds every possible value as text."""
    entries = pa.array(values[offsets[0] : offsets[-1]])
    # From 0, and small enough for Arrow's 32-bit lists: a block has few cells.
    starts = pa.array((offsets - offsets[0]).astype(np.int32))
    lists = pa.ListArray.from_arrays(starts, texts.take(entries))
    return pc.binary_join(lists, separator)
