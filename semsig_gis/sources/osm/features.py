"""OpenStreetMap elements as rows of tables: osmnx, QuackOSM, ohsome, GDAL, Geofabrik and others.

A row has a geometry and may have the id of its element. Its tags are one column each, one column
with all tags, or a class of Geofabrik.
"""

from __future__ import annotations

import functools
import json
import math
import re
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import shapely

from semsig_gis.core import CrsError, InputError
from semsig_gis.sources import parquet, vector
from semsig_gis.sources.catalog import data_folder, load_catalog
from semsig_gis.sources.csv_layer import csv_table
from semsig_gis.sources.filters import as_text
from semsig_gis.sources.layer import transformed
from semsig_gis.sources.osm.elements import (
    KIND_BY_LETTER,
    TagIndex,
    add_element,
    element_layers,
    feature_shape,
)
from semsig_gis.sources.parquet import read_parquet
from semsig_gis.sources.probe import TABLES, probe_file
from semsig_gis.sources.rows import (
    WGS84,
    BadFeatureError,
    Rows,
    built_geometries,
    choose_crs,
    identifier,
    parse_crs,
    plain,
)
from semsig_gis.storage import parse_toml

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    import geopandas as gpd
    from pyproj import CRS

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec
    from semsig_gis.sources.rows import Position

# Suffixes of OpenStreetMap files, and the names of their formats in pyosmium.
FORMATS = {".osm": "xml", ".osm.gz": "xml.gz", ".osm.bz2": "xml.bz2", ".pbf": "pbf",
           ".osh": "xml", ".osh.gz": "xml.gz", ".osh.bz2": "xml.bz2", ".o5m": "o5m",
           ".opl": "opl"}  # fmt: skip
# Suffixes of files with changes only.
CHANGES = (".osc", ".osc.gz", ".osc.bz2", ".o5c")
# Columns with all tags of a row: a map, JSON, or text such as '"amenity"=>"bench"'.
MAPS = ("tags", "other_tags", "@other_tags")
PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*(?:"((?:[^"\\]|\\.)*)"|NULL)')
ESCAPED = re.compile(r"\\(.)")
# Column of QuackOSM, which omits the tag `area`: only the shape of a square shows that it is one.
QUACKOSM = "feature_id"
# Columns with the id of an element, such as "node/123" or "n123".
NAMES = (QUACKOSM, "@id", "@osmId", "full_id", "osm_id", "osmid", "id")
NAME = re.compile(
    r"(?:https?://(?:www\.)?openstreetmap\.org/)?(n|node|w|way|r|rel|relation)[/ _:]?(-?\d+)",
    re.IGNORECASE,
)
# Columns with its kind and its number: osmnx from version 2, before it, QuickOSM, pyrosm, others.
KINDS_AND_NUMBERS = (
    ("element", "id"),
    ("element_type", "osmid"),
    ("osm_type", "osm_id"),
    ("osm_type", "id"),
    ("@type", "@id"),
    ("type", "id"),
)
# Numbers in tables of GDAL and Geofabrik, without the kind; GDAL has the second one for areas that
# are ways.
NUMBER, WAY_NUMBER = "osm_id", "osm_way_id"
# The same in tables of Overpass servers that do not state the kind.
NAMELESS = "@id"
# Columns of Geofabrik's classes.
CLASS, CODE = "fclass", "code"
# Tags that most tables lack.
TYPE, AREA, MULTIPOLYGON = "type", "area", "multipolygon"
ElementName = tuple["ElementKind | None", str]


