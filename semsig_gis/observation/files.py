"""Read files of queries, one view per row: independent queries, or the views of a route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import InputError
from semsig_gis.observation.leg import Leg
from semsig_gis.observation.north import GRID_NORTH
from semsig_gis.observation.sentences import RADIUS_M, parse_seen, parse_view, require_seen
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
    from semsig_gis.observation.vocabulary import Codes
    from semsig_gis.storage import Row

Route = tuple[list[tuple[str | int, View]], list[Leg]]

COORDINATE_KEYS = ("dx", "dy")
POLAR_KEYS = ("distance", "bearing")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class QueryLine:
    """A line of a file of queries: a query, possibly without objects, or an error.

    `name` is its ``id``, otherwise the line number. `unplaced` and `absent` are the class codes of
    objects in its sentence that were seen in an unknown direction, and that are not in sight;
    `in_words` is whether it has a sentence.
    """

    line: int
    name: str | int
    query: View | InputError
    unplaced: Codes = ()
    absent: Codes = ()
    in_words: bool = False


def read_queries(
    path: str | Path, *, taxonomy: Taxonomy, radius: float = RADIUS_M
) -> Iterator[QueryLine]:
    """Read the queries of a CSV file, or of a file of JSON lines, line by line.

    The columns are those of `parse_view`, and ``id``, which is optional; `radius` is the visibility
    range of the city. An invalid line has an error as its query. Raises InputError if the file
    cannot be read.
    """
    return _query_lines(file_rows(path, what="query"), str(path), taxonomy, radius)


def parse_queries(
    lines: Iterable[str | bytes], source: str, *, taxonomy: Taxonomy, radius: float = RADIUS_M
) -> Iterator[QueryLine]:
    """Read queries as `read_queries` does, from JSON lines; `source` names them in messages."""
    return _query_lines(json_rows(lines), source, taxonomy, radius)


def _query_lines(
    rows: Iterable[tuple[int, Row | Exception]], source: str, taxonomy: Taxonomy, radius: float
) -> Iterator[QueryLine]:
    def read(row: Row) -> tuple[View, Codes, Codes]:
        require_seen(row)
        return parse_seen(row, taxonomy=taxonomy, radius=radius)

    for line, row, result in scan_rows(rows, source, read, what="query"):
        name = _name(row_value(row, "id"), line)
        if isinstance(result, InputError):
            yield QueryLine(line=line, name=name, query=result)
        else:
            query, unplaced, absent = result
            yield QueryLine(
                line=line,
                name=name,
                query=query,
                unplaced=unplaced,
                absent=absent,
                in_words=row_value(row, "see") is not None,
            )


def read_route(
    path: str | Path,
    *,
    taxonomy: Taxonomy,
    north: North = GRID_NORTH,
    radius: float = RADIUS_M,
    track: Track | None = None,
) -> Route:
    """Read the views of a route from a file of queries (see `read_queries`).

    A line without objects is a view of no objects. Each line except the first also gives the step
    from the line before: ``dx`` and ``dy`` (metres to grid east and north), or ``distance``
    (metres) and ``bearing`` (degrees clockwise from `north`), and ``sigma`` (standard deviation of
    each coordinate in metres, 0 if missing). With a `track`, the steps come from the track, by the
    ``time`` of each line, or by the order of lines if none has a time; then ``sigma`` is 5 m if
    missing. There is one leg fewer than views. Raises InputError if the file cannot be read, a line
    is not a view of a route, or the track does not fit the views.
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
    """Read a route as `read_route` does, from JSON lines; `source` names them in messages."""
    rows = parse_rows(lines, source, _route_reader(taxonomy, north, radius), what="view")
    return _route(rows, source, track)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _RouteLine:
    """A line of a route: a view, and the leg that leads to it."""

    name: object
    view: View
    leg: Leg | None
    sigma: float | None
    time: dt.datetime | None


def _route_reader(taxonomy: Taxonomy, north: North, radius: float) -> Callable[[Row], _RouteLine]:
    """Return a function that reads a line of a route."""

    def read(row: Row) -> _RouteLine:
        sigma, time = row_value(row, "sigma"), row_value(row, "time")
        sigma = None if sigma is None else float(sigma)
        step = {
            name: float(row_value(row, name))
            for name in (*COORDINATE_KEYS, *POLAR_KEYS)
            if row_value(row, name) is not None
        }
        leg = None
        if step.keys() == set(COORDINATE_KEYS):
            leg = Leg(**step, sigma=sigma or 0.0)
        elif step.keys() == set(POLAR_KEYS):
            leg = Leg.towards(step["bearing"] + north.turn, step["distance"], sigma=sigma or 0.0)
        elif step:
            raise InputError(
                "its step from the line before needs dx and dy, or distance and bearing"
            )
        return _RouteLine(
            name=row_value(row, "id"),
            view=parse_view(row, taxonomy=taxonomy, radius=radius),
            leg=leg,
            sigma=sigma,
            time=None if time is None else parse_time(time),
        )

    return read


def _route(rows: list[tuple[int, _RouteLine]], source: str, track: Track | None) -> Route:
    views = [(_name(item.name, line), item.view) for line, item in rows]
    route_lines = [item for _, item in rows]
    advice = "leave it out, because the track gives the steps"
    if track is None:
        advice = "give dx and dy, or distance and bearing, on every line of a route but the first"
    for number, (line, item) in enumerate(rows):
        needs_no_step = number == 0 or track is not None
        if (item.leg is None) != needs_no_step:
            fault = "gives a step" if item.leg else "does not give the step from the line before"
            raise InputError(f"line {line} of {source} {fault}; {advice}.")
    if track is None:
        return views, [item.leg for item in route_lines if item.leg is not None]
    steps = np.diff(track.places([item.time for item in route_lines]), axis=0).tolist()
    sigmas = [STEP_ERROR_M if item.sigma is None else item.sigma for item in route_lines[1:]]
    return views, [
        Leg(dx=dx, dy=dy, sigma=sigma) for (dx, dy), sigma in zip(steps, sigmas, strict=True)
    ]


def _name(name: Any, line: int) -> str | int:  # noqa: ANN401 - any value of JSON
    """Return the name of a line, or its number."""
    return name if isinstance(name, (str, int)) else line if name is None else str(name)
