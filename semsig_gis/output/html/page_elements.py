"""Elements that all maps share: scripts, layers, the image of the cells, and parts of legends."""

from __future__ import annotations

import base64
import functools
import itertools
import re
from html import escape
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal, cast
from urllib.parse import urlsplit

import folium
import numpy as np
import xyzservices
from branca.element import Element, MacroElement
from folium.map import Layer
from folium.raster_layers import ImageOverlay
from folium.template import Template
from folium.utilities import JsCode

from semsig_gis import __version__
from semsig_gis.core import (
    VERDICTS,
    ClassSign,
    InputError,
    across_180,
    class_signs,
    family_named,
    nearest_name,
    place_links,
    to_degrees,
)
from semsig_gis.database import SignatureDatabase
from semsig_gis.observation import View
from semsig_gis.output.html.image import city_image, script_json
from semsig_gis.output.layers.styles import SEEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from branca.element import Figure
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core import Mark, Signature, Taxonomy
    from semsig_gis.objects import StreetObjects
    from semsig_gis.observation import Photo, Sector


MAX_ZOOM = 20
FIRST_VIEW_ZOOM = 17  # highest zoom of the first view of a new map
VIEW_QUANTILES = (0.0025, 0.9975)  # of x and of y; both leave out 1 % of the places at most
VIEW_MARGIN = 0.05  # of the sides of that box
# Files of the folder ``js`` that every page contains, in this order.
PAGE_FILES = (
    *("page.css", "panel.css", "layers.js", "state.js", "panel.js", "wheels.js", "search.js"),
    *("controls.js", "picture.js", "arrays.js", "board.js", "field.js", "objects.js", "ground.js"),
    "answer.js",
)
TILES_WITHOUT_KEY = "a provider such as 'OpenStreetMap.Mapnik' or 'CyclOSM'"
ANY_PLACE = (12.345678, 98.765432)  # in links, which the script replaces by another place
AREA_DEGREE = 4  # of the polynomial from x, y to degrees; exact to millimetres in a city
AREA_LATTICE = 9  # points a side from which the polynomial is fitted


@functools.cache
def page_element(file: str) -> str:
    """Return a file of the folder ``js`` as a style or script element."""
    text = resources.files("semsig_gis.output.html").joinpath("js", file).read_text("utf-8")
    if file.endswith(".css"):
        return f"<style>{text}</style>"
    # The developer tools of a browser show the script under this name.
    return f"<script>{text}//# sourceURL=semsig/{file}\n</script>"


class PageFile(Element):
    """A file of the folder ``js``, inserted unchanged because parsing it as a template is slow."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.file = file

    def render(self, **_kwargs: Any) -> str:  # noqa: ANN401 - as branca has it
        """Return the element."""
        return page_element(self.file)


class Call(MacroElement):
    """A call of a function of the page's script with map elements or plain values."""

    files: tuple[str, ...] = PAGE_FILES
    _template = Template(
        "{% macro script(this, kwargs) %}semsig.{{ this.function }}({{ this.arguments }});"
        "{% endmacro %}"
    )

    def __init__(self, function: str, *arguments: object, **layer: Any) -> None:  # noqa: ANN401
        super().__init__(**layer)  # type: ignore[no-untyped-call]
        self._name = "Semsig"
        self.function = function
        self.arguments = ", ".join(
            argument.get_name() if isinstance(argument, Element) else script_json(argument)
            for argument in arguments
        )

    def render(self, **kwargs: Any) -> Any:  # noqa: ANN401 - as branca has it
        """Add the style sheets and scripts to the header of the page, and the call to its body."""
        header = cast("Figure", self.get_root()).header
        for file in self.files:
            header.add_child(PageFile(file), name=file)
        return super().render(**kwargs)  # type: ignore[no-untyped-call]


GROUPS = {
    "cells": "Colour cells by",
    "queries": "Queries",
    "answer": "Answer",
    "objects": "Street objects",
    "ground": "Ground",
}
"""Titles of the groups in the layer control; only one layer of the group ``cells`` is on."""


