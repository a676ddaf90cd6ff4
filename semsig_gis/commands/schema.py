"""`semsig schema`: JSON Schema of the requests and results of all commands."""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from typing_extensions import TypedDict

from semsig_gis.commands.model import (
    Command,
    Field,
    Option,
    Reporter,
    Result,
    command,
    commands,
)
from semsig_gis.core import UnknownNameError, nearest_name

DIALECT = "https://json-schema.org/draft/2020-12/schema"
TYPES = {bool: "boolean", int: "integer", float: "number", str: "string", Path: "string"}


Schemas = TypedDict("Schemas", {"$schema": str, "commands": dict[str, dict[str, Any]]})


@command(
    "schema",
    title="Schema of the commands",
    group="Research",
    order=4,
    returns=Schemas,
    examples=(
        "semsig schema",
        "semsig schema localize evaluate",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Schema:
    """Print the JSON Schema of the requests and results of all commands, or of some.

    A request has a property for each option; `title`, `description`, `minimum`, `maximum`,
    `default` and the keys that begin with x- say what a dialog needs: unit, metavar, whether the
    option is advanced, and which files are read or written.
    """

    names: Annotated[
        list[str] | None,
        Option(
            "Names of commands; default: all.",
            positional=True,
            suggestions=lambda: tuple(commands()),
        ),
    ] = None

    def run(self, _reporter: Reporter) -> Result:
        """Return the schema of the commands, by name."""
        items = commands()
        for name in self.names or ():
            if name not in items:
                raise UnknownNameError(
                    f"there is no command {name!r}{nearest_name(name, items)}; give one of "
                    f"{', '.join(items)}."
                )

        def values() -> dict[str, Any]:
            return {
                "$schema": DIALECT,
                "commands": {name: command_schema(items[name]) for name in self.names or items},
            }

        return Result(values=values)


def command_schema(item: Command) -> dict[str, Any]:
    """Return the schema of the request and the result of a command."""
    return {
        "title": item.title,
        "description": item.help,
        "group": item.group,
        "request": {
            "type": "object",
            "properties": {field.name: field_schema(field) for field in item.fields},
            "required": [field.name for field in item.fields if field.required],
            "additionalProperties": False,
        },
        "result": result_schema(item),
    }


def result_schema(item: Command) -> dict[str, Any] | None:
    """Return the schema of the values of the result of a command, or of each line of them."""
    if item.returns is None:
        return None
    from pydantic import TypeAdapter
    from pydantic.json_schema import GenerateJsonSchema

    class Closed(GenerateJsonSchema):
        """Objects with known keys have no others."""

        def typed_dict_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401 - of pydantic
            return {"additionalProperties": False, **super().typed_dict_schema(schema)}

        def dataclass_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401 - of pydantic
            return {"additionalProperties": False, **super().dataclass_schema(schema)}

    returns = item.returns
    if isinstance(returns, str):
        returns = pkgutil.resolve_name(returns)
    schema = TypeAdapter(returns).json_schema(mode="serialization", schema_generator=Closed)
    # References are within the schema of the result, also in the schema of all commands.
    return {"$id": f"urn:semsig:{item.name}", **schema}


def field_schema(field: Field) -> dict[str, Any]:
    """Return the schema of a field."""
    option = field.option
    schema: dict[str, Any] = {"type": TYPES[field.kind]}
    if field.choices:
        schema["enum"] = list(field.choices)
    if option.low is not None:
        schema["minimum"] = option.low
    if option.high is not None:
        schema["maximum"] = option.high
    if field.many:
        schema = {"type": "array", "items": schema}
    if field.optional:
        schema = {"anyOf": [schema, {"type": "null"}]}
    schema |= {"title": field.title, "description": option.help}
    if not field.required:
        default = field.default
        schema["default"] = str(default) if isinstance(default, Path) else default
    details = {
        "x-flag": field.flag,
        "x-metavar": "" if field.kind is bool else field.metavar,
        "x-unit": option.unit,
        "x-default": option.default,
        "x-positional": option.positional,
        "x-advanced": option.advanced,
        "x-reads": option.reads,
        "x-writes": [*field.suffixes],
        "x-suggestions": [] if option.suggestions is None else list(option.suggestions()),
    }
    schema |= {name: value for name, value in details.items() if value}
    return schema
