"""Write an answer in degrees (WGS 84), for web maps and virtual globes: GeoJSON and KML."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import geopandas as gpd
import pandas as pd
import pyarrow as pa
import pyogrio
import shapely

from semsig_gis.core import GEOMETRY, one_line
from semsig_gis.output.features import geojson_options, write_errors
from semsig_gis.output.layers.columns import LINKS
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Mapping, Sequence
    from pathlib import Path

    from shapely.geometry.base import BaseGeometry

    from semsig_gis.output.layers.model import Layer


TITLE = "Where the query may have been seen from"
KML = "http://www.opengis.net/kml/2.2"


def write_answer_geojson(layers: Sequence[Layer], path: str | Path) -> None:
    """Write the layers of an answer as one GeoJSON, atomically.

    ``layer`` is the layer of a feature, ``Name`` adds the rank. The member ``semsig`` holds
    `Answer.to_dict` without the candidates.
    """
    parts = []
    for layer in layers:
        table = layer.read(slice(0, layer.rows))
        names = _names(layer, table.column(0).to_pylist())
        kinds = pa.repeat(layer.name.removesuffix("s"), layer.rows)
        parts.append(table.append_column("Name", [names]).append_column("layer", kinds))
    abstract = "\n".join([TITLE, *layers[0].licenses])
    with whole_file(path) as partial, write_errors(path):
        pyogrio.write_arrow(
            pa.concat_tables(parts, promote_options="permissive"),
            partial,
            layer="answer",
            driver="GeoJSON",
            geometry_name=GEOMETRY,
            geometry_type="Unknown",
            crs=layers[0].crs.to_wkt(),
            layer_options=geojson_options(abstract, layers[0].metadata),
        )


def write_answer_kml(layers: Sequence[Layer], path: str | Path) -> None:
    """Write the layers of an answer as one KML 2.2, atomically.

    Each layer is a folder, in the colours of the maps. The description holds the licences. The
    description of a place has links to public maps; nothing is requested before a click.
    """
    root = ET.Element("kml", xmlns=KML)
    document = ET.SubElement(root, "Document")
    _add_text(document, "name", TITLE)
    _add_text(document, "description", "\n".join(map(one_line, layers[0].licenses)))
    classes = [item for layer in layers for item in layer.styles[0].classes]
    for colour in dict.fromkeys(item.symbol.colour for item in classes):
        _add_style(document, colour)
    tables = [layer.read(slice(0, layer.rows)).to_pandas() for layer in layers]
    # All schemas precede the folders that use them. The integers of KML are too short for the ids
    # of cells, so integers are doubles.
    kinds = {"b": "bool", "i": "double", "f": "double"}
    for layer, table in zip(layers, tables, strict=True):
        schema = ET.SubElement(document, "Schema", id=layer.name, name=layer.name)
        for column, kind in table.drop(columns=GEOMETRY).dtypes.items():
            field = {"name": str(column), "type": kinds.get(kind.kind, "string")}
            ET.SubElement(schema, "SimpleField", field)
    for layer, table in zip(layers, tables, strict=True):
        folder = ET.SubElement(document, "Folder")
        _add_text(folder, "name", layer.title)
        _add_text(folder, "description", layer.description)
        shapes = gpd.GeoSeries.from_wkb(table.pop(GEOMETRY), crs=layer.crs).to_crs("EPSG:4326")
        names = _names(layer, table.iloc[:, 0])
        for name, row, shape in zip(names, table.to_dict("records"), shapes, strict=True):
            _add_place(folder, layer, name, row, shape)
    ET.indent(root)
    with whole_file(path) as partial:
        ET.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _names(layer: Layer, ranks: Iterable[object]) -> list[str]:
    """Return the name of each row: its kind, with the rank in a layer of several rows."""
    kind = layer.name.removesuffix("s")
    return [kind if kind == layer.name else f"{kind} {rank}" for rank in ranks]


def _add_text(parent: ET.Element, tag: str, text: object) -> ET.Element:
    element = ET.SubElement(parent, tag)
    element.text = str(text)
    return element


def _add_style(document: ET.Element, colour: str) -> None:
    """Add the style of a colour; KML orders the channels alpha, blue, green, red."""
    channels = "".join(reversed([colour[start : start + 2] for start in (1, 3, 5)]))
    style = ET.SubElement(document, "Style", id=f"c{colour[1:]}")
    for element, alpha in {"IconStyle": "ff", "LineStyle": "ff", "PolyStyle": "aa"}.items():
        _add_text(ET.SubElement(style, element), "color", f"{alpha}{channels}")


def _add_place(
    folder: ET.Element, layer: Layer, name: str, row: Mapping[Hashable, Any], shape: BaseGeometry
) -> None:
    """Add a row of a layer: its name, colour, columns and shape."""
    place = ET.SubElement(folder, "Placemark")
    _add_text(place, "name", name)
    style = layer.styles[0]
    if (item := style.class_of(row[style.column])) is not None:
        _add_text(place, "styleUrl", f"#c{item.symbol.colour[1:]}")
    lines = [
        f"{escape(column.title)}: {escape(one_line(text))}"
        for column in layer.columns
        if column.name in layer.display.tip and (text := column.text(row[column.name]))
    ]
    links = [
        f'<a href="{escape(row[column.name])}">{escape(column.title)}</a>'
        for column in layer.columns
        if column.tab == LINKS
    ]
    _add_text(place, "description", "<br>".join([*lines, " · ".join(links)]).removesuffix("<br>"))
    extended = ET.SubElement(place, "ExtendedData")
    data = ET.SubElement(extended, "SchemaData", schemaUrl=f"#{layer.name}")
    for column, value in row.items():
        if not pd.isna(value):
            content = int(value) if isinstance(value, bool) else value  # as GDAL reads it
            shown = one_line(content) if isinstance(content, str) else content
            _add_text(data, "SimpleData", shown).set("name", str(column))
    if shape.geom_type != "Polygon":  # a point or a line
        _add_text(ET.SubElement(place, shape.geom_type), "coordinates", _coordinates(shape))
        return
    polygon = ET.SubElement(place, "Polygon")
    for number, ring in enumerate(shapely.get_rings(shape)):  # the outer ring is the first
        edge = ET.SubElement(polygon, "innerBoundaryIs" if number else "outerBoundaryIs")
        _add_text(ET.SubElement(edge, "LinearRing"), "coordinates", _coordinates(ring))


def _coordinates(shape: BaseGeometry) -> str:
    return " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in shapely.get_coordinates(shape).tolist())
