"""OpenStreetMap files through pyosmium, in constant memory; several extracts are read as one."""

from __future__ import annotations

import contextlib
import itertools
import math
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import osmium
import shapely
from osmium.filter import KeyFilter
from osmium.osm import NODE, NOTHING, RELATION, WAY, Node, Relation, Way

from semsig_gis.core import HALF_TURN, CatalogError, SourceError, announce, temporary_folder
from semsig_gis.sources.area import Area, join_areas
from semsig_gis.sources.compression import check_compression_ratio
from semsig_gis.sources.osm import documents
from semsig_gis.sources.osm.elements import (
    KIND_BY_LETTER,
    TagIndex,
    add_element,
    element_layers,
    relation_shape,
    way_shape,
)
from semsig_gis.sources.osm.features import CHANGES, FORMATS
from semsig_gis.sources.osm.merge import age_notes, merge_extracts, read_errors
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.probe import text_format
from semsig_gis.sources.rows import WGS84, BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray
    from osmium.osm import Location

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import LayerBuilder, Position

# Index of pyosmium for the locations of nodes, in a temporary file.
LOCATION_INDEX = "sparse_file_array"
NO_LOCATION = (math.nan, math.nan)


class _Outline(NamedTuple):
    """A way or multipolygon of a layer, before the locations of its nodes are read."""

    layer: LayerBuilder
    row: int  # in the layer
    name: str
    outer: tuple[int, ...]  # ids of the outer ways; for a way, its own id
    inner: tuple[int, ...]
    is_way: bool

    @classmethod
    def of(cls, layer: LayerBuilder, name: str, element: Way | Relation) -> Self:
        """Return the outline of an element, the last row of its layer."""
        row = len(layer.rows.positions) - 1
        if isinstance(element, Way):
            return cls(layer, row, name, (element.id,), (), is_way=True)
        ways = [member for member in element.members if member.type == "w"]
        outer = tuple(member.ref for member in ways if member.role != "inner")
        inner = tuple(member.ref for member in ways if member.role == "inner")
        return cls(layer, row, name, outer, inner, is_way=False)

    def position(self, lines: Mapping[int, NDArray[np.float64]]) -> Position | str:
        """Return the geometry of a way or multipolygon, or an error message."""
        # The file may lack ways or nodes at its edge.
        ways = (*self.outer, *self.inner)
        absent = sum(way not in lines for way in ways)
        incomplete = absent or any(np.isnan(lines[way]).any() for way in ways)
        if incomplete and self.layer.spec.extended:
            # The outline of an extended thing needs not be complete.
            parts = [part for way in ways if way in lines for part in _known_parts(lines[way])]
            if parts:
                return shapely.MultiLineString(parts)
        if absent:
            what = f"{absent} of its {len(ways)} ways"
            return f"{self.name} lacks {what}, as where a file is clipped"
        nodes = sum(len(lines[way]) for way in ways)
        missing = sum(int(np.isnan(lines[way][:, 0]).sum()) for way in ways)
        if missing:
            what = f"{missing} of its {nodes} nodes"
            return f"{self.name} lacks {what}, as where a file is clipped"
        try:
            outer, inner = ([lines[way] for way in ways] for ways in (self.outer, self.inner))
            if self.is_way:
                return way_shape(outer[0], self.layer.spec.role)
            return relation_shape(outer, inner)
        except BadFeatureError as error:
            return f"{self.name} {error}"


