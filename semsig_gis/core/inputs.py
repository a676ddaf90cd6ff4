"""Check what users write, in files and arguments, by the types of the fields.

The only module that imports pydantic. A type may carry the words for what it accepts; the first
fault becomes one sentence: where, what was given, and what is accepted.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictFloat, StrictInt, create_model
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import ValidationError, core_schema

from semsig_gis.core.errors import CatalogError, InputError, nearest_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema, ErrorDetails

    from semsig_gis.core.errors import SemsigError

Kind = TypeVar("Kind")
Flag = StrictBool
Whole = StrictInt
Scalar = str | StrictInt | StrictFloat | StrictBool
"""A value of a field of data; bools and numbers are never converted to each other."""

ACCEPTED = {
    "string_type": "a string",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "mapping_type": "a table",
    "model_type": "a table",
    "dataclass_type": "a table",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
}
UNKNOWN_KEYS = frozenset({"extra_forbidden", "unexpected_keyword_argument"})
MOST_CHARACTERS = 60  # of a value in a message


class FileTable(BaseModel):
    """A table of a TOML or JSON file: a field for each key, and no other keys.

    Its fields may be dataclasses, in which other keys are errors, too.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Accepts:
    """What a message says of the values of a type, or of a schema of pydantic in its place."""

    words: str
    schema: CoreSchema | None = None

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Replace the errors of the type by one with the words."""
        schema = handler(source) if self.schema is None else self.schema
        return core_schema.custom_error_schema(
            schema, custom_error_type="accepts", custom_error_message=self.words
        )


@dataclasses.dataclass(frozen=True, slots=True)
class Parsed:
    """A value that a function returns for a value of a file, of the type `kind`.

    The function raises ValueError for a value that is not accepted.
    """

    parse: Callable[[Any], object]
    kind: Any = None

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema of the value in the file, followed by the function."""
        schema = handler(source) if self.kind is None else handler.generate_schema(self.kind)
        return core_schema.no_info_after_validator_function(self.parse, schema)


def number(
    words: str,
    least: float,
    most: float | None = None,
    *,
    above: bool = False,
    whole: bool = False,
) -> Accepts:
    """Return the type of a number from `least`, or only `above` it, to `most`; `whole` or not.

    A bool is not a number. NaN is never accepted, infinity only without a limit. A number of numpy
    is read as one of Python.
    """
    bounds: dict[str, Any] = {"gt" if above else "ge": least, "le": most}
    make = core_schema.int_schema if whole else core_schema.float_schema
    schema = core_schema.no_info_before_validator_function(
        _python_number, make(strict=True, **bounds)
    )
    return Accepts(words, schema)


