"""Which OpenStreetMap elements a layer means: exact tags, shared by every reader of such data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.core.errors import CatalogError
from semsig_gis.sources.layers import ANY_VALUE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.sources.layers import ElementKind, LayerSpec


def matches(tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element has the tags of the layer; without ``tags``, none has.

    One of the layer's alternatives must hold, in all its keys. Values compare exactly, so that
    ``amenity=toilets;bench`` is neither. Every value is every one but "no", by which mappers say
    that there is none.
    """
    return any(
        all(_accepts(accepted, tags.get(key)) for key, accepted in alternative)
        for alternative in spec.tags
    )


def counts(kind: ElementKind, tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element that has the tags of the layer is of a shape that it wants.

    It is not if its kind is not among the layer's ``elements``, if it is a relation but no
    multipolygon (it groups elements that are mapped themselves), or the outline of a square where
    centre lines of streets are wanted.
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
        return [number for number in sorted(candidates) if matches(tags, self._specs[number])]


def _accepts(accepted: tuple[str, ...], value: str | None) -> bool:
    return value in accepted or (ANY_VALUE in accepted and value not in {None, "no"})
