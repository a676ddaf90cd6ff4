"""Files of queries: one signature a row, from detectors or people, each by itself or a route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import InputError
from semsig_gis.core.view import View
from semsig_gis.database.north import GRID_NORTH
from semsig_gis.database.observation import RADIUS_M, parse_view, require_seen
from semsig_gis.likelihood.route import Leg
from semsig_gis.storage.rows import (
    file_rows,
    json_rows,
    parse_rows,
    read_rows,
    row_value,
    scan_rows,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.north import North
    from semsig_gis.storage.rows import Row

Route = tuple[list[tuple[str | int, View]], list[Leg]]

PLAIN_LEG = ("dx", "dy")
TOWARDS = ("distance", "bearing")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class QueryLine:
    """A line of a file of queries: a query, perhaps of nothing, or the error that it is none.

    `name` is its ``id``, or else the number of the line.
    """

    line: int
    name: str | int
    query: View | InputError


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
    def read(row: Row) -> View:
        require_seen(row)
        return parse_view(row, taxonomy=taxonomy, radius=radius)

    for line, row, query in scan_rows(rows, source, read, what="query"):
        yield QueryLine(line=line, name=_name(row_value(row, "id"), line), query=query)


def read_route(
    path: str | Path,
    *,
    taxonomy: Taxonomy,
    north: North = GRID_NORTH,
    radius: float = RADIUS_M,
) -> Route:
    """Read the views of a route from a file of queries (see `read_queries`).

    A line that does not say what was seen, like one where that is empty, has seen nothing. Each
    line but the first also tells the way from the line before: ``dx`` and ``dy`` (metres to
    grid east and north), or ``distance`` (metres) and ``bearing`` (degrees clockwise from
    `north`), and ``sigma`` (standard deviation of each coordinate in metres, 0 if missing).
    There is one leg fewer than views. Raises InputError if the file cannot be read or a line of it
    is no view of a route.
    """
    rows = read_rows(path, _route_reader(taxonomy, north, radius), what="view")
    return _route(rows, str(path))


def parse_route(
    lines: Iterable[str | bytes],
    source: str,
    *,
    taxonomy: Taxonomy,
    north: North = GRID_NORTH,
    radius: float = RADIUS_M,
) -> Route:
    """Read a route as `read_route` does, from JSON lines that messages call `source`."""
    rows = parse_rows(lines, source, _route_reader(taxonomy, north, radius), what="view")
    return _route(rows, source)


def _route_reader(
    taxonomy: Taxonomy, north: North, radius: float
) -> Callable[[Row], tuple[object, View, Leg | None]]:
    """Return what reads a line of a route: its name, its view, and the way to it."""

    def read(row: Row) -> tuple[object, View, Leg | None]:
        view = parse_view(row, taxonomy=taxonomy, radius=radius)
        return row_value(row, "id"), view, _leg(row, north)

    return read


def _leg(row: Row, north: North) -> Leg | None:
    values = {
        name: float(row_value(row, name))
        for name in (*PLAIN_LEG, *TOWARDS, "sigma")
        if row_value(row, name) is not None
    }
    if not values:
        return None
    sigma = values.pop("sigma", 0.0)
    if values.keys() == set(PLAIN_LEG):
        return Leg(dx=values["dx"], dy=values["dy"], sigma=sigma)
    if values.keys() == set(TOWARDS):
        return Leg.towards(values["bearing"] + north.turn, values["distance"], sigma=sigma)
    msg = "the way to it needs dx and dy, or distance and bearing"
    raise InputError(msg)


def _route(rows: list[tuple[int, tuple[object, View, Leg | None]]], source: str) -> Route:
    for number, (line, (_, _, leg)) in enumerate(rows):
        if (leg is None) != (number == 0):
            fault = "does not tell the way from the line before" if number else "tells a way"
            msg = (
                f"line {line} of {source} {fault}; give dx and dy, or distance and bearing, on "
                "every line of a route but the first."
            )
            raise InputError(msg)
    legs = [leg for _, (_, _, leg) in rows if leg is not None]
    return [(_name(name, line), query) for line, (name, query, _) in rows], legs


def _name(name: Any, line: int) -> str | int:  # noqa: ANN401 - any value of JSON
    """Return the name of a line, or its number."""
    return name if isinstance(name, (str, int)) else line if name is None else str(name)
