"""How QGIS draws layers (QML): classes, amounts, ranks and outcomes."""

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
    one_line,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.core import ClassSign, Mark, Taxonomy


# What is said of the numbers between two, and their colour.
Classes = Mapping[tuple[float, float], tuple[str, str]]

# How QGIS draws each shape: marker, angle, size and width of the outline, both in diameters of a
# circle. The arms of its cross are thin; an outline of the same colour makes room for the letter.
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
"""What is said of a cell, and its colour, by how many cells have its types."""

IDENTIFIABILITY: Classes = {
    (number / 10, (number + 1) / 10): (f"found: {10 * number} to {10 * (number + 1)} %", colour)
    for number, colour in enumerate(FOUND_RAMP)
}
"""What is said of a cell, and its colour, by the chance that a query from it is found."""

RANKS: Classes = {
    (1, 1): ("rank 1", RANK_RAMP[3]),
    (1, 3): ("rank 2 to 3", RANK_RAMP[2]),
    (3, 10): ("rank 4 to 10", RANK_RAMP[1]),
    (10, 1e9): ("rank 11 and more", RANK_RAMP[0]),
}
LABEL_LETTERS = 60
# What lies below, such as a street map, shows through.
CELLS_OPACITY = 0.7
# Wide enough to be found in a city, small enough not to hide a street: millimetres on the screen.
SMALLEST_MM, LARGEST_MM = 0.9, 6.0
# Diameter of a circle, and the height of letters in diameters.
CIRCLE_METRES, LETTER = 7.0, 0.6

# What QGIS calls the symbol of a geometry, in the order of its numbers of geometries.
SYMBOLS = {"point": "marker", "line": "line", "polygon": "fill"}

Options = Mapping[str, object]
# The class of a layer of a symbol, its options, and the symbol that it places along a line.
SymbolLayer = tuple[str, Options] | tuple[str, Options, "SymbolLayer"]


class Style(NamedTuple):
    """A way to draw a layer: its name, an element of QML, and how opaque it is (0 to 1)."""

    name: str
    renderer: str
    opacity: float = 1.0


class Entry(NamedTuple):
    """An entry of a legend: the values that it is about, its text, and how they are drawn."""

    values: dict[str, str]
    label: str
    symbol: tuple[SymbolLayer, ...]


def by_class(taxonomy: Taxonomy, codes: Iterable[int]) -> Style:
    """Return a style of points by the class code that they have: a shape with the symbol."""
    present = set(codes)
    entries = {
        str(code): Entry(
            {"value": str(code)}, shown_line(f"{sign.symbol}  {sign.title}"), _class_layers(sign)
        )
        for code, sign in class_signs(taxonomy).items()
        if code in present
    }
    return Style("Classes", _renderer("class_code", entries, "point"))


def _class_layers(sign: ClassSign) -> tuple[SymbolLayer, SymbolLayer]:
    """Return the shape of a class, and the letter on it."""
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
    # The anchor lifts the letter by half its size and the offset lets it down, since QGIS bounds no
    # length below 0; by a tenth less, since QGIS centres the ascent, which is above capitals.
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
    """Return a length of a sign that is given in diameters of a circle."""
    metres, most = CIRCLE_METRES * share, LARGEST_MM * share
    return _metres(metres, smallest=smallest * share, largest=most, length=length)


def by_amount(name: str, column: str, classes: Classes, *, geometry: str, size: float) -> Style:
    """Return a style of cells by a number, each as its square."""
    symbols = [_area(colour, geometry, size) for _, colour in classes.values()]
    entries = _ranges(classes, symbols)
    return Style(name, _renderer(column, entries, geometry), CELLS_OPACITY)


def by_rank(column: str, *, geometry: str) -> Style:
    """Return a style of places, the best the darkest."""
    symbols: list[SymbolLayer] = []
    for number, (_, colour) in enumerate(RANKS.values()):
        if geometry == "polygon":
            # Its edge is all that is seen of a region from far, and the palest is too pale for it.
            edge = RANK_RAMP[1] if colour == RANK_RAMP[0] else colour
            fill = {"color": _rgba(colour, 170), "style": "solid", "outline_color": _rgba(edge)}
            symbols.append(("SimpleFill", {**fill, "outline_style": "solid", "outline_width": 0.4}))
        else:
            # Pale places stand out from a pale map by their edges.
            edge, metres, smallest = RANK_RAMP[-1], 12.0 - 2.0 * number, 3.2 - 0.4 * number
            symbols.append(_marker("circle", colour, metres, smallest=smallest, outline=edge))
    entries = _ranges(RANKS, symbols)
    return Style("Rank", _renderer(column, entries, geometry, last_first=True))


