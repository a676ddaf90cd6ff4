"""OpenStreetMap files through pyosmium: ``.osm``, ``.osm.pbf`` and ``.osm.bz2``, in flat memory."""

from __future__ import annotations

import contextlib
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import osmium
from osmium.filter import KeyFilter
from osmium.osm import NODE, RELATION, WAY, Node, Relation, Way

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.sources.crs import WGS84, settle_crs
from semsig_gis.sources.osm.shapes import relation_shape, way_shape
from semsig_gis.sources.osm.tags import TagIndex, counts
from semsig_gis.sources.raw_layer import BadFeatureError, Row, RowRules, Rows, raw_layer

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray
    from osmium.osm import Location

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.layers import ElementKind, LayerSpec

# What a file is by its name, and what pyosmium calls it.
FORMATS = {".osm": "xml", ".osm.bz2": "xml.bz2", ".osm.pbf": "pbf"}
KINDS: dict[str, ElementKind] = {"n": "node", "w": "way", "r": "relation"}
# pyosmium's table of node places that is not in memory.
PLACES = "sparse_file_array"
NOWHERE = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class _Layer:
    """A layer that is looked for, and what has been seen of it."""

    spec: LayerSpec
    rules: RowRules
    rows: Rows


class _Outline(NamedTuple):
    """A way or multipolygon that a layer wants, before the places of its nodes are known."""

    layer: _Layer
    row: Row
    way: int | None  # its number; None for a multipolygon
    outer: tuple[int, ...] = ()  # ways of a multipolygon
    inner: tuple[int, ...] = ()

    @property
    def ways(self) -> tuple[int, ...]:
        return (*self.outer, *self.inner) if self.way is None else (self.way,)


