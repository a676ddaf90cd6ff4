"""Read rows of text files: CSV and JSON lines."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from semsig_gis.core import InputError, SemsigError
from semsig_gis.storage.text import parse_json, read_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

MAX_ROWS_BYTES = 2**30
"""Maximum size of a file of rows, which is read into memory."""

Row = dict[str, Any]
"""Values of a row by name."""

_T = TypeVar("_T")


def read_rows(path: str | Path, read: Callable[[Row], _T], *, what: str) -> list[tuple[int, _T]]:
    """Return the line number and ``read(row)`` of each row of a file (CSV or JSON lines).

    `read` raises an error with the reason if a row is not valid; `what` names a row in messages.
    InputError if the file cannot be read, has no rows, or a row is not valid.
    """
    return _all_rows(file_rows(path, what=what), str(path), read, what)


def parse_rows(
    lines: Iterable[str | bytes], source: str, read: Callable[[Row], _T], *, what: str
) -> list[tuple[int, _T]]:
    """Return the result of `read_rows` for JSON lines; `source` names them in messages."""
    return _all_rows(json_rows(lines), source, read, what)


def _all_rows(
    rows: Iterable[tuple[int, Row | Exception]], source: str, read: Callable[[Row], _T], what: str
) -> list[tuple[int, _T]]:
    """Return line number and ``read(row)`` of all rows, or raise the first error."""
    results = []
    for line, _, value in scan_rows(rows, source, read, what=what):
        if isinstance(value, InputError):
            raise value
        results.append((line, value))
    if not results:
        raise InputError(f"{source} has no rows; give one {what} on each line.")
    return results


def file_rows(path: str | Path, *, what: str) -> Iterator[tuple[int, Row | Exception]]:
    """Yield line number and values, or an error, of each row of a file (CSV or JSON lines).

    InputError if the file cannot be read; `what` names a row in messages.
    """
    file = Path(path)
    try:
        if file.suffix.lower() == ".csv":
            return csv_rows(read_whole(file, most=MAX_ROWS_BYTES).decode("utf-8-sig"), str(file))
        return json_rows(read_whole(file, most=MAX_ROWS_BYTES).split(b"\n"))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"{what} file {file} cannot be read ({reason}); give a CSV or JSON lines file."
        ) from error


def scan_rows(
    rows: Iterable[tuple[int, Row | Exception]],
    source: str,
    read: Callable[[Row], _T],
    *,
    what: str,
) -> Iterator[tuple[int, Row, _T | InputError]]:
    """Yield line number, values, and ``read(values)`` or its error, of each row.

    The values of a row that cannot be parsed are empty.
    """
    for line, row in rows:
        result: _T | InputError
        try:
            if isinstance(row, Exception):
                raise row
            if not isinstance(row, dict):
                raise InputError("it is not a table of names and values")
            result = read(row)
        except (SemsigError, ValueError, TypeError, OverflowError, RecursionError) as error:
            reason = str(error).rstrip(".")
            msg = f"line {line} of {source} is no {what} ({reason}); correct it or take it out."
            result = InputError(msg)
            result.__cause__ = error
        yield line, row if isinstance(row, dict) else {}, result


def row_value(row: Row, name: str) -> Any:  # noqa: ANN401 - any value of JSON
    """Return a value of a row; None if it is missing or a blank text."""
    value = row.get(name)
    return None if isinstance(value, str) and not value.strip() else value


def csv_rows(text: str, source: str) -> Iterator[tuple[int, Row | Exception]]:
    """Yield line number and values, or an error, of each row of CSV."""
    reader = csv.DictReader(io.StringIO(text, newline=""))
    try:
        _ = reader.fieldnames
    except csv.Error as error:
        raise InputError(f"{source} is not CSV ({error}); correct it.") from error
    while True:
        row: Row | Exception | None
        try:
            row = next(reader, None)
        except csv.Error as error:
            row = InputError(f"it is not CSV: {error}")
        if row is None:
            return
        yield reader.reader.line_num, row


def json_rows(lines: Iterable[str | bytes]) -> Iterator[tuple[int, Row | Exception]]:
    """Yield line number and values, or an error, of each JSON line that is not blank."""
    for line, text in enumerate(lines, start=1):
        if text.strip():
            row: Row | Exception
            try:
                row = parse_json(text)
            except ValueError as error:
                row = InputError(f"it is not JSON: {error}")
            yield line, row
