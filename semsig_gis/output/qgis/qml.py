"""Styles as QML of QGIS: renderers of vector layers, and colours of rasters."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from semsig_gis.core import GENERAL_PICTOGRAM
from semsig_gis.output.layers.columns import shown_lines

if TYPE_CHECKING:
    from semsig_gis.core import ClassSign
    from semsig_gis.output.layers.styles import Scale, Style, Symbol


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
MARKERS = {"x": "cross2", **{shape: marker for shape, (marker, *_) in CLASS_MARKERS.items()}}
# Limits of a sign on the screen: visible at the scale of a city, smaller than a street.
SMALLEST_MM, LARGEST_MM = 0.9, 6.0
# Diameter of a circle, and the height of letters and pictograms in diameters.
CIRCLE_METRES, LETTER, PICTOGRAM = 7.0, 0.6, 0.64
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><path d="{}" fill="{}"/></svg>'

# QGIS's symbol type of each geometry, in the order of QGIS's geometry numbers.
SYMBOLS = {"point": "marker", "line": "line", "polygon": "fill"}
CLEAR = "#ffffff00"

Options = Mapping[str, object]
# A symbol layer: its class, its options, and for lines the symbol that is placed along them.
SymbolLayer = tuple[str, Options] | tuple[str, Options, "SymbolLayer"]


def renderer(style: Style, geometry: str, shown: str = "") -> str:
    """Return the renderer element of QML that draws features by the column of a style.

    `shown` is an expression: features for which it is false are not drawn.
    """
    if not style.column:
        root = ET.Element("renderer-v2", type="singleSymbol")
        layers = _layers(style.classes[0].symbol, geometry)
        _add_symbol(ET.SubElement(root, "symbols"), "0", SYMBOLS[geometry], *layers)
        return ET.tostring(root, encoding="unicode")
    ranges = not any(item.value for item in style.classes)
    kind, parent, child = (
        ("graduatedSymbol", "ranges", "range")
        if ranges
        else ("categorizedSymbol", "categories", "category")
    )
    column = f'if({shown}, "{style.column}", NULL)' if shown else style.column
    root = ET.Element("renderer-v2", type=kind, attr=column)
    if ranges:
        root.set("graduatedMethod", "GraduatedColor")
    if style.last_first:  # draw the smallest number last, on top
        root.set("enableorderby", "1")
        clause = ET.SubElement(ET.SubElement(root, "orderby"), "orderByClause", asc="0")
        clause.text = f'"{style.column}"'
    legend, symbols = ET.SubElement(root, parent), ET.SubElement(root, "symbols")
    labels = shown_lines(item.label for item in style.classes)
    for number, (item, label) in enumerate(zip(style.classes, labels, strict=True)):
        # A common bound of two ranges belongs to the first.
        bounds = {"lower": repr(float(item.low)), "upper": repr(float(item.high))}
        values = bounds if ranges else {"value": item.value}
        entry = {**values, "symbol": str(number), "label": label, "render": "true"}
        ET.SubElement(legend, child, entry)
        _add_symbol(symbols, str(number), SYMBOLS[geometry], *_layers(item.symbol, geometry))
    return ET.tostring(root, encoding="unicode")


def _layers(symbol: Symbol, geometry: str) -> tuple[SymbolLayer, ...]:
    """Return the symbol layers of a symbol."""
    colour, opacity = symbol.colour, symbol.opacity
    if geometry == "polygon":
        fill = {"color": _rgba(colour, opacity), "style": "solid"}
        thin = opacity if symbol.edge_mm == 0.0 else 1.0
        edge = {"outline_color": _rgba(symbol.edge, thin), "outline_style": "solid"}
        return (("SimpleFill", {**fill, **edge, "outline_width": f"{symbol.edge_mm:g}"}),)
    if geometry == "line":
        line = {"line_color": _rgba(colour, opacity), "line_width": 0.26, "line_style": "solid"}
        if not symbol.shape:
            width: Options = {}
            if symbol.metres:
                smallest, largest = symbol.least_mm, LARGEST_MM
                width = _metres(
                    symbol.metres, smallest=smallest, largest=largest, length="line_width"
                )
            return (("SimpleLine", {**line, **width, "capstyle": "round", "joinstyle": "round"}),)
        end = {"placement": "lastvertex", "rotate": 0}
        return ("SimpleLine", line), ("MarkerLine", end, _marker(symbol))
    if symbol.sign is not None:
        return _class_layers(symbol.sign)
    return (_marker(symbol),)


def _marker(symbol: Symbol) -> SymbolLayer:
    marker = {"name": MARKERS[symbol.shape], "color": _rgba(symbol.colour, symbol.opacity)}
    if not symbol.edge:
        square = {"outline_style": "no", "size": symbol.metres, "size_unit": "MapUnit"}
        return "SimpleMarker", {**marker, **square}
    edge = {"outline_color": _rgba(symbol.edge), "outline_width": symbol.edge_mm}
    size = _metres(symbol.metres, smallest=symbol.least_mm, largest=LARGEST_MM)
    return "SimpleMarker", {**marker, **edge, **size}


def _class_layers(sign: ClassSign) -> tuple[SymbolLayer, SymbolLayer]:
    """Return the symbol layers of a class: its pictogram on a disc, or its letter on its shape."""
    own = sign.pictogram != GENERAL_PICTOGRAM
    marker, angle, size, outline = CLASS_MARKERS["circle" if own else sign.shape]
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
    if own:
        drawing = base64.b64encode(SVG.format(sign.pictogram, sign.ink).encode()).decode()
        picture = {"name": f"base64:{drawing}", **_of_circle("size", PICTOGRAM, smallest=0.0)}
        return ("SimpleMarker", shape), ("SvgMarker", picture)
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


def _rgba(colour: str, opacity: float = 1.0) -> str:
    return ",".join(map(str, (*bytes.fromhex(colour[1:]), round(255 * opacity))))


def by_pixel(scale: Scale) -> str:
    """Return a QML document that colours the first band of a raster by a scale."""
    items = scale.ranges
    if scale.below:
        items.insert(0, (0.0, items[0][0], scale.below, CLEAR))
    root = ET.Element("qgis", version="3.22.0", styleCategories="Symbology")
    band = {"type": "singlebandpseudocolor", "band": "1", "opacity": "1", "alphaBand": "-1"}
    ends = {"classificationMin": f"{items[0][0]:g}", "classificationMax": f"{items[-1][0]:g}"}
    raster = ET.SubElement(ET.SubElement(root, "pipe"), "rasterrenderer", {**band, **ends})
    steps = {"colorRampType": "DISCRETE", "classificationMode": "1", "clip": "0"}
    shader = ET.SubElement(ET.SubElement(raster, "rastershader"), "colorrampshader", steps)
    for number, (_, high, label, colour) in enumerate(items, start=1):
        value = "inf" if number == len(items) else f"{high:g}"
        item = {"value": value, "label": label, "color": colour[:7]}
        ET.SubElement(shader, "item", {**item, "alpha": "0" if colour == CLEAR else "255"})
    return ET.tostring(root, encoding="unicode")
