"""Read files of detections without regard to their format: JSON, XML, CSV and text."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

from semsig_gis.core import InputError
from semsig_gis.storage import file_rows, parse_json, read_text

if TYPE_CHECKING:
    from pathlib import Path

DECIMAL_COMMA = re.compile(r"^\s*(-?\d*),(\d+)\s*$")
INVALID = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError)
"""What reading a document of another form than expected raises."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A file and its content: a JSON value, an XML element, the words of lines, or rows of CSV."""

    file: Path
    content: Any


def read_document(file: Path) -> Document:
    """Read a file by its suffix; InputError if it cannot be read or parsed."""
    return Document(file=file, content=PARSERS[file.suffix.lower()](file))


def text_of(file: Path) -> str:
    """Return the text of a file; InputError if it cannot be read."""
    try:
        return read_text(file)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(
            f"{file} cannot be read ({reason}); give a file of detections, or a folder of them."
        ) from error


def _json(file: Path) -> Any:  # noqa: ANN401 - any JSON
    text = text_of(file)
    try:
        return parse_json(text)
    except ValueError as error:
        raise InputError(f"{file} is not JSON ({error}); export it again.") from error


def _xml(file: Path) -> ET.Element:
    text = text_of(file)
    if "<!DOCTYPE" in text:  # to prevent expansion of entities
        raise InputError(f"{file} defines its own document type; export it as CVAT or Pascal VOC.")
    try:
        return ET.fromstring(text)  # noqa: S314 - without a document type
    except (ET.ParseError, ValueError) as error:
        raise InputError(
            f"{file} is not XML that can be read ({error}); export it again."
        ) from error


def _words(file: Path) -> list[list[str]]:
    return [line.split() for line in text_of(file).splitlines()]


def _rows(file: Path) -> list[tuple[int, Any]]:
    rows = list(file_rows(file, what="table of boxes"))
    header = rows[0][1] if rows else None
    first = str(next(iter(header), "")) if isinstance(header, dict) else ""
    separator = next((mark for mark in (";", "\t") if mark in first), None)
    if separator is None:
        return rows
    # Spreadsheets of some languages have semicolons or tabs between columns, and decimal commas.
    lines = io.StringIO(text_of(file).removeprefix("\ufeff"), newline="")
    if first.startswith("sep="):
        next(lines)
    reader = csv.DictReader(lines, delimiter=separator)
    return [
        (
            reader.line_num,
            {
                name: DECIMAL_COMMA.sub(r"\1.\2", value) if isinstance(value, str) else value
                for name, value in row.items()
            },
        )
        for row in reader
    ]


PARSERS = {".csv": _rows, ".json": _json, ".txt": _words, ".xml": _xml}
"""How files are parsed, by their suffix."""
