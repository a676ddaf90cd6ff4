"""Files of queries: one signature a row, from detectors or people."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.errors import InputError, SemsigError
from semsig_gis.signatures import Signature

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.taxonomy import Taxonomy

__all__ = ["parse_queries", "read_queries"]

Queries = list[tuple[str | int, Signature]]


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
    semsig_gis.errors.InputError: queries file nowhere.csv cannot be read (No such file or
    directory); give a CSV or JSON lines file.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        msg = f"queries file {file} cannot be read ({reason}); give a CSV or JSON lines file."
        raise InputError(msg) from error
    return parse_queries(text, str(file), taxonomy=taxonomy, table=file.suffix.lower() == ".csv")


def parse_queries(text: str, source: str, *, taxonomy: Taxonomy, table: bool = False) -> Queries:
    r"""Read queries from text.

    Parameters
    ----------
    text : str
        JSON lines, or CSV.
    source : str
        What to call the text in messages.
    taxonomy : Taxonomy
        Classes that the symbols belong to.
    table : bool, default False
        True for CSV.

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
    queries: Queries = []
    for line, row in _rows(text, source, table=table):
        try:
            queries.append((row.get("id") or line, _signature(row, taxonomy)))
        except (SemsigError, ValueError, TypeError, AttributeError) as error:
            reason = str(error).rstrip(".")
            msg = f"line {line} of {source} is no query ({reason}); correct it or take it out."
            raise InputError(msg) from error
    if not queries:
        msg = f"{source} has no queries; give one on each line."
        raise InputError(msg)
    return queries


def _rows(text: str, source: str, *, table: bool) -> Iterator[tuple[int, Any]]:
    if table:
        reader = csv.DictReader(text.splitlines())
        for row in reader:
            yield reader.line_num, row
        return
    for line, part in enumerate(text.splitlines(), start=1):
        if part.strip():
            try:
                yield line, json.loads(part)
            except ValueError as error:
                msg = f"line {line} of {source} is not JSON ({error}); write one query a line."
                raise InputError(msg) from error


def _signature(row: dict[str, Any], taxonomy: Taxonomy) -> Signature:
    types, bearings = row.get("types"), row.get("bearings")
    if isinstance(bearings, str):
        bearings = [float(part) for part in re.split(r"[\s,;]+", bearings.strip()) if part]
    return Signature.parse(
        None if types in {None, ""} else str(types).strip(),
        bearings or None,
        taxonomy=taxonomy,
    )
