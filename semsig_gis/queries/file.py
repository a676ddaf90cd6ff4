"""Files of queries: one signature a row, from detectors or people, each by itself or a route."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.core.signature import Signature
from semsig_gis.likelihood.route import Leg
from semsig_gis.storage.geoparquet import parse_rows, read_rows, row_signature, row_value

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.storage.geoparquet import Row

Queries = list[tuple[str | int, Signature]]
Route = tuple[Queries, list[Leg]]

PLAIN_LEG = ("dx", "dy")
TOWARDS = ("distance", "bearing")


def read_queries(path: str | Path, *, taxonomy: Taxonomy) -> Queries:
    """Read the queries of a CSV file, or of a file of JSON lines.

    The columns are those of `row_signature` and perhaps ``id``. Each query comes with its ``id``,
    or else the number of its line. Raises InputError if the file cannot be read or a line of it is
    no query.
    """
    return _named(read_rows(path, lambda row: _query(row, taxonomy), what="query"))


def parse_queries(text: str, source: str, *, taxonomy: Taxonomy) -> Queries:
    """Read queries as `read_queries` does, from JSON lines that messages call `source`."""
    return _named(parse_rows(text, source, lambda row: _query(row, taxonomy), what="query"))


def read_route(path: str | Path, *, taxonomy: Taxonomy) -> Route:
    """Read the views of a route from a file of queries (see `read_queries`).

    Each line but the first also tells the way from the line before: ``dx`` and ``dy`` (metres to
    grid east and north), or ``distance`` (metres) and ``bearing`` (degrees clockwise from grid
    north), and ``sigma`` (standard deviation of each coordinate in metres, 0 if missing). A line
    may have seen nothing. There is one leg fewer than views. Raises InputError if the file cannot
    be read or a line of it is no view of a route.
    """
    return _route(read_rows(path, lambda row: _view(row, taxonomy), what="view"), str(path))


def parse_route(text: str, source: str, *, taxonomy: Taxonomy) -> Route:
    """Read a route as `read_route` does, from JSON lines that messages call `source`."""
    return _route(parse_rows(text, source, lambda row: _view(row, taxonomy), what="view"), source)


def _query(row: Row, taxonomy: Taxonomy) -> tuple[object, Signature]:
    signature = row_signature(row, taxonomy)
    if signature is None:
        msg = "it needs types, bearings or both"
        raise InputError(msg)
    return row_value(row, "id"), signature


def _view(row: Row, taxonomy: Taxonomy) -> tuple[object, Signature, Leg | None]:
    signature = row_signature(row, taxonomy)
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    return row_value(row, "id"), nothing if signature is None else signature, _leg(row)


def _leg(row: Row) -> Leg | None:
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
        return Leg.towards(values["bearing"], values["distance"], sigma=sigma)
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
    return _named([(line, (name, query)) for line, (name, query, _) in rows]), legs


def _named(rows: list[tuple[int, tuple[object, Signature]]]) -> Queries:
    """Return queries by their name, or the number of their line."""
    return [
        (name if isinstance(name, (str, int)) else line if name is None else str(name), query)
        for line, (name, query) in rows
    ]
