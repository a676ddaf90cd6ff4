"""Files of queries: one signature a row, from detectors or people, each by itself or a route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.database.north import GRID_NORTH
from semsig_gis.likelihood.route import Leg
from semsig_gis.storage.rows import (
    file_rows,
    json_rows,
    parse_rows,
    read_rows,
    row_signature,
    row_value,
    scan_rows,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.north import North
    from semsig_gis.storage.rows import Row

Route = tuple[list[tuple[str | int, Signature]], list[Leg]]

PLAIN_LEG = ("dx", "dy")
TOWARDS = ("distance", "bearing")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class QueryLine:
    """A line of a file of queries: a query, perhaps of nothing, or the error that it is none.

    `name` is its ``id``, or else the number of the line.
    """

    line: int
    name: str | int
    query: Signature | InputError


def read_queries(path: str | Path, *, taxonomy: Taxonomy) -> Iterator[QueryLine]:
    """Read the queries of a CSV file, or of a file of JSON lines, line by line.

    The columns are those of `row_signature` and perhaps ``id``. A line that is no query takes none
    of the others with it. Raises InputError if the file cannot be read.
    """
    return _query_lines(file_rows(path, what="query"), str(path), taxonomy)


def parse_queries(
    lines: Iterable[str | bytes], source: str, *, taxonomy: Taxonomy
) -> Iterator[QueryLine]:
    """Read queries as `read_queries` does, from JSON lines that messages call `source`."""
    return _query_lines(json_rows(lines), source, taxonomy)


def _query_lines(
    rows: Iterable[tuple[int, Row | Exception]], source: str, taxonomy: Taxonomy
) -> Iterator[QueryLine]:
    lines = scan_rows(rows, source, lambda row: _query(row, taxonomy), what="query")
    for line, row, query in lines:
        yield QueryLine(line=line, name=_name(row_value(row, "id"), line), query=query)


def read_route(path: str | Path, *, taxonomy: Taxonomy, north: North = GRID_NORTH) -> Route:
    """Read the views of a route from a file of queries (see `read_queries`).

    A line without types and bearings, like one where both are empty, has seen nothing. Each line
    but the first also tells the way from the line before: ``dx`` and ``dy`` (metres to
    grid east and north), or ``distance`` (metres) and ``bearing`` (degrees clockwise from
    `north`), and ``sigma`` (standard deviation of each coordinate in metres, 0 if missing).
    There is one leg fewer than views. Raises InputError if the file cannot be read or a line of it
    is no view of a route.
    """
    rows = read_rows(path, lambda row: _view(row, taxonomy, north), what="view")
    return _route(rows, str(path))


def parse_route(
    lines: Iterable[str | bytes], source: str, *, taxonomy: Taxonomy, north: North = GRID_NORTH
) -> Route:
    """Read a route as `read_route` does, from JSON lines that messages call `source`."""
    rows = parse_rows(lines, source, lambda row: _view(row, taxonomy, north), what="view")
    return _route(rows, source)


def _query(row: Row, taxonomy: Taxonomy) -> Signature:
    # Without their names, an empty row would be one that saw nothing, whatever it was meant for.
    if row.get("types") is None and row.get("bearings") is None:
        msg = "it needs types, bearings or both, which may be empty where nothing was seen"
        raise InputError(msg)
    return _seen(row, taxonomy)


def _view(row: Row, taxonomy: Taxonomy, north: North) -> tuple[object, Signature, Leg | None]:
    return row_value(row, "id"), _seen(row, taxonomy), _leg(row, north)


def _seen(row: Row, taxonomy: Taxonomy) -> Signature:
    signature = row_signature(row, taxonomy)
    return Signature(np.empty(0, np.uint8), np.empty(0)) if signature is None else signature


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


def _route(rows: list[tuple[int, tuple[object, Signature, Leg | None]]], source: str) -> Route:
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