def read_layers(
    path: str | Path,
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read layers of a ``.osm``, ``.osm.pbf`` or ``.osm.bz2`` file, one for each of `specs`.

    The file is streamed, so that memory grows with what is kept. Where a layer has ways, the places
    of all nodes are kept meanwhile in an unnamed temporary file, of 16 bytes a node. A layer is
    found by its ``tags`` and ``elements``; fields in ``where``, ``class_by``, ``width_by`` and
    ``width_field`` are keys of tags.

    Identifiers are such as ``"node/123"``. Street objects are points, the centroid of a way or an
    area; buildings are polygons and streets lines. ``read`` counts the elements with the layer's
    tags, ``filtered`` those that are mapped in another way than it wants, and errors are incomplete
    (clipped) or broken elements. `crs` is ignored but for a note: such files are in EPSG:4326.
    SourceError if the file cannot be used, CatalogError if a layer says no tags, or an
    ``id_field``.
    """
    path = Path(path)
    file = _file(path)
    layers = tuple(_layer(spec, filters=filters) for spec in specs)
    if not layers:
        return ()
    index = TagIndex([layer.spec for layer in layers])
    with _plainly(path):
        outlines = _scan(file, layers, index)
        numbers = {way for outline in outlines for way in outline.ways}
        lines = _lines(file, numbers) if numbers else {}
    for outline in outlines:
        _place(outline, lines)
    done = []
    for layer in layers:
        system, notes = settle_crs(
            WGS84, implicit=False, expected=layer.spec.crs, given=crs, where=str(path)
        )
        where = f"layer {layer.spec.name!r} of {path}"
        done.append(
            raw_layer(layer.rows, layer.spec, system, by_file=True, where=where, notes=notes)
        )
    return tuple(done)


def _layer(spec: LayerSpec, *, filters: bool) -> _Layer:
    where = f"layer {spec.name!r}"
    if spec.id_field is not None:
        msg = (
            f"{where} has id_field = {spec.id_field!r}, yet the kind and number of an element "
            "identify it; remove it."
        )
        raise CatalogError(msg)
    fields = [field for _, field in spec.fields]
    return _Layer(spec, RowRules(spec, fields, filters=filters, where=where), Rows())


# --- The file ---------------------------------------------------------------------------------


def _file(path: Path) -> osmium.io.File:
    """Return a file, once it is seen to exist and to be of a known kind."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        msg = f"{path} {what}; give an OpenStreetMap file."
        raise SourceError(msg)
    name = path.name.lower()
    known = next((kind for suffix, kind in FORMATS.items() if name.endswith(suffix)), None)
    if known is None:
        msg = f"{path} is not an OpenStreetMap file; give one of {', '.join(FORMATS)}."
        raise SourceError(msg)
    if path.stat().st_size == 0:
        msg = f"{path} is empty; get it again."
        raise SourceError(msg)
    # The whole path, because libosmium takes "-" for standard input and "http:" for an address.
    return osmium.io.File(str(path.absolute()), known)


@contextlib.contextmanager
def _plainly(path: Path) -> Iterator[None]:
    """Turn what goes wrong in pyosmium's reading into a `SourceError`."""
    try:
        yield
    except (osmium.InvalidLocationError, RuntimeError, ValueError) as error:
        cause = " ".join(str(error).split()).rstrip(".")
        msg = (
            f"{path} cannot be read ({cause}); "
            "it is damaged or not the kind of file that its name says, get it again."
        )
        raise SourceError(msg) from error


# --- Reading ----------------------------------------------------------------------------------


def _scan(file: osmium.io.File, layers: Sequence[_Layer], index: TagIndex) -> list[_Outline]:
    """Collect the nodes of every layer; return its ways and multipolygons."""
    outlines = []
    processor = osmium.FileProcessor(file, NODE | WAY | RELATION)
    for element in processor.with_filter(KeyFilter(*index.keys)):
        if not isinstance(element, Node | Way | Relation) or element.deleted:
            continue
        tags = {tag.k: tag.v for tag in element.tags}
        for number in index.layers(tags):
            layer = layers[number]
            row = _row(layer, KINDS[element.type_str()], element.id, tags)
            if row is None:
                continue
            if isinstance(element, Node):
                location = element.location
                if location.valid():
                    layer.rows.kept.append(row._replace(position=(location.lon, location.lat)))
                else:
                    layer.rows.errors[row.number] = f"{row.source_id} has no valid position"
            elif isinstance(element, Way):
                outlines.append(_Outline(layer, row, element.id))
            else:
                outlines.append(_multipolygon(layer, row, element))
    return outlines


def _row(layer: _Layer, kind: ElementKind, number: int, tags: Mapping[str, str]) -> Row | None:
    """Return the row of an element that has the tags of a layer; None where it is left out."""
    rows, rules = layer.rows, layer.rules
    rows.read += 1
    fields = {field: tags.get(field) for field in rules.fields}
    if not (counts(kind, tags, layer.spec) and rules.keeps(fields)):
        rows.filtered += 1
        return None
    name = f"{kind}/{number}"
    return Row(rows.read, rules.class_name(fields), name, None, rules.half_width(fields))


def _multipolygon(layer: _Layer, row: Row, relation: Relation) -> _Outline:
    ways = [member for member in relation.members if member.type == "w"]
    return _Outline(
        layer,
        row,
        None,
        outer=tuple(member.ref for member in ways if member.role != "inner"),
        inner=tuple(member.ref for member in ways if member.role == "inner"),
    )


def _lines(file: osmium.io.File, numbers: set[int]) -> dict[int, NDArray[np.float64]]:
    """Return longitude and latitude of the nodes of ways; NaN for nodes that the file lacks.

    An index of these nodes alone would be smaller, yet pyosmium's filters by number take more than
    a gigabyte for the numbers that nodes have today.
    """
    places = osmium.NodeLocationsForWays(osmium.index.create_map(PLACES))
    places.ignore_errors()
    with osmium.io.Reader(file, NODE) as reader:
        osmium.apply(reader, places)
    lines: dict[int, NDArray[np.float64]] = {}
    unsent: dict[int, list[int]] = {}
    # A pass of its own, because in some exports the ways stand before their nodes.
    for way in osmium.FileProcessor(file, WAY).with_filter(places):
        if not isinstance(way, Way) or way.id not in numbers:
            continue
        nodes = list(way.nodes)
        if any(node.ref < 0 for node in nodes):
            unsent[way.id] = [node.ref for node in nodes]
        else:
            lines[way.id] = _line(_lonlat(node.location) for node in nodes)
    if unsent:
        # Numbers below zero are those of editors and converters, which pyosmium's table refuses.
        wanted = set(itertools.chain.from_iterable(unsent.values()))
        found = {
            node.id: _lonlat(node.location)
            for node in osmium.FileProcessor(file, NODE)
            if isinstance(node, Node) and node.id in wanted
        }
        for number, refs in unsent.items():
            lines[number] = _line(found.get(ref, NOWHERE) for ref in refs)
    return lines


def _lonlat(location: Location) -> tuple[float, float]:
    return (location.lon, location.lat) if location.valid() else NOWHERE


def _line(places: Iterable[tuple[float, float]]) -> NDArray[np.float64]:
    return np.array(list(places), np.float64).reshape(-1, 2)


def _place(outline: _Outline, lines: Mapping[int, NDArray[np.float64]]) -> None:
    """Give a layer what a way or multipolygon stands for, or what is wrong with it."""
    rows, row = outline.layer.rows, outline.row
    try:
        _require_whole(outline, lines)
        outer, inner = ([lines[way] for way in ways] for ways in (outline.outer, outline.inner))
        role = outline.layer.spec.role
        position = (
            relation_shape(outer, inner, role)
            if outline.way is None
            else way_shape(lines[outline.way], role)
        )
    except BadFeatureError as error:
        rows.errors[row.number] = f"{row.source_id} {error}"
    else:
        rows.kept.append(row._replace(position=position))


def _require_whole(outline: _Outline, lines: Mapping[int, NDArray[np.float64]]) -> None:
    """Refuse what has ways or nodes that the file lacks, as at the edge of an extract."""
    absent = [way for way in outline.ways if way not in lines]
    if absent:
        msg = f"lacks {len(absent)} of its {len(outline.ways)} ways, as where a file is clipped"
        raise BadFeatureError(msg)
    nodes = sum(len(lines[way]) for way in outline.ways)
    missing = sum(int(np.isnan(lines[way][:, 0]).sum()) for way in outline.ways)
    if missing:
        msg = f"lacks {missing} of its {nodes} nodes, as where a file is clipped"
        raise BadFeatureError(msg)
