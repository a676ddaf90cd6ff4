"""OpenStreetMap elements in memory: JSON in several forms, and XML that pyosmium does not read.

Such XML has centres or geometries of Overpass servers, or elements that an editor has deleted.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import operator
import re
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal
from xml.etree import ElementTree as ET  # without entities, see `_read_xml`

import numpy as np

from semsig_gis.core import SourceError
from semsig_gis.sources.compression import open_unpacked
from semsig_gis.sources.filters import as_text
from semsig_gis.sources.osm.elements import (
    KIND_BY_LETTER,
    TagIndex,
    add_element,
    element_layers,
    number_in_files,
    relation_shape,
    way_shape,
)
from semsig_gis.sources.probe import BOM, ROOT, START_BYTES
from semsig_gis.sources.rows import WGS84, BadFeatureError
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

LONGEST_REMARK = 300
EXHAUSTED = ("timed out", "out of memory")
KINDS = frozenset(KIND_BY_LETTER.values())
# Keys of elements that are no tags, and other names of some.
OWN_KEYS = frozenset(
    {"action", "bounds", "center", "center_lat", "center_lon", "changeset", "geometry", "id", "lat",
     "lon", "members", "nodes", "timestamp", "type", "uid", "user", "version", "visible"}
)  # fmt: skip
NAMES_OF_KEYS = {"latitude": "lat", "lng": "lon", "long": "lon", "longitude": "lon"}
# What only Overpass servers and editors write in XML, and the kinds and numbers of elements.
NAMES = tuple(
    map(
        re.compile,
        (
            rb"<([nwr])[a-z]+ id=[\"'](-?\d+)",
            rb"<(node|way|relation)\s(?:[^>]*?\s)?id\s*=\s*[\"'](-?\d+)",
        ),
    )
)
CHUNK_BYTES = 2**22
DIALECTS = tuple(
    map(
        re.compile,
        (
            rb"<remark\b",
            rb"<center\s",
            rb"<nd\s[^>]*\slat",
            rb"<member\s[^>]*(?<!/)>",
            rb"<bounds\s[^>]*>\s*<(?:nd|member|tag)\b",
            rb"action\s*=\s*[\"']delete",
        ),
    )
)


@dataclass(frozen=True, slots=True)
class Document:
    """Elements of an answer, and the remark of the server, which is usually empty."""

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
    """Read the elements of a file of JSON or XML; SourceError if it has none of OpenStreetMap."""
    try:
        with open_unpacked(path) as stream:
            start = stream.read(START_BYTES)
            stream.seek(0)
            if start.removeprefix(BOM).lstrip().startswith(b"<"):
                elements, remark = _read_xml(stream)
            else:
                content = _parse_json(stream.read())
                elements = _json_elements(content)
                remark = content.get("remark", "") if isinstance(content, dict) else ""
        # The remark becomes a part of a sentence.
        remark = " ".join(str(remark).split()).rstrip(".").replace(". ", ", ")
        return Document(_current(elements), remark[:LONGEST_REMARK])
    except (ET.ParseError, EOFError, zlib.error) as error:
        raise SourceError(f"{where} is not whole XML ({error}); download it again.") from error
    except OSError as error:
        raise SourceError(
            f"{where} cannot be read ({error.strerror or error}); give a file of an Overpass "
            "server."
        ) from error
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
        whole = not isinstance(error, ValueError)
        remedy = (
            "give a list of elements with type, id, lat, lon and tags, or save it as GeoJSON"
            if whole
            else "download it again"
        )
        raise SourceError(f"{where} is not JSON as Overpass servers send it; {remedy}.") from error


def xml_form(path: Path) -> Literal["plain", "versions", "dialect"]:
    """Return whether XML has several versions of elements, or what pyosmium does not read.

    SourceError if its root is not that of elements.
    """
    form: Literal["plain", "versions"] = "plain"
    last: tuple[bytes, ...] = ()
    rest = b""
    try:
        with open_unpacked(path) as stream:
            _check_root(path, stream.read(START_BYTES))
            stream.seek(0)
            while chunk := stream.read(CHUNK_BYTES):
                text, end, rest = (rest + chunk).rpartition(b">")
                text += end
                if b"<action type" in text:  # differences as Overpass servers send them
                    raise changes_error(path)
                if any(pattern.search(text) for pattern in DIALECTS):
                    return "dialect"
                if form == "plain":
                    matches = (pattern.findall(text) for pattern in NAMES)  # the usual one first
                    names = [last, *next(filter(None, matches), ())]
                    last = names[-1]
                    if any(itertools.starmap(operator.eq, itertools.pairwise(names))):
                        form = "versions"
    except (EOFError, OSError, zlib.error):
        pass  # pyosmium reports what is damaged
    return form


def _check_root(path: Path, start: bytes) -> None:
    root = ROOT.search(start)
    if root is not None and root[1] != b"osm":
        raise changes_error(path)


def changes_error(path: Path) -> SourceError:
    """Return the error for a file that contains only what has changed."""
    return SourceError(
        f"{path} contains changes of OpenStreetMap (osmChange), not a map; apply it to the extract "
        f"that it belongs to, as with `osmium apply-changes extract.osm.pbf {path.name} -o "
        "new.osm.pbf`, and give the result."
    )


def _parse_json(text: bytes) -> Any:  # noqa: ANN401 - any JSON
    """Return the value of JSON, or the values of lines of JSON as a list."""
    text = text.removeprefix(BOM)
    try:
        return parse_json(text)
    except ValueError:
        lines = [line.strip(b"\x1e \t\r,") for line in text.split(b"\n")]
        values = [parse_json(line) for line in lines if line]
        if len(values) < 2:  # noqa: PLR2004 - one line is not whole
            raise
        return values


def _listed(content: Any) -> Iterator[Any]:  # noqa: ANN401 - any JSON
    """Yield the items of an answer, of several, of a list, of lists by kind, or inside others."""
    if isinstance(content, list):
        for item in content:
            yield from item.get("elements", [item])
    elif "elements" in content:
        yield from content["elements"]
    elif "type" in content:
        yield content
    elif lists := [(kind, f"{kind}s") for kind in KINDS if f"{kind}s" in content]:
        for kind, name in lists:
            yield from ({"type": kind, **item} for item in content[name])
    else:
        for inner in content.values():
            if isinstance(inner, dict | list):
                yield from _listed(inner)


def _json_elements(content: Any) -> list[dict[str, Any]]:  # noqa: ANN401 - any JSON
    """Return the elements in JSON; KeyError if it has no list of them."""
    items = list(_listed(content))
    if not items and "elements" not in content:
        raise KeyError("elements")
    return list(filter(None, map(_element, items)))


def _element(item: dict[str, Any]) -> dict[str, Any] | None:
    """Return an item with a whole number as id and texts in its tags; None if it is no element.

    An error if it is a malformed one.
    """
    if item["type"] not in KINDS:
        return None  # for example a count
    element = {NAMES_OF_KEYS.get(key, key): value for key, value in item.items()}
    if not isinstance(element["id"], int):
        element["id"] = int(as_text(element["id"]).rpartition("/")[2])
    if "center_lat" in element:
        element["center"] = {"lat": element["center_lat"], "lon": element["center_lon"]}
    tags = element.pop("tags", None)
    if isinstance(tags, str):
        tags = parse_json(tags)
    if isinstance(tags, list):
        tags = {tag["k"]: tag["v"] for tag in tags}
    if tags is None:  # or each is a key of its own, in tables
        tags = {key.removeprefix("tags."): element[key] for key in element.keys() - OWN_KEYS}
        tags = {key: value for key, value in tags.items() if isinstance(value, str)}
    if not all(isinstance(value, str | int | float | None) for value in tags.values()):
        raise TypeError
    if tags:
        element["tags"] = {key: as_text(tag) for key, tag in tags.items() if tag is not None}
    return element


def _current(elements: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the newest version of each element, without deleted ones."""
    elements = list(elements)
    newest: dict[tuple[str, int], int] = {}
    for element in elements:
        name = element["type"], element["id"]
        newest[name] = max(newest.get(name, 0), _version(element))
    return [
        element
        for element in elements
        if element.get("action") != "delete"
        and element.get("visible") not in {False, "false"}
        and (
            "version" not in element or _version(element) == newest[element["type"], element["id"]]
        )
    ]


