"""OpenStreetMap elements of a layer: selection by exact tags, and their geometry."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import shapely

from semsig_gis.core import CatalogError
from semsig_gis.sources.filters import ANY_VALUE
from semsig_gis.sources.rows import BadFeatureError, LayerBuilder

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec, Role
    from semsig_gis.sources.rows import Position

RING_NODES = 4  # of the smallest ring, a triangle: the first node is also the last
# Kinds of elements by the first letter of their names, as in "n123".
KIND_BY_LETTER: dict[str, ElementKind] = {"n": "node", "w": "way", "r": "relation"}


# Numbers below zero are those of a file: this is between the numbers of two files.
FILE_STEP = 10**12


def number_in_files(number: int, file: int) -> int:
    """Return a number of an element that is unique among files, which are counted from 0."""
    return number if number >= 0 else number - file * FILE_STEP


def way_shape(xy: NDArray[np.float64], role: Role) -> BaseGeometry:
    """Return the geometry of a way: an area if it is closed and not a street, else a line.

    Nodes are longitude and latitude, shape (n, 2). BadFeatureError for a building without area.
    """
    if len(xy) < 2:  # noqa: PLR2004
        raise BadFeatureError("has less than two nodes")
    if role == "streets":
        return shapely.LineString(xy)
    if not _is_ring(xy):
        if role == "buildings":
            raise BadFeatureError("is not closed, as the outline of a building is")
        return shapely.LineString(xy)
    area = _polygonal_part(shapely.Polygon(xy))
    if role == "buildings":
        return _require_area(area)
    return shapely.LineString(xy) if area.is_empty else area


def relation_shape(
    outer: Iterable[NDArray[np.float64]], inner: Iterable[NDArray[np.float64]]
) -> BaseGeometry:
    """Return the area of a multipolygon.

    Its ways come in any order and direction. BadFeatureError if they do not join to rings.
    """
    area: BaseGeometry = shapely.Polygon()
    for ring in (*_rings(outer), *_rings(inner)):
        # The symmetric difference counts an island in a hole as inside again.
        area = shapely.symmetric_difference(area, ring)
    return _require_area(_polygonal_part(area))


def feature_shape(geometry: shapely.Geometry, role: Role) -> shapely.Geometry:
    """Return the geometry of a way or multipolygon from the geometry in a file.

    A line, or an area without holes, is treated as the way that it was made from.
    """
    parts = shapely.get_parts(geometry)
    if len(parts) == 1 and shapely.get_num_interior_rings(parts[0]) == 0:
        kind = shapely.get_type_id(parts[0])
        outline = parts[0].exterior if kind == shapely.GeometryType.POLYGON else parts[0]
        if kind != shapely.GeometryType.POINT:
            return way_shape(shapely.get_coordinates(outline), role)
    elif shapely.get_dimensions(geometry) == 2:  # noqa: PLR2004
        return _require_area(_polygonal_part(geometry))
    return geometry


def _is_ring(xy: NDArray[np.float64]) -> bool:
    return len(xy) >= RING_NODES and bool((xy[0] == xy[-1]).all())


def _rings(ways: Iterable[NDArray[np.float64]]) -> list[BaseGeometry]:
    """Return the areas inside closed ways, and inside the rings that open ways form."""
    ways = list(ways)
    closed_ways = [shapely.Polygon(xy) for xy in ways if _is_ring(xy)]
    lines = [shapely.LineString(xy) for xy in ways if not _is_ring(xy) and len(xy) > 1]
    polygons, cuts, dangles, invalid_rings = shapely.polygonize_full(lines)
    if not all(part.is_empty for part in (cuts, dangles, invalid_rings)):
        raise BadFeatureError("has ways that do not join to rings")
    # polygonize_full makes holes of inner rings; here every ring is an area of its own.
    outlines = shapely.get_exterior_ring(shapely.get_parts(polygons))
    rings = [*closed_ways, *map(shapely.Polygon, outlines)]
    return [_polygonal_part(ring) for ring in rings]


def _polygonal_part(geometry: shapely.Geometry) -> BaseGeometry:
    """Return the areas in a geometry as one valid geometry."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    return shapely.union_all(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004