class ScriptLayer(Call, Layer):
    """A map layer that a JavaScript function returns, in one of the `GROUPS`.

    A group may have parts by family of classes, such as ``objects:shop``.

    A layer without a name is a part of another layer and is not listed in the layer control.
    """

    _template = Template(
        "{% macro script(this, kwargs) %}var {{ this.get_name() }} = "
        "semsig.{{ this.function }}({{ this.arguments }});{% endmacro %}"
    )

    def __init__(
        self, name: str | None, function: str, *arguments: object, group: str, show: bool = True
    ) -> None:
        listed = name is not None
        options = {"name": name, "overlay": True, "control": listed, "show": listed and show}
        super().__init__(function, *arguments, **options)
        self.group = group


class LayerGroups(Call):
    """The layer control of a map, with its layers in groups."""

    def __init__(self, map_: folium.Map, layers: folium.LayerControl) -> None:
        groups = {
            child.layer_name: child.group
            for child in layers_of(map_).values()
            if isinstance(child, ScriptLayer) and child.control
        }
        tiles = (child for child in layers_of(map_).values() if isinstance(child, folium.TileLayer))
        groups |= {child.layer_name: "ground" for child in tiles}
        titles: dict[str, str] = {}
        for group, title in GROUPS.items():
            parts = [part for part in groups.values() if part.startswith(f"{group}:")]
            families = {part: family_named(part.partition(":")[2]).title for part in parts}
            titles |= {group: title, **families}
        super().__init__("layerGroups", map_, layers, titles, groups)


class PageControls(Call):
    """Controls around a map, added last: search, light or dark colours, credits of the data."""

    def __init__(
        self,
        map_: folium.Map,
        layers: folium.LayerControl,
        area: dict[str, Any] | None,
        names: tuple[str, ...],
        first: str | None,
    ) -> None:
        links = [[title, address] for title, address in place_links(*ANY_PLACE).items()]
        about = {"credits": names, "first": first, "links": links, "at": ANY_PLACE}
        super().__init__("addControls", map_, layers, area, about)
        self.area, self.names, self.first = area, names, first


def start_map(map_: folium.Map | None, tiles: str | None, *, title: str) -> folium.Map:
    """Return the map to draw on: `map_`, or a new one with online `tiles` if they are given."""
    if map_ is not None:
        if tiles is not None:
            raise InputError(
                f"Tiles {tiles!r} were given with a map of your own; add them to that map."
            )
        return map_
    new_map = folium.Map(tiles=None, prefer_canvas=True, control_scale=True)
    if tiles is not None:
        provider = _tile_provider(tiles)
        name = provider["name"].removesuffix(".Mapnik").replace(".", " ")
        folium.TileLayer(provider, name=f"Online map: {name}", overlay=True).add_to(new_map)
    else:
        # Without tiles Leaflet has no maximum zoom; fractional zooms only blur tiles.
        new_map.options |= {"maxZoom": MAX_ZOOM, "zoomSnap": 0.25}
    cast("Figure", new_map.get_root()).title = title
    return new_map


def needs_server(tiles: str) -> bool:
    """Whether online tiles are refused to pages that are opened from disk.

    Such pages do not say where they are from, which the policy of OpenStreetMap's server requires.
    """
    address = str(_tile_provider(tiles).url)
    return urlsplit(address).hostname == "tile.openstreetmap.org"


def _tile_provider(name: str) -> xyzservices.TileProvider:
    """Return the xyzservices provider of online tiles with this name."""
    providers = xyzservices.providers
    plain = name.lower() == "openstreetmap"
    try:
        provider = providers.query_name("OpenStreetMap.Mapnik" if plain else name)
    except ValueError as error:
        raise InputError(
            f"Tiles {name!r} are not known to xyzservices"
            f"{nearest_name(name, providers.flatten())}; give {TILES_WITHOUT_KEY}."
        ) from error
    if provider.requires_token():
        raise InputError(
            f"Tiles {name!r} need a key from their provider; give {TILES_WITHOUT_KEY}."
        )
    return provider


