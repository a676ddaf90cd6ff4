"""OpenStreetMap files through pyosmium, in flat memory; several extracts are read as one."""

from __future__ import annotations

import contextlib
import itertools
import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import osmium
import shapely
from osmium.filter import KeyFilter
from osmium.osm import NODE, NOTHING, RELATION, WAY, Node, Relation, Way

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.core.geometry import HALF_TURN
from semsig_gis.core.temporary import own_folder
from semsig_gis.sources.area import Area, join_areas
from semsig_gis.sources.compression import require_modest
from semsig_gis.sources.osm.elements import ElementLayer, TagIndex, relation_shape, way_shape
from semsig_gis.sources.osm.features import FORMATS
from semsig_gis.sources.osm.merge import age_notes, merge_extracts, readable
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.rows import BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray
    from osmium.osm import Location

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec
    from semsig_gis.sources.rows import Position

KINDS: dict[str, ElementKind] = {"n": "node", "w": "way", "r": "relation"}
# pyosmium's table of node places that is not in memory.
PLACES = "sparse_file_array"
NOWHERE = (math.nan, math.nan)


class _Outline(NamedTuple):
    """A way or multipolygon that a layer wants, before the places of its nodes are known."""

    layer: ElementLayer
    row: int  # of the layer
    name: str
    outer: tuple[int, ...]  # ways; of a way, itself
    inner: tuple[int, ...]
    is_way: bool


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read layers of a file in one of `FORMATS`, or of several extracts, one for each of `specs`.

    The file is streamed; where a layer has ways, the places of all nodes are kept meanwhile in an
    unnamed temporary file, of 16 bytes a node. Nodes are points, ways lines or areas, multipolygons
    areas; identifiers are such as ``"node/123"``. Elements that are mapped in another way than the
    layer wants are filtered, clipped and broken ones unreadable. An element in several extracts
    counts once, by its newest copy. `crs` is only noted.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    files = {path: _file(path) for path in paths}
    where = str(paths[0]) if len(files) == 1 else f"{len(files)} extracts"
    layers = [ElementLayer(spec, filters=filters, where=where) for spec in specs]
    if not layers:
        return ()
    for spec in specs:
        if spec.id_field is not None:
            raise CatalogError(
                f"layer {spec.name!r} has id_field = {spec.id_field!r}, yet the kind and number of "
                "an element identify it; remove it."
            )
    index = TagIndex(specs)
    with _as_one(files, index) as file, readable(where):
        outlines = _scan(file, layers, index)
        ways = {way for outline in outlines for way in (*outline.outer, *outline.inner)}
        lines = _lines(file, ways) if ways else {}
    for outline in outlines:
        outline.layer.rows.positions[outline.row] = _position(outline, lines)
    notes = age_notes(files) if len(files) > 1 else ()
    extent = _extent(files.values())
    raw = (layer.raw(crs) for layer in layers)
    return tuple(replace(layer, notes=(*notes, *layer.notes), extent=extent) for layer in raw)


def _extent(files: Iterable[osmium.io.File]) -> Area | None:
    """Return the boxes that extracts say they cover; None where one of them does not."""
    boxes = []
    for file in files:
        with osmium.io.Reader(file, NOTHING) as reader:
            box = reader.header().box()
        if not box.valid():
            return None
        low, high = box.bottom_left, box.top_right
        spans = [(low.lon, high.lon)]
        if high.lon - low.lon > HALF_TURN:  # across the 180th meridian: osmium has swapped its ends
            spans = [(high.lon, HALF_TURN), (-HALF_TURN, low.lon)]
        boxes += [shapely.box(west, low.lat, east, high.lat) for west, east in spans]
    polygon = join_areas(np.array(boxes, dtype=object))
    return None if polygon is None else Area(polygon, "extract")


@contextlib.contextmanager
def _as_one(files: Mapping[Path, osmium.io.File], index: TagIndex) -> Iterator[osmium.io.File]:
    """Give the one file there is, or one that several extracts are merged into."""
    if len(files) == 1:
        yield from files.values()
        return
    with own_folder(Path(tempfile.gettempdir())) as folder:
        yield merge_extracts(files, index, folder / "merged.opl")


