"""Tracks of GPS receivers: where somebody was, and when."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np
from pyproj import Transformer

from semsig_gis.core import InputError
from semsig_gis.storage import read_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from pyproj import CRS

POINTS = ("trkpt", "rtept", "wpt")
"""Elements of GPX that are points, of which the first kind that a file has is its track."""
STEP_ERROR_M = 5.0
"""Standard deviation of the way between two places of a track, east and north."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    """The points of a track in their order.

    `xy` (n, 2) are metres in the CRS of a database, and `times` (n,) seconds since 1970, None
    where the file does not tell of every point when that was.
    """

    source: str
    xy: NDArray[np.float64]
    times: NDArray[np.float64] | None

    def places(self, times: Sequence[dt.datetime | None]) -> NDArray[np.float64]:
        """Return where each view was seen from, shape (n, 2), by its time or its number.

        Between two points, the way is straight and its speed the same. InputError if some views
        have a time and others do not, one is from before or after the track, or, without times,
        there is not one point for each view.
        """
        known = [one.timestamp() for one in times if one is not None]
        if not known:
            if len(times) != len(self.xy):
                raise InputError(
                    f"{self.source} has {len(self.xy):,} points for {len(times):,} views without a "
                    "time; give each view its time, or a track with one point for each view."
                )
            return self.xy
        if len(known) < len(times):
            number = times.index(None) + 1
            raise InputError(
                f"view {number} of the route has no time as others have; give all views theirs."
            )
        if self.times is None:
            raise InputError(
                f"{self.source} has no times; leave out the times of the views, and give one point "
                "for each."
            )
        asked = np.array(known)
        outside = np.flatnonzero((asked < self.times[0]) | (asked > self.times[-1]))
        if len(outside):
            first, last = (_said(float(one)) for one in self.times[[0, -1]])
            raise InputError(
                f"view {outside[0] + 1} of the route is from {_said(known[outside[0]])}, and "
                f"{self.source} from {first} to {last}; give the track of that walk, or times "
                "with their zone."
            )
        return np.column_stack([np.interp(asked, self.times, axis) for axis in self.xy.T])


def read_track(path: str | Path, *, crs: CRS) -> Track:
    """Read the points of a GPX file: those of its tracks, or else of its routes, or its waypoints.

    Points without a time have the order of the file, others that of time. InputError if the file
    is no GPX, or has no points.
    """
    try:
        text = read_text(path)
        if "<!DOCTYPE" in text:  # which may define texts that swell
            raise ValueError("it defines its own document type")  # noqa: TRY301 - as others below
        root = ET.fromstring(text)  # noqa: S314 - without a document type
        kinds = {name: [one for one in root.iter() if _name(one) == name] for name in POINTS}
        points = next(filter(None, kinds.values()), [])
        if not points:
            raise ValueError("it has no points")  # noqa: TRY301 - as others below
        degrees = np.array([[float(one.attrib[key]) for key in ("lon", "lat")] for one in points])
        times = [_time(one) for one in points]
    except (OSError, ET.ParseError, KeyError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"track {path} cannot be read ({reason}); give a GPX file.") from error
    x, y = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*degrees.T)
    xy = np.column_stack([x, y])
    if not np.isfinite(xy).all():
        raise InputError(
            f"track {path} has points that are not on the globe; give latitudes and longitudes."
        )
    known = [one.timestamp() for one in times if one is not None]
    if len(known) < len(points):
        return Track(source=str(path), xy=xy, times=None)
    order = np.argsort(known, kind="stable")
    return Track(source=str(path), xy=xy[order], times=np.array(known)[order])


def parse_time(text: object) -> dt.datetime:
    """Return a time as 2024-05-31T14:05:09+02:00 or with Z; without a zone, it is UTC."""
    try:
        time = dt.datetime.fromisoformat(str(text).strip())
    except ValueError as error:
        raise InputError(
            f"time {text!r} cannot be read; give one as 2024-05-31T14:05:09Z"
        ) from error
    return time if time.tzinfo else time.replace(tzinfo=dt.UTC)


def _time(point: ET.Element) -> dt.datetime | None:
    """Return the time of a point, None where it does not tell one."""
    told = next((one.text for one in point if _name(one) == "time"), None)
    return parse_time(told) if told and told.strip() else None


def _name(element: ET.Element) -> str:
    """Return the name of an element without that of its schema, of which GPX has several."""
    return element.tag.rpartition("}")[2]


def _said(seconds: float) -> str:
    return dt.datetime.fromtimestamp(seconds, dt.UTC).isoformat(timespec="seconds")
