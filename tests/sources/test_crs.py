"""Which CRS a file is in."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS

from semsig_gis.core.errors import CrsError
from semsig_gis.sources.raw_layer import crs_label, off_the_globe, settle_crs, usable_crs

LAMBERT = (
    'PROJCS["RGF93_Lambert_93",GEOGCS["GCS_RGF_1993",DATUM["D_RGF_1993",'
    'SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],'
    'UNIT["Degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic"],'
    'PARAMETER["False_Easting",{easting}],PARAMETER["False_Northing",6600000.0],'
    'PARAMETER["Central_Meridian",3.0],PARAMETER["Standard_Parallel_1",44.0],'
    'PARAMETER["Standard_Parallel_2",49.0],PARAMETER["Latitude_Of_Origin",46.5],'
    'UNIT["Meter",1.0]]'
)


def test_wkt_of_esri_becomes_the_code() -> None:
    crs = usable_crs(LAMBERT.format(easting="700000.0"))
    assert crs == CRS.from_epsg(2154)
    assert crs is not None
    assert crs_label(crs) == "EPSG:2154"


def test_wkt_that_only_resembles_a_code_is_kept() -> None:
    crs = usable_crs(LAMBERT.format(easting="700001.0"))
    assert crs is not None
    assert crs != CRS.from_epsg(2154)
    assert crs_label(crs) == "RGF93_Lambert_93"
    assert settle_crs(crs, implicit=False, expected=None, given=None, where="here") == (crs, ())


@pytest.mark.parametrize(
    "wkt",
    [
        "",
        " ",
        "nonsense",
        'LOCAL_CS["Undefined Cartesian SRS",UNIT["metre",1],AXIS["X",EAST],AXIS["Y",NORTH]]',
        (
            'GEOGCS["Undefined geographic SRS",DATUM["unknown",SPHEROID["unknown",6378137,298.25]],'
            'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]]'
        ),
        LAMBERT.format(easting="700000.0").replace("GCS_RGF_1993", ""),
    ],
)
def test_wkt_that_places_nothing(wkt: str) -> None:
    assert usable_crs(wkt) is None


def test_statements_in_their_order() -> None:
    lambert, degrees = CRS.from_epsg(2154), CRS.from_epsg(4326)

    def settled(own: CRS | None, expected: str | None, given: str | None) -> tuple[int | None, int]:
        crs, notes = settle_crs(
            own, implicit=own == degrees, expected=expected, given=given, where="here"
        )
        return crs.to_epsg(), len(notes)

    assert settled(lambert, None, None) == (2154, 0)
    assert settled(lambert, "EPSG:2154", None) == (2154, 0)
    assert settled(lambert, "EPSG:2154", "EPSG:4326") == (2154, 1)
    assert settled(lambert, "EPSG:4326", None) == (2154, 1)
    assert settled(degrees, None, None) == (4326, 0)  # GeoJSON that says nothing
    assert settled(degrees, "EPSG:2154", None) == (2154, 0)
    assert settled(None, "EPSG:2154", None) == (2154, 0)
    assert settled(None, "EPSG:4326", "EPSG:2154") == (2154, 0)
    with pytest.raises(CrsError, match="here does not say which CRS"):
        settled(None, None, None)


def test_only_degrees_have_limits() -> None:
    xy = np.array([[180.0, 90.0], [-180.0, -90.0], [180.1, 0.0], [0.0, -90.1], [4e5, 6e6]])
    assert off_the_globe(xy, CRS.from_epsg(4326)).tolist() == [False, False, True, True, True]
    assert not off_the_globe(xy, CRS.from_epsg(2154)).any()
    assert not off_the_globe(xy, CRS.from_epsg(4807)).any()  # in gons