def _require_area(area: BaseGeometry) -> BaseGeometry:
    if area.is_empty:
        raise BadFeatureError("encloses no area")
    return area


def has_tags(tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Whether an element has the tags of a layer; none has the tags of a layer without ``tags``.

    All keys of one of the alternatives must have an accepted value. Values are compared exactly, so
    ``amenity=toilets;bench`` is neither toilets nor a bench.
    """
    return any(
        all(
            tags.get(key) in accepted or (ANY_VALUE in accepted and tags.get(key, "no") != "no")
            for key, accepted in alternative
        )
        for alternative in spec.tags
    )


def has_shape(kind: ElementKind, tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Whether an element with the tags of a layer has the kind of geometry that the layer needs.

    It does not if its kind is not among the layer's ``elements``, if it is a relation but not a
    multipolygon, or if it is the outline of a square in a layer of streets.
    """
    if kind not in spec.elements:
        return False
    if kind == "relation" and tags.get("type") != "multipolygon":
        return False
    return spec.role != "streets" or tags.get("area", "no") == "no"


def require_tags(spec: LayerSpec) -> tuple[tuple[tuple[str, tuple[str, ...]], ...], ...]:
    """Return the tags of a layer; CatalogError if it has none."""
    if not spec.tags:
        raise CatalogError(f'layer {spec.name!r} has no tags; write tags = [{{ key = "value" }}].')
    return spec.tags


class TagIndex:
    """Index of the layers of a catalogue by tag, to find the layers of an element quickly."""

    def __init__(self, specs: Sequence[LayerSpec]) -> None:
        self._specs = specs
        self._by_tag: dict[tuple[str, str], set[int]] = {}
        self._used: set[str] = set()
        for number, spec in enumerate(specs):
            for alternative in require_tags(spec):
                # Every element of this alternative has its first tag, so one tag is enough.
                key, accepted = alternative[0]
                for value in accepted:
                    self._by_tag.setdefault((key, value), set()).add(number)
                self._used.update(key for key, _ in alternative)
        # Most elements have the same few tags, apart from those that no layer uses.
        self._find = functools.lru_cache(maxsize=4096)(self._layers)

    @property
    def keys(self) -> tuple[str, ...]:
        """Sorted keys; every element of a layer has at least one of them."""
        return tuple(sorted({key for key, _ in self._by_tag}))

    def layers(self, tags: Mapping[str, str]) -> tuple[int, ...]:
        """Return the numbers of the layers that an element belongs to, in order."""
        return self._find(tuple((key, tags[key]) for key in tags if key in self._used))

    def _layers(self, pairs: tuple[tuple[str, str], ...]) -> tuple[int, ...]:
        candidates: set[int] = set()
        for key, value in pairs:
            for candidate_value in (value, ANY_VALUE):
                candidates |= self._by_tag.get((key, candidate_value), set())
        tags = dict(pairs)
        return tuple(number for number in sorted(candidates) if has_tags(tags, self._specs[number]))


def element_layers(specs: Sequence[LayerSpec], *, filters: bool, where: str) -> list[LayerBuilder]:
    """Return a builder for each layer; its fields are keys of tags."""
    return [
        LayerBuilder(
            spec,
            [field for _, field in spec.fields],
            filters=filters,
            where=f"layer {spec.name!r} of {where}",
        )
        for spec in specs
    ]


def add_element(
    layer: LayerBuilder,
    kind: ElementKind,
    name: str,
    tags: Mapping[str, str],
    position: Position | str,
) -> bool:
    """Add an element with its position or an error message; return whether it is accepted."""
    if not has_shape(kind, tags, layer.spec):
        layer.rows.skip()
        return False
    layer.rows.add(tags, name, f"{name} {position}" if isinstance(position, str) else position)
    return True
