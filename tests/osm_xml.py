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
