"""What QGIS is told of the layers of a GeoPackage: names of fields, forms, tips, and a project.

``shown.toml`` says what the layers and fields are called; the templates are in
``templates/qgis``. QGIS itself is not needed.
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

from semsig_gis import __version__
from semsig_gis.core import GEOMETRY, class_signs, one_line
from semsig_gis.exports.styles import SYMBOLS, shown_line

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from jinja2 import Environment

    from semsig_gis.exports.layers import Layer
    from semsig_gis.exports.styles import Style

# Size of the map on the page, and of a part of its scale bar, in metres.
MAP_WIDTH, MAP_HEIGHT, BAR = 0.205, 0.160, 0.022
SCALES = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.5)
BARS = (1.0, 2.0, 5.0)
CREDIT_LETTERS, CREDITS = 300, 7
# Which table has more of which, told apart by which columns.
RELATIONS = {"evaluation_figures": ("evaluation", ("seed", "number"))}


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field of a layer: what a person calls it, what it means, and how it is written."""

    name: str
    alias: str
    about: str
    decimals: int | None
    tab: str
    index: int  # behind the feature's number


class Sign(NamedTuple):
    """What stands for a class in a tip."""

    symbol: str
    colour: str
    ink: str
    text: str


@dataclass(frozen=True, kw_only=True)
class ShownLayer:
    """A layer as the templates take it."""

    key: str
    title: str
    about: str
    licences: tuple[str, ...]
    source: str
    geometry: str
    styles: tuple[Style, ...]
    fields: tuple[Field, ...]
    signs: tuple[Sign, ...]
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
        """What a project calls it; QGIS takes no id that is shorter."""
        return f"semsig_layer_{self.key}"

    @property
    def names(self) -> list[str]:
        """Names of the fields."""
        return [field.name for field in self.fields]

    @property
    def tabs(self) -> list[tuple[str, list[Field]]]:
        """The form: fields by tabs."""
        return [(tab, list(fields)) for tab, fields in groupby(self.fields, key=lambda f: f.tab)]

    @property
    def geometry_number(self) -> int:
        """What QGIS calls the geometry in a style."""
        return [*SYMBOLS, "none"].index(self.geometry)

    @property
    def geometry_name(self) -> str:
        """What QGIS calls the geometry in a project."""
        return {"none": "No geometry"}.get(self.geometry, self.geometry.title())

    def is_drawn(self, scale: float) -> bool:
        """Return whether it is seen when the project is opened, at a scale of 1 to so many."""
        seen = self.farther <= scale <= (self.nearer or math.inf)
        return seen and not self.hidden and bool(self.styles)

    @property
    def tip(self) -> str:
        """HTML that is shown under the mouse."""
        return _environment().get_template("qgis/tips.html").render(layer=self)


def layer_fields(layer: Layer) -> tuple[Field, ...]:
    """Return what is to be said of the fields of a layer, in the order of its form."""
    columns = [name for name in layer.read(slice(0, 0)).column_names if name != GEOMETRY]
    titles = {one.name: one.title for one in layer.taxonomy.classes} if layer.taxonomy else {}
    fields = list(_told(layer.name, columns, titles))
    told = {field.name for field in fields}
    fields += [
        Field(name=name, alias=name, about="", decimals=None, tab="More", index=number)
        for number, name in enumerate(columns, start=1)
        if name not in told
    ]
    # Classes may have the same title, but no two fields the same name.
    often = Counter(field.alias for field in fields)
    return tuple(
        replace(field, alias=f"{field.alias} ({field.name})") if often[field.alias] > 1 else field
        for field in fields
    )


def _told(layer: str, columns: list[str], titles: dict[str, str]) -> Iterator[Field]:
    left = list(columns)
    for tab, entries in _shown().get(layer, {}).get("form", {}).items():
        for pattern, (alias, about, *decimals) in entries.items():
            fitting = re.compile(pattern.replace("#", r"(\d+)").replace("*", r"(\w+)"))
            for match in [found for name in left if (found := fitting.fullmatch(name))]:
                left.remove(match.string)
                word = match[1] if match.groups() else ""
                yield Field(
                    name=match.string,
                    alias=shown_line(alias.format(titles.get(word, word))),
                    about=about,
                    decimals=decimals[0] if decimals else None,
                    tab=tab,
                    index=columns.index(match.string) + 1,
                )


def layer_style(layer: ShownLayer, style: Style) -> str:
    """Return a style of a layer as QML, with all else that QGIS is told of the layer."""
    return _environment().get_template("qgis/style.qml").render(layer=layer, style=style)


