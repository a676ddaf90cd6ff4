"""Files of queries: one signature a row, from detectors or people, each by itself or a route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import InputError
from semsig_gis.observation.leg import Leg
from semsig_gis.observation.north import GRID_NORTH
from semsig_gis.observation.sentences import RADIUS_M, parse_view, require_seen, unplaced_codes
from semsig_gis.observation.track import STEP_ERROR_M, parse_time
from semsig_gis.observation.view import View
from semsig_gis.storage import file_rows, json_rows, parse_rows, read_rows, row_value, scan_rows

if TYPE_CHECKING:
    import datetime as dt
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from semsig_gis.core import Taxonomy
    from semsig_gis.observation.north import North
    from semsig_gis.observation.track import Track
    from semsig_gis.storage import Row

Route = tuple[list[tuple[str | int, View]], list[Leg]]
Codes = tuple[int, ...]

PLAIN_LEG = ("dx", "dy")
TOWARDS = ("distance", "bearing")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class QueryLine:
    """A line of a file of queries: a query, perhaps of nothing, or the error that it is none.

    `name` is its ``id``, or else the number of the line. `unplaced` and `absent` are the class
    codes of what its sentence says was seen in no known direction, and was not seen.
    """

    line: int
    name: str | int
    query: View | InputError
    unplaced: Codes = ()
    absent: Codes = ()


def read_queries(
    path: str | Path, *, taxonomy: Taxonomy, radius: float = RADIUS_M
) -> Iterator[QueryLine]:
    """Read the queries of a CSV file, or of a file of JSON lines, line by line.

    The columns are those of `parse_view` and perhaps ``id``; `radius` is the visibility range of
    the city. A line that is no query takes none of the others with it. Raises InputError if the
    file cannot be read.
    """
    return _query_lines(file_rows(path, what="query"), str(path), taxonomy, radius)


def parse_queries(
    lines: Iterable[str | bytes], source: str, *, taxonomy: Taxonomy, radius: float = RADIUS_M
) -> Iterator[QueryLine]:
    """Read queries as `read_queries` does, from JSON lines that messages call `source`."""
    return _query_lines(json_rows(lines), source, taxonomy, radius)


def _query_lines(
    rows: Iterable[tuple[int, Row | Exception]], source: str, taxonomy: Taxonomy, radius: float
) -> Iterator[QueryLine]:
    def read(row: Row) -> tuple[View, Codes, Codes]:
        require_seen(row)
        seen, unplaced, absent = unplaced_codes(str(row_value(row, "see") or ""), taxonomy)
        view = parse_view({**row, "see": seen}, taxonomy=taxonomy, radius=radius)
        return view, unplaced, absent

    for line, row, found in scan_rows(rows, source, read, what="query"):
        name = _name(row_value(row, "id"), line)
        if isinstance(found, InputError):
            yield QueryLine(line=line, name=name, query=found)
        else:
            query, unplaced, absent = found
            yield QueryLine(line=line, name=name, query=query, unplaced=unplaced, absent=absent)


def read_route(
    path: str | Path,
    *,
    taxonomy: Taxonomy,
    north: North = GRID_NORTH,
    radius: float = RADIUS_M,
    track: Track | None = None,
) -> Route:
    """Read the views of a route from a file of queries (see `read_queries`).

    A line that does not say what was seen, like one where that is empty, has seen nothing. Each
    line but the first also tells the way from the line before: ``dx`` and ``dy`` (metres to
    grid east and north), or ``distance`` (metres) and ``bearing`` (degrees clockwise from
    `north`), and ``sigma`` (standard deviation of each coordinate in metres, 0 if missing). With a
    `track`, that tells the ways, to 5 m where ``sigma`` is missing: by the ``time`` of each line,
    or where none has one, by their order. There is one leg fewer than views. Raises InputError if
    the file cannot be read, a line of it is no view of a route, or the track is of another one.
    """
    rows = read_rows(path, _route_reader(taxonomy, north, radius), what="view")
    return _route(rows, str(path), track)


def parse_route(
    lines: Iterable[str | bytes],
    source: str,
    *,
    taxonomy: Taxonomy,
    north: North = GRID_NORTH,
    radius: float = RADIUS_M,
    track: Track | None = None,
) -> Route:
    """Read a route as `read_route` does, from JSON lines that messages call `source`."""
    rows = parse_rows(lines, source, _route_reader(taxonomy, north, radius), what="view")
    return _route(rows, source, track)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Stop:
    """A line of a route: what it tells of its view and of the way to it."""

    name: object
    view: View
    leg: Leg | None
    sigma: float | None
    time: dt.datetime | None


def _route_reader(taxonomy: Taxonomy, north: North, radius: float) -> Callable[[Row], _Stop]:
    """Return what reads a line of a route."""

    def read(row: Row) -> _Stop:
        sigma, time = row_value(row, "sigma"), row_value(row, "time")
        sigma = None if sigma is None else float(sigma)
        return _Stop(
            name=row_value(row, "id"),
            view=parse_view(row, taxonomy=taxonomy, radius=radius),
            leg=_leg(row, north, sigma or 0.0),
            sigma=sigma,
            time=None if time is None else parse_time(time),
        )

    return read


def _leg(row: Row, north: North, sigma: float) -> Leg | None:
    values = {
        name: float(row_value(row, name))
        for name in (*PLAIN_LEG, *TOWARDS)
        if row_value(row, name) is not None
    }
    if not values:
        return None
    if values.keys() == set(PLAIN_LEG):
        return Leg(dx=values["dx"], dy=values["dy"], sigma=sigma)
    if values.keys() == set(TOWARDS):
        return Leg.towards(values["bearing"] + north.turn, values["distance"], sigma=sigma)
    raise InputError("its step from the line before needs dx and dy, or distance and bearing")


def _route(rows: list[tuple[int, _Stop]], source: str, track: Track | None) -> Route:
    views = [(_name(stop.name, line), stop.view) for line, stop in rows]
    stops = [stop for _, stop in rows]
    advice = "leave it out, because the track gives the steps"
    if track is None:
        advice = "give dx and dy, or distance and bearing, on every line of a route but the first"
    for number, (line, stop) in enumerate(rows):
        if (stop.leg is None) != (number == 0 or track is not None):
            gives = number == 0 or track
            fault = "gives a step" if gives else "does not give the step from the line before"
            raise InputError(f"line {line} of {source} {fault}; {advice}.")
    if track is None:
        return views, [stop.leg for stop in stops if stop.leg is not None]
    steps = np.diff(track.places([stop.time for stop in stops]), axis=0).tolist()
    sigmas = [STEP_ERROR_M if stop.sigma is None else stop.sigma for stop in stops[1:]]
    return views, [
        Leg(dx=dx, dy=dy, sigma=sigma) for (dx, dy), sigma in zip(steps, sigmas, strict=True)
    ]


def _name(name: Any, line: int) -> str | int:  # noqa: ANN401 - any value of JSON
    """Return the name of a line, or its number."""
    return name if isinstance(name, (str, int)) else line if name is None else str(name)
