"""Make command lines of `semsig` from the schema of its commands, without QGIS."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from .command import CommandError

__all__ = [
    "KINDS_OF_ONE",
    "check_output",
    "command_line",
    "option_words",
    "parameter_kinds",
    "read_commands",
    "value_schema",
]

HERE = Path(__file__).parent
KINDS_OF_ONE = {"extent": "extent", "text": "name", "file": "file", "polygons": "polygons"}
"""Words for the parameters of an option that has several, by their kinds."""
BOX = "WEST,SOUTH,EAST,NORTH"


def read_commands() -> dict[str, dict[str, Any]]:
    """Return the schema of each command by its name, as `semsig schema` printed it."""
    content = (HERE / "commands.json").read_text("utf-8")
    return json.loads(content)["commands"]  # type: ignore[no-any-return]


def value_schema(option: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of the value of an option that may be null: of a value, or of a list."""
    alternatives = option.get("anyOf", [option])
    return next(schema for schema in alternatives if schema["type"] != "null")


def parameter_kinds(  # noqa: PLR0911 - a kind each
    name: str, option: dict[str, Any]
) -> dict[str, str]:
    """Return the parameters for an option, their kinds by their names.

    Usually it is one: the name of the option in upper case. An option that takes a box, a file or
    a text, or a name or a file, has a parameter for each.

    Examples
    --------
    >>> area = {"type": "string", "x-metavar": "WEST,SOUTH,EAST,NORTH|FILE"}
    >>> parameter_kinds("area", area)
    {'AREA': 'polygons', 'AREA_EXTENT': 'extent'}
    """
    name = name.strip("_").upper()
    schema, metavar = value_schema(option), option.get("x-metavar", "")
    many = "items" in schema
    schema = schema.get("items", schema)
    if "x-writes" in option:
        kinds = {".gpkg": "layers", ".tif": "raster", "": "new folder"}
        return {name: kinds.get(option["x-writes"][0], "new file")}
    if schema["type"] == "boolean":
        return {name: "yes or no" if "anyOf" in option else "switch"}
    if "enum" in schema:
        return {name: "choices" if many else "choice"}
    if schema["type"] != "string" and not many:
        return {name: schema["type"]}
    if metavar == "CRS":
        return {name: "crs"}
    if metavar.startswith(BOX):
        others = set(metavar.split("|"))
        return {
            **({name: "polygons"} if "FILE" in others else {}),
            f"{name}_EXTENT": "extent",
            **({f"{name}_TEXT": "text"} if others - {BOX, "CANVAS", "FILE"} else {}),
        }
    if option.get("x-reads") and option.get("x-suggestions"):
        return {name: "choices" if many else "choice", f"{name}_FILE": "file"}
    if metavar in {"FILE", "FILE|-"}:
        return {name: "files" if many else "file"}
    if metavar == "FOLDER":
        return {name: "folder"}
    many_kind = "choices" if option.get("x-suggestions") else "lines"
    return {name: many_kind if many else "text"}


def option_words(option: dict[str, Any], value: Any) -> list[str]:  # noqa: ANN401 - any value
    """Return the words of a command line for the value of an option; none for the default.

    Examples
    --------
    >>> option_words({"x-flag": "--merge", "default": True}, False)
    ['--no-merge']
    """
    flag = option["x-flag"]
    if value is None or value in ("", []) or value == option.get("default"):
        return []
    if isinstance(value, bool):
        return [flag if value else flag.replace("--", "--no-", 1)]
    values = value if isinstance(value, list) else [value]
    return [str(item) if option.get("x-positional") else f"{flag}={item}" for item in values]


def command_line(name: str, command: dict[str, Any], values: dict[str, Any]) -> list[str]:
    """Return the arguments of a command; raise CommandError if a required option has no value."""
    request = command["request"]
    options: list[str] = []
    positional: list[str] = []
    for key, option in request["properties"].items():
        words = option_words(option, values.get(key))
        if not words and key in request["required"]:
            message = f"{option['title']} was not given; choose it, or type it."
            raise CommandError(message)
        (positional if option.get("x-positional") else options).extend(words)
    # Words after the two dashes are never read as options, whatever they are.
    return [name, *options, "--", *positional]


def check_output(path: str, suffixes: list[str]) -> None:
    """Raise CommandError before the work if an output cannot be written.

    An empty suffix accepts any, also a folder. The command creates a folder of results, but not the
    folder of a file.
    """
    target = Path(path)
    if "" not in suffixes:
        if target.suffix.lower() not in suffixes:
            listed = " or ".join(suffixes)
            message = f"{path} does not end in {listed}; give the name of a {listed} file."
            raise CommandError(message)
        if os.path.isdir(target):  # noqa: PTH112 - Path.is_dir may raise
            message = f"{path} is a folder; give the name of a file to write."
            raise CommandError(message)
    # Find the nearest folder that exists; what is written may exist itself.
    places = [target.absolute().parent, *target.absolute().parents]
    if suffixes == [""]:
        places.insert(0, target.absolute())
    existing = (place for place in places if os.path.exists(place))  # noqa: PTH110 - as above
    folder = next(existing, places[-1])
    if not folder.is_dir():
        message = f"{path} cannot be written, since {folder} is not a folder; choose another place."
        raise CommandError(message)
    if suffixes != [""] and folder != target.absolute().parent:
        message = (
            f"{path} cannot be written, because there is no folder {target.parent}; make it, or "
            "choose another place."
        )
        raise CommandError(message)
    if not os.access(folder, os.W_OK | os.X_OK):
        message = (
            f"{path} cannot be written, since {folder} is read-only; choose a folder you can "
            "write to."
        )
        raise CommandError(message)
