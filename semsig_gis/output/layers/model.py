"""Layers: tables with a geometry, columns and styles, read in blocks of rows; and rasters."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import shapely

from semsig_gis import __version__
from semsig_gis.core import GEOMETRY, InputError
from semsig_gis.output.layers.columns import described

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import geopandas as gpd
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import GridSpec, Taxonomy
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.output.layers.columns import Column, Form
    from semsig_gis.output.layers.styles import Scale, Style

    Progress = Callable[[int, int], None] | None  # called with the numbers of rows: done, all


ROWS_A_BLOCK = 1 << 16
EXPORTED, CHECKSUM = "rows", "checksum"
"""Keys of the facts of layers that are read back: number of rows, and `cells_checksum`."""
GEOMETRY_TYPES = {"polygon": "Polygon", "line": "LineString", "point": "Point"}


@dataclass(frozen=True, eq=False, kw_only=True)
class Display:
    """How a layer is shown in QGIS: its place in the legend, its texts and the scales it has."""

    level: int = 0  # of two layers, that with the higher level is drawn on top
    group: str = "Layers"  # of the legend
    name: str = ""  # expression for the name of a feature in lists, searches and map tips
    # Columns of symbols, bearings and distances of a compass wheel in map tips, and what separates
    # the numbers; and columns that a map tip lists.
    signature: tuple[str, str, str, str] | None = None
    tip: tuple[str, ...] = ()
    label: str = ""  # expression of the label on the map
    shown: str = ""  # expression: of the features that are drawn; all by default
    # The layer is hidden where the denominator of the scale is greater or smaller.
    nearer: int = 0
    farther: int = 0
    covers: str = ""  # a layer that is hidden where this one is visible
    hidden: bool = False  # when the project opens
    joins: tuple[str, tuple[str, ...]] | None = None  # a layer, and the columns that join the two


@dataclass(frozen=True, eq=False, kw_only=True)
class Layer:
    """A table, usually with geometry, that is read in blocks of rows to limit the memory.

    What renders a layer reads its columns and its styles here, and knows nothing else about it.
    """

    name: str
    title: str
    description: str
    geometry: str  # polygon, line, point or none
    crs: CRS
    rows: int
    bounds: tuple[float, float, float, float]
    read: Callable[[slice], pa.Table]  # the geometry, as WKB, is the last column
    licenses: tuple[str, ...]
    facts: Mapping[str, Any]  # plain values for JSON
    form: Form = field(default_factory=dict)
    styles: tuple[Style, ...] = ()  # the first is the default
    display: Display = Display()
    taxonomy: Taxonomy | None = None  # of the symbols in its texts
    reach: float = 1.0  # longest visibility range of classes that are not tall, metres
    parts: tuple[Layer, ...] = ()  # tables with fewer columns, for a format of several layers
    cell_size: float = 0.0  # metres
    squares: Callable[[int], Layer] | None = None  # statistics by the number of cells on a side

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the columns in the table, without the geometry."""
        return tuple(name for name in self.read(slice(0, 0)).column_names if name != GEOMETRY)

    @functools.cached_property
    def columns(self) -> tuple[Column, ...]:
        """Descriptions of the columns, in the order of the form."""
        classes = () if self.taxonomy is None else self.taxonomy.classes
        return described(self.names, self.form, {item.name: item.title for item in classes})

    @property
    def credits(self) -> dict[str, Any]:
        """Licences and program version, for the metadata of a file."""
        return {"licenses": list(self.licenses), "written_by": f"semsig_gis {__version__}"}

    @property
    def metadata(self) -> dict[str, Any]:
        """Facts, title and unit of each column, and credits, for the metadata of a file."""
        columns = {item.name: {"title": item.title, "unit": item.unit} for item in self.columns}
        return {**self.facts, "columns": columns, **self.credits}

    @property
    def metadata_texts(self) -> dict[str, str]:
        """The metadata with each value as JSON text."""
        return {key: json.dumps(value, allow_nan=False) for key, value in self.metadata.items()}

    @property
    def abstract(self) -> str:
        """The description with the licences, a line each."""
        return "\n".join([self.description, *self.licenses])

    def blocks(self, progress: Progress = None) -> Iterator[pa.Table]:
        """Yield the rows in blocks; a layer without rows yields one empty block."""
        for low in range(0, max(self.rows, 1), ROWS_A_BLOCK):
            high = min(low + ROWS_A_BLOCK, self.rows)
            yield self.read(slice(low, high))
            if progress is not None:
                progress(high, self.rows)


def table_layer(frame: gpd.GeoDataFrame, **about: Any) -> Layer:  # noqa: ANN401 - as `Layer` has
    """Return a layer of a table in memory; numbers that are not finite become null."""
    shapes = frame.geometry
    columns = {}
    for column in frame.columns.drop(shapes.name):
        values = frame[column]
        if pd.api.types.is_float_dtype(values.dtype):
            numbers = values.to_numpy(np.float64)
            columns[column] = pa.array(numbers, mask=~np.isfinite(numbers))
        else:
            texts = pd.api.types.is_string_dtype(values.dtype)
            columns[column] = pa.Array.from_pandas(values, type=pa.string() if texts else None)
    table = pa.table({**columns, GEOMETRY: pa.array(shapely.to_wkb(shapes.array), pa.binary())})
    return Layer(
        **about,
        crs=shapes.crs,
        rows=len(table),
        bounds=tuple(shapes.total_bounds.tolist()),
        read=lambda rows: table.slice(rows.start, rows.stop - rows.start),
    )


def group_means(groups: NDArray[np.int64], values: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Return the mean of the values in each group (float64, `count`); NaN in an empty group."""
    numbers = np.bincount(groups, minlength=count)
    means = np.full(count, np.nan)
    np.divide(np.bincount(groups, values, count), numbers, out=means, where=numbers > 0)
    return means


@dataclass(frozen=True, eq=False, kw_only=True)
class Raster:
    """Numbers at columns and rows of a grid, in bands."""

    name: str
    grid: GridSpec
    columns: NDArray[np.int32]
    rows: NDArray[np.int32]
    crs: CRS
    bands: Mapping[str, tuple[NDArray[np.float64], str]]  # numbers and their unit; NaN is no data
    licenses: tuple[str, ...]
    version: str  # of the program that wrote the database
    facts: Mapping[str, Any] = field(default_factory=dict)  # plain values for JSON
    scale: Scale | None = None  # classes of the first band


def cell_raster(
    database: SignatureDatabase,
    name: str,
    values: ArrayLike,
    *,
    unit: str = "",
    scale: Scale | None = None,
    facts: Mapping[str, Any] | None = None,
) -> Raster:
    """Return a raster with one number for each cell; InputError for another number of them."""
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != (len(database),):
        raise InputError(
            f"{numbers.size} numbers were given for {len(database)} cells; give one for each."
        )
    return Raster(
        name=name,
        grid=database.grid,
        columns=database.columns,
        rows=database.rows,
        crs=database.crs,
        bands={name: (numbers, unit)},
        licenses=database.licenses,
        version=database.version,
        facts=facts or {},
        scale=scale,
    )
