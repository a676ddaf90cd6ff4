"""Geometries in GML of every version, and the order of their axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import shapely

from semsig_gis.sources import LayerSpec, parse_xml

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.sources import RawLayer

GML = """<FeatureCollection xmlns:gml="http://www.opengis.net/gml"><gml:featureMembers><a>
<gml:boundedBy><gml:Envelope srsName="{0}"><gml:lowerCorner>0 0</gml:lowerCorner></gml:Envelope>
</gml:boundedBy><n>7</n><empty/><many><one>a</one> <one>b</one></many><shape>{1}</shape></a>
</gml:featureMembers></FeatureCollection>"""
POINT = '<gml:Point srsName="{0}"><gml:pos srsDimension="3">2 48 30</gml:pos></gml:Point>'
RING = "<gml:LinearRing><gml:posList>0 0 0 4 4 4 0 0</gml:posList></gml:LinearRing>"
HOLE = "<gml:LinearRing><gml:coordinates>1,2 1,3 2,3 1,2</gml:coordinates></gml:LinearRing>"
PATCH = f"<gml:exterior>{RING}</gml:exterior><gml:interior>{HOLE}</gml:interior>"
SEGMENT = (
    '<gml:LineStringSegment><gml:posList srsDimension="3">0 1 9 2 3 9</gml:posList>'
    "</gml:LineStringSegment>"
)
AREA = "POLYGON ((0 0, 0 4, 4 4, 0 0), (1 2, 1 3, 2 3, 1 2))"


SURFACE = (
    f"<gml:Surface><gml:patches><gml:PolygonPatch>{PATCH}</gml:PolygonPatch></gml:patches>"
    "</gml:Surface>"
)
TWO = "".join(f"<gml:Point><gml:pos>{xy}</gml:pos></gml:Point>" for xy in ("1 2", "3 4"))
SPEC = LayerSpec(name="a", class_name="bench", id_field="n", where=(("many", ("a b",)),))


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        (f"<gml:Polygon>{PATCH}</gml:Polygon>", AREA),
        (
            f"<gml:MultiSurface><gml:surfaceMember>{SURFACE}</gml:surfaceMember></gml:MultiSurface>",
            AREA,
        ),
        (f"<gml:Curve><gml:segments>{SEGMENT}</gml:segments></gml:Curve>", "LINESTRING (0 1, 2 3)"),
        (
            f"<gml:MultiPoint><gml:pointMembers>{TWO}</gml:pointMembers></gml:MultiPoint>",
            "POINT (1 2); POINT (3 4)",
        ),
        ("<gml:Polygon><gml:exterior/></gml:Polygon>", None),
        ("<gml:Point><gml:pos>here</gml:pos></gml:Point>", None),
        ("<gml:Curve><gml:segments><gml:Arc/></gml:segments></gml:Curve>", None),
    ],
)
def test_gml_geometries_are_read(
    read_as: Callable[..., RawLayer], shape: str, text: str | None
) -> None:
    layer = read_as("a.gml", GML.format("EPSG:4326", shape), SPEC)
    assert layer.counts.unreadable == (text is None)
    if text is None:
        assert "is not valid GML" in layer.errors[0]
    else:
        shapes = [shapely.from_wkt(part) for part in text.split("; ")]
        assert layer.table.geometry.tolist() == shapes
        ids = ["7"] if len(shapes) == 1 else ["7/1", "7/2"]
        assert layer.table["source_id"].tolist() == ids


@pytest.mark.parametrize(
    ("name", "crs", "turned"),
    [
        ("EPSG:4326", "EPSG:4326", False),
        ("urn:ogc:def:crs:EPSG::4326", "EPSG:4326", True),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", False),
        ("http://www.opengis.net/def/crs/EPSG/0/3879", "EPSG:3879", True),
        ("http://www.opengis.net/gml/srs/epsg.xml#3879", "EPSG:3879", False),
        ("urn:ogc:def:crs:EPSG::25833", "EPSG:25833", False),
    ],
)
def test_crs_name_decides_the_axis_order(
    read_as: Callable[..., RawLayer], *, name: str, crs: str, turned: bool
) -> None:
    layer = read_as("a.gml", GML.format(name, POINT.format(name)), SPEC)
    assert layer.table.crs == crs
    assert layer.table.geometry.tolist() == [shapely.Point((48, 2) if turned else (2, 48))]


def test_document_type_is_refused_in_any_encoding() -> None:
    text = '<?xml version="1.0" encoding="UTF-16"?>{}<a>1</a>'
    assert parse_xml(text.format("").encode("utf-16")).text == "1"
    with pytest.raises(ValueError, match="document type"):
        parse_xml(text.format('<!DOCTYPE a [<!ENTITY b "c">]>').encode("utf-16"))