def _known_parts(line: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the parts of a line, shape (n, 2), with known nodes."""
    starts = np.flatnonzero(np.diff(np.isnan(line[:, 0]), prepend=True))
    return [part for part in np.split(line, starts) if len(part) > 1 and not np.isnan(part).any()]


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from a file in one of `FORMATS`, or from several extracts.

    The file is streamed; if a layer has ways, the locations of all nodes are kept in an unnamed
    temporary file, 16 bytes per node. Nodes become points, ways lines or areas, multipolygons
    areas; identifiers are such as ``"node/123"``. Elements of another kind than the layer needs
    count as filtered, clipped and invalid ones as unreadable. An element in several extracts counts
    once, by its newest copy, also of the versions in a history, and not if it is deleted. XML that
    pyosmium does not read is read by `documents`, and gives layers of its own if there are
    other files. `crs` only causes a note.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    files = {path: _file(path) for path in paths}
    forms = {path: documents.xml_form(path) for path in files if _kind(path).startswith("xml")}
    dialects = [path for path, form in forms.items() if form == "dialect"]
    if dialects:
        others = [path for path in files if path not in dialects]
        more = read_layers(others, specs, filters=filters, crs=crs) if others else ()
        return more + documents.read_layers(
            dialects, specs, filters=filters, crs=crs, files_before=len(others)
        )
    where = str(paths[0]) if len(files) == 1 else f"{len(files)} extracts"
    layers = element_layers(specs, filters=filters, where=where)
    if not layers:
        return ()
    for spec in specs:
        if spec.id_field is not None:
            raise CatalogError(
                f"layer {spec.name!r} has id_field = {spec.id_field!r}, yet the kind and number of "
                "an element identify it; remove it."
            )
    seconds = sum(path.stat().st_size / _bytes_a_second(path) for path in paths)
    announce(seconds, f"reading {where}")
    index = TagIndex(specs)
    with contextlib.ExitStack() as stack:
        stack.enter_context(read_errors(where))
        if (
            len(files) == 1
            and "versions" not in forms.values()
            and not _has_versions(*files.values())
        ):
            (file,) = files.values()
            # First the elements with tags, then the lines of the ways that they need.
            outlines = _scan(file, layers, index)
        else:
            outlines = None
        if outlines is None:  # several extracts, or several versions of an element
            folder = stack.enter_context(temporary_folder(Path(tempfile.gettempdir())))
            file = merge_extracts(files, index, folder / "merged.opl")
            layers = element_layers(specs, filters=filters, where=where)
            outlines = _scan(file, layers, index) or []
        ways = {way for outline in outlines for way in (*outline.outer, *outline.inner)}
        lines = _lines(file, ways) if ways else {}
    for outline in outlines:
        outline.layer.rows.positions[outline.row] = outline.position(lines)
    notes = age_notes(files) if len(files) > 1 else ()
    extent = _extent(files.values())
    raw = (layer.layer(WGS84, requested=crs) for layer in layers)
    return tuple(replace(layer, notes=(*notes, *layer.notes), extent=extent) for layer in raw)


def _bytes_a_second(path: Path) -> float:
    """Return the measured speed of reading a file; compressed ones are slower."""
    return 12e6 if path.suffix == ".osm" else 2e6


def _extent(files: Iterable[osmium.io.File]) -> Area | None:
    """Return the area of the bounding boxes in the headers of extracts; None if one has none."""
    boxes = []
    for file in files:
        with osmium.io.Reader(file, NOTHING) as reader:
            box = reader.header().box()
        if not box.valid():
            return None
        low, high = box.bottom_left, box.top_right
        spans = [(low.lon, high.lon)]
        if high.lon - low.lon > HALF_TURN:  # across the 180th meridian: osmium swaps the ends
            spans = [(high.lon, HALF_TURN), (-HALF_TURN, low.lon)]
        boxes += [shapely.box(west, low.lat, east, high.lat) for west, east in spans]
    polygon = join_areas(np.array(boxes, dtype=object))
    return None if polygon is None else Area(polygon, "extract")


def _file(path: Path) -> osmium.io.File:
    """Open a file of elements; SourceError if it is missing, empty or of another format."""
    require_file(path, "an OpenStreetMap file")
    kind = _kind(path)
    if path.stat().st_size == 0:
        raise SourceError(f"{path} is empty; download it again.")
    check_compression_ratio(path)
    # An absolute path, because libosmium reads "-" as standard input and "http:" as an address.
    return osmium.io.File(str(path.absolute()), kind)


def _kind(path: Path) -> str:
    """Return the name of a file's format in pyosmium; SourceError if it is another format."""
    name = path.name.lower()
    if name.endswith(CHANGES):
        raise documents.changes_error(path)
    kind = next((kind for suffix, kind in FORMATS.items() if name.endswith(suffix)), None)
    if kind is None and text_format(path) == "osm":
        return "xml"
    if kind is None:
        raise SourceError(f"{path} is not an OpenStreetMap file; give one of {', '.join(FORMATS)}.")
    return kind


def _has_versions(file: osmium.io.File) -> bool:
    """Whether a file says that it may have several versions of an element."""
    with osmium.io.Reader(file, NOTHING) as reader:
        return bool(reader.header().has_multiple_object_versions)


def _scan(
    file: osmium.io.File, layers: Sequence[LayerBuilder], index: TagIndex
) -> list[_Outline] | None:
    """Add the elements of a file to their layers; return the ways and multipolygons.

    None if an element is there more than once.
    """
    outlines: list[_Outline] = []
    names: set[str] = set()
    processor = osmium.FileProcessor(file, NODE | WAY | RELATION)
    for element in processor.with_filter(KeyFilter(*index.keys)):
        if not isinstance(element, Node | Way | Relation) or element.deleted:
            continue
        tags = dict(element.tags)
        kind = KIND_BY_LETTER[element.type_str()]
        name = f"{kind}/{element.id}"
        numbers = index.layers(tags)
        if not numbers:
            continue
        if name in names:
            return None
        names.add(name)
        for layer in (layers[number] for number in numbers):
            if isinstance(element, Node):
                valid = element.location.valid()
                position = _lonlat(element.location) if valid else "has no valid position"
                add_element(layer, kind, name, tags, position)
            elif add_element(layer, kind, name, tags, None):
                outlines.append(_Outline.of(layer, name, element))
    return outlines


def _lines(file: osmium.io.File, numbers: set[int]) -> dict[int, NDArray[np.float64]]:
    """Return longitude and latitude of the nodes of ways; NaN for nodes that the file lacks.

    The locations of all nodes are stored, because an id filter of pyosmium takes more than a
    gigabyte for today's ids.
    """
    locations = osmium.NodeLocationsForWays(osmium.index.create_map(LOCATION_INDEX))
    locations.ignore_errors()
    with osmium.io.Reader(file, NODE) as reader:
        osmium.apply(reader, locations)
    lines: dict[int, NDArray[np.float64]] = {}
    local_ways: dict[int, list[int]] = {}
    # A second pass, because some files have ways before their nodes.
    for way in osmium.FileProcessor(file, WAY).with_filter(locations):
        if not isinstance(way, Way) or way.id not in numbers:
            continue
        nodes = list(way.nodes)
        if any(node.ref < 0 for node in nodes):
            local_ways[way.id] = [node.ref for node in nodes]
        else:
            lines[way.id] = _line(_lonlat(node.location) for node in nodes)
    if local_ways:
        # Editors and converters use ids below zero, which the index of pyosmium does not accept.
        local_ids = set(itertools.chain.from_iterable(local_ways.values()))
        local_locations = {
            node.id: _lonlat(node.location)
            for node in osmium.FileProcessor(file, NODE)
            if isinstance(node, Node) and node.id in local_ids
        }
        for number, refs in local_ways.items():
            lines[number] = _line(local_locations.get(ref, NO_LOCATION) for ref in refs)
    return lines


def _lonlat(location: Location) -> tuple[float, float]:
    return (location.lon, location.lat) if location.valid() else NO_LOCATION


def _line(points: Iterable[tuple[float, float]]) -> NDArray[np.float64]:
    return np.array(list(points), np.float64).reshape(-1, 2)
