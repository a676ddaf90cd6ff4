"""OpenStreetMap elements of a layer: which it means, by exact tags, and how they become rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.crs import WGS84, settle_crs
from semsig_gis.sources.layers import ANY_VALUE
from semsig_gis.sources.raw_layer import RowRules, Rows, raw_layer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.layers import ElementKind, LayerSpec
    from semsig_gis.sources.raw_layer import Position


def has_tags(tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element has the tags of the layer; without ``tags``, none has.

    One of the alternatives must hold, in all its keys. Values compare exactly, so that
    ``amenity=toilets;bench`` is neither.
    """
    return any(
        all(_accepts(accepted, tags.get(key)) for key, accepted in alternative)
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


class TagIndex:
    """The layers of a catalogue by tag, to find those of an element without trying each.

    CatalogError if a layer says no tags.
    """

    def __init__(self, specs: Sequence[LayerSpec]) -> None:
        self._specs = specs
        self._by_tag: dict[tuple[str, str], set[int]] = {}
        for number, spec in enumerate(specs):
            if not spec.tags:
                msg = f'layer {spec.name!r} has no tags; write tags = [{{ key = "value" }}].'
                raise CatalogError(msg)
            for alternative in spec.tags:
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


def _accepts(accepted: tuple[str, ...], value: str | None) -> bool:
    return value in accepted or (ANY_VALUE in accepted and value not in {None, "no"})


class ElementLayer:
    """A layer that is being read, of elements that have its tags."""

    def __init__(self, spec: LayerSpec, *, filters: bool, where: str) -> None:
        self.spec = spec
        self.rows = Rows()
        self._where = f"layer {spec.name!r} of {where}"
        fields = [field for _, field in spec.fields]  # any key of a tag may be one
        self._rules = RowRules(spec, fields, filters=filters, where=self._where)

    def add(
        self, kind: ElementKind, number: int, tags: Mapping[str, str], position: Position | str
    ) -> bool:
        """Add an element, with what is wrong with it in the place of its position, if it counts."""
        self.rows.read += 1
        if not has_shape(kind, tags, self.spec):
            self.rows.filtered += 1
            return False
        name = f"{kind}/{number}"
        text = f"{name} {position}" if isinstance(position, str) else position
        self.rows.add([tags.get(field) for field in self._rules.fields], name, text)
        return True

    def raw(self, crs: str | None) -> RawLayer:
        """Return the layer; elements are in WGS 84, whatever CRS the user states."""
        system, notes = settle_crs(
            WGS84, implicit=False, expected=self.spec.crs, given=crs, where=self._where
        )
        return raw_layer(
            self.rows, self._rules, system, by_file=True, where=self._where, notes=notes
        )
