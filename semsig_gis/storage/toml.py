"""Read, check and write TOML: unknown keys and values of a wrong type raise a clear error."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import CatalogError, InputError, nearest_name
from semsig_gis.storage.text import parse_json, read_text

if TYPE_CHECKING:
    from collections.abc import Iterable


TYPE_NAMES: dict[type, str] = {
    str: "a string",
    int: "a whole number",
    list: "a list",
    dict: "a table",
    bool: "true or false",
}


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


def check_keys(
    table: Mapping[str, Any],
    allowed: Mapping[str, type],
    where: str,
    needed: Iterable[str] = (),
) -> None:
    """Raise CatalogError if a table has an unknown key, a value of a wrong type, or lacks a key.

    `allowed` is the type of the value by key, ``object`` if it is checked elsewhere.
    """
    for key, value in table.items():
        if key not in allowed:
            raise CatalogError(
                f"{where} has the key {key!r}, which is unknown"
                f"{nearest_name(key, allowed)}; the keys are {', '.join(allowed)}."
            )
        kind = allowed[key]
        if kind is object:
            continue
        # A bool is an int in Python, but not in a catalogue.
        if not isinstance(value, kind) or isinstance(value, bool) != (kind is bool):
            raise CatalogError(f"{where} has {key} = {value!r}; write {TYPE_NAMES[kind]}.")
    for key in needed:
        if key not in table:
            raise CatalogError(f"{where} lacks the key {key!r}; add it.")


def one_of(value: str, key: str, choices: tuple[str, ...], where: str) -> Any:  # noqa: ANN401
    """Return `value` if it is one of `choices`; else CatalogError, with the nearest choice."""
    if value not in choices:
        names = ", ".join(repr(choice) for choice in choices)
        raise CatalogError(
            f"{where} has {key} = {value!r}{nearest_name(value, choices)}; write one of {names}."
        )
    return value


def texts(items: object, key: str, where: str) -> tuple[str, ...]:
    """Return a list of texts that are not empty; CatalogError for any other value."""
    if not isinstance(items, list) or not all(isinstance(item, str) and item for item in items):
        raise CatalogError(f"{where} has {key} = {items!r}; write a list of texts.")
    return tuple(items)


def metres(value: object, key: str, where: str, *, most: float) -> float:
    """Return a length in metres, above 0 and up to `most`; CatalogError for any other value."""
    # A bool is an int in Python, but not in a catalogue. NaN fails both comparisons.
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value <= most:
        raise CatalogError(
            f"{where} has {key} = {value!r}; write metres above 0 and up to {most:g}."
        )
    return float(value)


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
