"""Which coordinate reference system the coordinates of a file are in: stated, never guessed."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core.errors import CrsError

if TYPE_CHECKING:
    from numpy.typing import NDArray

WGS84 = CRS.from_epsg(4326)
# Half a turn and a quarter of one, with room for the rounding of the last decimal.
LONGITUDE_LIMIT = 180.0 + 1e-6
LATITUDE_LIMIT = 90.0 + 1e-6


def parse_crs(text: str) -> CRS:
    """Return the CRS that a person wrote; CrsError if pyproj does not know it."""
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        msg = f"CRS {text!r} is unknown; write a code such as 'EPSG:2154' or 'EPSG:4326'."
        raise CrsError(msg) from error


@functools.lru_cache(maxsize=64)  # looking for the code takes 0.2 s
def usable_crs(wkt: str) -> CRS | None:
    """Return the CRS that a file states, or None where it does not tie coordinates to the Earth.

    One that equals an EPSG definition becomes that, so that coordinates in it are not transformed.
    """
    if not wkt.strip():
        return None
    try:
        crs = CRS.from_wkt(wkt)
    except CRSError:
        return None
    geodetic = crs.geodetic_crs
    if geodetic is None or not (crs.is_geographic or crs.is_projected):
        return None  # an engineering CRS: a plane of its own
    if not geodetic.name or crs.name.lower().startswith("undefined"):
        return None  # without a named datum, a transformation is off by up to hundreds of metres
    code = crs.to_epsg()
    if code is not None:
        epsg = CRS.from_epsg(code)
        if epsg.equals(crs, ignore_axis_order=True):
            return epsg
    return crs


def crs_label(crs: CRS) -> str:
    """Return a short name for messages: the code where there is one."""
    code = crs.to_epsg()
    return crs.name if code is None else f"EPSG:{code}"


def settle_crs(
    own: CRS | None, *, implicit: bool, expected: str | None, given: str | None, where: str
) -> tuple[CRS, tuple[str, ...]]:
    """Return the CRS of a layer: the file's own statement, else the user's, catalogue's or default.

    `implicit` says that `own` is only the default of the format; `expected` is the catalogue's word
    and `given` the user's. A note says where the file contradicts it. CrsError if nobody states
    one.
    """
    stated = given or expected
    if own is not None and not implicit:
        if stated is None or own.equals(parse_crs(stated), ignore_axis_order=True):
            return own, ()
        note = f"the file is in {crs_label(own)}, not in {stated} as stated; the file's CRS is used"
        return own, (note,)
    if stated is not None:
        return parse_crs(stated), ()
    if own is not None:
        return own, ()
    msg = (
        f"{where} does not say which CRS its coordinates are in; "
        "state its crs, such as 'EPSG:2154' or 'EPSG:4326'."
    )
    raise CrsError(msg)


def off_the_globe(xy: NDArray[np.float64], crs: CRS) -> NDArray[np.bool_]:
    """Tell which coordinates cannot be longitudes and latitudes in degrees, shape (n,).

    All False for a CRS that is projected, or in other units such as gons.
    """
    units = {axis.unit_name for axis in crs.axis_info}
    if not crs.is_geographic or units != {"degree"}:
        return np.zeros(len(xy), dtype=np.bool_)
    return (np.abs(xy[:, 0]) > LONGITUDE_LIMIT) | (np.abs(xy[:, 1]) > LATITUDE_LIMIT)


def fits_the_globe(xy: NDArray[np.float64]) -> bool:
    """Tell whether every coordinate could be a longitude and a latitude in degrees."""
    return len(xy) > 0 and not off_the_globe(xy, WGS84).any()
