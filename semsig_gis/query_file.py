"""Files of queries: one signature a row, from detectors or people, each by itself or a route."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.errors import InputError
from semsig_gis.route import Leg
from semsig_gis.row_file import given, parse_rows, read_rows, row_signature
from semsig_gis.signatures import Signature

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.row_file import Row
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["parse_queries", "parse_route", "read_queries", "read_route"]

Queries = list[tuple[str | int, Signature]]
Route = tuple[Queries, list[Leg]]

PLAIN_LEG = ("dx", "dy")
TOWARDS = ("distance", "bearing")


def read_queries(path: str | Path, *, taxonomy: Taxonomy) -> Queries:
    """Read the queries of a file.

    Parameters
    ----------
    path : str or Path
        A CSV file with columns ``types`` and ``bearings`` (numbers with blanks, commas or
        semicolons between them), one of which may be missing or empty, and ``id`` if wanted; or
        JSON lines with the same names, where bearings may be a list.
    taxonomy : Taxonomy
        Classes that the symbols belong to.

    Returns
    -------
    list of tuple of (str or int, Signature)
        Name of each query (its ``id``, or the number of its line) and the query.

    Raises
    ------
    InputError
        If the file cannot be read or a line of it is no query.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> read_queries("nowhere.csv", taxonomy=paper_taxonomy())
    Traceback (most recent call last):
    ...
    semsig_gis.errors.InputError: query file nowhere.csv cannot be read (No such file or
    directory); give a CSV or JSON lines file.
    """
    return _named(read_rows(path, lambda row: _query(row, taxonomy), what="query"))


def parse_queries(text: str, source: str, *, taxonomy: Taxonomy) -> Queries:
    r"""Read queries from text.

    Parameters
    ----------
    text : str
        JSON lines.
    source : str
        What to call the text in messages.
    taxonomy : Taxonomy
        Classes that the symbols belong to.

    Returns
    -------
    list of tuple of (str or int, Signature)
        Name of each query and the query.

    Raises
    ------
    InputError
        If there is no line, or one is no query; with its number.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> lines = '{"id": "a", "types": "DB", "bearings": [10, 80]}\n{"types": "?B"}\n'
    >>> [(name, len(query)) for name, query in
    ...     parse_queries(lines, "example", taxonomy=paper_taxonomy())]
    [('a', 2), (2, 2)]
    """
    return _named(parse_rows(text, source, lambda row: _query(row, taxonomy), what="query"))


def read_route(path: str | Path, *, taxonomy: Taxonomy) -> Route:
    """Read the views of a route.

    Parameters
    ----------
    path : str or Path
        A file of queries (see `read_queries`), in which each line but the first also tells the way
        from the line before: ``dx`` and ``dy`` (metres to grid east and north), or ``distance``
        (metres) and ``bearing`` (degrees clockwise from grid north), and ``sigma`` (standard
        deviation of each coordinate in metres, 0 if missing). A line may have seen nothing.
    taxonomy : Taxonomy
        Classes that the symbols belong to.

    Returns
    -------
    queries : list of tuple of (str or int, Signature)
        Name of each view and what was seen.
    legs : list of Leg
        The ways between them, one fewer.

    Raises
    ------
    InputError
        If the file cannot be read, or a line of it is no view of a route.
    """
    return _route(read_rows(path, lambda row: _view(row, taxonomy), what="view"), str(path))


def parse_route(text: str, source: str, *, taxonomy: Taxonomy) -> Route:
    r"""Read the views of a route from text.

    Parameters
    ----------
    text : str
        JSON lines.
    source : str
        What to call the text in messages.
    taxonomy : Taxonomy
        Classes that the symbols belong to.

    Returns
    -------
    queries : list of tuple of (str or int, Signature)
        Name of each view and what was seen.
    legs : list of Leg
        The ways between them, one fewer.

    Raises
    ------
    InputError
        If there is no line, or one is no view of a route; with its number.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> lines = '{"types": "DB"}\n{"types": "", "distance": 20, "bearing": 90, "sigma": 2}\n'
    >>> queries, legs = parse_route(lines, "example", taxonomy=paper_taxonomy())
    >>> [len(query) for _, query in queries], legs[0].dx, legs[0].sigma
    ([2, 0], 20.0, 2.0)
    """
    return _route(parse_rows(text, source, lambda row: _view(row, taxonomy), what="view"), source)


def _query(row: Row, taxonomy: Taxonomy) -> tuple[object, Signature]:
    signature = row_signature(row, taxonomy)
    if signature is None:
        msg = "it needs types, bearings or both"
        raise InputError(msg)
    return given(row, "id"), signature


def _view(row: Row, taxonomy: Taxonomy) -> tuple[object, Signature, Leg | None]:
    signature = row_signature(row, taxonomy)
    nothing = Signature(np.empty(0, np.uint8), np.empty(0))
    return given(row, "id"), nothing if signature is None else signature, _leg(row)


def _leg(row: Row) -> Leg | None:
    told = {
        name: float(given(row, name))
        for name in (*PLAIN_LEG, *TOWARDS, "sigma")
        if given(row, name) is not None
    }
    if not told:
        return None
    sigma = told.pop("sigma", 0.0)
    if set(told) == set(PLAIN_LEG):
        return Leg(dx=told["dx"], dy=told["dy"], sigma=sigma)
    if set(told) == set(TOWARDS):
        return Leg.towards(told["bearing"], told["distance"], sigma=sigma)
    msg = "the way to it needs dx and dy, or distance and bearing"
    raise InputError(msg)


def _route(rows: list[tuple[int, tuple[object, Signature, Leg | None]]], source: str) -> Route:
    legs = []
    for number, (line, (_, _, leg)) in enumerate(rows):
        if (leg is None) != (number == 0):
            does = "does not tell the way from the line before" if number else "tells a way"
            msg = (
                f"line {line} of {source} {does}; give dx and dy, or distance and bearing, on "
                "every line of a route but the first."
            )
            raise InputError(msg)
        if leg is not None:
            legs.append(leg)
    return _named([(line, (name, query)) for line, (name, query, _) in rows]), legs


def _named(rows: list[tuple[int, tuple[object, Signature]]]) -> Queries:
    """Return queries by their name, or the number of their line."""
    return [
        (name if isinstance(name, (str, int)) else line if name is None else str(name), query)
        for line, (name, query) in rows
    ]
