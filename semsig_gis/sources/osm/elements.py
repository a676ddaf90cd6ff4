"""OpenStreetMap elements of a layer: which it means, by exact tags, and what they stand for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.filters import ANY_VALUE
from semsig_gis.sources.rows import (
    WGS84,
    BadFeatureError,
    RowRules,
    Rows,
    raw_layer,
    settle_crs,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec, Role
    from semsig_gis.sources.rows import Position

RING_NODES = 4  # of the smallest, a triangle: the first node comes again at its end


def way_shape(xy: NDArray[np.float64], role: Role) -> BaseGeometry:
    """Return what a way stands for: an area or a line, of buildings an area, of streets a line.

    Nodes are longitude and latitude, shape (n, 2). A closed way is an area, but for a street.
    """
    if len(xy) < 2:  # noqa: PLR2004
        raise BadFeatureError("has less than two nodes")
    if role == "streets":
        return shapely.LineString(xy)
    if not _is_ring(xy):
        if role == "buildings":
            raise BadFeatureError("is not closed, as the outline of a building is")
        return shapely.LineString(xy)
    area = _areas(shapely.Polygon(xy))
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
        # Parity, so that an island in a hole is inside again.
        area = shapely.symmetric_difference(area, ring)
    return _require_area(_areas(area))


def feature_shape(geometry: shapely.Geometry, role: Role) -> shapely.Geometry:
    """Return what a way or multipolygon stands for of which a program has made a shape already.

    It is as of `way_shape` if it has one outline, whether drawn as a line or an area.
    """
    parts = shapely.get_parts(geometry)
    if len(parts) == 1 and shapely.get_num_interior_rings(parts[0]) == 0:
        kind = shapely.get_type_id(parts[0])
        outline = parts[0].exterior if kind == shapely.GeometryType.POLYGON else parts[0]
        if kind != shapely.GeometryType.POINT:
            return way_shape(shapely.get_coordinates(outline), role)
    elif shapely.get_dimensions(geometry) == 2:  # noqa: PLR2004
        return _require_area(_areas(geometry))
    return geometry


def _is_ring(xy: NDArray[np.float64]) -> bool:
    return len(xy) >= RING_NODES and bool((xy[0] == xy[-1]).all())


def _rings(ways: Iterable[NDArray[np.float64]]) -> list[BaseGeometry]:
    """Return the areas inside the rings that ways are or join to."""
    ways = list(ways)
    closed = [shapely.Polygon(xy) for xy in ways if _is_ring(xy)]
    lines = [shapely.LineString(xy) for xy in ways if not _is_ring(xy) and len(xy) > 1]
    joined, cuts, dangles, broken = shapely.polygonize_full(lines)
    if not all(part.is_empty for part in (cuts, dangles, broken)):
        raise BadFeatureError("has ways that do not join to rings")
    outlines = shapely.get_exterior_ring(shapely.get_parts(joined))
    filled = [shapely.Polygon(outline) for outline in outlines]
    return [_areas(ring) for ring in (*closed, *filled)]


def _areas(geometry: shapely.Geometry) -> BaseGeometry:
    """Return the areas in a geometry, in valid form."""
    parts = shapely.get_parts(shapely.make_valid(geometry))
    return shapely.union_all(parts[shapely.get_dimensions(parts) == 2])  # noqa: PLR2004


def _require_area(area: BaseGeometry) -> BaseGeometry:
    if area.is_empty:
        raise BadFeatureError("encloses no area")
    return area


def has_tags(tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element has the tags of the layer; without ``tags``, none has.

    One of the alternatives must hold, in all its keys. Values compare exactly, so that
    ``amenity=toilets;bench`` is neither.
    """
    return any(
        all(
            tags.get(key) in accepted or (ANY_VALUE in accepted and tags.get(key, "no") != "no")
            for key, accepted in alternative
        )
        for alternative in spec.tags
    )


def has_shape(kind: ElementKind, tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element that has the tags of the layer is of a shape that it wants.

    It is not if its kind is not among the layer's ``elements``, if it is a relation but no
    multipolygon, or the outline of a square where centre lines of streets are wanted.
    """
    if kind not in spec.elements:
        return False
    if kind == "relation" and tags.get("type") != "multipolygon":
        return False
    return spec.role != "streets" or tags.get("area", "no") == "no"


def require_tags(spec: LayerSpec) -> tuple[tuple[tuple[str, tuple[str, ...]], ...], ...]:
    """Return the tags of a layer; CatalogError if it says none."""
    if not spec.tags:
        raise CatalogError(f'layer {spec.name!r} has no tags; write tags = [{{ key = "value" }}].')
    return spec.tags


class TagIndex:
    """The layers of a catalogue by tag, to find those of an element without trying each."""

    def __init__(self, specs: Sequence[LayerSpec]) -> None:
        self._specs = specs
        self._by_tag: dict[tuple[str, str], set[int]] = {}
        for number, spec in enumerate(specs):
            for alternative in require_tags(spec):
                # An element that lacks the first of the tags need not be looked at.
                key, accepted = alternative[0]
                for value in accepted:
                    self._by_tag.setdefault((key, value), set()).add(number)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of which every element of any of the layers has at least one, sorted."""
        return tuple(sorted({key for key, _ in self._by_tag}))

    def layers(self, tags: Mapping[str, str]) -> list[int]:
        """Return the positions of the layers whose tags an element has, in order."""
        candidates: set[int] = set()
        for key, value in tags.items():
            for looked_up in (value, ANY_VALUE):
                candidates |= self._by_tag.get((key, looked_up), set())
        return [number for number in sorted(candidates) if has_tags(tags, self._specs[number])]


class ElementLayer:
    """A layer that is being read, of elements that have its tags."""

    def __init__(self, spec: LayerSpec, *, filters: bool, where: str) -> None:
        self.spec = spec
        self.rows = Rows()
        fields = [field for _, field in spec.fields]  # any key of a tag may be one
        where = f"layer {spec.name!r} of {where}"
        self._rules = RowRules(spec, fields, filters=filters, where=where)

    def add(
        self, kind: ElementKind, name: str, tags: Mapping[str, str], position: Position | str
    ) -> bool:
        """Add an element, with what is wrong with it in the place of its position, if it counts."""
        self.rows.read += 1
        if not has_shape(kind, tags, self.spec):
            self.rows.filtered += 1
            return False
        text = f"{name} {position}" if isinstance(position, str) else position
        self.rows.add([tags.get(field) for field in self._rules.fields], name, text)
        return True

    def raw(self, crs: str | None) -> RawLayer:
        """Return the layer; elements are in WGS 84, whatever CRS the user states."""
        system, notes = settle_crs(
            WGS84, implicit=False, expected=self.spec.crs, given=crs, where=self._rules.file
        )
        return raw_layer(self.rows, self._rules, system, by_file=True, notes=notes)
