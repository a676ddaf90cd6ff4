"""How QGIS draws the layers: QML, as it stands in the table ``layer_styles`` of a GeoPackage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree as ET

from semsig_gis.map_legend import ERROR_RAMP, FAILED, FOUND_RAMP, SUCCESSFUL
from semsig_gis.tables import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.taxonomy import Taxonomy

__all__ = [
    "AMBIGUITY",
    "IDENTIFIABILITY",
    "OUTCOMES",
    "Style",
    "by_amount",
    "by_class",
    "by_outcome",
    "by_rank",
]

# What is said of the numbers between two, and their colour.
Classes = Mapping[tuple[float, float], tuple[str, str]]

# Colours that colour-blind people tell apart, and shapes with room for a letter: together, all
# classes of the paper look different. Green comes first because trees do.
CLASS_COLOURS = (
    *("#009e73", "#0072b2", "#e69f00", "#cc79a7", "#d55e00"),
    *("#56b4e9", "#333333", "#882255", "#999933"),
)
CLASS_SHAPES = ("circle", "square", "diamond", "pentagon", "hexagon")

OUTCOMES = {"found": SUCCESSFUL, "missed": FAILED, "nothing seen": "#777777"}
"""Colour of a query by what became of it."""

AMBIGUITY: Classes = {
    (1, 1): ("alone", FOUND_RAMP[9]),
    (1, 10): ("2 to 10 alike", FOUND_RAMP[7]),
    (10, 100): ("11 to 100", FOUND_RAMP[5]),
    (100, 1000): ("101 to 1,000", FOUND_RAMP[3]),
    (1000, 1e9): ("more", FOUND_RAMP[0]),
}
"""What is said of a cell, and its colour, by how many cells have its types."""

IDENTIFIABILITY: Classes = {
    (number / 10, (number + 1) / 10): (f"{10 * number} to {10 * (number + 1)} %", colour)
    for number, colour in enumerate(FOUND_RAMP)
}
"""What is said of a cell, and its colour, by the chance that a query from it is found."""

RANKS: Classes = {
    (low, high): (label, colour)
    for (low, high, label), colour in zip(
        ((1, 1, "1"), (1, 3, "2 to 3"), (3, 10, "4 to 10"), (10, 1e9, "11 and more")),
        reversed(ERROR_RAMP),
        strict=True,
    )
}
LABEL_LETTERS = 60
# What lies below, such as a street map, shows through.
CELLS_OPACITY = 0.7
# Wide enough to be found in a city, small enough not to hide a street: millimetres on the screen.
SMALLEST_MM, LARGEST_MM = 0.9, 6.0

Options = Mapping[str, object]
# The class of a layer of a symbol, its options, and the symbol that it places along a line.
SymbolLayer = tuple[str, Options] | tuple[str, Options, "SymbolLayer"]


class Style(NamedTuple):
    """A style of a layer."""

    name: str
    qml: str


def by_class(taxonomy: Taxonomy, codes: Iterable[int]) -> Style:
    """Return a style of points by the class code that they have: a shape with the symbol."""
    renderer = ET.Element("renderer-v2", type="categorizedSymbol", attr="class_code")
    categories = ET.SubElement(renderer, "categories")
    symbols = ET.SubElement(renderer, "symbols")
    present = set(codes)
    for number, item in enumerate(sorted(taxonomy.classes, key=lambda one: one.code)):
        if item.code not in present:
            continue
        ET.SubElement(
            categories,
            "category",
            value=str(item.code),
            symbol=str(number),
            label=_label(f"{item.symbol}  {item.title}"),
            render="true",
        )
        shape = CLASS_SHAPES[number % len(CLASS_SHAPES)]
        colour = CLASS_COLOURS[number % len(CLASS_COLOURS)]
        letter: Options = {
            "font": "DejaVu Sans",
            "chr": item.symbol,
            "color": _rgba("#ffffff"),
            **_metres(4.2, smallest=0.0, largest=0.6 * LARGEST_MM),
            "vertical_anchor_point": 1,
            "horizontal_anchor_point": 1,
        }
        _add_symbol(symbols, number, "marker", _marker(shape, colour, 7.0), ("FontMarker", letter))
    return Style("Classes", _document(renderer, "point"))


def by_amount(
    name: str,
    column: str,
    classes: Classes,
    *,
    geometry: str,
    size: float,
) -> Style:
    """Return a style of cells by a number, each as its square."""
    symbols = [_area(colour, geometry, size) for _, colour in classes.values()]
    return Style(name, _graduated(column, classes, symbols, geometry, opacity=CELLS_OPACITY))


def by_rank(column: str, *, geometry: str) -> Style:
    """Return a style of places, the best the darkest."""
    symbols: list[SymbolLayer] = []
    edge = ERROR_RAMP[-1]  # pale places stand out from a pale map by their edges
    for number, (_, colour) in enumerate(RANKS.values()):
        if geometry == "polygon":
            fill = {"color": _rgba(colour, 170), "style": "solid", "outline_color": _rgba(edge)}
            symbols.append(("SimpleFill", {**fill, "outline_style": "solid", "outline_width": 0.4}))
        else:
            metres, smallest = 12.0 - 2.0 * number, 3.2 - 0.4 * number
            symbols.append(_marker("circle", colour, metres, smallest=smallest, outline=edge))
    return Style("Rank", _graduated(column, RANKS, symbols, geometry))


def by_outcome(*, geometry: str) -> Style:
    """Return a style of queries by what became of them; a line ends in a mark at the best place."""
    renderer = ET.Element("renderer-v2", type="categorizedSymbol", attr="outcome")
    categories = ET.SubElement(renderer, "categories")
    symbols = ET.SubElement(renderer, "symbols")
    for number, (outcome, colour) in enumerate(OUTCOMES.items()):
        ET.SubElement(
            categories,
            "category",
            value=outcome,
            symbol=str(number),
            label=outcome,
            render="true",
        )
        if geometry == "point":
            shape = {"found": "circle", "missed": "triangle"}.get(outcome, "cross2")
            _add_symbol(symbols, number, "marker", _marker(shape, colour, 12.0, smallest=1.8))
        else:
            line = {"line_color": _rgba(colour, 150), "line_width": 0.26, "line_style": "solid"}
            end = _marker("cross2", colour, 10.0, smallest=1.4, outline=colour)
            _add_symbol(
                symbols,
                number,
                "line",
                ("SimpleLine", line),
                ("MarkerLine", {"placement": "lastvertex", "rotate": 0}, end),
            )
    return Style("Outcome", _document(renderer, geometry))


def _graduated(
    column: str,
    classes: Classes,
    layers: Sequence[SymbolLayer],
    geometry: str,
    *,
    opacity: float = 1.0,
) -> str:
    """Return a document that draws by a number; of two ranges, the first holds their border."""
    renderer = ET.Element(
        "renderer-v2", type="graduatedSymbol", attr=column, graduatedMethod="GraduatedColor"
    )
    ranges = ET.SubElement(renderer, "ranges")
    symbols = ET.SubElement(renderer, "symbols")
    for number, ((low, high), (label, _)) in enumerate(classes.items()):
        ET.SubElement(
            ranges,
            "range",
            lower=repr(float(low)),
            upper=repr(float(high)),
            symbol=str(number),
            label=label,
            render="true",
        )
        kind = "fill" if geometry == "polygon" else "marker"
        _add_symbol(symbols, number, kind, layers[number])
    return _document(renderer, geometry, opacity=opacity)


def _area(colour: str, geometry: str, size: float) -> SymbolLayer:
    """Return a cell as its square, whether it is a polygon or a point."""
    if geometry == "polygon":
        # An outline as thin as can be, lest hairs of the background show between the cells.
        return "SimpleFill", {
            "color": _rgba(colour),
            "style": "solid",
            "outline_color": _rgba(colour),
            "outline_style": "solid",
            "outline_width": 0,
        }
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


def _metres(size: float, *, smallest: float, largest: float) -> Options:
    """Return the size of a marker on the ground, within bounds in millimetres on the screen."""
    return {
        "size": size,
        "size_unit": "MapUnit",
        "size_map_unit_scale": f"3x:0,0,{int(smallest > 0)},{smallest},1,{largest}",
    }


def _add_symbol(parent: ET.Element, name: object, kind: str, *layers: SymbolLayer) -> None:
    symbol = ET.SubElement(
        parent, "symbol", name=str(name), type=kind, alpha="1", clip_to_extent="1"
    )
    for number, (class_name, options, *along) in enumerate(layers):
        layer = ET.SubElement(
            symbol, "layer", attrib={"class": class_name, "enabled": "1", "locked": "0"}
        )
        listed = ET.SubElement(layer, "Option", type="Map")
        for key, value in options.items():
            ET.SubElement(listed, "Option", name=key, value=str(value), type="QString")
        for inner in along:
            _add_symbol(layer, f"@{name}@{number}", "marker", inner)


def _document(renderer: ET.Element, geometry: str, *, opacity: float = 1.0) -> str:
    root = ET.Element("qgis", version="3.22.0", styleCategories="Symbology")
    root.append(renderer)
    ET.SubElement(root, "layerOpacity").text = str(opacity)
    kind = ET.SubElement(root, "layerGeometryType")
    kind.text = str(("point", "line", "polygon").index(geometry))
    return ET.tostring(root, encoding="unicode")


def _label(text: str) -> str:
    """Return text from data for a legend: one short line, in which QGIS evaluates nothing."""
    line = one_line(text).replace("[%", "[ %")
    return line if len(line) <= LABEL_LETTERS else f"{line[: LABEL_LETTERS - 1].rstrip()}…"


def _rgba(colour: str, opacity: int = 255) -> str:
    parts = [int(colour[place : place + 2], 16) for place in (1, 3, 5)]
    return ",".join(str(part) for part in [*parts, opacity])
