"""What all maps are made of: the page, the cells as an image, drawings, a legend."""

from __future__ import annotations

import base64
import itertools
from html import escape
from typing import TYPE_CHECKING, Any, Literal, cast

import folium
import numpy as np
from branca.element import Element, MacroElement
from folium.map import Layer
from folium.raster_layers import ImageOverlay
from folium.template import Template
from folium.utilities import JsCode
from pyproj import Transformer

from semsig_gis.core.colours import SHADES
from semsig_gis.core.errors import InputError
from semsig_gis.database.database import SignatureDatabase
from semsig_gis.maps import board as _map_board
from semsig_gis.maps import heat as _map_heat
from semsig_gis.maps import packing as _map_packing
from semsig_gis.maps import popup as _map_popup
from semsig_gis.maps import search as _map_search
from semsig_gis.maps.image import city_image
from semsig_gis.maps.map_page import SCRIPT, STYLE, script_json

if TYPE_CHECKING:
    from branca.element import Figure
    from numpy.typing import ArrayLike, NDArray
    from pyproj import CRS

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.objects.table import StreetObjects

MAX_ZOOM = 20
CLOSE_ZOOM = 17  # the closest that a new map shows by itself
SCRIPTS = (
    *(SCRIPT, _map_popup.SCRIPT, _map_search.SCRIPT),
    *(_map_packing.SCRIPT, _map_board.SCRIPT, _map_heat.SCRIPT),
)
POWERS = 4  # of x and y, which tell a place within millimetres in a city
LATTICE = 9


class Furniture(MacroElement):
    """An element that needs the style and the script of this module in the page, once."""

    def render(self, **kwargs: Any) -> Any:  # noqa: ANN401 - as branca has it
        """Put the style and script into the page, then the element."""
        figure = cast("Figure", self.get_root())
        page = f"<style>{STYLE}</style>\n<script>{''.join(SCRIPTS)}</script>"
        figure.header.add_child(Element(page), name="semsig")
        return super().render(**kwargs)  # type: ignore[no-untyped-call]


class Legend(Furniture):
    """A box with the meaning of the signs, folded on small screens, and what to show beside it."""

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