def _version(element: Mapping[str, Any]) -> int:
    return int(element.get("version") or 0)


def _read_xml(stream: BinaryIO) -> tuple[list[dict[str, Any]], str]:
    """Return the elements of XML as in JSON, and the remark.

    ParseError if it is not whole, or has a document type, which could declare entities.
    """
    if b"<!DOCTYPE" in stream.read(START_BYTES):
        raise ET.ParseError("it has a document type")
    stream.seek(0)
    elements, remark = [], ""
    path: list[ET.Element] = []
    for event, item in ET.iterparse(stream, ["start", "end"]):  # noqa: S314 - see above
        if event == "start":
            path.append(item)
            continue
        path.pop()
        if len(path) == 1:
            if item.tag in KINDS and "id" in item.attrib:
                elements.append(_xml_element(item))
            elif item.tag == "remark":
                remark = item.text or ""
            path[0].clear()
    return elements, remark


def _xml_element(item: ET.Element) -> dict[str, Any]:
    """Return an element of XML as in JSON."""
    element: dict[str, Any] = {"type": item.tag, **item.attrib, "id": int(item.attrib["id"])}
    tags = {tag.get("k", ""): tag.get("v", "") for tag in item.iter("tag")}
    if tags:
        element["tags"] = tags
    if (centre := item.find("center")) is not None:
        element["center"] = dict(centre.attrib)
    if item.tag == "way":
        nodes = item.findall("nd")
        element["nodes"] = [int(node.get("ref", 0)) for node in nodes]
        if geometry := _geometry(nodes):
            element["geometry"] = geometry
    elif item.tag == "relation":
        element["members"] = [
            {**member.attrib, "ref": int(member.get("ref", 0))}
            | ({"geometry": shape} if (shape := _geometry(member.findall("nd"))) else {})
            for member in item.iter("member")
        ]
    return element