@dataclass(frozen=True, eq=False)
class FeatureTable:
    """Columns of a table and the positions of its rows in WGS 84; `notes` list unreadable rows."""

    columns: Mapping[str, Sequence[Any]]
    positions: Sequence[Position | str]
    notes: tuple[str, ...] = ()

    def tags(self, keys: frozenset[str]) -> tuple[list[dict[str, str]], int]:
        """Return the tags of every row with their `keys`, and the number of unreadable rows."""
        size = len(next(iter(self.columns.values()), ()))
        tags: list[dict[str, str]] = [{} for _ in range(size)]
        unreadable = 0
        # Columns with all tags, then a column for each tag, then Geofabrik's classes.
        for name in MAPS:
            for row, value in _valid_rows(self.columns.get(name)):
                try:
                    tags[row].update((key, text) for key, text in _parse_tags(value) if key in keys)
                except (TypeError, ValueError):
                    unreadable += 1
        for key in keys.intersection(self.columns):
            if key == TYPE and _has_kinds(self.columns[key]):
                continue
            for row, value in _valid_rows(self.columns[key]):
                tags[row][key] = _tag_value(value)
        if CLASS in self.columns and CODE in self.columns:
            codes = dict(_valid_rows(self.columns[CODE]))
            for row, value in _valid_rows(self.columns[CLASS]):
                tags[row].update(_geofabrik_tags(str(value), as_text(codes.get(row, ""))))
        return tags, unreadable

    def names(self, size: int) -> list[ElementName]:
        """Return kind and number of the element of every row; (None, "") for rows without id."""
        names: list[ElementName] = [(None, "")] * size
        # Numbers without a kind (GDAL, osm2pgsql).
        among_areas = WAY_NUMBER in self.columns
        for row, number in _numbers(self.columns.get(NUMBER, self.columns.get(NAMELESS))):
            # Relations of osm2pgsql have numbers below zero.
            relation = among_areas or number.startswith("-")
            names[row] = ("relation" if relation else None, number.lstrip("-"))
        for row, number in _numbers(self.columns.get(WAY_NUMBER)):
            names[row] = ("way", number)
        for row, name in self.whole_names():  # more exact
            names[row] = name
        return names

    def whole_names(self) -> Iterator[tuple[int, ElementName]]:
        """Yield kinds and numbers from two columns, then from columns such as ``node/123``."""
        columns = self.columns
        for kind_column, number_column in KINDS_AND_NUMBERS:
            if {kind_column, number_column} <= columns.keys() and _has_kinds(columns[kind_column]):
                kinds = dict(_valid_rows(columns[kind_column]))
                for row, number in _numbers(columns[number_column]):
                    if row in kinds:
                        yield row, (KIND_BY_LETTER[str(kinds[row])[0].lower()], number)
        for column in NAMES:
            for row, value in _valid_rows(columns.get(column)):
                match = NAME.fullmatch(value) if isinstance(value, str) else None
                if match and int(match[2]):
                    yield row, (KIND_BY_LETTER[match[1][0].lower()], match[2])


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from vector files or GeoParquet files with tags.

    An element in several tables counts once. SourceError if a file cannot be read.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
    tables = (table for file in paths for table in _tables(file, specs, crs=crs))
    return _table_layers(tables, specs, filters=filters, where=where)


def frame_layers(
    frame: gpd.GeoDataFrame, specs: Sequence[LayerSpec], *, filters: bool = True
) -> tuple[RawLayer, ...]:
    """Return the layers of a GeoDataFrame with tags; CrsError if it has no CRS."""
    return _table_layers([_frame_table(frame)], specs, filters=filters, where="the table")


def _table_layers(
    tables: Iterable[FeatureTable], specs: Sequence[LayerSpec], *, filters: bool, where: str
) -> tuple[RawLayer, ...]:
    """Return the layers of tables of elements, one for each of `specs`."""
    layers = element_layers(specs, filters=filters, where=where)
    index, keys = TagIndex(specs), _keys(specs)
    known_names: set[tuple[int, str]] = set()
    notes: list[str] = []
    for table in tables:
        tags_by_row, unreadable = table.tags(keys)
        names = table.names(len(tags_by_row))
        maps = set() if QUACKOSM in table.columns else {*MAPS}
        has_area_tag = not {AREA, *maps}.isdisjoint(table.columns)
        notes += table.notes
        if unreadable:
            notes.append(f"{unreadable:,} rows have tags that cannot be read")
        for row, tags in enumerate(tags_by_row):
            numbers = index.layers(tags)
            if not numbers:
                continue
            position = table.positions[row]
            kind, element_number = names[row]
            kind, element_tags = _as_element(kind, tags, position, has_area_tag=has_area_tag)
            name = f"{kind}/{element_number}" if element_number else ""
            for number in numbers:
                if name and (number, name) in known_names:
                    layers[number].rows.read += 1
                    layers[number].rows.repeated += 1
                    continue
                known_names.add((number, name))
                shape = _element_shape(position, layers[number].spec)
                add_element(layers[number], kind, name or f"row {row + 1}", element_tags, shape)
    raw = [layer.layer(WGS84, requested=None) for layer in layers]
    # A table rarely contains elements of all layers, so an empty layer is not worth a note. Rows
    # that cannot be read belong to no layer; their notes go to the first one.
    raw = [layer if layer.counts.read else replace(layer, notes=()) for layer in raw]
    return (replace(raw[0], notes=(*raw[0].notes, *notes)), *raw[1:]) if raw else ()


