"""Street objects: raw layers become one checked table of points in a metric CRS."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely

from semsig_gis import __version__
from semsig_gis.core.crs import (
    CLASS_CODE,
    COUNT,
    GEOMETRY,
    MERGED,
    SOURCE,
    SOURCE_ID,
)
from semsig_gis.core.errors import DatabaseError
from semsig_gis.core.taxonomy import Taxonomy
from semsig_gis.storage.geoparquet import (
    BBOX,
    COVERING,
    GROUP_ROWS,
    bounds_column,
    geo_metadata,
    hilbert_order,
    read_geoparquet,
    rows_meeting,
    write_geoparquet,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.sources import RawLayer


KIND = "street objects"


@dataclass(frozen=True, eq=False)
class StreetObjects:
    """The street objects of a city.

    Parameters
    ----------
    table : GeoDataFrame
        One row an object: ``class_code`` (uint8), ``source`` (layer name), ``source_id``,
        ``count`` (rows of the sources that were collapsed into it) and ``geometry`` (point in a
        metric CRS). After `objects.conflate.conflate` also ``merged``: what other sources
        say of the same object, as ``"source:id; source:id"``, or empty.
    taxonomy : Taxonomy
        The classes that the codes belong to.
    licenses : tuple of str
        One line for every publisher and licence: who, under what, which layers.

    Examples
    --------
    >>> objects = demo_objects
    >>> objects.xy.shape == (len(objects), 2)
    True
    """

    table: gpd.GeoDataFrame
    taxonomy: Taxonomy
    licenses: tuple[str, ...]

    def __len__(self) -> int:  # noqa: D105
        return len(self.table)

    @property
    def crs(self) -> CRS:
        """Metric coordinate reference system of the positions."""
        crs: CRS = self.table.crs
        return crs

    @property
    def codes(self) -> NDArray[np.uint8]:
        """Class code of every object, shape (n,)."""
        codes: NDArray[np.uint8] = self.table[CLASS_CODE].to_numpy(np.uint8)
        return codes

    @property
    def class_counts(self) -> dict[int, int]:
        """How many objects of each class code there are, of those that there are."""
        codes, counts = np.unique(self.codes, return_counts=True)
        return dict(zip(codes.tolist(), counts.tolist(), strict=True))

    @functools.cached_property
    def xy(self) -> NDArray[np.float64]:
        """Position of every object in metres, shape (n, 2)."""
        xy: NDArray[np.float64] = shapely.get_coordinates(self.table.geometry.array)
        xy.setflags(write=False)
        return xy


def license_lines(layers: Iterable[RawLayer]) -> tuple[str, ...]:
    """Return whom to name for layers.

    There is a line for every publisher and licence, with the names of the layers that they cover.
    """
    layers_of: dict[str, list[str]] = {}
    for layer in layers:
        publisher = layer.spec.attribution or "no attribution given"
        names = layers_of.setdefault(f"{publisher} ({layer.spec.license})", [])
        if layer.spec.name not in names:
            names.append(layer.spec.name)
    return tuple(f"{terms}: {', '.join(names)}" for terms, names in layers_of.items())


def save_objects(objects: StreetObjects, path: str | Path, *, keep_order: bool = False) -> None:
    """Save street objects as one GeoParquet file that can be read by box.

    Parameters
    ----------
    objects : StreetObjects
        What to save.
    path : str or Path
        File to write; it appears whole, by rename.
    keep_order : bool, default False
        Whether the objects stay in their order, for whoever knows them by row number. Else the
        file holds them in a spatial order, of which a box is read faster, and so does what
        `open_objects` returns; saving that again does not change the order.

    Notes
    -----
    The column ``bbox`` holds the bounds of every object, and the rows are in groups of
    `storage.geoparquet.GROUP_ROWS`.

    Examples
    --------
    >>> import tempfile
    >>> objects = demo_objects
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(objects, f"{folder}/objects.parquet")
    ...     len(open_objects(f"{folder}/objects.parquet")) == len(objects)
    True
    """
    table = objects.table
    if not keep_order:
        table = table.iloc[hilbert_order(table.geometry.array)]
    columns = {
        CLASS_CODE: pa.array(table[CLASS_CODE].to_numpy(np.uint8)),
        SOURCE: pa.array(table[SOURCE].tolist(), pa.string()),
        SOURCE_ID: pa.array(table[SOURCE_ID].tolist(), pa.string()),
        COUNT: pa.array(table[COUNT].to_numpy(np.int32)),
    }
    if MERGED in table.columns:
        columns[MERGED] = pa.array(table[MERGED].tolist(), pa.string())
    columns[GEOMETRY] = pa.array(shapely.to_wkb(table.geometry.array), pa.binary())
    columns[BBOX] = bounds_column(shapely.bounds(table.geometry.array))
    bounds = (*objects.xy.min(axis=0), *objects.xy.max(axis=0))
    geo = geo_metadata(objects.crs, geometry_types=["Point"], bounds=bounds)
    geo["columns"]["geometry"]["covering"] = COVERING
    write_geoparquet(
        pa.table(columns),
        path,
        geo=geo,
        group_rows=GROUP_ROWS,
        specs=objects_specs(objects),
    )


def objects_specs(objects: StreetObjects) -> dict[str, Any]:
    """Return all but the table of street objects, as plain values for JSON."""
    return {
        "kind": KIND,
        "version": __version__,
        "taxonomy": objects.taxonomy.to_list(),
        "licenses": list(objects.licenses),
    }


def open_objects(path: str | Path, *, box: Sequence[float] | None = None) -> StreetObjects:
    """Open a file that `save_objects` wrote, or a part of it.

    Parameters
    ----------
    path : str or Path
        File to read.
    box : sequence of float, optional
        ``xmin, ymin, xmax, ymax`` in metres: only objects in it or on its edge.

    Returns
    -------
    StreetObjects
        The objects; there is at least one, but in a box there may be none.

    Raises
    ------
    DatabaseError
        If the file is missing, damaged, or holds something else.

    Examples
    --------
    >>> open_objects("nowhere.parquet")
    Traceback (most recent call last):
    ...
    semsig_gis.core.errors.DatabaseError: nowhere.parquet does not exist;
    give a street objects file.
    """
    arrow, specs, crs = read_geoparquet(path, kind=KIND, box=box)
    if box is not None:
        arrow = rows_meeting(arrow, box)
    return objects_of(arrow, specs, crs, path=path, box=box)


def objects_of(
    arrow: pa.Table,
    specs: dict[str, Any],
    crs: CRS,
    *,
    path: str | Path,
    box: Sequence[float] | None = None,
) -> StreetObjects:
    """Return the street objects that columns and the values of `objects_specs` hold.

    The columns are those of `StreetObjects.table`, ``geometry`` as WKB. With a box ``xmin, ymin,
    xmax, ymax`` in metres, only objects in it or on its edge are returned, possibly none. Raise
    DatabaseError, which names `path`, if they are damaged; without a box, a table without objects
    is damaged.
    """
    try:
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        columns = {
            CLASS_CODE: arrow[CLASS_CODE].to_numpy(),
            SOURCE: arrow[SOURCE].to_pylist(),
            SOURCE_ID: arrow[SOURCE_ID].to_pylist(),
            COUNT: arrow[COUNT].to_numpy(),
        }
        if MERGED in arrow.column_names:  # only conflated objects have it
            columns[MERGED] = arrow[MERGED].to_pylist()
        table = gpd.GeoDataFrame(
            columns,
            geometry=shapely.from_wkb(arrow[GEOMETRY].to_numpy(zero_copy_only=False)),
            crs=crs,
        )
        for code in pc.unique(arrow[CLASS_CODE]).to_pylist():
            taxonomy.by_code(code)
        licenses = tuple(specs["licenses"])
    except (TypeError, ValueError, LookupError, shapely.errors.ShapelyError) as error:
        msg = f"{path} is damaged ({error}); load the street objects again."
        raise DatabaseError(msg) from error
    xy = shapely.get_coordinates(table.geometry.array)
    points = (table.geometry.geom_type == "Point").all()
    some = len(table) > 0 or box is not None
    if not (some and points and len(xy) == len(table) and np.isfinite(xy).all()):
        msg = f"{path} is damaged (it has rows without a position); load the street objects again."
        raise DatabaseError(msg)
    if box is not None:
        inside = ((xy >= box[:2]) & (xy <= box[2:])).all(axis=1)
        table = table[inside].reset_index(drop=True)
    return StreetObjects(table, taxonomy, licenses)
