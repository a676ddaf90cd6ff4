"""Draw the packages and their imports: ``python docs/architecture.py``, into docs/images.

Floors come from the import contract in pyproject.toml, roles from the docstrings of the packages,
arrows from the imports. An arrow is left out if it follows from other arrows. With ``--check``
nothing is written, and the exit code is 1 if the picture is out of date.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs/images/architecture.svg"
WIDTH, FLOOR, ROOM, GAP = 960, 84, 50, 24
LETTER = 7  # mean width of a letter in pixels
STYLE = """
  text { font: 13px system-ui, sans-serif; fill: #222; text-anchor: middle; }
  .name { font-weight: 600; font-size: 15px; }
  rect { fill: #eef3f7; stroke: #4a6b82; rx: 6px; }
  path { fill: none; stroke: #8aa0b0; stroke-width: 1.5; marker-end: url(#head); }
"""
HEAD = """<defs>
<marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7"
  orient="auto">
<path d="M0 0 L8 4 L0 8 z" style="fill:#8aa0b0;stroke:none"/>
</marker>
</defs>"""


def floors() -> list[list[str]]:
    """Return the packages of each floor, the highest first."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [[name.strip() for name in layer.split("|")] for layer in layers]


def role(package: str, width: float) -> str:
    """Return the first line of a package's docstring, up to its colon if it is too wide."""
    text = (ROOT / "semsig_gis" / package / "__init__.py").read_text(encoding="utf-8")
    line = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0].rstrip(".")
    return line if len(line) * LETTER <= width else line.partition(":")[0]


def arrows(packages: list[str]) -> list[tuple[str, str]]:
    """Return pairs of packages, the first importing the second, without implied pairs."""
    graph = grimp.build_graph("semsig_gis", cache_dir=None)
    imports = {name: set[str]() for name in packages}
    for module in graph.modules:
        home = module.split(".")[1:2]
        for other in graph.find_modules_directly_imported_by(module):
            target = other.split(".")[1:2]
            if home and target and home != target:
                imports[home[0]].add(target[0])
    reach: dict[str, set[str]] = {}
    for name in reversed(packages):  # a package imports only lower packages
        reach[name] = imports[name].union(*(reach[other] for other in imports[name]))
    return [
        (name, other)
        for name in packages
        for other in packages
        if other in imports[name] and all(other not in reach[lower] for lower in imports[name])
    ]


def draw() -> str:
    """Return the picture as SVG."""
    rows = floors()
    places: dict[str, tuple[float, float]] = {}
    rooms = []
    for floor, names in enumerate(rows):
        width = (WIDTH - GAP * (len(names) + 1)) / len(names)
        for column, name in enumerate(names):
            x, y = GAP + column * (width + GAP), GAP + floor * FLOOR
            places[name] = x + width / 2, y
            rooms.append(
                f'<rect x="{x:.0f}" y="{y}" width="{width:.0f}" height="{ROOM}"/>\n'
                f'<text class="name" x="{x + width / 2:.0f}" y="{y + 20}">{name}</text>\n'
                f'<text x="{x + width / 2:.0f}" y="{y + 39}">{escape(role(name, width))}</text>'
            )
    lines = []
    for name, other in arrows([name for names in rows for name in names]):
        (x, y), (to_x, to_y) = places[name], places[other]
        lines.append(f'<path d="M{x:.0f} {y + ROOM} L{to_x:.0f} {to_y - 3}"/>')
    height = GAP + len(rows) * FLOOR
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">',
            "<title>The packages of semsig_gis, each above the packages that it imports</title>",
            f"<style>{STYLE}</style>",
            HEAD,
            *lines,
            *rooms,
            "</svg>\n",
        ]
    )


def main() -> int:
    """Write the picture, or check that it is current."""
    picture = draw()
    if "--check" not in sys.argv[1:]:
        PICTURE.write_text(picture, encoding="utf-8")
    elif not PICTURE.is_file() or PICTURE.read_text(encoding="utf-8") != picture:
        sys.stderr.write(f"{PICTURE.name} is out of date; run `python docs/architecture.py`.\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
