"""Project and layer properties of a GeoPackage for QGIS: field names, forms, map tips.

The templates are in ``templates/qgis``. QGIS itself is not needed.
"""

from __future__ import annotations

import functools
import io
import math
import uuid
import zipfile
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby
from typing import TYPE_CHECKING, Any

import lazy_loader

from semsig_gis import __version__
from semsig_gis.core import GENERAL_PICTOGRAM, class_signs, epsg_code, one_line
from semsig_gis.output.layers.columns import LINKS, shown_lines
from semsig_gis.output.qgis.qml import SYMBOLS, renderer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import jinja2

    from semsig_gis.core import ClassSign
    from semsig_gis.output.layers.columns import Column
    from semsig_gis.output.layers.model import Layer
    from semsig_gis.output.layers.styles import Style
else:
    jinja2 = lazy_loader.load("jinja2")

Bounds = tuple[float, float, float, float]

# Size of the map on the page, and length of a segment of its scale bar, in metres.
MAP_WIDTH, MAP_HEIGHT, BAR = 0.205, 0.160, 0.022
SCALES = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.5)
BARS = (1.0, 2.0, 5.0)
CREDIT_LETTERS, CREDITS = 300, 7


@dataclass(frozen=True, kw_only=True)
class ShownLayer:
    """A layer in a GeoPackage, with what the templates need in addition."""

    layer: Layer
    source: str
    nearer: int  # of the layer, or where a layer above covers it
    relation: str  # table of further columns

    @property
    def id(self) -> str:
        """Id in the project; QGIS does not accept a shorter id."""
        return f"semsig_layer_{self.layer.name}"

    @property
    def licences(self) -> list[str]:
        """The licences, a short line each."""
        return shown_lines(self.layer.licenses, CREDIT_LETTERS)

    @property
    def tabs(self) -> list[tuple[str, list[Column]]]:
        """Tabs of the form, each with its columns."""
        columns = groupby(self.layer.columns, key=lambda column: column.tab)
        return [(tab, list(members)) for tab, members in columns]

    @property
    def geometry_number(self) -> int:
        """QGIS's number of the geometry in a style."""
        return [*SYMBOLS, "none"].index(self.layer.geometry)

    @property
    def geometry_name(self) -> str:
        """QGIS's name of the geometry in a project."""
        return {"none": "No geometry"}.get(self.layer.geometry, self.layer.geometry.title())

    def renderer(self, style: Style) -> str:
        """Return the renderer of a style."""
        return renderer(style, self.layer.geometry, self.layer.display.shown)

    def is_drawn(self, scale: float) -> bool:
        """Return whether the layer is visible when the project opens at a scale of 1 to `scale`."""
        display = self.layer.display
        in_range = display.farther <= scale <= (self.nearer or math.inf)
        return in_range and not display.hidden and bool(self.layer.styles)

    @property
    def signs(self) -> list[ClassSign]:
        """Signs of the classes; the titles are HTML inside a string of an expression."""
        escapes = str.maketrans({"'": "''", "[": "&#91;", "]": "&#93;"})
        taxonomy = self.layer.taxonomy
        signs = [] if taxonomy is None else [*class_signs(taxonomy).values()]
        titles = shown_lines(sign.title for sign in signs)
        return [
            replace(sign, title=escape(title, quote=False).translate(escapes))
            for sign, title in zip(signs, titles, strict=True)
        ]

    @property
    def pictograms(self) -> dict[str, str]:
        """Pictograms of the classes that have one, by their symbols."""
        drawings = {sign.symbol: sign.pictogram for sign in self.signs}
        return {name: path for name, path in drawings.items() if path != GENERAL_PICTOGRAM}

    @property
    def links(self) -> list[Column]:
        """The columns of addresses."""
        return [column for column in self.layer.columns if column.tab == LINKS]

    def action(self, column: Column) -> str:
        """Return the id of the action that opens the address of a column."""
        return f"{{{uuid.uuid5(uuid.NAMESPACE_URL, f'{self.id}/{column.name}')}}}"

    @property
    def tip(self) -> str:
        """HTML of the map tip, with expressions of QGIS."""
        return _environment().get_template("qgis/tips.html").render(shown=self, layer=self.layer)


def layer_style(shown: ShownLayer, style: Style | None) -> str:
    """Return a style of a layer as QML, with the other properties of the layer."""
    return _environment().get_template("qgis/style.qml").render(shown=shown, style=style)