def has_element_columns(fields: Iterable[str]) -> bool:
    """Whether columns certainly belong to elements of OpenStreetMap with their tags."""
    fields = set(fields)
    pairs = (pair for pair in KINDS_AND_NUMBERS if pair != (TYPE, "id"))
    has_names = not fields.isdisjoint({QUACKOSM, "@id", "@osmId", "full_id", NUMBER})
    # The tags come last, because it takes 0.2 s to read the catalogue that lists them.
    return (has_names or any(map(fields.issuperset, pairs))) and has_tag_columns(fields)


def has_tag_columns(fields: Iterable[str]) -> bool:
    """Whether some columns are tags or contain tags."""
    fields = set(fields)
    return bool(fields & {*MAPS, *_index().keys} or fields.issuperset((CLASS, CODE)))


def frame_fields(frame: gpd.GeoDataFrame) -> list[str]:
    """Return the names of a table's columns and of its index."""
    return [str(name) for name in (*frame.index.names, *frame.columns) if name is not None]


def _frame_table(frame: gpd.GeoDataFrame) -> FeatureTable:
    """Return a GeoDataFrame as a table of elements; CrsError if it has no CRS."""
    levels = [name for name in frame.index.names if name is not None and name not in frame]
    frame = frame.reset_index(level=levels) if levels else frame
    if frame.crs is None:
        raise CrsError("the table has no coordinate reference system; state it with set_crs.")
    if not frame.columns.is_unique:
        names = frame.columns[frame.columns.duplicated()]
        raise InputError(f"the table has several columns {names[0]!r}; rename or drop them.")
    geometry = frame.geometry.to_numpy()
    if not frame.crs.equals(WGS84, ignore_axis_order=True):
        geometry = transformed(geometry, frame.crs, WGS84)
    columns = {
        str(name): [
            value if valid else None
            for value, valid in zip(frame[name].to_list(), frame[name].notna(), strict=True)
        ]
        for name in frame.columns
        if name != frame.geometry.name
    }
    return FeatureTable(columns, geometry.tolist())


@functools.cache
def _index() -> TagIndex:
    """Return the layers of OpenStreetMap's catalogue by tag."""
    return TagIndex([spec for spec in load_catalog("openstreetmap").layers if spec.tags])


def _tables(path: Path, specs: Sequence[LayerSpec], *, crs: str | None) -> Iterator[FeatureTable]:
    """Yield the tables of a file with the columns that are needed."""
    names_read = {*_keys(specs), *MAPS, *NAMES, WAY_NUMBER, CLASS, CODE}
    names_read.update(name for pair in KINDS_AND_NUMBERS for name in pair)
    if path.suffix.lower() in parquet.SUFFIXES:
        frame = read_parquet(path, kind="features", columns=names_read)
        if frame.crs is None and crs is not None:
            frame = frame.set_crs(parse_crs(crs))
        yield _frame_table(frame)
        return
    if path.suffix.lower() in TABLES:
        tables = iter([_csv_rows(path, specs[0], names_read, crs=crs)])
    else:
        # A file that the probe does not open as a vector file is refused here with its error.
        layers = probe_file(path).layers or vector.spatial_layers(path)
        tables = vector.read_tables(
            layers, lambda fields: names_read if has_tag_columns(fields) else (), crs=crs
        )
    for rows, system, crs_notes in tables:
        arrays = {name: rows.column(name) for name in rows.columns}
        columns = {
            name: [plain(v) for v in array.to_pylist()] if isinstance(array, pa.Array) else array
            for name, array in arrays.items()
        }
        positions = rows.positions
        if not system.equals(WGS84, ignore_axis_order=True):
            shapes = [None if isinstance(position, str) else position for position in positions]
            degrees = transformed(built_geometries(shapes), system, WGS84)
            # Error messages stay in their places.
            pairs = zip(positions, degrees, strict=True)
            positions = [old if isinstance(old, str) else new for old, new in pairs]
        notes = list(crs_notes)
        if rows.errors:
            number, text = next(iter(rows.errors.items()))
            notes.append(f"{len(rows.errors):,} rows cannot be read (row {number}: {text})")
        yield FeatureTable(columns, positions, tuple(notes))


def _csv_rows(
    path: Path, spec: LayerSpec, names: Collection[str], *, crs: str | None
) -> tuple[Rows, CRS, tuple[str, ...]]:
    """Return the rows of a CSV file with some columns, their CRS, and notes."""
    table = csv_table(lambda: path.open("rb"), spec, what=str(path), where=str(path))
    rows = Rows.of(name for name in table.names if name in names)
    for row in table.rows():
        if isinstance(row, str):
            rows.skip(row)
            continue
        try:
            place: Position | str = table.places.read(row) if table.places else None
        except BadFeatureError as error:
            place = str(error)
        rows.add({name: value for name, value in row.items() if value}, "", place)
    own = table.places.crs if table.places else None
    system, notes = choose_crs(
        own or WGS84, implicit=own is None, expected=None, requested=crs, where=str(path)
    )
    return rows, system, (*table.file.notes, *notes)


