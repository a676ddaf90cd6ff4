"""Files of one signature a row: CSV, or JSON lines with the same names."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from semsig_gis.core.errors import InputError, SemsigError
from semsig_gis.core.signature import Signature

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from semsig_gis.core.taxonomy import Taxonomy

Row = dict[str, Any]
"""The values of a row by name."""

_T = TypeVar("_T")


def read_rows(path: str | Path, read: Callable[[Row], _T], *, what: str) -> list[tuple[int, _T]]:
    """Return the line number of each row of a file, and what `read` made of the row.

    The file is CSV (suffix ``.csv``) or JSON lines. `read` raises an error that says what is wrong
    with a row; `what` names a row in messages, such as ``"query"``. InputError if the file cannot
    be read, has no rows, or a row cannot be used.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        msg = f"{what} file {file} cannot be read ({reason}); give a CSV or JSON lines file."
        raise InputError(msg) from error
    return parse_rows(text, str(file), read, what=what, table=file.suffix.lower() == ".csv")


def parse_rows(
    text: str, source: str, read: Callable[[Row], _T], *, what: str, table: bool = False
) -> list[tuple[int, _T]]:
    """Return what `read_rows` does, from text: CSV if `table`, else JSON lines.

    `source` names the text in messages.
    """
    rows = []
    for line, values in _csv(text, source) if table else _json_lines(text):
        try:
            row = json.loads(values) if isinstance(values, str) else values
            if not isinstance(row, dict):
                msg = "it is not a table of names and values"
                raise InputError(msg)
            rows.append((line, read(row)))
        except (SemsigError, ValueError, TypeError, OverflowError, RecursionError) as error:
            reason = str(error).rstrip(".")
            if isinstance(error, json.JSONDecodeError):
                reason = f"it is not JSON: {reason}"
            msg = f"line {line} of {source} is no {what} ({reason}); correct it or take it out."
            raise InputError(msg) from error
    if not rows:
        msg = f"{source} has no rows; give one {what} on each line."
        raise InputError(msg)
    return rows


def row_signature(row: Row, taxonomy: Taxonomy) -> Signature | None:
    """Return the signature of a row, clockwise from north, or None where nothing was seen.

    The row has ``types`` (symbols such as ``DDB``) and ``bearings`` (degrees; a list, or text with
    blanks, commas or semicolons between them), each of which may be missing or empty. InputError if
    they cannot be used or do not fit each other.
    """
    types, bearings = row_value(row, "types"), row_value(row, "bearings")
    if isinstance(bearings, str):
        bearings = [float(part) for part in re.split(r"[\s,;]+", bearings.strip()) if part]
    elif isinstance(bearings, (int, float)):
        bearings = [bearings]
    symbols = None if types is None else str(types).strip()
    if not symbols and not bearings:
        return None
    return Signature.parse(symbols or None, bearings or None, taxonomy=taxonomy)


def row_value(row: Row, name: str) -> Any:  # noqa: ANN401 - any value of JSON
    """Return a value of a row, None where it is missing or empty; 0 is a value."""
    value = row.get(name)
    return None if isinstance(value, str) and not value.strip() else value


def _csv(text: str, source: str) -> Iterator[tuple[int, Row]]:
    reader = csv.DictReader(io.StringIO(text, newline=""))
    try:
        for row in reader:
            yield reader.line_num, row
    except csv.Error as error:
        msg = f"{source} is not CSV ({error}); correct it."
        raise InputError(msg) from error


def _json_lines(text: str) -> Iterator[tuple[int, str]]:
    for line, part in enumerate(text.split("\n"), start=1):
        if part.strip():
            yield line, part
