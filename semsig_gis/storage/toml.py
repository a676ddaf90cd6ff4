"""Read and write TOML."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semsig_gis.core import CatalogError, InputError
from semsig_gis.storage.text import parse_json, read_text


def read_values(path: str | Path, what: str) -> Any:  # noqa: ANN401 - as the file has it
    """Return the values of a TOML file (suffix ``.toml``) or a JSON file.

    InputError if it cannot be read; `what` names its purpose in the message.
    """
    file = Path(path)
    try:
        text = read_text(file)
        toml = file.suffix.lower() == ".toml"
        return tomllib.loads(text) if toml else parse_json(text, finite=True)
    except (OSError, ValueError, RecursionError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"{what} file {file} cannot be read ({reason}); give a JSON or TOML file."
        ) from error


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the values of TOML; CatalogError, with the file name `where`, if it is not valid."""
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise CatalogError(f"{where} is not valid TOML: {error}.") from error


def toml_text(values: Mapping[str, Any]) -> str:
    """Return values (without None, NaN or infinity) as TOML; tables become sections at the end.

    Parsing the text returns the same values, except for empty tables.
    """
    return _section(values).lstrip("\n")


def _section(values: Mapping[str, Any], *parents: str) -> str:
    tables = {name: value for name, value in values.items() if isinstance(value, Mapping)}
    lines = [
        f"{_key(name)} = {_inline(value)}\n" for name, value in values.items() if name not in tables
    ]
    for name, table in tables.items():
        path = (*parents, _key(name))
        # A table that contains only tables needs no heading.
        if any(not isinstance(value, Mapping) for value in table.values()):
            lines.append(f"\n[{'.'.join(path)}]\n")
        lines.append(_section(table, *path))
    return "".join(lines)


def _inline(value: Any) -> str:  # noqa: ANN401 - any value of JSON
    if isinstance(value, Mapping):
        items = ", ".join(f"{_key(name)} = {_inline(item)}" for name, item in value.items())
        return f"{{ {items} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    return _text(value) if isinstance(value, str) else json.dumps(value, allow_nan=False)


def _key(name: str) -> str:
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _text(name)


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
