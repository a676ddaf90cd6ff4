"""What an Overpass server sends: elements of OpenStreetMap in JSON, and remarks on them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import SourceError
from semsig_gis.sources.osm.elements import ElementLayer, TagIndex, relation_shape, way_shape
from semsig_gis.sources.raw_layer import BadFeatureError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.layers import LayerSpec
    from semsig_gis.sources.raw_layer import Position

KINDS = ("node", "way", "relation")
LONGEST_REMARK = 300
EXHAUSTED = ("timed out", "out of memory")


@dataclass(frozen=True, slots=True)
class Document:
    """The elements of one answer, and what the server remarks on it: as a rule, nothing."""

    elements: list[dict[str, Any]]
    remark: str = ""

    @property
    def exhausted(self) -> bool:
        """Whether the answer is incomplete because the question was too large."""
        return self.failed and any(words in self.remark for words in EXHAUSTED)

    @property
    def failed(self) -> bool:
        """Whether the answer is incomplete."""
        return "error" in self.remark


def load_document(path: Path, *, where: str) -> Document:
    """Read an answer, complete or not; SourceError if it is not one of an Overpass server."""
    try:
        content = json.loads(path.read_bytes())
        elements = [element for element in content["elements"] if _is_element(element)]
        remark = " ".join(str(content.get("remark", "")).split())
        # as part of a sentence of ours
        return Document(elements, remark.rstrip(".").replace(". ", ", ")[:LONGEST_REMARK])
    except OSError as error:
        msg = f"{where} cannot be read ({error.strerror}); give a JSON file of an Overpass server."
        raise SourceError(msg) from error
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        msg = f"{where} is not what Overpass servers send in JSON; get it again."
        raise SourceError(msg) from error


def _is_element(element: dict[str, Any]) -> bool:
    """Tell whether it is an element of the map; one that is and is malformed raises TypeError."""
    if element["type"] not in KINDS:
        return False  # such as a count
    tags = element.get("tags", {})
    if isinstance(element["id"], int) and all(isinstance(value, str) for value in tags.values()):
        return True
    raise TypeError


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read layers of a file of Overpass JSON, or of the tiles of an area, one for each of `specs`.

    They are as of `sources.osm.file.read_layers`; an element in several tiles counts once.
    SourceError if a file is not Overpass JSON, or is incomplete by its own remark.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} tiles"
    layers = [ElementLayer(spec, filters=filters, where=where) for spec in specs]
    if not layers:
        return ()
    index = TagIndex(specs)
    seen: set[tuple[str, int]] = set()
    for file in paths:
        document = load_document(file, where=str(file))
        if document.failed:
            msg = f"{file} is incomplete ({document.remark}); ask for a smaller area."
            raise SourceError(msg)
        places = _Places(document)
        for element in document.elements:
            name = kind, number = element["type"], element["id"]
            # what has no tags is there for the positions of others
            if "tags" in element and name not in seen:
                seen.add(name)
                tags = element["tags"]
                for layer in (layers[place] for place in index.layers(tags)):
                    layer.add(kind, number, tags, places.position(element, layer.spec))
    return tuple(layer.raw(crs) for layer in layers)


class _Places:
    """The positions of the elements of a document.

    A way has its nodes' positions (``out geom``), only its centre (``out center``), or names nodes
    that are elements of their own (``out; >; out skel``).
    """

    def __init__(self, document: Document) -> None:
        self._by_kind: dict[str, dict[int, dict[str, Any]]] = {"node": {}, "way": {}}
        for element in document.elements:
            if element["type"] in self._by_kind:
                self._by_kind[element["type"]][element["id"]] = element

    def position(self, element: dict[str, Any], spec: LayerSpec) -> Position | str:
        """Return what an element stands for, or what is wrong with it."""
        try:
            return self._shape(element, spec)
        except BadFeatureError as error:
            return str(error)
        except (AttributeError, KeyError, TypeError):
            return "is not as Overpass servers send elements"

    def _shape(self, element: dict[str, Any], spec: LayerSpec) -> Position:
        if element["type"] == "node":
            return _point(element)
        if "center" in element and spec.role == "objects" and not _has_outline(element):
            return _point(element["center"])
        if element["type"] == "way":
            return way_shape(self._line(element), spec.role)
        parts = list(self._bounds(element))
        outer = [line for line, inner in parts if not inner]
        return relation_shape(outer, [line for line, inner in parts if inner], spec.role)

    def _bounds(self, relation: dict[str, Any]) -> Iterator[tuple[NDArray[np.float64], bool]]:
        """Yield the ways of a multipolygon, and whether each bounds a hole."""
        for member in relation.get("members", ()):
            if member.get("type") == "way":
                way = member if "geometry" in member else self._by_kind["way"].get(member["ref"])
                yield self._line(way or {}), member.get("role") == "inner"

    def _line(self, way: dict[str, Any]) -> NDArray[np.float64]:
        """Return longitude and latitude of the nodes of a way, shape (n, 2)."""
        nodes = way.get("geometry")
        if nodes is None:
            nodes = [self._by_kind["node"].get(number) for number in way.get("nodes", ())]
        missing = sum(node is None for node in nodes)
        if missing or not nodes:
            msg = f"lacks {missing} of its {len(nodes)} nodes" if nodes else "has no positions"
            raise BadFeatureError(msg)
        return np.array([_point(node) for node in nodes])


def _has_outline(element: dict[str, Any]) -> bool:
    return "geometry" in element or any("geometry" in part for part in element.get("members", ()))


def _point(place: dict[str, Any]) -> tuple[float, float]:
    try:
        return float(place["lon"]), float(place["lat"])
    except (KeyError, TypeError, ValueError) as error:
        msg = "has no valid position"
        raise BadFeatureError(msg) from error