def _python_number(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def metres(most: float) -> Accepts:
    """Return the type of a length above 0 and up to `most` metres."""
    return number(f"metres above 0 and up to {most:g}", 0, most, above=True)


def matching(pattern: str, words: str) -> Accepts:
    """Return the type of a text that matches a regular expression as a whole."""
    return Accepts(words, core_schema.str_schema(pattern=f"^{pattern}$"))


def file_key(name: str) -> Any:  # noqa: ANN401 - pydantic's own type
    """Return the annotation of a field that has another name in a file."""
    return Field(alias=name)


def pairs(kind: object) -> Parsed:
    """Return the type of pairs of a key and a value of a type, written as a table."""
    return Parsed(lambda table: tuple(table.items()), dict.__class_getitem__((str, kind)))


def length(least: int, most: int | None = None) -> Any:  # noqa: ANN401 - pydantic's own type
    """Return the annotation of a text, list or table with a number of parts."""
    return Field(min_length=least, max_length=most)


Text = Annotated[str, length(1), Accepts("a text that is not empty")]
Texts = Annotated[tuple[Text, ...], Accepts("a list of texts that are not empty")]


def read_table(
    kind: type[Kind], values: object, where: str, *, error: type[SemsigError] = CatalogError
) -> Kind:
    """Return the values of a file as a `FileTable` or a dataclass; `error` if they do not fit.

    Messages begin with `where`, such as "catalogue town.toml".
    """
    model = _model(kind)  # type: ignore[arg-type]
    try:
        table = model.model_validate(values)
    except ValidationError as fault:
        raise _error(error, fault, model, values, where) from None
    if isinstance(table, kind):
        return table
    return kind(**{name: getattr(table, name) for name in table.model_fields_set})


def check_fields(item: Any, where: str, *, error: type[SemsigError] = InputError) -> None:  # noqa: ANN401
    """Check the fields of a frozen dataclass by their types, and convert them; else raise `error`.

    For its ``__post_init__``. Messages begin with `where`, such as "the noise".
    """
    values = {field.name: getattr(item, field.name) for field in dataclasses.fields(item)}
    model = _model(type(item))  # type: ignore[arg-type]
    try:
        table = model.model_validate(values, by_alias=False, by_name=True)
    except ValidationError as fault:
        raise _error(error, fault, model, values, where) from None
    for name in values:
        object.__setattr__(item, name, getattr(table, name))


@functools.cache
def _model(kind: Any) -> type[BaseModel]:  # noqa: ANN401
    """Return a table with the fields of a dataclass."""
    if issubclass(kind, BaseModel):
        table: type[BaseModel] = kind
        return table
    types = get_type_hints(kind, include_extras=True)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        is_required = field.default is field.default_factory is dataclasses.MISSING
        fields[field.name] = (types[field.name], ... if is_required else None)
    return create_model(kind.__name__, __base__=FileTable, **fields)


def _error(
    kind: type[SemsigError],
    fault: ValidationError,
    model: type[BaseModel],
    values: object,
    where: str,
) -> SemsigError:
    """Return the first fault as an error, or an unknown key, as it may explain a missing one."""
    details = fault.errors(include_url=False)
    first = next((item for item in details if item["type"] in UNKNOWN_KEYS), details[0])
    path = [step for step in first["loc"] if step != "[key]"]
    if first["type"] == "value_error":
        return kind(f"{_place(where, values, path)}: {first['ctx']['error']}")
    verb = "write" if kind is CatalogError else "give"
    value = f"{first['input']!r:.{MOST_CHARACTERS}}"
    if first["loc"][-1:] == ("[key]",):
        place = _place(where, values, path[:-1])
        return kind(f"{place} has the key {value}{_remedy(first, verb)}.")
    if not path or isinstance(path[-1], int):
        return kind(f"{_place(where, values, path)} is {value}{_remedy(first, verb)}.")
    place, key = _place(where, values, path[:-1]), str(path[-1])
    if first["type"] == "missing":
        return kind(f"{place} lacks the key {key!r}; add it.")
    if first["type"] in UNKNOWN_KEYS:
        keys = list(_keys(model.model_json_schema(), path[:-1]))
        return kind(
            f"{place} has the key {key!r}, which is unknown{nearest_name(key, keys)}; "
            f"the keys are {', '.join(keys)}."
        )
    return kind(f"{place} has {key} = {value}{_remedy(first, verb)}.")


def _remedy(fault: ErrorDetails, verb: str) -> str:
    """Return the end of a sentence, with what is accepted."""
    if fault["type"] == "literal_error":
        words = fault["ctx"]["expected"]
        near = nearest_name(str(fault["input"]), re.findall("'(.*?)'", words))
        return f"{near}; {verb} {words}"
    words = ACCEPTED.get(fault["type"], fault["msg"]).format(**fault.get("ctx", {}))
    words = words.replace(" 1 entries", " 1 entry")
    return f"; {verb} {words.replace('Input should be', 'a value that is')}"


def _place(where: str, values: Any, path: Sequence[int | str]) -> str:  # noqa: ANN401
    """Return a place in a file in words, such as "catalogue a.toml, layer 'trees', class_by"."""
    words = [where]
    for step in path:
        try:
            values = values[step]
        except (LookupError, TypeError):
            values = None
        if isinstance(step, int):
            name = values.get("name") if isinstance(values, Mapping) else None
            label = repr(name) if isinstance(name, str) else f"{step + 1}"
            words[-1] = f"{re.sub('(?<=ss)es$|(?<!s)s$', '', words[-1])} {label}"
        else:
            words.append(str(step))
    return ", ".join(words)


def _keys(schema: Mapping[str, Any], path: Sequence[int | str]) -> Iterator[str]:
    """Yield the keys of a table at a place, by the JSON Schema of the file."""

    def alternatives(node: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        yield node
        for item in node.get("anyOf", ()):
            yield from alternatives(item)

    nodes = list(alternatives(schema))
    for step in path:
        parts = [
            node["items"]
            if isinstance(step, int) and "items" in node
            else node.get("properties", {}).get(step, node.get("additionalProperties"))
            for node in nodes
        ]
        nodes = [node for part in parts if isinstance(part, dict) for node in alternatives(part)]
    for node in nodes:
        yield from node.get("properties", ())


def json_schema(kind: type[FileTable], *, described_by: type | None = None) -> dict[str, Any]:
    """Return the JSON Schema of a table.

    Its descriptions are those of the parameters in the docstrings of the classes, or of the class
    that is `described_by`.
    """
    schema = kind.model_json_schema(schema_generator=_Schema)
    return schema if described_by is None else _described(schema, described_by)


class _Schema(GenerateJsonSchema):
    """A schema without defaults and titles, in which a key that is given has a value."""

    def nullable_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401 - pydantic's own types
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401
        return self.generate_inner(schema["schema"])

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ANN401, ARG002
        return False

    def dataclass_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401
        keys = {item["name"]: item for item in schema["schema"]["fields"]}
        return _described(super().dataclass_schema(schema), schema["cls"], keys)

    def model_schema(self, schema: Any) -> dict[str, Any]:  # noqa: ANN401
        return _described(super().model_schema(schema), schema["cls"], schema["schema"]["fields"])


def _described(
    table: dict[str, Any], kind: type, fields: Mapping[str, Mapping[str, Any]] | None = None
) -> dict[str, Any]:
    """Return a schema with the descriptions of a class; its `fields` may have other keys."""
    text = inspect.cleandoc(kind.__doc__ or "")
    table |= {"description": text.partition("\n\n")[0], "additionalProperties": False}
    for names, words in re.findall(r"^([\w, ]+) : .*\n((?:    .*\n?)+)", text, re.MULTILINE):
        for name in names.split(", "):
            key = (fields or {}).get(name, {}).get("validation_alias", name)
            if key in table["properties"]:
                table["properties"][key]["description"] = " ".join(words.split())
    return table