def add_layer(
    map_: folium.Map, name: str, function: str, *arguments: object, group: str, show: bool = True
) -> None:
    """Add a layer that a function of the page's script returns.

    A new kind of layer needs three things: a JavaScript function ``semsig.FUNCTION`` in the folder
    ``js`` (with its file in `PAGE_FILES`), a call of this function with its name and data, and a
    part of the legend (`layer_part`).
    """
    ScriptLayer(unique_layer_name(map_, name), function, *arguments, group=group, show=show).add_to(
        map_
    )


def finish_map(
    map_: folium.Map,
    source: SignatureDatabase | StreetObjects | None,
    *,
    legend: str = "",
    view: NDArray[np.float64] | None = None,
    zoom: int = FIRST_VIEW_ZOOM,
    licenses: tuple[str, ...] = (),
    first: str | None = None,
) -> folium.Map:
    """Add the legend, the layer control and the other controls, after all layers.

    ``view`` holds places that the first view shows, at a zoom of at most ``zoom``; the search box
    finds the cells and places of ``source``. ``first`` is the key of what the panel shows first,
    such as ``answer:1``; the other boxes are folded then.
    """
    if legend:
        corners = None if view is None else [view.min(axis=0).tolist(), view.max(axis=0).tolist()]
        Call("legend", map_, legend, corners, zoom).add_to(map_)
    children = layers_of(map_)
    area = None if source is None else search_area(source)
    lines = (*(() if source is None else map(str, source.licenses)), *licenses)
    # The terms; the layers that they apply to are in the part on the data.
    names = tuple(re.sub(r"(?<=\)): .*", "", line, flags=re.DOTALL) for line in lines)
    # A map that was finished before has these controls already: replace them.
    for name, child in list(children.items()):
        if isinstance(child, PageControls):
            names, first = child.names + names, child.first or first
            if area is None or area["grid"] is None:
                area = child.area or area
        if isinstance(child, folium.LayerControl | LayerGroups | PageControls):
            del children[name]
    collapsed = cast("bool", JsCode("semsig.small.matches"))
    # No automatic z-index: parts of a layer keep their order, and layers may share parts.
    layers = folium.LayerControl(collapsed=collapsed, autoZIndex=False)
    layers.add_to(map_)
    LayerGroups(map_, layers).add_to(map_)
    PageControls(map_, layers, area, tuple(dict.fromkeys(names)), first).add_to(map_)
    return map_


def search_area(source: SignatureDatabase | StreetObjects) -> dict[str, Any]:
    """Return area and grid of a source, and a polynomial from x, y to degrees, for the search."""
    low, high = source.xy.min(axis=0), source.xy.max(axis=0)
    grid, edge = None, 0.0
    if isinstance(source, SignatureDatabase):
        edge = source.grid.step
        grid = {
            "step": source.grid.step,
            "origin": list(source.grid.origin),
            "columns": [int(source.columns.min()), int(source.columns.max())],
            "rows": [int(source.rows.min()), int(source.rows.max())],
        }
    authority = source.crs.to_authority()
    middle, half = (low + high) / 2.0, max(float((high - low).max()) / 2.0, 1.0)
    # Fit the polynomial that replaces the projection in the browser; it is accurate enough in an
    # area of some hundred kilometres. u and v are x and y scaled to -1..1.
    u, v = (part.ravel() for part in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, AREA_LATTICE)]))
    degrees = to_latlon(middle + half * np.stack([u, v], axis=1), source.crs, digits=9)
    powers = [(i, j) for i in range(AREA_DEGREE + 1) for j in range(AREA_DEGREE + 1 - i)]
    terms = np.stack([u**i * v**j for i, j in powers], axis=1)
    weights = np.linalg.lstsq(terms, degrees, rcond=None)[0].tolist()
    return {
        "crs": source.crs.name if authority is None else ":".join(authority),
        "box": [*(low - edge).tolist(), *(high + edge).tolist()],
        "middle": middle.tolist(),
        "half": half,
        "terms": [[*power, *weight] for power, weight in zip(powers, weights, strict=True)],
        "grid": grid,
    }


def layers_of(map_: folium.Map) -> dict[str, Element]:
    """Return the elements of a map by name."""
    return map_._children  # noqa: SLF001 - branca has no public access