def _file(path: Path) -> osmium.io.File:
    """Return a file that exists and is of a known kind."""
    require_file(path, "an OpenStreetMap file")
    name = path.name.lower()
    kind = next((kind for suffix, kind in FORMATS.items() if name.endswith(suffix)), None)
    if kind is None:
        raise SourceError(f"{path} is not an OpenStreetMap file; give one of {', '.join(FORMATS)}.")
    if path.stat().st_size == 0:
        raise SourceError(f"{path} is empty; download it again.")
    require_modest(path)
    # The whole path, because libosmium takes "-" for standard input and "http:" for an address.
    return osmium.io.File(str(path.absolute()), kind)


def _scan(file: osmium.io.File, layers: Sequence[ElementLayer], index: TagIndex) -> list[_Outline]:
    """Collect the elements of every layer; return its ways and multipolygons."""
    outlines = []
    processor = osmium.FileProcessor(file, NODE | WAY | RELATION)
    for element in processor.with_filter(KeyFilter(*index.keys)):
        if not isinstance(element, Node | Way | Relation) or element.deleted:
            continue
        tags = {tag.k: tag.v for tag in element.tags}
        kind = KINDS[element.type_str()]
        name = f"{kind}/{element.id}"
        for layer in (layers[number] for number in index.layers(tags)):
            if isinstance(element, Node):
                valid = element.location.valid()
                place = _lonlat(element.location) if valid else "has no valid position"
                layer.add(kind, name, tags, place)
            elif layer.add(kind, name, tags, None):
                row = len(layer.rows.positions) - 1
                outlines.append(_Outline(layer, row, name, *_ways(element)))
    return outlines


def _ways(element: Way | Relation) -> tuple[tuple[int, ...], tuple[int, ...], bool]:
    """Return the ways that bound an element, those of its holes, and whether it is a way itself."""
    if isinstance(element, Way):
        return (element.id,), (), True
    ways = [member for member in element.members if member.type == "w"]
    outer = tuple(member.ref for member in ways if member.role != "inner")
    return outer, tuple(member.ref for member in ways if member.role == "inner"), False


def _lines(file: osmium.io.File, numbers: set[int]) -> dict[int, NDArray[np.float64]]:
    """Return longitude and latitude of the nodes of ways; NaN for nodes that the file lacks.

    pyosmium's filters by number would take more than a gigabyte for today's numbers of nodes.
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
        numbers_below_zero = set(itertools.chain.from_iterable(unsent.values()))
        places_below_zero = {
            node.id: _lonlat(node.location)
            for node in osmium.FileProcessor(file, NODE)
            if isinstance(node, Node) and node.id in numbers_below_zero
        }
        for number, refs in unsent.items():
            lines[number] = _line(places_below_zero.get(ref, NOWHERE) for ref in refs)
    return lines


def _lonlat(location: Location) -> tuple[float, float]:
    return (location.lon, location.lat) if location.valid() else NOWHERE


def _line(places: Iterable[tuple[float, float]]) -> NDArray[np.float64]:
    return np.array(list(places), np.float64).reshape(-1, 2)


def _position(outline: _Outline, lines: Mapping[int, NDArray[np.float64]]) -> Position | str:
    """Return what a way or multipolygon stands for, or what is wrong with it."""
    try:
        _require_whole((*outline.outer, *outline.inner), lines)
        outer, inner = ([lines[way] for way in ways] for ways in (outline.outer, outline.inner))
        if outline.is_way:
            return way_shape(outer[0], outline.layer.spec.role)
        return relation_shape(outer, inner)
    except BadFeatureError as error:
        return f"{outline.name} {error}"


def _require_whole(ways: Sequence[int], lines: Mapping[int, NDArray[np.float64]]) -> None:
    """Refuse what has ways or nodes that the file lacks, as at the edge of an extract."""
    absent = [way for way in ways if way not in lines]
    if absent:
        raise BadFeatureError(
            f"lacks {len(absent)} of its {len(ways)} ways, as where a file is clipped"
        )
    nodes = sum(len(lines[way]) for way in ways)
    missing = sum(int(np.isnan(lines[way][:, 0]).sum()) for way in ways)
    if missing:
        raise BadFeatureError(f"lacks {missing} of its {nodes} nodes, as where a file is clipped")
