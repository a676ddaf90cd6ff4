"""Forms of JSON that hold features but are not GeoJSON, and their conversion to it."""

from __future__ import annotations

import itertools
import json
import re
from typing import TYPE_CHECKING, Any

from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

# The start of a text that is GeoJSON without doubt, which is not parsed here.
COLLECTION = re.compile(r'\s*\{\s*"type"\s*:\s*"FeatureCollection"')
RECORD_SEPARATOR = "\x1e"
# A feature that is counted as a row that cannot be read.
UNREADABLE = {"type": "Feature", "properties": None, "geometry": {"type": "Point"}}
# How deeply the positions, or the lists of arcs, of the geometries of TopoJSON are nested.
POINT_DEPTHS = {"Point": 0, "MultiPoint": 1}
ARC_DEPTHS = {"LineString": 0, "Polygon": 1, "MultiLineString": 1, "MultiPolygon": 2}
NEXT_RECORD = re.compile(r"[^\s,]")


def converted(text: str) -> Mapping[str, Sequence[Mapping[str, Any]]] | None:
    """Return the records of each layer of a text, or None if it is GeoJSON or is not known.

    Known are GeoJSON and plain records in lines, TopoJSON, and backups of uMap. The only layer of a
    text without names has the name "". Records are features, or are plain. ValueError if a known
    form is damaged.
    """
    if COLLECTION.match(text) and text.count('"FeatureCollection"') == 1:
        return None
    try:
        document = parse_json(text)
    except ValueError:
        records = list(_in_lines(text))
        whole = sum(record is not UNREADABLE for record in records)
        several = len(records) > 1 or RECORD_SEPARATOR in text
        return {"": records} if several and 2 * whole > len(records) else None
    if not isinstance(document, dict):
        return None
    if document.get("type") == "Topology":
        try:
            return dict(_Topology(document).layers())
        except (AttributeError, LookupError, TypeError):
            raise ValueError("it is not whole TopoJSON") from None
    if document.get("type") == "umap" and isinstance(document.get("layers"), list):
        return dict(_umap(document["layers"])) or {"": []}
    return None


def _in_lines(text: str) -> Iterator[Mapping[str, Any]]:
    """Yield the records of a text with a record in each line, or after each separator."""
    decoder = json.JSONDecoder()
    parts = text.split(RECORD_SEPARATOR) if text.lstrip()[:1] == RECORD_SEPARATOR else [text]
    for part in parts:
        at, text_end = 0, len(part.rstrip())
        while at < text_end:
            at = NEXT_RECORD.search(part, at).start()  # type: ignore[union-attr] # before the end
            try:
                value, at = decoder.raw_decode(part, at)
            except (ValueError, RecursionError):
                value, at = None, (part.find("\n", at) + 1 or text_end)
            if isinstance(value, dict) and value.get("type") == "FeatureCollection":
                yield from value.get("features") or ()
            else:
                yield value if isinstance(value, dict) else UNREADABLE


def _umap(layers: Sequence[Any]) -> Iterator[tuple[str, list[Mapping[str, Any]]]]:
    names: set[str] = set()
    for number, layer in enumerate(layers, start=1):
        features = layer.get("features") if isinstance(layer, dict) else None
        if not isinstance(features, list) or not features:
            continue
        options = layer.get("_umap_options") or layer.get("_storage") or {}
        name = str(options.get("name") or f"layer {number}")
        name = name if name not in names else f"{name} ({number})"
        names.add(name)
        yield name, features


class _Topology:
    """TopoJSON (its specification, version 1), with positions instead of arcs."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        transform = document.get("transform") or {}
        self.quantized = bool(transform)
        self.scale = transform.get("scale", (1, 1))
        self.shift = transform.get("translate", (0, 0))
        self.arcs = [self._arc(arc) for arc in document.get("arcs") or ()]
        self.objects = document["objects"]

    def layers(self) -> Iterator[tuple[str, list[Mapping[str, Any]]]]:
        """Yield the names of the layers and their features."""
        for name, item in self.objects.items():
            parts = item["geometries"] if item.get("type") == "GeometryCollection" else [item]
            yield (
                str(name),
                [
                    {"type": "Feature", "properties": part.get("properties") or {}}
                    | ({"id": part["id"]} if "id" in part else {})
                    | {"geometry": self._geometry(part)}
                    for part in parts
                ],
            )

    def _geometry(self, item: Mapping[str, Any]) -> Mapping[str, Any] | None:
        kind = item.get("type")
        if kind == "GeometryCollection":
            return {"type": kind, "geometries": [*map(self._geometry, item["geometries"])]}
        if kind in POINT_DEPTHS:
            parts = _nested(item["coordinates"], POINT_DEPTHS[kind], self._position)
        elif kind in ARC_DEPTHS:
            parts = _nested(item["arcs"], ARC_DEPTHS[kind], self._line)
        else:
            return None
        return {"type": kind, "coordinates": parts}

    def _position(self, at: Sequence[float]) -> list[float]:
        return [
            value * scale + shift
            for value, scale, shift in zip(at, self.scale, self.shift, strict=False)
        ]

    def _arc(self, steps: Sequence[Sequence[float]]) -> list[list[float]]:
        # Each position is relative to the one before, if positions are quantized.
        if self.quantized:
            steps = list(itertools.accumulate(steps, lambda a, b: [a[0] + b[0], a[1] + b[1]]))
        return [self._position(at) for at in steps]

    def _line(self, indices: Sequence[int]) -> list[list[float]]:
        places: list[list[float]] = []
        for index in indices:
            arc = self.arcs[index] if index >= 0 else self.arcs[~index][::-1]
            places += arc[1:] if places else arc
        return places


def _nested(parts: Any, depth: int, convert: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - lists
    if depth == 0:
        return convert(parts)
    return [_nested(part, depth - 1, convert) for part in parts]
