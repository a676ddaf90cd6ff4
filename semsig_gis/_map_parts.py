"""What all maps are made of: the page, the cells as an image, drawings, a legend."""

from __future__ import annotations

import base64
import itertools
from typing import TYPE_CHECKING, Any, cast

import folium
import numpy as np
from branca.element import Element, MacroElement
from folium.map import Layer
from folium.raster_layers import ImageOverlay
from folium.template import Template
from folium.utilities import JsCode
from pyproj import Transformer

from semsig_gis.errors import InputError
from semsig_gis.map_image import city_image
from semsig_gis.map_legend import SHADES
from semsig_gis.map_page import SCRIPT, STYLE, script_json

if TYPE_CHECKING:
    from branca.element import Figure
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.database import SignatureDatabase

__all__ = [
    "Drawing",
    "Furniture",
    "Legend",
    "add_city",
    "add_image",
    "cell_signature",
    "class_titles",
    "finished_map",
    "free_name",
    "layers_of",
    "popup_signature",
    "prepared_map",
    "to_latlon",
]

MAX_ZOOM = 20
CLOSE_ZOOM = 17  # the closest that a new map shows by itself


class Furniture(MacroElement):
    """An element that needs the style and the script of this module in the page, once."""

    def render(self, **kwargs: Any) -> Any:  # noqa: ANN401 - as branca has it
        """Put the style and script into the page, then the element."""
        figure = cast("Figure", self.get_root())
        page = f"<style>{STYLE}</style>\n<script>{SCRIPT}</script>"
        figure.header.add_child(Element(page), name="semsig")
        return super().render(**kwargs)  # type: ignore[no-untyped-call]


class Legend(Furniture):
    """A box with the meaning of the signs, folded on narrow screens, and what to show beside it."""

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        semsig.legend(
          {{ this._parent.get_name() }}, {{ this.text }}, {{ this.view }}, {{ this.zoom }});
        {% endmacro %}
        """
    )

    def __init__(
        self, text: str, view: NDArray[np.float64] | None, *, zoom: int = CLOSE_ZOOM
    ) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._name = "SemsigLegend"
        self.text = script_json(text)
        self.zoom = zoom
        corners = None if view is None else [view.min(axis=0).tolist(), view.max(axis=0).tolist()]
        self.view = script_json(corners)


class Drawing(Furniture, Layer):
    """A layer that a function of this module's script draws, on a canvas where the map has one."""

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        var {{ this.get_name() }} = semsig.{{ this.function }}({{ this.arguments }});
        {% endmacro %}
        """
    )

    def __init__(self, name: str, function: str, *arguments: object, show: bool = True) -> None:
        super().__init__(name=name, overlay=True, show=show)
        self._name = "SemsigDrawing"
        self.function = function
        self.arguments = ", ".join(map(script_json, arguments))


def prepared_map(map_: folium.Map | None, tiles: str | None, *, title: str) -> folium.Map:
    """Return the map to draw on."""
    if map_ is not None:
        if tiles is not None:
            msg = f"Tiles {tiles!r} were given with a map of your own; add them to that map."
            raise InputError(msg)
        return map_
    try:
        made = folium.Map(tiles=tiles, prefer_canvas=True, control_scale=True)
    except ValueError as error:
        msg = (
            f"Tiles {tiles!r} are not known to folium; give a name such as 'OpenStreetMap' or "
            "'CartoDB positron', or add a tile layer to a map of your own."
        )
        raise InputError(msg) from error
    if tiles is None:
        # Only tiles tell Leaflet where to stop, and only they look bad between whole zooms.
        made.options |= {"maxZoom": MAX_ZOOM, "zoomSnap": 0.25}
    cast("Figure", made.get_root()).title = title
    return made


def finished_map(chosen: folium.Map) -> folium.Map:
    """Put the layer control last, where it knows all layers."""
    children = layers_of(chosen)
    for name in [key for key, child in children.items() if isinstance(child, folium.LayerControl)]:
        del children[name]
    narrow = cast("bool", JsCode("window.innerWidth <= 700"))
    folium.LayerControl(collapsed=narrow).add_to(chosen)
    return chosen


def layers_of(map_: folium.Map) -> dict[str, Element]:
    return map_._children  # noqa: SLF001 - branca has no public way to look at them


def to_latlon(xy: NDArray[np.float64], crs: CRS, *, digits: int = 6) -> NDArray[np.float64]:
    """Return latitudes and longitudes, by default to about 0.1 m, shape (n, 2); NaN stays NaN."""
    to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(xy[:, 0], xy[:, 1])
    degrees = np.round(np.stack([latitude, longitude], axis=1), digits)
    return np.where(np.isfinite(degrees), degrees, np.nan)


def class_titles(database: SignatureDatabase) -> dict[str, str]:
    return {item.symbol: item.title for item in database.taxonomy.classes}


def popup_signature(types: str | None, bearings: ArrayLike | None) -> list[Any]:
    """Return a signature for the popup: symbols and whole degrees."""
    if bearings is None:
        return [types, None]
    degrees = np.rint(np.asarray(bearings, np.float64)).astype(int) % 360
    return [types, degrees.tolist()]


def cell_signature(database: SignatureDatabase, cell: int) -> list[Any]:
    return popup_signature(database.types(cell), database.signature(cell).bearings)


def free_name(map_: folium.Map, name: str) -> str:
    """Return the name for a layer, with a number where the map has one of that name."""
    taken = {child.layer_name for child in layers_of(map_).values() if isinstance(child, Layer)}
    numbered = (f"{name}, {number}" for number in itertools.count(2))
    return next(one for one in itertools.chain([name], numbered) if one not in taken)


def add_city(chosen: folium.Map, database: SignatureDatabase) -> None:
    """Add the cells as an image, unless the map shows them already."""
    picture = city_image(database, SHADES)
    shown = {child.url for child in layers_of(chosen).values() if isinstance(child, ImageOverlay)}
    if _data_url(picture[0]) not in shown:
        # In the pane of tiles, below everything else.
        add_image(chosen, *picture, name="Objects seen from a cell")


def add_image(
    chosen: folium.Map,
    image: bytes,
    bounds: list[list[float]],
    *,
    name: str,
    opacity: float = 1.0,
    show: bool = True,
) -> None:
    """Add a PNG below everything that is drawn."""
    ImageOverlay(
        _data_url(image),
        bounds,
        name=free_name(chosen, name),
        pane="tilePane",
        opacity=opacity,
        show=show,
    ).add_to(chosen)


def _data_url(image: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(image).decode('ascii')}"
