from __future__ import annotations

import pytest
from pyproj import CRS, Proj
from sentences import refused

from semsig_gis.core.errors import CrsError
from semsig_gis.core.geometry import require_metric_crs

METRIC = {
    "Lambert-93": 2154,
    "as text": "EPSG:2154",
    "UTM": "EPSG:32631",
    "UTM south": "EPSG:32733",
    "a PROJ string": "+proj=utm +zone=31 +ellps=GRS80 +type=crs",
    "a Transverse Mercator of one's own": "+proj=tmerc +lat_0=43 +lon_0=3.8 +type=crs",
    "with a datum shift": "+proj=tmerc +lon_0=3 +ellps=GRS80 +towgs84=1,2,3 +type=crs",
    "British grid": "EPSG:27700",
    "Belgian Lambert": "EPSG:31370",
    "Dutch stereographic": "EPSG:28992",
    "northing first": "EPSG:31467",
    "Swiss grid, an oblique Mercator": "EPSG:2056",
    "Hungarian grid, an oblique Mercator": "EPSG:23700",
    "Malaysian grid, an oblique Mercator": "EPSG:3375",
    "with a height": "EPSG:2154+5773",
    "three-dimensional": "EPSG:9895",
    "a .prj file of ESRI": CRS("EPSG:2154").to_wkt("WKT1_ESRI"),
    "the American metre": CRS("EPSG:32631").to_wkt("WKT1_GDAL").replace('"metre"', '"meter"'),
}
REFUSED = {
    "WGS 84": ("EPSG:4326", "WGS 84 is in degrees"),
    "RGF93": ("EPSG:4171", "in degrees"),
    "degrees with a height": ("EPSG:4979", "in degrees"),
    "degrees and a height system": ("EPSG:4326+5773", "in degrees"),
    "Web Mercator": ("EPSG:3857", "Mercator"),
    "Web Mercator with a height": ("EPSG:3857+5773", "Mercator"),
    "Web Mercator by ESRI": ("ESRI:102100", "Mercator"),
    "World Mercator": ("EPSG:3395", "Mercator"),
    "World Mercator by ESRI": ("ESRI:54004", "Mercator"),
    "Mercator with a datum shift": ("+proj=merc +ellps=GRS80 +towgs84=0,0,0 +type=crs", "Mercator"),
    "plate carree": ("EPSG:4087", "cylindrical"),
    "equal-area cylinder": ("EPSG:6933", "cylindrical"),
    "feet": ("EPSG:2263", "not in metres"),
    "kilometres": ("+proj=utm +zone=31 +units=km +type=crs", "not in metres"),
    "geocentric": ("EPSG:4978", "is geocentric, not projected"),
    "local": ('LOCAL_CS["site",UNIT["metre",1]]', "is engineering, not projected"),
    "vertical": ("EPSG:5773", "is vertical, not projected"),
    "south-orientated": ("EPSG:2048", "east and north"),
    "Krovak, south and west": ("EPSG:5513", "east and north"),
    "polar": ("EPSG:3031", "east and north"),
    "nothing": (None, "no coordinate reference system was given"),
    "empty": ("", "unknown"),
    "nonsense": ("Lambert", "'Lambert' is unknown"),
    "a code that is not": ("EPSG:999999", "'EPSG:999999' is unknown"),
    "a number that is no code": (0, "unknown"),
}


@pytest.mark.parametrize("crs", METRIC.values(), ids=METRIC)
def test_a_metric_system_is_accepted(crs: str | int) -> None:
    system = require_metric_crs(crs)
    assert system.is_projected
    assert len(system.axis_info) == 2
    assert require_metric_crs(system) == system


@pytest.mark.parametrize(("crs", "words"), REFUSED.values(), ids=REFUSED)
def test_another_system_is_refused_in_one_sentence(crs: str | int | None, words: str) -> None:
    with refused(CrsError, words, "give a projected CRS in metres"):
        require_metric_crs(crs)


@pytest.mark.parametrize("crs", ["EPSG:2154", "EPSG:32631", "EPSG:31467", "EPSG:2056"])
def test_one_metre_is_one_metre_in_an_accepted_system(crs: str) -> None:
    area = require_metric_crs(crs).area_of_use
    assert area is not None
    middle = (area.west + area.east) / 2, (area.south + area.north) / 2
    factors = Proj(crs).get_factors(*middle)
    assert factors.meridional_scale == pytest.approx(1.0, rel=2e-3)
    assert factors.parallel_scale == pytest.approx(1.0, rel=2e-3)