def to_latlon(xy: NDArray[np.float64], crs: CRS, *, digits: int = 6) -> NDArray[np.float64]:
    """Return latitudes and longitudes, by default to about 0.1 m, shape (n, 2); NaN stays NaN."""
    longitude, latitude = to_degrees(crs).transform(xy[:, 0], xy[:, 1])
    degrees = np.round(np.stack([latitude, across_180(longitude, crs)], axis=1), digits)
    return np.where(np.isfinite(degrees), degrees, np.nan)


def to_metres(place: tuple[float, float], crs: CRS) -> NDArray[np.float64]:
    """Return x and y of a latitude and longitude in a coordinate system, shape (1, 2)."""
    lat, lon = place
    return np.array([to_degrees(crs).transform(lon, lat, direction="INVERSE")])


def exact_latlon(xy: ArrayLike, crs: CRS) -> list[list[float]]:
    """Return latitudes and longitudes of one or more places, to about a centimetre."""
    places = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    degrees: list[list[float]] = to_latlon(places, crs, digits=7).tolist()
    return degrees


def corners_of(source: SignatureDatabase | StreetObjects) -> NDArray[np.float64]:
    """Return latitudes and longitudes of two corners of a box around 99 % of the places.

    The few places far from the others would make the rest of a map tiny.
    """
    least, low, high, most = np.quantile(source.xy, [0.0, *VIEW_QUANTILES, 1.0], axis=0)
    margin = VIEW_MARGIN * (high - low)
    box = np.stack([np.maximum(least, low - margin), np.minimum(most, high + margin)])
    return to_latlon(box, source.crs)


def panel_signs(database: SignatureDatabase) -> dict[str, Any]:
    """Return the signs of classes by symbol, and of verdicts, for the script."""
    classes = class_signs(database.taxonomy).values()
    return {
        "classes": {sign.symbol: sign_look(sign) for sign in classes},
        "verdicts": {
            verdict: {"outline": OUTLINES[shape], "colour": VERDICTS[verdict]}
            for verdict, shape in VERDICT_SHAPES.items()
        },
    }


def sign_look(sign: ClassSign) -> dict[str, Any]:
    """Return the sign of a class for the script."""
    return {
        "title": sign.title,
        "colour": sign.colour,
        "ink": sign.ink,
        "outline": OUTLINES[sign.shape],
        "drop": sign.drop,
        "pictogram": sign.pictogram,
    }


def panel_signature(types: str | None, bearings: ArrayLike | None, **look: Any) -> list[Any]:  # noqa: ANN401
    """Return a signature for the panel: symbols, whole degrees and options of its look."""
    if bearings is None:
        return [types, None]
    degrees = np.rint(np.asarray(bearings, np.float64)).astype(int) % 360
    return [types, degrees.tolist(), look] if look else [types, degrees.tolist()]


def query_signature(
    query: Signature,
    taxonomy: Taxonomy,
    *,
    radius: float,
    **look: Any,  # noqa: ANN401
) -> list[Any]:
    """Return a query for the panel; `radius` is the visibility range in metres.

    `look` may contain the ``place`` where it is drawn and the ``turn`` in degrees.
    """
    types = None if query.codes is None else taxonomy.decode(query.codes)
    look |= {"kind": "query", "reach": radius}
    if isinstance(query, View):
        if query.ranges is not None:
            look["metres"] = _whole_metres(query.ranges)
        if all(photo.sectors for photo in query.photos):
            look |= {"sectors": _sectors(query.photos), "outside": query.outside().tolist()}
    return panel_signature(types, query.bearings, **look)


def cell_signature(
    database: SignatureDatabase,
    cell: int,
    query: Signature | None = None,
    turn: float = 0.0,
    *,
    place: Sequence[float] | None = None,
) -> list[Any]:
    """Return the signature of a cell for the panel.

    ``query``, turned by ``turn`` degrees, gives the sectors to draw; ``place`` is the latitude and
    longitude of the cell.
    """
    row = database.select(slice(cell, cell + 1))
    bearings = row.bearings
    look: dict[str, Any] = {
        "reach": database.near_reach,
        "metres": _whole_metres(row.distances),
        **({} if row.extents is None else {"extents": np.rint(row.extents).astype(int).tolist()}),
        **({} if place is None else {"place": list(place)}),
    }
    if isinstance(query, View):
        photos = [photo.turned(turn) for photo in query.photos]
        # Photos with separate north errors have no common turn, so their sectors are not drawn.
        one_turn = len(photos) == 1 or not any(photo.north_sigma for photo in photos)
        if one_turn and all(photo.sectors for photo in photos):
            sees = np.any([photo.sees(bearings) for photo in photos], axis=0)
            look |= {"sectors": _sectors(photos), "outside": np.flatnonzero(~sees).tolist()}
    return panel_signature(database.types(cell), bearings, **look)


