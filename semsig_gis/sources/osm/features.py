"""OpenStreetMap elements as rows of tables: osmnx, QuackOSM, ohsome, GDAL, Geofabrik and others.

A row has a geometry, tells which element it is or does not, and has its tags in columns of their
own, in one column of all of them, or as a class of Geofabrik.
"""

from __future__ import annotations

import functools
import itertools
import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import shapely

from semsig_gis.core.errors import CrsError, InputError
from semsig_gis.sources import parquet
from semsig_gis.sources.catalog import data_folder, load_catalog
from semsig_gis.sources.filters import as_text
from semsig_gis.sources.osm.elements import ElementLayer, TagIndex, feature_shape
from semsig_gis.sources.parquet import column_names, read_parquet
from semsig_gis.sources.rows import WGS84, BadFeatureError, built_geometries, parse_crs
from semsig_gis.sources.vector import layer_fields, read_tables
from semsig_gis.sources.vector.member import DRIVERS
from semsig_gis.storage.toml import parse_toml

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec
    from semsig_gis.sources.rows import Position

# What a file is by its name, and what pyosmium calls it.
FORMATS = {".osm": "xml", ".osm.gz": "xml.gz", ".osm.bz2": "xml.bz2", ".pbf": "pbf"}
SUFFIXES = frozenset({*DRIVERS, *parquet.SUFFIXES, ".zip"} - {".csv"})
# Columns of all tags of a row: a map, JSON, or text such as '"amenity"=>"bench"'.
MAPS = ("tags", "other_tags", "@other_tags")
PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"\s*=>\s*(?:"((?:[^"\\]|\\.)*)"|NULL)')
ESCAPED = re.compile(r"\\(.)")
# QuackOSM's, which leaves out the tag `area`, so that a square is told by its shape alone.
QUACKOSM = "feature_id"
# Columns that say which element a row is, such as "node/123" or "n123".
NAMES = (QUACKOSM, "@id", "@osmId", "full_id", "osm_id", "osmid", "id")
NAME = re.compile(r"(n|node|w|way|r|relation)/?(\d+)")
# Columns of its kind and of its number, of osmnx before and after version 2, QuickOSM and pyrosm.
KINDS_AND_NUMBERS = (
    ("element", "id"),
    ("element_type", "osmid"),
    ("osm_type", "osm_id"),
    ("osm_type", "id"),
    ("type", "id"),
)
# Of GDAL and Geofabrik, which leave the kind to the geometry; GDAL has ways among areas here.
NUMBER, WAY_NUMBER = "osm_id", "osm_way_id"
KINDS: dict[str, ElementKind] = {"n": "node", "w": "way", "r": "relation"}
# Geofabrik's classes.
CLASS, CODE = "fclass", "code"
# What no element is without and still not told by most tables.
TYPE, AREA, MULTIPOLYGON = "type", "area", "multipolygon"
OVERPASS_START = 4096
Name = tuple["ElementKind | None", str]


@dataclass(frozen=True, eq=False)
class FeatureTable:
    """Rows by column, and where each is, in WGS 84; `notes` are about those that are not there."""

    columns: Mapping[str, pd.Series[Any]]
    positions: Sequence[Position | str]
    notes: tuple[str, ...] = ()


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read layers of vector files or GeoParquet with tags, or of several, one for each of `specs`.

    An element in several tables counts once. SourceError if a file cannot be read.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
    tables = (table for file in paths for table in _tables(file, specs, crs=crs))
    return table_layers(tables, specs, filters=filters, where=where)


def frame_layers(
    frame: gpd.GeoDataFrame, specs: Sequence[LayerSpec], *, filters: bool = True
) -> tuple[RawLayer, ...]:
    """Return the layers of a GeoDataFrame with tags; CrsError if it has no CRS."""
    return table_layers([frame_table(frame)], specs, filters=filters, where="the table")


def table_layers(
    tables: Iterable[FeatureTable], specs: Sequence[LayerSpec], *, filters: bool, where: str
) -> tuple[RawLayer, ...]:
    """Return the layers of tables of elements, one for each of `specs`."""
    layers = [ElementLayer(spec, filters=filters, where=where) for spec in specs]
    index, keys = TagIndex(specs), _keys(specs)
    seen: set[tuple[int, str]] = set()
    notes: list[str] = []
    for table in tables:
        tags, unread = _tags(table.columns, keys)
        names = _names(table.columns, len(tags))
        maps = set() if QUACKOSM in table.columns else {*MAPS}
        all_tags = not {AREA, *maps}.isdisjoint(table.columns)
        notes += table.notes
        if unread:
            notes.append(f"{unread:,} rows have tags that cannot be read")
        for row, found in enumerate(tags):
            matches = index.layers(found)
            if not matches:
                continue
            position = table.positions[row]
            kind, number = names[row]
            kind = kind or _kind(position)
            name = f"{kind}/{number}" if number else ""
            full = _completed(found, kind, position, all_tags=all_tags)
            for layer in matches:
                if name and (layer, name) in seen:
                    continue
                seen.add((layer, name))
                place = _place(position, layers[layer].spec)
                layers[layer].add(kind, name or f"row {row + 1}", full, place)
    raw = [layer.raw(None) for layer in layers]
    # A table seldom holds elements of all layers, and what cannot be read is of none of them.
    raw = [layer if layer.counts.read else replace(layer, notes=()) for layer in raw]
    return (replace(raw[0], notes=(*raw[0].notes, *notes)), *raw[1:]) if raw else ()


def has_element_columns(fields: Iterable[str]) -> bool:
    """Tell whether columns can only be those of elements of OpenStreetMap, with their tags."""
    fields = set(fields)
    pairs = (pair for pair in KINDS_AND_NUMBERS if pair != (TYPE, "id"))
    named = fields & {QUACKOSM, "@id", "@osmId", "full_id", NUMBER}
    return has_tag_columns(fields) and bool(named or any(fields.issuperset(pair) for pair in pairs))


def has_tag_columns(fields: Iterable[str]) -> bool:
    """Tell whether some columns are tags, or hold them."""
    fields = set(fields)
    return bool(fields & {*MAPS, *_index().keys} or fields.issuperset((CLASS, CODE)))


def file_reader(path: Path, *, sure: bool = False) -> str | None:
    """Return the reader of a file of elements by what is in it, None where it has no tags.

    If `sure`, the file has to say which elements they are, too.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES or not path.is_file():
        return None
    if suffix == ".json":
        with path.open("rb") as stream:
            start = stream.read(OVERPASS_START)
        if b'"elements"' in start and b'"Feature' not in start:
            return "overpass"
    names = [column_names(path)] if suffix in parquet.SUFFIXES else layer_fields(path)
    tells = has_element_columns if sure else has_tag_columns
    return "osm_features" if any(map(tells, names)) else None


def frame_fields(frame: gpd.GeoDataFrame) -> list[str]:
    """Return the columns of a table by name, those of its index among them."""
    return [str(name) for name in (*frame.index.names, *frame.columns) if name is not None]


def frame_table(frame: gpd.GeoDataFrame) -> FeatureTable:
    """Return the rows of a GeoDataFrame; CrsError if it has no CRS."""
    levels = [name for name in frame.index.names if name is not None and name not in frame]
    frame = frame.reset_index(level=levels) if levels else frame
    if frame.crs is None:
        raise CrsError("the table has no coordinate reference system; state it with set_crs.")
    if not frame.columns.is_unique:
        names = frame.columns[frame.columns.duplicated()]
        raise InputError(f"the table has several columns {names[0]!r}; rename or drop them.")
    geometry = frame.geometry
    if not frame.crs.equals(WGS84, ignore_axis_order=True):
        geometry = geometry.to_crs(WGS84)
    columns = {str(name): frame[name] for name in frame.columns if name != geometry.name}
    return FeatureTable(columns, geometry.to_list())


@functools.cache
def _index() -> TagIndex:
    """Return the layers of OpenStreetMap's catalogue by tag."""
    return TagIndex(load_catalog("openstreetmap").layers)


def _tables(path: Path, specs: Sequence[LayerSpec], *, crs: str | None) -> Iterator[FeatureTable]:
    """Yield the tables of a file, with the columns that matter."""
    names_read = {*_keys(specs), *MAPS, *NAMES, WAY_NUMBER, CLASS, CODE}
    names_read.update(name for pair in KINDS_AND_NUMBERS for name in pair)
    if path.suffix.lower() in parquet.SUFFIXES:
        frame = read_parquet(path, kind="features", columns=names_read)
        if frame.crs is None and crs is not None:
            frame = frame.set_crs(parse_crs(crs))
        yield frame_table(frame)
        return
    for table in read_tables(
        path, lambda fields: names_read if has_tag_columns(fields) else (), crs=crs
    ):
        rows = table.rows
        values = zip(*rows.values, strict=True) if rows.values else [()] * len(table.fields)
        columns = {
            name: pd.Series(list(column), dtype=object)
            for name, column in zip(table.fields, values, strict=True)
        }
        positions = rows.positions
        if not table.crs.equals(WGS84, ignore_axis_order=True):
            positions = _in_degrees(positions, table.crs)
        notes = table.notes
        if rows.errors:
            number, text = next(iter(rows.errors.items()))
            notes += (f"{len(rows.errors):,} rows cannot be read (row {number}: {text})",)
        yield FeatureTable(columns, positions, notes)


def _in_degrees(positions: Sequence[Position | str], crs: object) -> list[Position | str]:
    shapes = [None if isinstance(position, str) else position for position in positions]
    moved = gpd.GeoSeries(built_geometries(shapes), crs=crs).to_crs(WGS84)
    return [
        position if isinstance(position, str) else shape
        for position, shape in zip(positions, moved, strict=True)
    ]


def _keys(specs: Sequence[LayerSpec]) -> frozenset[str]:
    """Return the keys of tags that decide about the layers."""
    tags = {key for spec in specs for alternative in spec.tags for key, _ in alternative}
    return frozenset({*tags, *(field for spec in specs for _, field in spec.fields), TYPE, AREA})


def _tags(
    columns: Mapping[str, pd.Series[Any]], keys: frozenset[str]
) -> tuple[list[dict[str, str]], int]:
    """Return the tags of every row that matter, and of how many rows they cannot be read."""
    size = len(next(iter(columns.values()), ()))
    tags: list[dict[str, str]] = [{} for _ in range(size)]
    unread = 0
    for name in MAPS:
        for row, value in _known(columns.get(name)):
            try:
                tags[row].update((key, text) for key, text in _parsed(value) if key in keys)
            except (TypeError, ValueError):
                unread += 1
    for key in keys.intersection(columns):
        if key == TYPE and _says_kinds(columns[key]):
            continue
        for row, value in _known(columns[key]):
            tags[row][key] = _text(value)
    if CLASS in columns and CODE in columns:
        codes = dict(_known(columns[CODE]))
        for row, value in _known(columns[CLASS]):
            tags[row].update(_geofabrik_tags(str(value), as_text(codes.get(row, ""))))
    return tags, unread


def _known(values: pd.Series[Any] | None) -> Iterator[tuple[int, Any]]:
    """Yield the rows of a column that have a value, and these."""
    if values is None:
        return
    rows = np.flatnonzero(values.notna().to_numpy())
    yield from zip(rows.tolist(), values.iloc[rows].to_list(), strict=True)


def _text(value: object) -> str:
    """Return the value of a tag; of several, as osmnx joins ways, all as OpenStreetMap does."""
    if isinstance(value, list | tuple | set | np.ndarray):
        return ";".join(as_text(one) for one in value)
    return as_text(value)


def _parsed(value: object) -> list[tuple[str, str]]:
    """Return the tags of a map, a list of pairs, JSON, or text such as ``"key"=>"value"``."""
    if isinstance(value, str):
        text = value.strip()
        if not text.startswith(("{", "[")):
            pairs = PAIR.findall(text)
            if text and not pairs:
                raise ValueError(text)
            return [(ESCAPED.sub(r"\1", key), ESCAPED.sub(r"\1", said)) for key, said in pairs]
        value = json.loads(text)
    if isinstance(value, dict):
        items = list(value.items())
    else:
        pairs = list(value)  # type: ignore[call-overload]
        items = [tuple(pair.values()) if isinstance(pair, dict) else pair for pair in pairs]
    return [(str(key), _text(said)) for key, said in items if said is not None]


@functools.cache
def _geofabrik() -> tuple[dict[str, dict[str, str]], dict[str, str]]:
    """Return the tags of Geofabrik's classes, and the keys whose values classes of roads are."""
    source = data_folder() / "geofabrik.toml"
    content = parse_toml(source.read_text(encoding="utf-8"), "geofabrik.toml")
    return content["tags"], content["keys"]


@functools.lru_cache(maxsize=1024)
def _geofabrik_tags(name: str, code: str) -> dict[str, str]:
    tags, keys = _geofabrik()
    if name in tags:
        return tags[name]
    return {key: name for start, key in keys.items() if code.startswith(start)}


def _says_kinds(values: pd.Series[Any]) -> bool:
    """Tell whether a column says node, way or relation of every row, and not the tag `type`."""
    return set(values.dropna().astype(str).str.lower()) <= set(KINDS.values())


def _names(columns: Mapping[str, pd.Series[Any]], size: int) -> list[Name]:
    """Return kind and number of the element of every row, as far as it is told."""
    names: list[Name] = [(None, "")] * size
    told = (_numbered(columns), _of_pairs(columns), _of_texts(columns))
    for row, name in itertools.chain.from_iterable(told):
        names[row] = name
    return names


def _numbered(columns: Mapping[str, pd.Series[Any]]) -> Iterator[tuple[int, Name]]:
    """Yield what GDAL, Geofabrik and osm2pgsql say, of whose columns one has the number alone."""
    among_areas = WAY_NUMBER in columns
    for row, value in _known(columns.get(NUMBER)):
        number = as_text(value)
        if number.lstrip("-").isdigit():  # osm2pgsql has relations below zero
            relation = among_areas or number.startswith("-")
            yield row, ("relation" if relation else None, number.lstrip("-"))
    for row, value in _known(columns.get(WAY_NUMBER)):
        if as_text(value).isdigit():
            yield row, ("way", as_text(value))


def _of_pairs(columns: Mapping[str, pd.Series[Any]]) -> Iterator[tuple[int, Name]]:
    """Yield what two columns say, one of the kind and one of the number."""
    for kinds, numbers in KINDS_AND_NUMBERS:
        if kinds in columns and numbers in columns and _says_kinds(columns[kinds]):
            told = dict(_known(columns[kinds]))
            for row, value in _known(columns[numbers]):
                if row in told and as_text(value).isdigit():
                    yield row, (KINDS[str(told[row])[0].lower()], as_text(value))


def _of_texts(columns: Mapping[str, pd.Series[Any]]) -> Iterator[tuple[int, Name]]:
    """Yield what a column of both says."""
    for column in NAMES:
        for row, value in _known(columns.get(column)):
            match = NAME.fullmatch(value) if isinstance(value, str) else None
            if match:
                yield row, (KINDS[match[1][0]], match[2])


def _kind(position: Position | str) -> ElementKind:
    """Return the kind of element that a geometry is most likely of."""
    if isinstance(position, tuple | str) or position is None:
        return "node"
    if shapely.get_dimensions(position) <= 0:
        return "node"
    parts = shapely.get_parts(position)
    whole = len(parts) == 1 and shapely.get_num_interior_rings(parts[0]) == 0
    return "way" if whole else "relation"


def _completed(
    tags: dict[str, str], kind: ElementKind, position: Position | str, *, all_tags: bool
) -> dict[str, str]:
    """Add what its geometry says of an element and its table may not: that it is an area."""
    if isinstance(position, tuple | str) or shapely.get_dimensions(position) != 2:  # noqa: PLR2004
        return tags
    if kind == "relation":
        return {TYPE: MULTIPOLYGON, **tags}
    return tags if all_tags else {AREA: "yes", **tags}


def _place(position: Position | str, spec: LayerSpec) -> Position | str:
    """Return what an element stands for in a layer, or what is wrong with it."""
    if position is None or isinstance(position, tuple | str):
        return position
    try:
        return feature_shape(position, spec.role)
    except BadFeatureError as error:
        return str(error)
