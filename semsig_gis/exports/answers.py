"""An answer as one file in degrees (WGS 84), for the web and for globes: GeoJSON and KML."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import geopandas as gpd
import pandas as pd
import pyarrow as pa
import pyogrio
import shapely

from semsig_gis.core import ANSWERS, GEOMETRY, one_line
from semsig_gis.exports.files import geojson_options, whole_by_gdal
from semsig_gis.exports.styles import RANKS
from semsig_gis.storage import whole_file

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Mapping, Sequence
    from pathlib import Path

    from shapely.geometry.base import BaseGeometry

    from semsig_gis.exports.layers import Layer


TITLE = "Where the query may have been seen from"
KML = "http://www.opengis.net/kml/2.2"


def write_answer_geojson(layers: Sequence[Layer], path: str | Path) -> None:
    """Write the layers of an answer as one GeoJSON, which appears whole, by rename.

    ``layer`` names the layer of a feature, and ``Name`` says it with the rank. The member
    ``semsig`` holds what `Answer.to_dict` tells beside the candidates.
    """
    parts = []
    for layer in layers:
        table = layer.read(slice(0, layer.rows))
        names = _names(layer, table.column(0).to_pylist())
        kinds = pa.repeat(_kind(layer), layer.rows)
        parts.append(table.append_column("Name", [names]).append_column("layer", kinds))
    about = {**layers[0].facts, **layers[0].credits}
    with whole_file(path) as partial, whole_by_gdal(path):
        pyogrio.write_arrow(
            pa.concat_tables(parts, promote_options="permissive"),
            partial,
            layer="answer",
            driver="GeoJSON",
            geometry_name=GEOMETRY,
            geometry_type="Unknown",
            crs=layers[0].crs.to_wkt(),
            layer_options=geojson_options("\n".join([TITLE, *layers[0].licenses]), about),
        )


def write_answer_kml(layers: Sequence[Layer], path: str | Path) -> None:
    """Write the layers of an answer as one KML 2.2, a folder each, which appears whole, by rename.

    The colours are those of the maps, the licences stand in the description, and nothing is asked
    of any server.
    """
    root = ET.Element("kml", xmlns=KML)
    document = ET.SubElement(root, "Document")
    _add_text(document, "name", TITLE)
    _add_text(document, "description", "\n".join(map(one_line, layers[0].licenses)))
    colours = [*(colour for _, colour in RANKS.values()), *(one.colour for one in ANSWERS.values())]
    for colour in colours:
        _add_style(document, colour)
    tables = [layer.read(slice(0, layer.rows)).to_pandas() for layer in layers]
    for layer, table in zip(layers, tables, strict=True):
        _add_schema(document, layer.name, table.drop(columns=GEOMETRY))
    for layer, table in zip(layers, tables, strict=True):
        folder = ET.SubElement(document, "Folder")
        _add_text(folder, "name", layer.title)
        _add_text(folder, "description", layer.description)
        shapes = gpd.GeoSeries.from_wkb(table.pop(GEOMETRY), crs=layer.crs).to_crs("EPSG:4326")
        names = _names(layer, table.iloc[:, 0])
        for name, row, shape in zip(names, table.to_dict("records"), shapes, strict=True):
            _add_place(folder, layer.name, name, row, shape)
    ET.indent(root)
    with whole_file(path) as partial:
        ET.ElementTree(root).write(partial, encoding="utf-8", xml_declaration=True)


def _kind(layer: Layer) -> str:
    """Return what a row of a layer is."""
    return layer.name.removesuffix("s")


def _names(layer: Layer, first: Iterable[object]) -> list[str]:
    """Return a name for each row: what it is, and of many the rank, which comes first."""
    kind = _kind(layer)
    return [kind if kind == layer.name else f"{kind} {rank}" for rank in first]


def _add_text(parent: ET.Element, tag: str, text: object) -> ET.Element:
    element = ET.SubElement(parent, tag)
    element.text = str(text)
    return element


def _add_style(document: ET.Element, colour: str) -> None:
    """Add how places of a colour are drawn; KML has the parts of colours the other way round."""
    turned = "".join(reversed([colour[place : place + 2] for place in (1, 3, 5)]))
    style = ET.SubElement(document, "Style", id=f"c{colour[1:]}")
    _add_text(ET.SubElement(style, "IconStyle"), "color", f"ff{turned}")
    _add_text(ET.SubElement(style, "LineStyle"), "color", f"ff{turned}")
    _add_text(ET.SubElement(style, "PolyStyle"), "color", f"aa{turned}")


def _add_schema(document: ET.Element, name: str, table: pd.DataFrame) -> None:
    # Its whole numbers are too short for the ids of cells.
    kinds = {"b": "bool", "i": "double", "f": "double"}
    schema = ET.SubElement(document, "Schema", id=name, name=name)
    for column in map(str, table):
        kind = kinds.get(table[column].dtype.kind, "string")
        ET.SubElement(schema, "SimpleField", name=column, type=kind)


def _add_place(
    folder: ET.Element, layer: str, name: str, row: Mapping[Hashable, Any], shape: BaseGeometry
) -> None:
    """Add a row of a layer: its name, colour, columns and shape."""
    place = ET.SubElement(folder, "Placemark")
    _add_text(place, "name", name)
    _add_text(place, "styleUrl", f"#c{_colour(next(iter(row.values())))[1:]}")
    data = ET.SubElement(ET.SubElement(place, "ExtendedData"), "SchemaData", schemaUrl=f"#{layer}")
    for column, value in row.items():
        if not pd.isna(value):
            known = int(value) if isinstance(value, bool) else value  # as GDAL reads it
            text = one_line(known) if isinstance(known, str) else known
            _add_text(data, "SimpleData", text).set("name", str(column))
    _add_shape(place, shape)


def _colour(first: object) -> str:
    """Return the colour of a place by its first column: what was answered, or a rank."""
    if first in ANSWERS:
        return ANSWERS[str(first)].colour
    return next(colour for (_, high), (_, colour) in RANKS.items() if float(str(first)) <= high)


def _add_shape(parent: ET.Element, shape: BaseGeometry) -> None:
    if shape.geom_type == "Point":
        _add_text(ET.SubElement(parent, "Point"), "coordinates", _coordinates(shape))
        return
    polygon = ET.SubElement(parent, "Polygon")
    # The outside first.
    for number, ring in enumerate(shapely.get_rings(shape)):
        edge = ET.SubElement(polygon, "innerBoundaryIs" if number else "outerBoundaryIs")
        _add_text(ET.SubElement(edge, "LinearRing"), "coordinates", _coordinates(ring))


def _coordinates(shape: BaseGeometry) -> str:
    return " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in shapely.get_coordinates(shape).tolist())
