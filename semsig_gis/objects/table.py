"""The table of street objects: points in a metric CRS, saved as GeoParquet."""

from __future__ import annotations

import copy
import functools
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import lazy_loader
import numpy as np
import pyarrow as pa

from semsig_gis import __version__
from semsig_gis.core import (
    CLASS_CODE,
    CLASS_NAME,
    COUNT,
    GEOMETRY,
    GROUP,
    HEIGHT,
    LICENSES,
    MERGED,
    NOTES,
    SOURCE,
    SOURCE_ID,
    TEXTS,
    DatabaseError,
    Displayed,
    Taxonomy,
    bounds_text,
    brief,
    crs_label,
    map_with,
    plot_with,
)
from semsig_gis.sources import as_text
from semsig_gis.storage import (
    BBOX,
    COVERING,
    GROUP_ROWS,
    bounds_column,
    geo_metadata,
    hilbert_order,
    points_to_wkb,
    read_geoparquet,
    require_kinds,
    rows_meeting,
    texts_of,
    whole_numbers,
    wkb_to_points,
    write_geoparquet,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from pathlib import Path

    import geopandas as gpd
    import pandas as pd
    import shapely
    from numpy.typing import NDArray
    from pyproj import CRS

    from semsig_gis.core import Axes, MapFrame
    from semsig_gis.sources import RawLayer
    from semsig_gis.storage import ColumnKind
else:
    shapely = lazy_loader.load("shapely")

KIND = "street objects"
# Columns without the geometry, and their types.
REQUIRED = {CLASS_CODE: np.uint8, SOURCE: str, SOURCE_ID: str, COUNT: np.int32}
# Columns that are there if a value is, and what stands for no value.
OPTIONAL: dict[str, Any] = {MERGED: "", GROUP: -1, HEIGHT: math.nan, **dict.fromkeys(TEXTS, "")}
COLUMNS = {
    **REQUIRED,
    MERGED: str,
    GROUP: np.int32,
    HEIGHT: np.float32,
    **dict.fromkeys(TEXTS, str),
}
NUMBERS = {name for name, kind in COLUMNS.items() if kind is not str}
BETWEEN_LAYERS = ", "
BEFORE_LAYERS = ": "
# Key of the layers of each line of ``licenses``, if the line itself is ambiguous.
LICENSE_LAYERS = "license_layers"


@dataclass(frozen=True, slots=True)
class Licence:
    """Attribution and licence of layers; its text is an attribution line.

    `layers` is empty if they are not known.
    """

    terms: str
    layers: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the attribution line."""
        layers = BETWEEN_LAYERS.join(self.layers)
        return f"{self.terms}{BEFORE_LAYERS}{layers}" if layers else self.terms


def layer_note(layer: str, note: str) -> str:
    """Return a note about a layer, which begins with its name."""
    return f"{layer}{BEFORE_LAYERS}{note}"


def join_licences(licences: Iterable[Licence]) -> tuple[Licence, ...]:
    """Return licences with those of the same terms joined; each layer is listed once."""
    layers_of: dict[str, dict[str, None]] = {}
    for licence in licences:
        layers_of.setdefault(licence.terms, {}).update(dict.fromkeys(licence.layers))
    return tuple(Licence(terms, tuple(layers)) for terms, layers in layers_of.items())


def layer_licences(layers: Iterable[RawLayer]) -> tuple[Licence, ...]:
    """Return the licences of layers."""
    return join_licences(Licence(layer.spec.terms, (layer.spec.name,)) for layer in layers)


@dataclass(frozen=True, eq=False, repr=False)
class StreetObjects(Displayed):
    """The street objects of a city.

    Parameters
    ----------
    table : GeoDataFrame
        One row per object: ``class_code`` (uint8), ``source`` (layer name), ``source_id``,
        ``count`` (number of rows collapsed into it) and ``geometry`` (point in a metric CRS); after
        `conflate` also ``merged``, the same object in other sources: ``"source:id; source:id"``.
        Columns that are there only if a value is: ``group`` (int32, number of the extended thing
        that a point belongs to, or -1), ``height`` (float32, metres, or NaN), and what is written
        on objects, empty where nothing is: ``name``, ``brand``, ``operator``, ``ref``,
        ``house_number`` and ``street``.
    taxonomy : Taxonomy
        The classes of the codes.
    licenses : tuple of Licence
        One for every publisher and licence, with its layers.
    notes : tuple of str
        Warnings of the load; a warning about a layer begins with its name and a colon.

    Examples
    --------
    >>> demo_objects.xy.shape == (len(demo_objects), 2)
    True
    """

    table: gpd.GeoDataFrame
    taxonomy: Taxonomy
    licenses: tuple[Licence, ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:  # noqa: D105
        return len(self.codes)

    def _facts(self) -> dict[str, object]:
        return {
            "objects": len(self),
            "classes": len(self.class_counts),
            "CRS": crs_label(self.crs),
            "bounds": bounds_text(self.xy),
        }

    @functools.cached_property
    def crs(self) -> CRS:
        """Metric coordinate reference system of the positions."""
        crs: CRS = self.table.crs
        return crs

    @functools.cached_property
    def codes(self) -> NDArray[np.uint8]:
        """Class code of every object, shape (n,)."""
        codes: NDArray[np.uint8] = self.table[CLASS_CODE].to_numpy(np.uint8, copy=True)
        codes.setflags(write=False)
        return codes

    @functools.cached_property
    def present_codes(self) -> NDArray[np.uint8]:
        """Class codes of the objects, ascending."""
        return np.flatnonzero(np.bincount(self.codes)).astype(np.uint8)

    @functools.cached_property
    def arrow(self) -> pa.Table:
        """The columns of `table` as an Arrow table, with the geometry as well-known binary."""
        columns = {
            name: pa.array(self.table[name].to_numpy(kind))
            if name in NUMBERS
            else pa.array(_as_texts(self.table[name]), pa.string())
            for name, kind in COLUMNS.items()
            if name in self.table
        }
        return pa.table({**columns, GEOMETRY: points_to_wkb(self.xy)})

    @functools.cached_property
    def groups(self) -> NDArray[np.int32] | None:
        """Number of the extended thing of every point, or -1, shape (n,); None if none is one."""
        if GROUP not in self.arrow.column_names:
            return None
        groups = whole_numbers(self.arrow[GROUP]).astype(np.int32)
        groups.setflags(write=False)
        return groups

    @functools.cached_property
    def heights(self) -> NDArray[np.float32] | None:
        """Height of every object in metres, or NaN, shape (n,); None if none is known."""
        if HEIGHT not in self.arrow.column_names:
            return None
        heights: NDArray[np.float32] = self.arrow[HEIGHT].to_numpy().astype(np.float32)
        heights.setflags(write=False)
        return heights

    @functools.cached_property
    def texts(self) -> pa.Table | None:
        """The columns of what is written on the objects; None if nothing is."""
        names = [name for name in TEXTS if name in self.arrow.column_names]
        return self.arrow.select(names) if names else None

    @property
    def class_counts(self) -> dict[int, int]:
        """Number of objects by class code; classes without objects are omitted."""
        codes, counts = np.unique(self.codes, return_counts=True)
        return dict(zip(codes.tolist(), counts.tolist(), strict=True))

    @functools.cached_property
    def xy(self) -> NDArray[np.float64]:
        """Position of every object in metres, shape (n, 2)."""
        xy: NDArray[np.float64] = shapely.get_coordinates(self.table.geometry.array)
        xy.setflags(write=False)
        return xy

    def to_geodataframe(self) -> gpd.GeoDataFrame:
        """Return the objects as a table with the symbols, names and titles of their classes.

        The columns are ``class_code``, ``symbol``, ``class_name``, ``title`` and the other columns
        of `table`; `objects_from_frame` accepts it with ``class_column="class_name"``.
        """
        classes = {item.code: item for item in self.taxonomy.classes}
        kinds = [classes[code] for code in self.codes.tolist()]
        frame = self.table.copy()
        frame.insert(1, "symbol", [item.symbol for item in kinds])
        frame.insert(2, CLASS_NAME, [item.name for item in kinds])
        frame.insert(3, "title", [item.title for item in kinds])
        frame.attrs[LICENSES] = [str(licence) for licence in self.licenses]
        return frame

    def plot(self, *, ax: Axes | None = None, legend: bool = True) -> Axes:
        """Plot the objects with the symbols of their classes (see `plot_objects`)."""
        return plot_with("plot_objects", self, ax=ax, legend=legend)

    def explore(self) -> MapFrame:
        """Show the objects on a map in a notebook (see `objects_map`)."""
        return map_with("objects_map", self)


class _ArrowObjects(StreetObjects):
    """Street objects in Arrow, with a GeoDataFrame that is created at its first use."""

    @functools.cached_property
    def table(self) -> gpd.GeoDataFrame:
        """The table of objects."""
        import geopandas as gpd  # noqa: PLC0415 - 0.7 s

        columns = {
            name: column.to_numpy() if name in NUMBERS else column.to_pylist()
            for name, column in zip(self.arrow.column_names, self.arrow.columns, strict=True)
            if name in COLUMNS
        }
        return gpd.GeoDataFrame(columns, geometry=shapely.points(self.xy), crs=self.crs)


def arrow_objects(arrow: pa.Table, *, xy: NDArray[np.float64], **attributes: Any) -> StreetObjects:  # noqa: ANN401
    """Return the street objects of an Arrow table, with positions and all other attributes.

    The columns are those of `StreetObjects.arrow`.
    """
    codes = whole_numbers(arrow[CLASS_CODE]).astype(np.uint8)
    for values in (codes, xy):
        values.setflags(write=False)
    objects = _ArrowObjects.__new__(_ArrowObjects)
    vars(objects).update(attributes, arrow=arrow, codes=codes, xy=xy)
    return objects


def _as_texts(column: pd.Series) -> list[str]:
    """Return the texts of a column; what is missing is empty."""
    return [
        as_text(value) if there else "" for value, there in zip(column, column.notna(), strict=True)
    ]


def without_empty(arrow: pa.Table) -> pa.Table:
    """Return the columns of objects without the optional ones in which no object has a value."""
    always = {*REQUIRED, MERGED, GEOMETRY}  # conflated objects have `merged` in any case
    return arrow.select(
        [
            name
            for name in arrow.column_names
            if name in always or (name in COLUMNS and _has_value(arrow[name], OPTIONAL[name]))
        ]
    )


def _has_value(column: pa.ChunkedArray, nothing: object) -> bool:
    import pyarrow.compute as pc  # noqa: PLC0415 - slow, and not needed to read objects

    if pa.types.is_floating(column.type):
        return not bool(pc.all(pc.is_null(column, nan_is_null=True)).as_py())
    return bool(pc.any(pc.not_equal(column, nothing)).as_py())


def joined_tables(first: gpd.GeoDataFrame, second: gpd.GeoDataFrame) -> gpd.GeoDataFrame:
    """Return the rows of two tables of street objects.

    Extended things of the second one have new groups, but for those that share an identifier in
    their source with a thing of the first one, as a river that crosses both areas does.
    """
    import pandas as pd  # noqa: PLC0415 - 0.4 s

    if GROUP in first and GROUP in second:
        second = second.assign(**{GROUP: _joined_groups(first, second)})
    table = pd.concat([first, second], ignore_index=True)
    nothing = {name: value for name, value in OPTIONAL.items() if name in table}
    kinds = {name: COLUMNS[name] for name in nothing if name in NUMBERS}
    return table.fillna(nothing).astype({CLASS_CODE: np.uint8, **kinds})


def _joined_groups(first: gpd.GeoDataFrame, second: gpd.GeoDataFrame) -> NDArray[np.int64]:
    """Return the groups of the second table in the numbers of `joined_tables`."""
    identifier = [SOURCE, SOURCE_ID]
    things = [
        table.loc[(table[GROUP] >= 0) & (table[SOURCE_ID] != ""), [*identifier, GROUP]]
        for table in (first, second)
    ]
    shared = things[1].merge(things[0].drop_duplicates(identifier), on=identifier)
    shared = shared.drop_duplicates(f"{GROUP}_x").set_index(f"{GROUP}_x")[f"{GROUP}_y"]
    numbers = second[GROUP].to_numpy(np.int64)
    renamed: NDArray[np.int64] = np.where(numbers < 0, numbers, numbers + first[GROUP].max() + 1)
    rows = second[GROUP].isin(shared.index).to_numpy()
    renamed[rows] = shared.loc[numbers[rows]].to_numpy()
    return renamed


def with_notes(objects: StreetObjects, notes: tuple[str, ...]) -> StreetObjects:
    """Return the same objects with other notes."""
    result = copy.copy(objects)
    vars(result)["notes"] = notes
    return result


def save_objects(objects: StreetObjects, path: str | Path, *, keep_order: bool = False) -> None:
    """Save street objects as a GeoParquet file that can be read by box.

    Parameters
    ----------
    objects : StreetObjects
        The objects.
    path : str or Path
        File to write, atomically.
    keep_order : bool, default False
        Whether to keep the order of the objects, for data that refers to them by row number. By
        default they are sorted along a curve, in row groups, which makes reading by box faster;
        saving them again does not change this order.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import open_objects, save_objects
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(demo_objects, f"{folder}/objects.parquet")
    ...     len(open_objects(f"{folder}/objects.parquet")) == len(demo_objects)
    True
    """
    bounds = np.column_stack([objects.xy, objects.xy])
    rows = np.arange(len(objects)) if keep_order else hilbert_order(bounds)
    arrow = without_empty(objects.arrow).take(pa.array(rows))
    arrow = arrow.append_column(BBOX, bounds_column(bounds[rows]))
    box = (*objects.xy.min(axis=0), *objects.xy.max(axis=0))
    geo = geo_metadata(objects.crs, geometry_types=["Point"], bounds=box)
    geo["columns"]["geometry"]["covering"] = COVERING
    write_geoparquet(arrow, path, geo=geo, group_rows=GROUP_ROWS, specs=objects_specs(objects))


def objects_specs(objects: StreetObjects) -> dict[str, Any]:
    """Return the metadata of street objects as plain values for JSON.

    The layers of licences are included only if the lines of the licences are ambiguous, and notes
    only if there are any.
    """
    specs: dict[str, Any] = {
        "kind": KIND,
        "version": __version__,
        "taxonomy": objects.taxonomy.to_list(),
        "licenses": [str(licence) for licence in objects.licenses],
    }
    if _licences(specs, objects.arrow[SOURCE].unique().to_pylist()) != objects.licenses:
        specs[LICENSE_LAYERS] = [list(licence.layers) for licence in objects.licenses]
    if objects.notes:
        specs[NOTES] = list(objects.notes)
    return specs


def _licences(specs: Mapping[str, Any], sources: Iterable[str]) -> tuple[Licence, ...]:
    """Return the licences of a file from its specs and the layers of its objects."""
    lines = list(map(str, specs["licenses"]))
    if LICENSE_LAYERS not in specs:
        layers = frozenset(sources)
        return tuple(_licence_of(line, layers) for line in lines)
    licences = []
    for line, names in zip(lines, specs[LICENSE_LAYERS], strict=True):
        end = f"{BEFORE_LAYERS}{BETWEEN_LAYERS.join(names)}" if names else ""
        if not line.endswith(end):
            raise ValueError(f"licence {line!r} is not that of {names}")
        licences.append(Licence(line.removesuffix(end), tuple(names)))
    return tuple(licences)


def _licence_of(line: str, sources: Collection[str]) -> Licence:
    """Split an attribution line into its terms and its layers.

    If there is not exactly one way to split it, all of it is terms, and there are no layers.
    """
    parts = line.split(BEFORE_LAYERS)
    readings = [
        Licence(BEFORE_LAYERS.join(parts[:mark]), names)
        for mark in range(1, len(parts))
        for names in _names_in(BEFORE_LAYERS.join(parts[mark:]), sources)
    ]
    return readings[0] if len(readings) == 1 else Licence(line)


def _names_in(text: str, sources: Collection[str]) -> list[tuple[str, ...]]:
    """Return the ways to parse a text as a list of layers, at most two.

    A name may itself contain the separator, so this is dynamic programming from the end.
    """
    parts = text.split(BETWEEN_LAYERS)
    ways: list[list[tuple[str, ...]]] = [[] for _ in parts] + [[()]]  # from each part to the end
    for start in reversed(range(len(parts))):
        for end in range(start + 1, len(parts) + 1):
            name = BETWEEN_LAYERS.join(parts[start:end])
            if name in sources:
                ways[start] += [(name, *rest) for rest in ways[end]]
        del ways[start][2:]
    return ways[0]


def open_objects(path: str | Path, *, box: Sequence[float] | None = None) -> StreetObjects:
    """Open a file by `save_objects`, or a part of it.

    Parameters
    ----------
    path : str or Path
        File to read. DatabaseError if it is missing, damaged, or of another kind.
    box : sequence of float, optional
        ``xmin, ymin, xmax, ymax`` in metres: only objects in it or on its edge.

    Returns
    -------
    StreetObjects
        The objects; there is at least one, but in a box there may be none.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import save_objects
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_objects(demo_objects, f"{folder}/objects.parquet")
    ...     len(open_objects(f"{folder}/objects.parquet")) == len(demo_objects)
    True
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
    """Return street objects from an Arrow table and the values of `objects_specs`.

    The columns are those of `StreetObjects.table`, with ``geometry`` as WKB. With a box, only
    objects in it or on its edge are returned, possibly none. DatabaseError, with `path`, if the
    data is damaged or, without a box, has no objects.
    """
    try:
        arrow.validate(full=True)
        arrow = _checked(arrow)
        taxonomy = Taxonomy.from_list(specs["taxonomy"])
        for code in arrow[CLASS_CODE].unique().to_pylist():
            taxonomy.by_code(code)
        licenses = _licences(specs, arrow[SOURCE].unique().to_pylist())
        notes = tuple(map(str, specs.get(NOTES, ())))
        xy = wkb_to_points(arrow[GEOMETRY])
    except (TypeError, ValueError, LookupError, pa.ArrowException) as error:
        raise DatabaseError(
            f"{path} is damaged ({brief(error)}); load the street objects again."
        ) from error
    may_be_empty = box is not None
    if not ((len(arrow) or may_be_empty) and len(xy) == len(arrow) and np.isfinite(xy).all()):
        raise DatabaseError(
            f"{path} is damaged (it has rows without a position); load the street objects again."
        )
    if box is not None:
        inside = ((xy >= box[:2]) & (xy <= box[2:])).all(axis=1)
        arrow, xy = arrow.filter(pa.array(inside)), xy[inside]
    return arrow_objects(arrow, xy=xy, crs=crs, taxonomy=taxonomy, licenses=licenses, notes=notes)


def licenses_of(*tables: gpd.GeoDataFrame | None) -> tuple[str, ...]:
    """Return the distinct attribution lines of tables of buildings and streets.

    The tables are from `read_surroundings` or `assemble`.
    """
    lines = [table.attrs.get(LICENSES, ()) for table in tables if table is not None]
    return tuple(dict.fromkeys(itertools.chain.from_iterable(lines)))


def _checked(arrow: pa.Table) -> pa.Table:
    """Return the table of a file with empty texts for nulls; raise as `require_kinds` does."""
    arrow.select([*REQUIRED, GEOMETRY])
    names = [name for name in COLUMNS if name in arrow.column_names]
    for name in names:
        if name not in NUMBERS:
            place = arrow.column_names.index(name)
            arrow = arrow.set_column(place, name, texts_of(arrow[name]))
    kinds: dict[str, ColumnKind] = {
        name: "text" if name not in NUMBERS else "number" if name == HEIGHT else "whole"
        for name in names
    }
    require_kinds(arrow, kinds, may_lack=[HEIGHT])
    counts = whole_numbers(arrow[COUNT])
    if len(arrow) and not 1 <= counts.min() <= counts.max() <= np.iinfo(np.int32).max:
        raise ValueError(f"its column {COUNT} has numbers from {counts.min()} to {counts.max()}")
    return arrow