def _whole_metres(ranges: NDArray[np.float64]) -> list[int | None]:
    return [None if np.isnan(metres) else round(metres) for metres in ranges.tolist()]


def _sectors(photos: Iterable[Photo]) -> list[Sector]:
    return [sector for photo in photos for sector in photo.sectors]


def ranks_text(low: int, high: int) -> str:
    """Return a rank, or the range of ranks of tied cells."""
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"


def ties_text(tied: int) -> str:
    """Return the number of tied cells, as a suffix of a rank or a distance."""
    return f", {tied:,} tied" if tied > 1 else ""


def unique_layer_name(map_: folium.Map, name: str) -> str:
    """Return the name of a layer, with a number if the map has a layer of that name."""
    names = {child.layer_name for child in layers_of(map_).values() if isinstance(child, Layer)}
    numbered = (f"{name}, {number}" for number in itertools.count(2))
    return next(text for text in itertools.chain([name], numbered) if text not in names)


def add_city(map_: folium.Map, database: SignatureDatabase, *, show: bool = True) -> ImageOverlay:
    """Add the image of the number of objects seen from each cell, if missing; return the image.

    It is shown unless the cells are coloured by another layer.
    """
    picture = city_image(database)
    for child in layers_of(map_).values():
        if isinstance(child, ImageOverlay) and child.url == data_url(picture[0]):
            return child
    image = cell_image(map_, *picture, dark="flip")
    show = show and not any(layer.show for layer in cell_colours(map_))
    colour_cells(map_, "Objects seen from a cell", image, show=show)
    return image


def cell_image(
    map_: folium.Map,
    image: bytes,
    bounds: list[list[float]],
    *,
    dark: Literal["flip", "lift", "keep"],
    opacity: float = 1.0,
) -> ImageOverlay:
    """Return a PNG as an overlay below all drawn layers, for `colour_cells`.

    With dark colours, ``flip`` inverts shades that start near white, ``lift`` brightens ramps with
    a dark end, and ``keep`` changes nothing.
    """
    overlay = ImageOverlay(
        data_url(image),
        bounds,
        pane="tilePane",  # below everything else
        opacity=opacity,
        class_name=f"semsig-{dark}",
        control=False,
        show=False,
    )
    overlay.add_to(map_)
    return overlay


def cell_colours(map_: folium.Map) -> list[ScriptLayer]:
    """Return the layers of the group ``cells``."""
    layers = (child for child in layers_of(map_).values() if isinstance(child, ScriptLayer))
    return [layer for layer in layers if layer.control and layer.group == "cells"]


def colour_cells(map_: folium.Map, name: str, *layers: Layer, show: bool = True) -> None:
    """Add layers as one entry of the group ``cells``; with `show`, hide the entries before it."""
    for other in cell_colours(map_) if show else ():
        other.show = False
    add_layer(map_, name, "together", *layers, group="cells", show=show)


def data_url(image: bytes) -> str:
    """Return a PNG as a data URL."""
    return f"data:image/png;base64,{base64.b64encode(image).decode('ascii')}"


# Shapes of legend signs that flip or lift with dark colours like the image that they explain.
FLIPPING, LIFTING = "square semsig-flip", "square semsig-lift"
NAMED_CLASSES = 6  # in a legend
# SVG path of each shape, around (0, 0), with about the area of a circle of radius 1.
OUTLINES = {
    "circle": "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z",
    "square": "M-.9,-.9H.9V.9H-.9Z",
    "diamond": "M0,-1.25L1.25,0L0,1.25L-1.25,0Z",
    "triangle": "M0,-1.2L1.2,1.2H-1.2Z",
    "hexagon": "M0,-1.15L1,-.575V.575L0,1.15L-1,.575V-.575Z",
    "triangle_down": "M0,1.2L1.2,-1.2H-1.2Z",
    "cross": "M-.6,-1.1H.6V-.6H1.1V.6H.6V1.1H-.6V.6H-1.1V-.6H-.6Z",
}
# Frame around the sign of an object, by the verdict on the object.
VERDICT_SHAPES = {
    "matched": "circle",
    "misnamed": "diamond",
    "missed": "circle",  # in dashes
    "false": "square",
}


