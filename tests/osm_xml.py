"""OpenStreetMap files that tests write."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path


def node(
    number: int, lon: float, lat: float, tags: Mapping[str, str] | None = None, **meta: object
) -> str:
    """Return a node; `meta` are further attributes, such as its version."""
    return f'<node id="{number}" lon="{lon}" lat="{lat}"{_meta(meta)}>{_tags(tags)}</node>'


def way(
    number: int, nodes: Iterable[int], tags: Mapping[str, str] | None = None, **meta: object
) -> str:
    refs = "".join(f'<nd ref="{ref}"/>' for ref in nodes)
    return f'<way id="{number}"{_meta(meta)}>{refs}{_tags(tags)}</way>'


def relation(number: int, members: Mapping[int, str], tags: Mapping[str, str]) -> str:
    """Return a relation of ways, by their roles."""
    parts = "".join(
        f'<member type="way" ref="{ref}" role="{role}"/>' for ref, role in members.items()
    )
    return f'<relation id="{number}">{parts}{_tags(tags)}</relation>'


def write_osm(path: Path, *elements: str) -> Path:
    path.write_text(f'<osm version="0.6">{"".join(elements)}</osm>', encoding="utf-8")
    return path


def _meta(meta: Mapping[str, object]) -> str:
    return "".join(f" {key}={quoteattr(str(value))}" for key, value in meta.items())


def _tags(tags: Mapping[str, str] | None) -> str:
    return "".join(
        f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in (tags or {}).items()
    )


def street_town() -> list[str]:
    """Return a street with objects along it: points, lines, areas and an area with a hole."""
    lon, lat = 2.35, 48.85
    things: list[Mapping[str, str]] = [
        {"natural": "tree", "leaf_type": "broadleaved"},
        {"natural": "tree"},
        {"amenity": "bench", "backrest": "yes", "note": 'a "quoted" => text'},
        {"amenity": "bench", "layer": "-1"},
        {"highway": "street_lamp"},
        {"highway": "bus_stop"},
        {"amenity": "waste_basket"},
        {"highway": "crossing", "crossing": "zebra"},
        {"amenity": "vending_machine", "vending": "parking_tickets"},
        {"traffic_sign": "FR:B1"},
    ]
    parts = [node(n, lon + n * 1e-4, lat + n % 3 * 1e-5, tags) for n, tags in enumerate(things, 1)]
    corners = [(0, 0), (3, 0), (3, 1), (0, 1), (1, 0.2), (2, 0.2), (2, 0.8), (1, 0.8)]
    for number, (east, north) in enumerate([*corners, *corners], 101):
        shift = 4e-4 if number > 100 + len(corners) else 0.0
        parts.append(node(number, lon + east * 1e-4 + shift, lat + 3e-4 + north * 1e-4))
    outer, inner = [101, 102, 103, 104, 101], [105, 106, 107, 108, 105]
    parts += [
        way(201, outer),
        way(202, inner),
        way(203, [109, 110, 111, 112, 109], {"amenity": "toilets", "building": "yes"}),
        way(204, [113, 114], {"amenity": "bench"}),
        way(205, [1, 3, 5, 7, 9], {"highway": "residential", "name": "Rue"}),
        way(206, [113, 114, 115, 116, 113], {"highway": "pedestrian", "area": "yes"}),
    ]
    return [
        *parts,
        relation(
            301,
            {201: "outer", 202: "inner"},
            {"type": "multipolygon", "amenity": "fountain", "building": "yes"},
        ),
    ]
