"""Styles of layers for QGIS (QML): by class, amount, rank and outcome."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree as ET

from semsig_gis.core import (
    ANSWERS,
    FOUND_RAMP,
    GROUP_COLOURS,
    OUTCOMES,
    RANK_RAMP,
    class_signs,
    group_labels,
    one_lines,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.core import ClassSign, Mark, Taxonomy


# Label and colour of each range of numbers, by its lower and upper bound.
Classes = Mapping[tuple[float, float], tuple[str, str]]

# The marker of QGIS for each shape: name, angle, size and width of the outline, both in diameters
# of a circle. The arms of QGIS's cross are thin; the outline widens them to hold the letter.
CLASS_MARKERS = {
    "circle": ("circle", 0, 1.0, 0.0),
    "square": ("square", 0, 0.9, 0.0),
    "diamond": ("diamond", 0, 1.25, 0.0),
    "triangle": ("triangle", 0, 1.2, 0.0),
    "hexagon": ("hexagon", 0, 1.15, 0.0),
    "triangle_down": ("triangle", 180, 1.2, 0.0),
    "cross": ("cross_fill", 0, 0.625, 0.475),
}

AMBIGUITY: Classes = {
    (low, high - 1): (label, colour)
    for (low, colour), high, label in zip(
        GROUP_COLOURS.items(), [*list(GROUP_COLOURS)[1:], 10**9], group_labels(), strict=True
    )
}
"""Label and colour of a cell, by the number of cells with its types."""

IDENTIFIABILITY: Classes = {
    (number / 10, (number + 1) / 10): (f"found: {10 * number} to {10 * (number + 1)} %", colour)
    for number, colour in enumerate(FOUND_RAMP)
}
"""Label and colour of a cell, by the chance that a query from it is found."""

RANKS: Classes = {
    (1, 1): ("rank 1", RANK_RAMP[3]),
    (1, 3): ("rank 2 to 3", RANK_RAMP[2]),
    (3, 10): ("rank 4 to 10", RANK_RAMP[1]),
    (10, 1e9): ("rank 11 and more", RANK_RAMP[0]),
}
LABEL_LETTERS = 60
# Cells are transparent, so that a background map stays visible.
CELLS_OPACITY = 0.7
# Limits of a sign on the screen: visible at the scale of a city, smaller than a street.
SMALLEST_MM, LARGEST_MM = 0.9, 6.0
# Diameter of a circle, and the height of letters in diameters.
CIRCLE_METRES, LETTER = 7.0, 0.6

# QGIS's symbol type of each geometry, in the order of QGIS's geometry numbers.
SYMBOLS = {"point": "marker", "line": "line", "polygon": "fill"}

Options = Mapping[str, object]
# A symbol layer: its class, its options, and for lines the symbol that is placed along them.
SymbolLayer = tuple[str, Options] | tuple[str, Options, "SymbolLayer"]


class Style(NamedTuple):
    """A style of a layer: name, renderer element of QML, and opacity (0 to 1)."""

    name: str
    renderer: str
    opacity: float = 1.0


class LegendEntry(NamedTuple):
    """An entry of a legend: its values as attributes of QML, its text, and its symbol."""

    values: dict[str, str]
    label: str
    symbol: tuple[SymbolLayer, ...]


def by_class(taxonomy: Taxonomy, codes: Iterable[int]) -> Style:
    """Return a style of points by class code: the shape of the class with its letter."""
    present = set(codes)
    signs = {str(code): sign for code, sign in class_signs(taxonomy).items() if code in present}
    labels = shown_lines(f"{sign.symbol}  {sign.title}" for sign in signs.values())
    entries = {
        code: LegendEntry({"value": code}, label, _class_layers(sign))
        for (code, sign), label in zip(signs.items(), labels, strict=True)
    }
    return Style("Classes", _renderer("class_code", entries, "point"))


def _class_layers(sign: ClassSign) -> tuple[SymbolLayer, SymbolLayer]:
    """Return the symbol layers of a class: its shape and its letter."""
    marker, angle, size, outline = CLASS_MARKERS[sign.shape]
    edge = _of_circle("outline_width", outline) if outline else {"outline_width": 0.1}
    shape = {
        "name": marker,
        "angle": angle,
        "color": _rgba(sign.colour),
        "outline_color": _rgba(sign.colour if outline else "#ffffff"),
        "joinstyle": "miter",
        **edge,
        **_of_circle("size", size),
    }
    # The anchor moves the letter up by half its size and the offset moves it down again, because
    # QGIS does not limit negative lengths. The offset is a tenth smaller, because QGIS centres the
    # ascent, which is higher than capital letters.
    down = sign.drop / 2 + (0.5 - 0.1) * LETTER
    letter = {
        "font": "DejaVu Sans",
        "font_style": "Bold",
        "chr": sign.symbol,
        "color": _rgba(sign.ink),
        "horizontal_anchor_point": 1,
        "vertical_anchor_point": 2,
        **_of_circle("size", LETTER, smallest=0.0),
        **_of_circle("offset", down, smallest=0.0),
        "offset": f"0,{CIRCLE_METRES * down:.3g}",
    }
    return ("SimpleMarker", shape), ("FontMarker", letter)


def _of_circle(length: str, share: float, *, smallest: float = SMALLEST_MM) -> Options:
    """Return a length of a sign; `share` is in diameters of a circle."""
    metres, largest = CIRCLE_METRES * share, LARGEST_MM * share
    return _metres(metres, smallest=smallest * share, largest=largest, length=length)


def by_amount(name: str, column: str, classes: Classes, *, geometry: str, size: float) -> Style:
    """Return a style of cells by a number; polygons and points are drawn as squares."""
    symbols: list[SymbolLayer] = []
    for _, colour in classes.values():
        color = _rgba(colour)
        if geometry == "polygon":
            # The thinnest outline covers the gaps that anti-aliasing leaves between cells.
            fill = {"color": color, "style": "solid", "outline_color": color}
            symbols.append(("SimpleFill", {**fill, "outline_style": "solid", "outline_width": 0}))
        else:
            square = {"name": "square", "color": color, "outline_style": "no"}
            symbols.append(("SimpleMarker", {**square, "size": size, "size_unit": "MapUnit"}))
    return Style(name, _renderer(column, _ranges(classes, symbols), geometry), CELLS_OPACITY)


def by_rank(column: str, *, geometry: str) -> Style:
    """Return a style of places by rank; the best is the darkest."""
    symbols: list[SymbolLayer] = []
    for number, (_, colour) in enumerate(RANKS.values()):
        if geometry == "polygon":
            # At small scales only the edge of a region is visible; the palest colour would vanish.
            edge = RANK_RAMP[1] if colour == RANK_RAMP[0] else colour
            fill = {"color": _rgba(colour, 170), "style": "solid", "outline_color": _rgba(edge)}
            symbols.append(("SimpleFill", {**fill, "outline_style": "solid", "outline_width": 0.4}))
        else:
            # A dark edge makes pale places visible on a pale map.
            edge, metres, smallest = RANK_RAMP[-1], 12.0 - 2.0 * number, 3.2 - 0.4 * number
            symbols.append(_marker_layer("circle", colour, metres, smallest=smallest, outline=edge))
    entries = _ranges(RANKS, symbols)
    return Style("Rank", _renderer(column, entries, geometry, last_first=True))


def by_outcome(*, geometry: str) -> Style:
    """Return a style of queries by outcome; a line ends in a mark at the best place."""
    return _by_mark("Outcome", OUTCOMES, geometry)


def by_answer() -> Style:
    """Return a style of the best place, by whether it is the answer or withheld."""
    return _by_mark("Answer", ANSWERS, "point")


def _by_mark(name: str, marks: Mapping[str, Mark], geometry: str) -> Style:
    """Return a style by the column with the name of the style, in lower case."""
    entries = {}
    for number, (value, mark) in enumerate(marks.items()):
        symbol: tuple[SymbolLayer, ...]
        if geometry == "line":
            line = {"line_color": _rgba(mark.colour, 150), "line_width": 0.26}
            end = _marker_layer("cross2", mark.colour, 10.0, smallest=1.4, outline=mark.colour)
            symbol = (
                ("SimpleLine", {**line, "line_style": "solid"}),
                ("MarkerLine", {"placement": "lastvertex", "rotate": 0}, end),
            )
        else:
            shape = CLASS_MARKERS[mark.shape][0]
            symbol = (_marker_layer(shape, mark.colour, 12.0, smallest=1.8, outline="#222222"),)
        entries[str(number)] = LegendEntry({"value": value}, value, symbol)
    return Style(name, _renderer(name.lower(), entries, geometry))


def _ranges(classes: Classes, symbols: Sequence[SymbolLayer]) -> dict[str, LegendEntry]:
    """Return an entry for each range of numbers; a common bound belongs to the first range."""
    return {
        str(number): LegendEntry(
            {"lower": repr(float(low)), "upper": repr(float(high))}, label, (symbols[number],)
        )
        for number, ((low, high), (label, _)) in enumerate(classes.items())
    }


def _marker_layer(
    shape: str, colour: str, metres: float, *, smallest: float, outline: str
) -> SymbolLayer:
    return "SimpleMarker", {
        "name": shape,
        "color": _rgba(colour),
        "outline_color": _rgba(outline),
        "outline_width": 0.1,
        **_metres(metres, smallest=smallest, largest=LARGEST_MM),
    }


def _metres(size: float, *, smallest: float, largest: float, length: str = "size") -> Options:
    """Return a length on the ground, limited to a range of millimetres on the screen."""
    return {
        length: f"{size:.3g}",
        f"{length}_unit": "MapUnit",
        f"{length}_map_unit_scale": f"3x:0,0,{int(smallest > 0)},{smallest:.3g},1,{largest:.3g}",
    }


def _add_symbol(parent: ET.Element, name: str, kind: str, *layers: SymbolLayer) -> None:
    symbol = ET.SubElement(parent, "symbol", name=name, type=kind, alpha="1", clip_to_extent="1")
    for number, (class_name, options, *along) in enumerate(layers):
        layer = ET.SubElement(
            symbol, "layer", attrib={"class": class_name, "enabled": "1", "locked": "0"}
        )
        option_map = ET.SubElement(layer, "Option", type="Map")
        for key, value in options.items():
            ET.SubElement(option_map, "Option", name=key, value=str(value), type="QString")
        for inner in along:
            _add_symbol(layer, f"@{name}@{number}", "marker", inner)


def _renderer(
    column: str, entries: Mapping[str, LegendEntry], geometry: str, *, last_first: bool = False
) -> str:
    """Return a renderer element that draws features by a column; `entries` are by symbol name."""
    ranges = any("lower" in entry.values for entry in entries.values())
    kind, parent, child = (
        ("graduatedSymbol", "ranges", "range")
        if ranges
        else ("categorizedSymbol", "categories", "category")
    )
    renderer = ET.Element("renderer-v2", type=kind, attr=column)
    if ranges:
        renderer.set("graduatedMethod", "GraduatedColor")
    if last_first:  # draw the smallest number last, on top
        renderer.set("enableorderby", "1")
        clause = ET.SubElement(ET.SubElement(renderer, "orderby"), "orderByClause", asc="0")
        clause.text = f'"{column}"'
    legend, symbols = ET.SubElement(renderer, parent), ET.SubElement(renderer, "symbols")
    for name, entry in entries.items():
        ET.SubElement(
            legend, child, {**entry.values, "symbol": name, "label": entry.label, "render": "true"}
        )
        _add_symbol(symbols, name, SYMBOLS[geometry], *entry.symbol)
    return ET.tostring(renderer, encoding="unicode")


def shown_lines(texts: Iterable[str], letters: int = LABEL_LETTERS) -> list[str]:
    """Return texts from data for QGIS: short single lines, without expressions to evaluate."""
    lines = [line.replace("[%", "[ %") for line in one_lines(texts)]
    return [line if len(line) <= letters else f"{line[: letters - 1].rstrip()}…" for line in lines]


def _rgba(colour: str, opacity: int = 255) -> str:
    return ",".join(map(str, (*bytes.fromhex(colour[1:]), opacity)))
