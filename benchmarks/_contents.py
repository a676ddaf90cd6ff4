"""Digests of files, without the parts that differ from run to run or between machines."""

from __future__ import annotations

import contextlib
import hashlib
import re
import sqlite3
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Patterns of parts that differ from run to run or between machines, and their replacements.
_MASKS = (
    (r'"(seconds\w*|\w+_seconds)": [\d.e-]+', r'"\1": 0'),
    (r'"(timing|machine|versions)": \{[^{}]*\}', r'"\1": {}'),
    (r"(Seconds a query\s*│\s*)[\d.]+\s*", r"\1"),
    # The table of times in `semsig reproduce`: as JSON, CSV, Markdown and HTML.
    (r'\{[^{}]*"unit": "ms"[^{}]*\}', "{}"),
    (r"(?m:^)times,.*\n", ""),
    (r"(?s)(## |>)Retrieval times\b(?:(?!\n## |<h2).)*", r"\1"),
    # folium gives random names to the parts of a map.
    (r"_[0-9a-f]{32}(?![0-9a-f])", "_"),
    # Leaflet and jQuery are in a page, or linked if the package was built without them.
    (r'[ \t]*(<script src="http[^>]*></script>|<link rel="stylesheet" href="http[^>]*>)\s*', ""),
    (r"(?s)[ \t]*<(script|style)>\n/\*(! jQuery| @preserve| required styles).*?</\1>\s*", ""),
    (r"semsig: the map takes Leaflet from the web.*\n", ""),
)
TIMES = {"timing.json", "times.json"}
"""Files that contain only seconds and the machine."""

_TEXTS = {".csv", ".geojson", ".html", ".json", ".jsonl", ".md", ".svg", ".toml"}
_SCHEMA = "SELECT type, name, sql FROM sqlite_master ORDER BY name"
_STAMPS = {"last_change", "timestamp", "update_time"}  # columns of a GeoPackage
_PROJECT_STAMP = r'"last_modified_time":"[^"]*"'


def masked(text: str) -> str:
    """Return a text with the parts replaced that differ from run to run."""
    for pattern, instead in _MASKS:
        text = re.sub(pattern, instead, text)
    return text


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes."""
    return hashlib.sha256(content).hexdigest()


def file_digest(path: Path) -> str:
    """Return the SHA-256 of the contents of a file."""
    if path.suffix == ".gpkg":
        return digest("\n".join(_dump(path)).encode())
    content = path.read_bytes()
    return digest(masked(content.decode()).encode() if path.suffix in _TEXTS else content)


def _dump(path: Path) -> Iterator[str]:
    """Yield the rows of all tables of a GeoPackage, without the times when they were written."""
    with contextlib.closing(sqlite3.connect(path)) as file:
        for kind, name, sql in file.execute(_SCHEMA).fetchall():
            yield f"{kind} {name}: {sql}"
            if kind == "table":
                rows = file.execute(f'SELECT * FROM "{name}"')  # noqa: S608 - as the file says
                columns = [
                    i for i, (item, *_) in enumerate(rows.description) if item not in _STAMPS
                ]
                texts = (repr([row[i] for i in columns]) for row in rows)
                yield from sorted(re.sub(_PROJECT_STAMP, "", text) for text in texts)