def _keys(specs: Sequence[LayerSpec]) -> frozenset[str]:
    """Return the keys of the tags that the layers use."""
    tags = {key for spec in specs for alternative in spec.tags for key, _ in alternative}
    return frozenset({*tags, *(field for spec in specs for _, field in spec.fields), TYPE, AREA})


def _valid_rows(values: Sequence[Any] | None) -> Iterator[tuple[int, Any]]:
    """Yield the numbers and values of the rows of a column that have a value."""
    for row, value in enumerate(values or ()):
        if value is not None and not (isinstance(value, float) and math.isnan(value)):
            yield row, value


def _numbers(values: Sequence[Any] | None) -> Iterator[tuple[int, str]]:
    """Yield the rows of a column with a whole number that is not only a placeholder, and it."""
    counts = Counter(map(as_text, values or ()))
    for row, value in _valid_rows(values):
        number = identifier(value, counts[as_text(value)] > 1)
        if number.lstrip("-").isdigit() and int(number):
            yield row, number


def _tag_value(value: object) -> str:
    """Return the value of a tag as text; osmnx gives a joined way a list of values."""
    if isinstance(value, list | tuple | set | np.ndarray):
        return ";".join(map(as_text, value))
    return as_text(value)


def _parse_tags(value: object) -> list[tuple[str, str]]:
    """Return the tags of a map, a list of pairs, JSON, or text such as ``"key"=>"value"``."""
    if isinstance(value, str):
        text = value.strip()
        if not text.startswith(("{", "[")):
            pairs = PAIR.findall(text)
            if text and not pairs:
                raise ValueError(text)
            return [(ESCAPED.sub(r"\1", key), ESCAPED.sub(r"\1", text)) for key, text in pairs]
        value = json.loads(text)
    if isinstance(value, dict):
        items = list(value.items())
    else:
        pairs = list(value)  # type: ignore[call-overload]
        items = [tuple(pair.values()) if isinstance(pair, dict) else pair for pair in pairs]
    return [(str(key), _tag_value(item)) for key, item in items if item is not None]


@functools.cache
def _geofabrik() -> tuple[dict[str, dict[str, str]], dict[str, str]]:
    """Return the tags of Geofabrik's classes, and the keys of its classes by the start of a code.

    A class such as ``residential`` is the value of its key, here ``highway``.
    """
    source = data_folder() / "geofabrik.toml"
    content = parse_toml(source.read_text(encoding="utf-8"), "geofabrik.toml")
    return content["tags"], content["keys"]


@functools.lru_cache(maxsize=1024)
def _geofabrik_tags(name: str, code: str) -> dict[str, str]:
    tags, keys = _geofabrik()
    if name in tags:
        return tags[name]
    return {key: name for start, key in keys.items() if code.startswith(start)}


def _has_kinds(values: Sequence[Any]) -> bool:
    """Whether all values are node, way or relation, unlike those of the tag `type`."""
    return {str(value).lower() for _, value in _valid_rows(values)} <= set(KIND_BY_LETTER.values())


def _as_element(
    kind: ElementKind | None,
    tags: dict[str, str],
    position: Position | str,
    *,
    has_area_tag: bool,
) -> tuple[ElementKind, dict[str, str]]:
    """Return the kind of an element, if unknown the likely one, and the tags.

    The tags of an area are added to an element with an area if its table lacks such tags.
    """
    if isinstance(position, tuple | str):
        return kind or "node", tags
    dimensions = shapely.get_dimensions(position)  # -1 without a position
    if kind is None and dimensions <= 0:
        kind = "node"
    elif kind is None:
        parts = shapely.get_parts(position)
        simple = len(parts) == 1 and shapely.get_num_interior_rings(parts[0]) == 0
        kind = "way" if simple else "relation"
    if dimensions == 2 and kind == "relation":  # noqa: PLR2004
        return kind, {TYPE: MULTIPOLYGON, **tags}
    if dimensions == 2 and not has_area_tag:  # noqa: PLR2004
        return kind, {AREA: "yes", **tags}
    return kind, tags


def _element_shape(position: Position | str, spec: LayerSpec) -> Position | str:
    """Return the geometry of an element in a layer, or an error message."""
    if position is None or isinstance(position, tuple | str):
        return position
    try:
        return feature_shape(position, spec.role)
    except BadFeatureError as error:
        return str(error)