class Script(Furniture):
    """A call of a function of this module's script, which draws nothing by itself."""

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        semsig.{{ this.function }}({{ this.arguments }});
        {% endmacro %}
        """
    )

    def __init__(self, function: str, *arguments: object) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._name = "SemsigScript"
        self.function = function
        self.arguments = ", ".join(map(script_json, arguments))


class Surroundings(Furniture):
    """What stands around a map: search, light and dark, and who is to be named for the data.

    It comes last, when all boxes are there, and shows what the map is to show between them.
    """

    _template = Template(
        """
        {% macro script(this, kwargs) %}
        semsig.furnish({{ this._parent.get_name() }}, {{ this.layers.get_name() }},
          {{ this.area }}, {{ this.credits_ }});
        {% endmacro %}
        """
    )

    def __init__(
        self, layers: folium.LayerControl, area: dict[str, Any] | None, names: tuple[str, ...]
    ) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._name = "SemsigSurroundings"
        self.layers = layers
        self.names = names
        self.found = area
        self.area, self.credits_ = script_json(area), script_json(names)


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


def finished_map(
    chosen: folium.Map,
    source: SignatureDatabase | StreetObjects | None,
    *,
    licenses: tuple[str, ...] = (),
) -> folium.Map:
    """Add what every map has, last, where the layer control knows all layers.

    The source of what was drawn names whom to credit and what a search finds: cells by number,
    places by x and y in its CRS.
    """
    children = layers_of(chosen)
    area = None if source is None else _area(source)
    names = (*(() if source is None else map(str, source.licenses)), *licenses)
    for name, child in list(children.items()):
        if isinstance(child, Surroundings):
            names = child.names + names
            if area is None or area["grid"] is None:
                area = child.found or area
        if isinstance(child, folium.LayerControl | Surroundings):
            del children[name]
    layers = folium.LayerControl(collapsed=cast("bool", JsCode("semsig.small.matches")))
    layers.add_to(chosen)
    Surroundings(layers, area, tuple(dict.fromkeys(names))).add_to(chosen)
    return chosen


def _area(source: SignatureDatabase | StreetObjects) -> dict[str, Any]:
    """Return where the places of a source are, for the search of the page."""
    low, high = source.xy.min(axis=0), source.xy.max(axis=0)
    grid = None
    edge = 0.0
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
    # A polynomial is as good as the projection itself in an area of some hundred kilometres.
    u, v = (part.ravel() for part in np.meshgrid(*2 * [np.linspace(-1.0, 1.0, LATTICE)]))
    degrees = to_latlon(middle + half * np.stack([u, v], axis=1), source.crs, digits=9)
    powers = [(i, j) for i in range(POWERS + 1) for j in range(POWERS + 1 - i)]
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


def layer_text(text: str) -> str:
    """Return text for the name of a layer, which the layer control reads as HTML."""
    # A brace could begin what folium renders once more (see `maps.map_page`), and a sign of
    # direction turns text round as far as the element goes.
    return f"<bdi>{escape(text)}</bdi>".replace("{", "&#123;")


def layers_of(map_: folium.Map) -> dict[str, Element]:
    """Return what was added to a map, by name."""
    return map_._children  # noqa: SLF001 - branca has no public way to look at them


def to_latlon(xy: NDArray[np.float64], crs: CRS, *, digits: int = 6) -> NDArray[np.float64]:
    """Return latitudes and longitudes, by default to about 0.1 m, shape (n, 2); NaN stays NaN."""
    to_degrees = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    longitude, latitude = to_degrees.transform(xy[:, 0], xy[:, 1])
    degrees = np.round(np.stack([latitude, longitude], axis=1), digits)
    return np.where(np.isfinite(degrees), degrees, np.nan)


def class_titles(database: SignatureDatabase) -> dict[str, str]:
    """Return the title of each class by its symbol."""
    return {item.symbol: item.title for item in database.taxonomy.classes}


def popup_signature(types: str | None, bearings: ArrayLike | None) -> list[Any]:
    """Return a signature for the popup: symbols and whole degrees."""
    if bearings is None:
        return [types, None]
    degrees = np.rint(np.asarray(bearings, np.float64)).astype(int) % 360
    return [types, degrees.tolist()]


def query_signature(query: Signature, taxonomy: Taxonomy) -> list[Any]:
    """Return a query for the popup."""
    types = None if query.codes is None else taxonomy.decode(query.codes)
    return popup_signature(types, query.bearings)


def cell_signature(database: SignatureDatabase, cell: int) -> list[Any]:
    """Return what a cell sees for the popup."""
    return popup_signature(database.types(cell), database.signature(cell).bearings)


def free_name(map_: folium.Map, name: str) -> str:
    """Return the name for a layer, with a number where the map has one of that name."""
    taken = {child.layer_name for child in layers_of(map_).values() if isinstance(child, Layer)}
    numbered = (f"{name}, {number}" for number in itertools.count(2))
    return next(one for one in itertools.chain([name], numbered) if one not in taken)


def add_city(chosen: folium.Map, database: SignatureDatabase, *, show: bool = True) -> None:
    """Add the cells as an image, unless the map shows them already."""
    picture = city_image(database, SHADES)
    shown = {child.url for child in layers_of(chosen).values() if isinstance(child, ImageOverlay)}
    if _data_url(picture[0]) not in shown:
        # In the pane of tiles, below everything else.
        add_image(chosen, *picture, name="Objects seen from a cell", dark="flip", show=show)


def add_image(
    chosen: folium.Map,
    image: bytes,
    bounds: list[list[float]],
    *,
    name: str,
    opacity: float = 1.0,
    dark: Literal["flip", "lift"],
    show: bool = True,
) -> None:
    """Add a PNG below everything that is drawn, and say what becomes of it in the dark.

    Shades that begin near the colour of paper flip their lightness; ramps from dark to light are
    lifted, so that their dark end is seen.
    """
    ImageOverlay(
        _data_url(image),
        bounds,
        name=free_name(chosen, name),
        pane="tilePane",
        opacity=opacity,
        class_name=f"semsig-{dark}",
        show=show,
    ).add_to(chosen)


def _data_url(image: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(image).decode('ascii')}"
