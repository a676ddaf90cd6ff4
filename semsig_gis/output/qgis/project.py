"""Project and layer properties of a GeoPackage for QGIS: field names, forms, map tips.

``shown.toml`` has the titles of layers and fields; the templates are in ``templates/qgis``. QGIS
itself is not needed.
"""

from __future__ import annotations

import functools
import io
import math
import re
import tomllib
import zipfile
from collections import Counter
from dataclasses import dataclass, replace
from html import escape
from importlib import resources
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

import lazy_loader

from semsig_gis import __version__
from semsig_gis.core import GEOMETRY, class_signs, one_line
from semsig_gis.output.styles import SYMBOLS, shown_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import jinja2

    from semsig_gis.output.layers.model import Layer
    from semsig_gis.output.styles import Style
else:
    jinja2 = lazy_loader.load("jinja2")

Bounds = tuple[float, float, float, float]

# Size of the map on the page, and length of a segment of its scale bar, in metres.
MAP_WIDTH, MAP_HEIGHT, BAR = 0.205, 0.160, 0.022
SCALES = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.5)
BARS = (1.0, 2.0, 5.0)
CREDIT_LETTERS, CREDITS = 300, 7
# Tables with further columns of a layer: the layer, and the columns that join them.
RELATIONS = {"evaluation_figures": ("evaluation", ("seed", "number"))}


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field of a layer: its title and meaning for a person, decimals, and tab of the form."""

    name: str
    alias: str
    about: str
    decimals: int | None
    tab: str
    index: int  # in QGIS, where the feature id has index 0


class TipSign(NamedTuple):
    """The sign of a class in a map tip."""

    symbol: str
    colour: str
    ink: str
    text: str


@dataclass(frozen=True, kw_only=True)
class ShownLayer:
    """A layer with all that the templates need."""

    key: str
    title: str
    about: str
    licences: tuple[str, ...]
    source: str
    geometry: str
    styles: tuple[Style, ...]
    fields: tuple[Field, ...]
    signs: tuple[TipSign, ...]
    reach: float
    group: str = ""
    expression: str = ""
    label: str = ""
    nearer: float = 0.0
    farther: float = 0.0
    hidden: bool = False
    relation: str = ""

    @property
    def id(self) -> str:
        """Id in the project; QGIS does not accept a shorter id."""
        return f"semsig_layer_{self.key}"

    @property
    def names(self) -> list[str]:
        """Names of the fields."""
        return [field.name for field in self.fields]

    @property
    def tabs(self) -> list[tuple[str, list[Field]]]:
        """Tabs of the form, each with its fields."""
        return [(tab, list(fields)) for tab, fields in groupby(self.fields, key=lambda f: f.tab)]

    @property
    def geometry_number(self) -> int:
        """QGIS's number of the geometry in a style."""
        return [*SYMBOLS, "none"].index(self.geometry)

    @property
    def geometry_name(self) -> str:
        """QGIS's name of the geometry in a project."""
        return {"none": "No geometry"}.get(self.geometry, self.geometry.title())

    def is_drawn(self, scale: float) -> bool:
        """Return whether the layer is visible when the project opens at a scale of 1 to `scale`."""
        in_range = self.farther <= scale <= (self.nearer or math.inf)
        return in_range and not self.hidden and bool(self.styles)

    @property
    def tip(self) -> str:
        """HTML of the map tip, with expressions of QGIS."""
        return _environment().get_template("qgis/tips.html").render(layer=self)


def layer_fields(layer: Layer) -> tuple[Field, ...]:
    """Return the fields of a layer, in the order of its form."""
    columns = [name for name in layer.read(slice(0, 0)).column_names if name != GEOMETRY]
    titles = {item.name: item.title for item in layer.taxonomy.classes} if layer.taxonomy else {}
    fields = list(_listed_fields(layer.name, columns, titles))
    aliases = shown_lines(field.alias for field in fields)
    fields = [replace(field, alias=alias) for field, alias in zip(fields, aliases, strict=True)]
    names = {field.name for field in fields}
    fields += [
        Field(name=name, alias=name, about="", decimals=None, tab="More", index=number)
        for number, name in enumerate(columns, start=1)
        if name not in names
    ]
    # Classes may have equal titles, but the names of two fields differ.
    counts = Counter(field.alias for field in fields)
    return tuple(
        replace(field, alias=f"{field.alias} ({field.name})") if counts[field.alias] > 1 else field
        for field in fields
    )


