"""Read tracks of GPS receivers: places and times."""

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
"""Point elements of GPX; the track of a file consists of the first kind that it has."""
STEP_ERROR_M = 5.0
"""Standard deviation of the step between two places of a track, east and north, in metres."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    """The points of a track, in order.

    `xy` (n, 2) are in metres in the CRS of a database, and `times` (n,) in seconds since 1970; None
    if a point of the file has no time.
    """

    source: str
    xy: NDArray[np.float64]
    times: NDArray[np.float64] | None

    def places(self, times: Sequence[dt.datetime | None]) -> NDArray[np.float64]:
        """Return the place of each view, shape (n, 2), by its time or its number.

        Places are interpolated between points. InputError if some views have a time and others do
        not, a time is outside the track, or, without times, the numbers of points and of views
        differ.
        """
        seconds = np.array([time.timestamp() for time in times if time is not None])
        if not len(seconds):
            if len(times) != len(self.xy):
                raise InputError(
                    f"{self.source} has {len(self.xy):,} points for {len(times):,} views without a "
                    "time; give each view its time, or a track with one point for each view."
                )
            return self.xy
        if len(seconds) < len(times):
            number = times.index(None) + 1
            raise InputError(
                f"view {number} of the route has no time as others have; give all views theirs."
            )
        if self.times is None:
            raise InputError(
                f"{self.source} has no times; leave out the times of the views, and give one point "
                "for each."
            )
        outside = np.flatnonzero((seconds < self.times[0]) | (seconds > self.times[-1]))
        if len(outside):
            own, first, last = (
                dt.datetime.fromtimestamp(value, dt.UTC).isoformat(timespec="seconds")
                for value in (seconds[outside[0]], self.times[0], self.times[-1])
            )
            raise InputError(
                f"view {outside[0] + 1} of the route is from {own}, and "
                f"{self.source} from {first} to {last}; give the track of that walk, or times "
                "with their zone."
            )
        return np.column_stack([np.interp(seconds, self.times, axis) for axis in self.xy.T])


def read_track(path: str | Path, *, crs: CRS) -> Track:
    """Read the points of a GPX file: of its tracks, otherwise of its routes, or its waypoints.

    They are in the order of time, or of the file if a point has no time. InputError if the file is
    not GPX, or has no points.
    """
    try:
        text = read_text(path)
        if "<!DOCTYPE" in text:  # to prevent expansion of entities
            raise ValueError("it defines its own document type")  # noqa: TRY301 - as others below
        root = ET.fromstring(text)  # noqa: S314 - without a document type
        elements = list(root.iter())
        kinds = ([point for point in elements if _name(point) == name] for name in POINTS)
        points = next(filter(None, kinds), [])
        if not points:
            raise ValueError("it has no points")  # noqa: TRY301 - as others below
        degrees = np.array(
            [[float(point.attrib[key]) for key in ("lon", "lat")] for point in points]
        )
        texts = [
            next((child.text for child in point if _name(child) == "time"), None)
            for point in points
        ]
        times = [parse_time(text) for text in texts if text and text.strip()]
    except (OSError, ET.ParseError, KeyError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"track {path} cannot be read ({reason}); give a GPX file.") from error
    x, y = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*degrees.T)
    xy = np.column_stack([x, y])
    if not np.isfinite(xy).all():
        raise InputError(
            f"track {path} has points that are not on the globe; give latitudes and longitudes."
        )
    seconds = np.array([time.timestamp() for time in times])
    if len(seconds) < len(points):
        return Track(source=str(path), xy=xy, times=None)
    order = np.argsort(seconds, kind="stable")
    return Track(source=str(path), xy=xy[order], times=seconds[order])


def parse_time(text: object) -> dt.datetime:
    """Parse a time such as 2024-05-31T14:05:09+02:00 or with Z; without a zone, it is UTC."""
    try:
        time = dt.datetime.fromisoformat(str(text).strip())
    except ValueError as error:
        raise InputError(
            f"time {text!r} cannot be read; give one as 2024-05-31T14:05:09Z"
        ) from error
    return time if time.tzinfo else time.replace(tzinfo=dt.UTC)


def _name(element: ET.Element) -> str:
    """Return the name of an element without its namespace; GPX has several."""
    return element.tag.rpartition("}")[2]