def shown_layers(layers: Sequence[Layer], file: str) -> list[ShownLayer]:
    """Return the layers of the GeoPackage `file` for the templates, the uppermost first."""
    place = file if file.isprintable() else one_line(file)  # XML has no control characters
    # A layer is hidden at the scales where an overview layer covers it.
    covered = {layer.display.covers: layer.display.farther for layer in layers}
    relations = {layer.display.joins[0]: layer.name for layer in layers if layer.display.joins}
    return [
        ShownLayer(
            layer=layer,
            source=f"./{place}|layername={layer.name}",
            nearer=layer.display.nearer or covered.get(layer.name, 0),
            relation=relations.get(layer.name, ""),
        )
        for layer in sorted(layers, key=lambda layer: -layer.display.level)
    ]


def project_archive(layers: Sequence[Layer], shown: Sequence[ShownLayer], title: str) -> bytes:
    """Return a project of QGIS (``.qgz``) with layers of one GeoPackage."""
    spatial = [layer for layer in layers if layer.geometry != "none"]
    # Without the names of the layers of the source, which the properties of a layer have.
    lines = (line.partition(": ")[0] for item in shown for line in item.licences)
    credit = [*dict.fromkeys(lines)]
    if len(credit) > CREDITS:  # the page has room for a few lines
        rest = f"and {len(credit) - CREDITS + 1} more, which the properties of the layers name"
        credit[CREDITS - 1 :] = [rest]
    bounds = _total_bounds([layer.bounds for layer in spatial])
    page = _page(bounds)
    text = (
        _environment()
        .get_template("qgis/project.qgs")
        .render(
            title=shown_lines([title])[0],
            subtitle=shown_lines([spatial[0].description], CREDIT_LETTERS)[0],
            crs=spatial[0].crs,
            code=epsg_code(spatial[0].crs),
            bounds=bounds,
            page=page,
            layers=shown,
            groups=_grouped(shown),
            drawn=_grouped([layer for layer in shown if layer.is_drawn(page["scale"])]),
            relations=[
                {"having": having, "of": of, "fields": joins[1]}
                for of in shown
                for having in shown
                if (joins := having.layer.display.joins) and having.layer.name == of.relation
            ],
            credits=[*credit, f"Made with semsig_gis {__version__}"],
        )
    )
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        # The date is constant, so that the same layers give the same bytes.
        entry = zipfile.ZipInfo("project.qgs")
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, text)
    return content.getvalue()


def _grouped(layers: Sequence[ShownLayer]) -> list[tuple[str, list[ShownLayer]]]:
    return [
        (name, list(members))
        for name, members in groupby(layers, key=lambda shown: shown.layer.display.group)
    ]


def _total_bounds(bounds: Sequence[Bounds]) -> Bounds:
    """Return the bounds of all layers; the bounds of a layer without rows are not finite."""
    finite = [box for box in bounds if all(map(math.isfinite, box))] or [(0.0, 0.0, 1.0, 1.0)]
    west, south, east, north = zip(*finite, strict=True)
    return min(west), min(south), max(east), max(north)


def _page(bounds: Bounds) -> dict[str, Any]:
    """Return the scale (round) and bounds of the map on the page, and its scale bar."""
    west, south, east, north = bounds
    scale = _round(max((east - west) / MAP_WIDTH, (north - south) / MAP_HEIGHT, 100.0), SCALES)
    x, y = (west + east) / 2, (south + north) / 2
    width, height = scale * MAP_WIDTH / 2, scale * MAP_HEIGHT / 2
    bar = _round(scale * BAR / BARS[1], BARS)
    unit = ("km", "km", bar / 1000) if bar >= 1000 else ("meters", "m", bar)  # noqa: PLR2004
    return {
        "scale": scale,
        "bounds": (x - width, y - height, x + width, y + height),
        **dict(zip(("unit", "label", "bar"), unit, strict=True)),
    }


def _round(number: float, steps: Sequence[float]) -> float:
    """Return the smallest round number that is not below `number`."""
    power = 10.0 ** math.floor(math.log10(number))
    return next((step * power for step in steps if step * power >= number), 10 * power)


@functools.cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("semsig_gis"),
        # Map tips are HTML with expressions, so their template escapes texts itself.
        autoescape=jinja2.select_autoescape(("xml", "qml", "qgs"), default=False),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