def by_outcome(*, geometry: str) -> Style:
    """Return a style of queries by what became of them; a line ends in a mark at the best place."""
    draw = _outcome_line if geometry == "line" else _outcome_point
    entries = {
        str(number): Entry({"value": outcome}, outcome, draw(mark))
        for number, (outcome, mark) in enumerate(OUTCOMES.items())
    }
    return Style("Outcome", _renderer("outcome", entries, geometry))


def by_answer() -> Style:
    """Return a style of the best place, whether it is given as the answer or not."""
    entries = {
        str(number): Entry({"value": name}, name, _outcome_point(mark))
        for number, (name, mark) in enumerate(ANSWERS.items())
    }
    return Style("Answer", _renderer("answer", entries, "point"))


def _outcome_point(mark: Mark) -> tuple[SymbolLayer, ...]:
    shape = CLASS_MARKERS[mark.shape][0]
    return (_marker(shape, mark.colour, 12.0, smallest=1.8, outline="#222222"),)


def _outcome_line(mark: Mark) -> tuple[SymbolLayer, ...]:
    line = {"line_color": _rgba(mark.colour, 150), "line_width": 0.26, "line_style": "solid"}
    end = _marker("cross2", mark.colour, 10.0, smallest=1.4, outline=mark.colour)
    return ("SimpleLine", line), ("MarkerLine", {"placement": "lastvertex", "rotate": 0}, end)


def _ranges(classes: Classes, symbols: Sequence[SymbolLayer]) -> dict[str, Entry]:
    """Return an entry for each range of numbers; of two ranges, the first holds their border."""
    return {
        str(number): Entry(
            {"lower": repr(float(low)), "upper": repr(float(high))}, label, (symbols[number],)
        )
        for number, ((low, high), (label, _)) in enumerate(classes.items())
    }


def _area(colour: str, geometry: str, size: float) -> SymbolLayer:
    """Return a cell as its square, whether it is a polygon or a point."""
    if geometry == "polygon":
        # An outline as thin as can be, lest hairs of the background show between the cells.
        fill = {"color": _rgba(colour), "style": "solid", "outline_color": _rgba(colour)}
        return "SimpleFill", {**fill, "outline_style": "solid", "outline_width": 0}
    return "SimpleMarker", {
        "name": "square",
        "color": _rgba(colour),
        "outline_style": "no",
        "size": size,
        "size_unit": "MapUnit",
    }


def _marker(
    shape: str, colour: str, metres: float, *, smallest: float = SMALLEST_MM, outline: str = ""
) -> SymbolLayer:
    return "SimpleMarker", {
        "name": shape,
        "color": _rgba(colour),
        "outline_color": _rgba(outline or "#ffffff"),
        "outline_width": 0.1,
        **_metres(metres, smallest=smallest, largest=LARGEST_MM),
    }


def _metres(size: float, *, smallest: float, largest: float, length: str = "size") -> Options:
    """Return a length on the ground, within bounds in millimetres on the screen."""
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
        listed = ET.SubElement(layer, "Option", type="Map")
        for key, value in options.items():
            ET.SubElement(listed, "Option", name=key, value=str(value), type="QString")
        for inner in along:
            _add_symbol(layer, f"@{name}@{number}", "marker", inner)


def _renderer(
    column: str, entries: Mapping[str, Entry], geometry: str, *, last_first: bool = False
) -> str:
    """Return an element that draws by a column: its entries by the names of their symbols."""
    ranges = any("lower" in entry.values for entry in entries.values())
    kind, parent, child = (
        ("graduatedSymbol", "ranges", "range")
        if ranges
        else ("categorizedSymbol", "categories", "category")
    )
    renderer = ET.Element("renderer-v2", type=kind, attr=column)
    if ranges:
        renderer.set("graduatedMethod", "GraduatedColor")
    if last_first:  # so that the least number lies on top
        renderer.set("enableorderby", "1")
        clause = ET.SubElement(ET.SubElement(renderer, "orderby"), "orderByClause", asc="0")
        clause.text = f'"{column}"'
    listed, symbols = ET.SubElement(renderer, parent), ET.SubElement(renderer, "symbols")
    for name, entry in entries.items():
        ET.SubElement(
            listed, child, {**entry.values, "symbol": name, "label": entry.label, "render": "true"}
        )
        _add_symbol(symbols, name, SYMBOLS[geometry], *entry.symbol)
    return ET.tostring(renderer, encoding="unicode")


def shown_line(text: str, letters: int = LABEL_LETTERS) -> str:
    """Return text from data for QGIS: one short line, in which it evaluates nothing."""
    line = one_line(text).replace("[%", "[ %")
    return line if len(line) <= letters else f"{line[: letters - 1].rstrip()}…"


def _rgba(colour: str, opacity: int = 255) -> str:
    parts = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
    return ",".join(str(part) for part in [*parts, opacity])