def _listed_fields(layer: str, columns: list[str], titles: dict[str, str]) -> Iterator[Field]:
    """Yield the fields that ``shown.toml`` lists; a column has its first matching pattern."""
    remaining = list(columns)
    for tab, entries in _layer_texts().get(layer, {}).get("form", {}).items():
        for pattern, (alias, about, *decimals) in entries.items():
            regex = re.compile(pattern.replace("#", r"(\d+)").replace("*", r"(\w+)"))
            for match in [*filter(None, map(regex.fullmatch, remaining))]:
                remaining.remove(match.string)
                word = match[1] if match.groups() else ""
                yield Field(
                    name=match.string,
                    alias=alias.format(titles.get(word, word)),
                    about=about,
                    decimals=decimals[0] if decimals else None,
                    tab=tab,
                    index=columns.index(match.string) + 1,
                )


def layer_style(layer: ShownLayer, style: Style) -> str:
    """Return a style of a layer as QML, with the other properties of the layer."""
    return _environment().get_template("qgis/style.qml").render(layer=layer, style=style)


def shown_layers(layers: Sequence[Layer], file: str) -> list[ShownLayer]:
    """Return the layers of the GeoPackage `file` for the templates, the uppermost first."""
    texts = _layer_texts()
    order = [*texts]
    place = file if file.isprintable() else one_line(file)  # XML has no control characters
    names = {layer.name for layer in layers}
    # A layer is hidden at the scales where an overview layer covers it.
    overviews = [texts[name] for name in texts if name in names and "covers" in texts[name]]
    covered = {overview["covers"]: overview["farther"] for overview in overviews}
    relations = {of: name for name, (of, _) in RELATIONS.items() if name in names}
    return [
        ShownLayer(
            key=layer.name,
            title=layer.title,
            about=layer.description,
            licences=tuple(shown_lines(layer.licenses, CREDIT_LETTERS)),
            source=f"./{place}|layername={layer.name}",
            geometry=layer.geometry,
            styles=layer.styles,
            fields=layer_fields(layer),
            signs=_signs(layer),
            reach=layer.reach or 1.0,
            group=text.get("group", "Layers"),
            expression=text.get("name", ""),
            label=text.get("label", ""),
            nearer=text.get("nearer", covered.get(layer.name, 0)),
            farther=text.get("farther", 0),
            hidden=text.get("hidden", False),
            relation=relations.get(layer.name, ""),
        )
        for layer in sorted(layers, key=lambda x: order.index(x.name) if x.name in order else -1)
        for text in [texts.get(layer.name, {})]
    ]


def _signs(layer: Layer) -> tuple[TipSign, ...]:
    """Return the signs of the classes; titles are HTML inside a string of an expression."""
    escapes = str.maketrans({"'": "''", "[": "&#91;", "]": "&#93;"})
    signs = [] if layer.taxonomy is None else [*class_signs(layer.taxonomy).values()]
    titles = shown_lines(sign.title for sign in signs)
    return tuple(
        TipSign(
            symbol=sign.symbol,
            colour=sign.colour,
            ink=sign.ink,
            text=escape(title, quote=False).translate(escapes),
        )
        for sign, title in zip(signs, titles, strict=True)
    )


def project_archive(layers: Sequence[Layer], shown: Sequence[ShownLayer], title: str) -> bytes:
    """Return a project of QGIS (``.qgz``) with layers of one GeoPackage."""
    spatial = [layer for layer in layers if layer.geometry != "none"]
    credit = [*dict.fromkeys(line for layer in shown for line in layer.licences)]
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
            code=spatial[0].crs.to_epsg(),
            bounds=bounds,
            page=page,
            layers=shown,
            groups=_grouped(shown),
            drawn=_grouped([layer for layer in shown if layer.is_drawn(page["scale"])]),
            relations=[
                {"having": having, "of": of, "fields": RELATIONS[having.key][1]}
                for of in shown
                for having in shown
                if having.key == of.relation
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
    return [(name, list(group)) for name, group in groupby(layers, key=lambda x: x.group)]


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
def _layer_texts() -> dict[str, Any]:
    """Return ``shown.toml``: titles, forms and scales by layer, the uppermost first."""
    text = resources.files("semsig_gis.output.qgis").joinpath("shown.toml").read_text("utf-8")
    return tomllib.loads(text)


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
