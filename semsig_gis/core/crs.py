"""Names of columns, and the rule that distances are taken in a metric coordinate system."""

from __future__ import annotations

import re

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core.errors import CrsError

CLASS_CODE = "class_code"
CLASS_NAME = "class_name"
SOURCE = "source"
SOURCE_ID = "source_id"
COUNT = "count"
MERGED = "merged"
GEOMETRY = "geometry"
HALF_WIDTH = "half_width"

LICENSES = "licenses"
"""Whom to name for a table of buildings or streets: a key of its `attrs`."""


def require_metric_crs(crs: CRS | str | int | None) -> CRS:
    """Return a coordinate system, without its height, if distances in metres can be taken in it.

    Raises CrsError if it is missing, unknown, in degrees or feet, a Mercator or cylindrical
    projection, where lengths grow with the latitude (1.5 times at Paris), or if its axes do not
    point east and north, from which bearings are counted.
    """
    advice = (
        "give a projected CRS in metres, such as 'EPSG:2154' for France or the UTM zone of the city"
    )
    if crs is None:
        msg = f"no coordinate reference system was given; {advice}."
        raise CrsError(msg)
    try:
        system = CRS.from_user_input(crs).to_2d()
    except CRSError as error:
        msg = f"coordinate reference system {crs!r} is unknown; {advice}."
        raise CrsError(msg) from error
    fault = _fault(system)
    if fault:
        msg = f"{system.name} {fault}; {advice}."
        raise CrsError(msg)
    return system


def _fault(system: CRS) -> str:
    """Return why distances and bearings cannot be taken in a system, or nothing."""
    if system.is_geographic:
        return "is in degrees"
    if not system.is_projected:
        return f"is {system.type_name.removesuffix(' CRS').lower()}, not projected"
    # The operation of a bound system is its datum shift; the projection is its source's.
    plane = system.source_crs if system.is_bound else system
    operation = plane.coordinate_operation if plane else None
    method = operation.method_name.lower() if operation else ""
    # Transverse and oblique ones (UTM, the Swiss and Hungarian grids) are true near their line.
    if re.search("mercator|cylindrical", method) and not re.search("transverse|oblique", method):
        return "is a Mercator or cylindrical projection, whose lengths grow with latitude"
    if any(axis.unit_conversion_factor != 1.0 for axis in system.axis_info):
        return "is not in metres"
    if {axis.direction for axis in system.axis_info} != {"east", "north"}:
        return "has axes that do not point east and north"
    return ""