def shown_layers(layers: Sequence[Layer], file: str) -> list[ShownLayer]:
    """Return layers of a GeoPackage of that name for the templates, the uppermost first."""
    order = [*_shown()]
    place = file if file.isprintable() else one_line(file)  # what is not is no XML
    names = {layer.name for layer in layers}
    known = sorted(layers, key=lambda one: order.index(one.name) if one.name in order else -1)
    covers = [told for name, told in _shown().items() if name in names and "covers" in told]
    covered = {told["covers"]: told["farther"] for told in covers}
    relations = {of: name for name, (of, _) in RELATIONS.items() if name in names}
    return [
        ShownLayer(
            key=layer.name,
            title=layer.title,
            about=layer.description,
            licences=tuple(shown_line(text, CREDIT_LETTERS) for text in layer.licenses),
            source=f"./{place}|layername={layer.name}",
            geometry=layer.geometry,
            styles=layer.styles,
            fields=layer_fields(layer),
            signs=_signs(layer),
            reach=layer.reach or 1.0,
            group=told.get("group", "Layers"),
            expression=told.get("name", ""),
            label=told.get("label", ""),
            nearer=told.get("nearer", covered.get(layer.name, 0)),
            farther=told.get("farther", 0),
            hidden=told.get("hidden", False),
            relation=relations.get(layer.name, ""),
        )
        for layer in known
        for told in [_shown().get(layer.name, {})]
    ]


def _signs(layer: Layer) -> tuple[Sign, ...]:
    """Return the signs of the classes; their names as HTML in a text of an expression."""
    if layer.taxonomy is None:
        return ()
    marks = {"'": "''", "[": "&#91;", "]": "&#93;"}
    return tuple(
        Sign(
            symbol=sign.symbol,
            colour=sign.colour,
            ink=sign.ink,
            text="".join(
                marks.get(one, one) for one in escape(shown_line(sign.title), quote=False)
            ),
        )
        for sign in class_signs(layer.taxonomy).values()
    )


def project_archive(layers: Sequence[Layer], shown: Sequence[ShownLayer], title: str) -> bytes:
    """Return a project of QGIS (``.qgz``) with layers of one GeoPackage."""
    drawn = [layer for layer in layers if layer.geometry != "none"]
    licences = [*dict.fromkeys(line for layer in shown for line in layer.licences)]
    bounds = _joined([layer.bounds for layer in drawn])
    page = _page(bounds)
    text = (
        _environment()
        .get_template("qgis/project.qgs")
        .render(
            title=shown_line(title),
            subtitle=shown_line(drawn[0].description, CREDIT_LETTERS),
            crs=drawn[0].crs,
            code=drawn[0].crs.to_epsg(),
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
            credits=[*_credits(licences), f"Made with semsig_gis {__version__}"],
        )
    )
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        # Of a date of its own, so that the same layers are the same bytes.
        entry = zipfile.ZipInfo("project.qgs")
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, text)
    return packed.getvalue()


def _credits(licences: list[str]) -> list[str]:
    """Return whom to name on the page, on which there is room for a few."""
    if len(licences) <= CREDITS:
        return licences
    rest = f"and {len(licences) - CREDITS + 1} more, which the properties of the layers name"
    return [*licences[: CREDITS - 1], rest]


def _grouped(layers: Sequence[ShownLayer]) -> list[tuple[str, list[ShownLayer]]]:
    return [(name, list(group)) for name, group in groupby(layers, key=lambda one: one.group)]


Bounds = tuple[float, float, float, float]


def _joined(bounds: Sequence[Bounds]) -> Bounds:
    """Return the bounds of all; a layer without rows has none."""
    known = [box for box in bounds if all(map(math.isfinite, box))] or [(0.0, 0.0, 1.0, 1.0)]
    west, south, east, north = zip(*known, strict=True)
    return min(west), min(south), max(east), max(north)


def _page(bounds: Bounds) -> dict[str, Any]:
    """Return what the map on the page shows, at a round scale, and the parts of its scale bar."""
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
    """Return the least round number that is not below another."""
    power = 10.0 ** math.floor(math.log10(number))
    return next((step * power for step in steps if step * power >= number), 10 * power)


@functools.cache
def _shown() -> dict[str, Any]:
    text = resources.files("semsig_gis.exports").joinpath("shown.toml").read_text("utf-8")
    return tomllib.loads(text)


@functools.cache
def _environment() -> Environment:
    from jinja2 import (  # noqa: PLC0415 - only where it is used
        Environment,
        PackageLoader,
        StrictUndefined,
        select_autoescape,
    )

    return Environment(
        loader=PackageLoader("semsig_gis"),
        # Tips are HTML in which expressions stand, and say what is to be escaped themselves.
        autoescape=select_autoescape(("xml", "qml", "qgs"), default=False),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
