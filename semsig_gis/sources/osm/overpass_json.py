"""What an Overpass server sends: elements of OpenStreetMap in JSON, and remarks on them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import SourceError
from semsig_gis.sources.crs import WGS84, settle_crs
from semsig_gis.sources.osm.shapes import relation_shape, way_shape
from semsig_gis.sources.osm.tags import TagIndex, counts
from semsig_gis.sources.raw_layer import BadFeatureError, Row, RowRules, Rows, raw_layer

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources import RawLayer
    from semsig_gis.sources.layers import ElementKind, LayerSpec
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

    Layers, `crs` and what is returned are as of `sources.osm.file.read_layers`. An
    element that is in several tiles counts once. SourceError if a file is missing, is not Overpass
    JSON, or is incomplete by its own remark; CatalogError if a layer says no tags.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} tiles"
    layers = [_Layer(spec, _rules(spec, filters=filters, where=where)) for spec in specs]
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
            name = element["type"], element["id"]
            # what has no tags is there for the positions of others
            if "tags" in element and name not in seen:
                seen.add(name)
                for number in index.layers(element["tags"]):
                    layers[number].take(element, places)
    done = []
    for layer in layers:
        system, notes = settle_crs(
            WGS84, implicit=False, expected=layer.spec.crs, given=crs, where=where
        )
        place = f"layer {layer.spec.name!r} of {where}"
        done.append(
            raw_layer(layer.rows, layer.spec, system, by_file=True, where=place, notes=notes)
        )
    return tuple(done)


def _rules(spec: LayerSpec, *, filters: bool, where: str) -> RowRules:
    fields = [field for _, field in spec.fields]
    return RowRules(spec, fields, filters=filters, where=where)


@dataclass(frozen=True, slots=True)
class _Layer:
    """A layer that is looked for, and what has been seen of it."""

    spec: LayerSpec
    rules: RowRules
    rows: Rows = field(default_factory=Rows)

    def take(self, element: dict[str, Any], places: _Places) -> None:
        """Count an element that has the tags of the layer, and keep it if it is wanted."""
        kind: ElementKind = element["type"]
        tags = element["tags"]
        rows, rules = self.rows, self.rules
        rows.read += 1
        values = {name: tags.get(name) for name in rules.fields}
        if not (counts(kind, tags, self.spec) and rules.keeps(values)):
            rows.filtered += 1
            return
        name = f"{kind}/{element['id']}"
        try:
            position = places.position(element, self.spec)
        except BadFeatureError as error:
            rows.errors[rows.read] = f"{name} {error}"
        except (AttributeError, KeyError, TypeError):
            rows.errors[rows.read] = f"{name} is not as Overpass servers send elements"
        else:
            source_id = rules.source_id(values, name)
            class_name, half_width = rules.class_name(values), rules.half_width(values)
            rows.kept.append(Row(rows.read, class_name, source_id, position, half_width))


class _Places:
    """The positions of the elements of a document, however it says them.

    A way has its nodes' positions (``out geom``), only its centre (``out center``), or names nodes
    that are elements of their own (``out; >; out skel``).
    """

    def __init__(self, document: Document) -> None:
        self._by_kind: dict[str, dict[int, dict[str, Any]]] = {"node": {}, "way": {}}
        for element in document.elements:
            if element["type"] in self._by_kind:
                self._by_kind[element["type"]][element["id"]] = element

    def position(self, element: dict[str, Any], spec: LayerSpec) -> Position:
        """Return what an element stands for.

        BadFeatureError if its position is not there, or not in full.
        """
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