def sign_svg(sign: ClassSign) -> str:
    """Return the sign of a class as SVG: its pictogram on a disc."""
    return (
        '<svg class="semsig-sign pictogram" viewBox="-1.1 -1.1 2.2 2.2" aria-hidden="true">'
        f'<path d="{OUTLINES["circle"]}" fill="{sign.colour}"/>'
        f'<path d="{sign.pictogram}" transform="scale(.085)translate(-8-8)" fill="{sign.ink}"/>'
        "</svg>"
    )


def family_svg(name: str) -> str:
    """Return the sign of a family as SVG, for headings."""
    family = family_named(name)
    return sign_svg(ClassSign("?", family.title, "circle", family.colour, family.pictogram))


def mark_svg(mark: Mark) -> str:
    """Return a mark as SVG."""
    return (
        '<svg class="semsig-sign mark" viewBox="-1.5 -1.5 3 3" aria-hidden="true">'
        f'<path d="{OUTLINES[mark.shape]}" fill="{mark.colour}"/></svg>'
    )


def escaped_text(text: str) -> str:
    """Return text from data as HTML; its text direction does not change the text around it."""
    return f"<bdi>{escape(text)}</bdi>"


def swatch(colour: str, shape: str = "round") -> str:
    """Return a small patch of a colour for a legend, as HTML."""
    return f'<i class="{shape}" style="background:{colour}"></i>'


def ramp_bar(colours: Iterable[str], low: str, high: str) -> str:
    """Return a colour ramp with labels at both ends, as HTML."""
    gradient = f"linear-gradient(to right,{','.join(colours)})"
    return (
        f'<i class="ramp" style="background:{gradient}"></i>'
        f'<span class="ends"><small>{low}</small><small>{high}</small></span>'
    )


def class_bar(colours: Sequence[str], breaks: Sequence[str]) -> str:
    """Return a bar of classed colours with the breaks between them, as HTML."""
    share = 100.0 / len(colours)
    parts = ",".join(
        f"{colour} {number * share:.1f}% {(number + 1) * share:.1f}%"
        for number, colour in enumerate(colours)
    )
    labels = "".join(f"<small>{text}</small>" for text in breaks)
    return (
        f'<i class="ramp" style="background:linear-gradient(to right,{parts})"></i>'
        f'<span class="breaks">{labels}</span>'
    )


def shades_part() -> str:
    """Return the legend of the image that `add_city` adds."""
    signs = " ".join(
        f"<span style='white-space:nowrap'>{swatch(colour, FLIPPING)}{label}</span>"
        for _, _, label, colour in SEEN.ranges
    )
    name = "Objects seen from a cell"
    return layer_part(name, f"<p>{name}<br>{signs}</p>")


def layer_part(layer: str, text: str) -> str:
    """Return a part of a legend that is shown while a layer of that name is on.

    A name that ends with a space is a prefix of layer names.
    """
    return f'<div data-layer="{escape(layer)}">{text}</div>'


def subtitle_part(text: str) -> str:
    """Return a part of a legend that the title of the map repeats."""
    return f'<span class="semsig-subtitle">{text}</span>'


def folded_part(title: str, text: str) -> str:
    """Return a part of a legend that is folded until it is clicked."""
    return f"<details><summary>{title}</summary>{text}</details>"


def credits_part(licenses: Iterable[str]) -> str:
    """Return the credits and licences of the data, folded."""
    lines = [f"{escaped_text(line)}<br>" for line in licenses]
    lines.append(f"Made with semsig_gis {escape(__version__)}")
    return folded_part("About", f"<p><small>{''.join(lines)}</small></p>")
