"""Which OpenStreetMap elements a layer means: exact tags, shared by every reader of such data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.errors import CatalogError
from semsig_gis.layer_spec import ANY_VALUE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from semsig_gis.layer_spec import ElementKind, LayerSpec


def matches(tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element has the tags of the layer.

    One of the layer's alternatives must hold, in all its keys. Values compare exactly, so that
    ``amenity=toilets;bench`` is neither. Every value is every one but "no", by which mappers say
    that there is none.

    Parameters
    ----------
    tags : mapping of str to str
        Tags of the element.
    spec : LayerSpec
        The layer; without ``tags`` it means no element at all.

    Returns
    -------
    bool
        Whether the tags are the layer's.

    Examples
    --------
    >>> from semsig_gis.layer_spec import LayerSpec
    >>> taps = LayerSpec(
    ...     name="taps",
    ...     class_name="water_fountain",
    ...     tags=((("amenity", ("drinking_water",)),), (("man_made", ("water_tap",)),)),
    ... )
    >>> matches({"amenity": "drinking_water", "name": "Fontaine"}, taps)
    True
    >>> matches({"amenity": "public_bookcase"}, taps)
    False
    """
    return any(
        all(_accepts(accepted, tags.get(key)) for key, accepted in alternative)
        for alternative in spec.tags
    )


def counts(kind: ElementKind, tags: Mapping[str, str], spec: LayerSpec) -> bool:
    """Tell whether an element that has the tags of the layer is of a shape that it wants.

    Parameters
    ----------
    kind : {"node", "way", "relation"}
        Kind of the element.
    tags : mapping of str to str
        Its tags.
    spec : LayerSpec
        The layer.

    Returns
    -------
    bool
        False for a kind that is not among the layer's ``elements``, for a relation that is no
        multipolygon (it groups elements that are mapped themselves), and for the outline of a
        square where centre lines of streets are wanted.

    Examples
    --------
    >>> from semsig_gis.layer_spec import LayerSpec
    >>> stops = LayerSpec(name="stops", class_name="bus_stop", elements=("node",))
    >>> counts("node", {"highway": "bus_stop"}, stops), counts("way", {}, stops)
    (True, False)
    """
    if kind not in spec.elements:
        return False
    if kind == "relation" and tags.get("type") != "multipolygon":
        return False
    return spec.role != "streets" or tags.get("area", "no") == "no"


class TagIndex:
    """The layers of a catalogue by tag, to find those of an element without trying each.

    Parameters
    ----------
    specs : sequence of LayerSpec
        The layers.

    Raises
    ------
    CatalogError
        If a layer says no tags.

    Examples
    --------
    >>> from semsig_gis.layer_spec import LayerSpec
    >>> trees = LayerSpec(name="t", class_name="alignment_tree", tags=((("natural", ("tree",)),),))
    >>> index = TagIndex([trees])
    >>> index.keys, index.layers({"natural": "tree"}), index.layers({"natural": "tree_row"})
    (('natural',), [0], [])
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
        """Return the positions of the layers whose tags an element has, in order.

        Parameters
        ----------
        tags : mapping of str to str
            Tags of the element.

        Returns
        -------
        list of int
            Positions in the layers that the index was made of.
        """
        candidates: set[int] = set()
        for key, value in tags.items():
            for looked_up in (value, ANY_VALUE):
                candidates |= self._by_tag.get((key, looked_up), set())
        return [number for number in sorted(candidates) if matches(tags, self._specs[number])]


def _accepts(accepted: tuple[str, ...], value: str | None) -> bool:
    return value in accepted or (ANY_VALUE in accepted and value not in {None, "no"})