def _geometry(nodes: Sequence[ET.Element]) -> list[dict[str, str] | None]:
    """Return the positions of nodes that have one; an empty list if none has one."""
    places = [dict(node.attrib) if "lat" in node.attrib else None for node in nodes]
    return places if any(places) else []


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
    files_before: int = 0,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from a file of JSON or XML, or from the tiles of an area.

    The layers are the same as those of `sources.osm.file.read_layers`; an element in several tiles
    counts once. SourceError if a file has no elements or is incomplete by its own remark.
    Elements with numbers below zero are those of a file; `files_before` are read elsewhere.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} tiles"
    layers = element_layers(specs, filters=filters, where=where)
    if not layers:
        return ()
    index = TagIndex(specs)
    known_elements: set[tuple[str, int]] = set()
    centre_counts: collections.Counter[str] = collections.Counter()
    for file_number, file in enumerate(paths, start=files_before):
        document = load_document(file, where=str(file))
        if document.failed:
            raise SourceError(f"{file} is incomplete ({document.remark}); ask for a smaller area.")
        positions = _ElementPositions(document)
        for element in document.elements:
            kind, number = element["type"], number_in_files(element["id"], file_number)
            name = kind, number
            # Elements without tags are only there for the positions of others.
            if "tags" in element and name not in known_elements:
                known_elements.add(name)
                tags = element["tags"]
                for layer in (layers[place] for place in index.layers(tags)):
                    position = positions.position(element, layer.spec)
                    accepted = add_element(layer, kind, f"{kind}/{number}", tags, position)
                    centre_counts[layer.spec.name] += accepted and _has_only_centre(element)
    raw = [layer.layer(WGS84, requested=crs) for layer in layers]
    for number, raw_layer in enumerate(raw):
        centres = centre_counts[raw_layer.spec.name]
        if centres and raw_layer.spec.role == "objects":
            note = f"{centres:,} elements have only the middle of their box; ask for `out geom`"
            raw[number] = dataclasses.replace(raw_layer, notes=(*raw_layer.notes, note))
    return tuple(raw)


def _has_only_centre(element: dict[str, Any]) -> bool:
    parts = (element, *element.get("members", ()))
    return "center" in element and not any("geometry" in part for part in parts)


class _ElementPositions:
    """Geometries of the elements of a document.

    A way has the positions of its nodes (``out geom``), only its centre (``out center``), or the
    ids of nodes that are separate elements (``out; >; out skel``).
    """

    def __init__(self, document: Document) -> None:
        self._by_kind: dict[str, dict[int, dict[str, Any]]] = {"node": {}, "way": {}}
        for element in document.elements:
            if element["type"] in self._by_kind:
                self._by_kind[element["type"]][element["id"]] = element

    def position(self, element: dict[str, Any], spec: LayerSpec) -> Position | str:
        """Return the geometry of an element in a layer, or an error message."""
        try:
            return self._shape(element, spec)
        except BadFeatureError as error:
            return str(error)
        except (AttributeError, KeyError, TypeError):
            return "is not as Overpass servers send elements"

    def _shape(self, element: dict[str, Any], spec: LayerSpec) -> Position:
        if element["type"] == "node":
            return _point(element)
        if spec.role == "objects" and _has_only_centre(element):
            return _point(element["center"])
        if element["type"] == "way":
            return way_shape(self._line(element), spec.role)
        outer: list[NDArray[np.float64]] = []
        inner: list[NDArray[np.float64]] = []
        for member in element.get("members", ()):
            if member.get("type") == "way":
                way = member if "geometry" in member else self._by_kind["way"].get(member["ref"])
                lines = inner if member.get("role") == "inner" else outer
                lines.append(self._line(way or {}))
        return relation_shape(outer, inner)

    def _line(self, way: dict[str, Any]) -> NDArray[np.float64]:
        """Return longitude and latitude of the nodes of a way, shape (n, 2)."""
        nodes = way.get("geometry")
        if nodes is None:
            nodes = [self._by_kind["node"].get(number) for number in way.get("nodes", ())]
        missing = sum(node is None for node in nodes)
        if missing or not nodes:
            raise BadFeatureError(
                f"lacks {missing} of its {len(nodes)} nodes" if nodes else "has no positions"
            )
        return np.array([_point(node) for node in nodes])


def _point(place: dict[str, Any]) -> tuple[float, float]:
    try:
        return float(place["lon"]), float(place["lat"])
    except (KeyError, TypeError, ValueError) as error:
        raise BadFeatureError("has no valid position") from error
