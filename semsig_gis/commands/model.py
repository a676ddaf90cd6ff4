"""The parts of a command: options, fields, requests, results, and the registry of commands."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import importlib
import inspect
import os
import pkgutil
import shlex
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from semsig_gis.core import InputError, installed_commands

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from contextlib import AbstractContextManager

    from semsig_gis.core import Table

GROUPS = ("Prepare", "Ask", "Look", "Measure", "Research")
"""Headings under which front ends list the commands, in their order."""

Advance = Callable[[int, int], None]
"""Receives the amount of finished work and the total."""


class Reporter(Protocol):
    """Shows the progress and the remarks of a command while it runs."""

    def progress(
        self, label: str, *, unit: Literal["steps", "bytes"] = "steps"
    ) -> AbstractContextManager[Advance]:
        """Show the progress of the work in a block."""

    def remark(self, text: str) -> None:
        """Show a sentence that is not part of the result."""


class _Silent:
    """A reporter that shows nothing."""

    def progress(
        self,
        _label: str,
        *,
        unit: Literal["steps", "bytes"] = "steps",  # noqa: ARG002 - as in `Reporter`
    ) -> AbstractContextManager[Advance]:
        return contextlib.nullcontext(lambda _completed, _total: None)

    def remark(self, _text: str) -> None:
        pass


SILENT: Reporter = _Silent()


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a command returns.

    `values` returns plain values for JSON, or with `stream` an iterator of them, one for each
    line. `summary` has what a person reads: a sentence or a few lines, and a table only if the
    answer is a list; None: the result has no such form. `tables` has the details, which are shown
    on demand. Both may be computed while they are read. `files` are the written files by what
    they contain, and `notes` are sentences to show above them.
    """

    values: Callable[[], Any] | None = None
    summary: Iterable[str | Table] | None = None
    tables: Iterable[str | Table] = ()
    files: Mapping[str, Path] = dataclasses.field(default_factory=dict)
    stream: bool = False
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Option:
    """What a front end needs to offer a field of a request.

    Parameters
    ----------
    help : str
        One or two sentences for the user.
    title : str, optional
        A few words for dialogs; by default the name of the field.
    unit : str, optional
        Unit of a number, such as ``m`` or ``°``.
    low, high : float, optional
        Smallest and largest number.
    metavar : str, optional
        Word for the value in the help, such as ``LAT,LON,SIGMA``; by default from the type and
        the unit.
    default : str, optional
        Description of the default if it is not a plain value.
    positional : bool, default False
        Whether the command line takes the value without the name of an option.
    advanced : bool, default False
        Whether only `--help-all` and the advanced part of dialogs show it.
    reads : bool, default False
        Whether the value is a file or folder that is read.
    writes : str or tuple of str, optional
        Suffixes of the file that is written, the usual one first; ``""`` accepts any, also a
        folder.
    suggestions : callable, optional
        Returns names that the value may have, among others, for completion.
    short : str, optional
        Short name on the command line, such as ``-q``.
    panel : str, optional
        One of `PANELS`, the heading in the help; by default that of output for a file that is
        written.
    """

    help: str
    title: str = dataclasses.field(default="", kw_only=True)
    unit: str = dataclasses.field(default="", kw_only=True)
    low: float | None = dataclasses.field(default=None, kw_only=True)
    high: float | None = dataclasses.field(default=None, kw_only=True)
    metavar: str = dataclasses.field(default="", kw_only=True)
    default: str = dataclasses.field(default="", kw_only=True)
    positional: bool = dataclasses.field(default=False, kw_only=True)
    advanced: bool = dataclasses.field(default=False, kw_only=True)
    reads: bool = dataclasses.field(default=False, kw_only=True)
    writes: str | tuple[str, ...] | None = dataclasses.field(default=None, kw_only=True)
    suggestions: Callable[[], Sequence[str]] | None = dataclasses.field(default=None, kw_only=True)
    short: str = dataclasses.field(default="", kw_only=True)
    panel: str = dataclasses.field(default="", kw_only=True)


ARGUMENTS, SAW, KNOW, SEARCH, OPTIONS, OUTPUT = PANELS = (
    "Arguments",
    "What you saw",
    "What you know",
    "How it is searched",
    "Options",
    "Output",
)
"""Headings of the options in the help, in their order."""


METAVARS = {"m": "METRES", "°": "DEGREES", "s": "SECONDS", "years": "YEARS"}


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field of a request: its option with its name, type and default.

    `kind` is the type of one value: bool, int, float, str or Path. `choices` are its only values.
    """

    name: str
    option: Option
    kind: type
    annotation: Any
    choices: tuple[str, ...] = ()
    many: bool = False
    optional: bool = False  # None is accepted
    required: bool = False
    default: Any = None

    @property
    def flag(self) -> str:
        """The name on the command line."""
        name = self.name.strip("_").replace("_", "-")
        return name if self.option.positional else f"--{name}"

    @property
    def suffixes(self) -> tuple[str, ...]:
        """The suffixes of the file that is written; empty if none is."""
        writes = self.option.writes
        return (writes,) if isinstance(writes, str) else writes or ()

    @property
    def panel(self) -> str:
        """The heading of the option in the help."""
        if self.option.positional:
            return ARGUMENTS
        return self.option.panel or (OUTPUT if self.suffixes else OPTIONS)

    @property
    def title(self) -> str:
        """The title in dialogs."""
        return self.option.title or self.name.strip("_").replace("_", " ").capitalize()

    @property
    def metavar(self) -> str:
        """The word for the value in the help."""
        option = self.option
        if option.metavar:
            return option.metavar
        if self.choices:
            return "|".join(self.choices)
        if self.kind is Path:
            return "FILE"
        if self.kind in {int, float}:
            return METAVARS.get(option.unit, "NUMBER")
        return "TEXT"

    @property
    def opposite(self) -> str:
        """The name on the command line that turns a choice off; empty for others."""
        is_choice = self.kind is bool and (self.optional or self.default)
        return self.flag.replace("--", "--no-", 1) if is_choice else ""

    @property
    def usage(self) -> str:
        """The name on the command line with the word for the value."""
        if self.option.positional:
            name = f"{self.flag}..." if self.many else self.flag
            return name if self.required else f"[{name}]"
        names = ", ".join(filter(None, [self.option.short, self.flag]))
        if self.kind is not bool:
            return f"{names} {self.metavar}"
        return f"{names}, {self.opposite}" if self.opposite else names

    @property
    def details(self) -> list[str]:
        """The default, the range, and whether the value is required, for the help."""
        option = self.option
        default = option.default
        hidden = self.default is None or self.default is False or self.default == ""
        if not default and not hidden:
            default = self.flag if self.kind is bool else _text(self.default)
        details = [f"default: {default}"] if default else []
        if option.low is not None and option.high is not None:
            details.append(f"from {option.low:,} to {option.high:,}")
        return [*details, "required"] if self.required else details

    def words(self, value: Any) -> list[str]:  # noqa: ANN401 - as many types as fields
        """Return a value as words of a command line; none for the default."""
        if value == self.default or value is None:
            return []
        if self.option.positional:
            return [str(item) for item in (value if self.many else [value])]
        if self.kind is bool:
            return [self.flag if value else self.opposite]
        items = value if self.many else [value]
        return [word for item in items for word in (self.flag, _text(item))]


def _text(value: object) -> str:
    return f"{value:.10g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command: its name, its group, the class of its requests and the type of its values.

    `examples` are command lines.
    """

    name: str
    title: str
    group: str
    order: int
    request: type[Any]
    returns: Any
    examples: tuple[str, ...] = ()

    @property
    def help(self) -> str:
        """The description: a first line, and paragraphs."""
        return inspect.getdoc(self.request) or ""

    @property
    def line(self) -> str:
        """The first line of the description."""
        return self.help.partition("\n")[0]

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields of a request, inputs without a name first."""
        return fields_of(self.request)


def fields_of(request: type[Any]) -> tuple[Field, ...]:
    """Return the fields of a class of requests, positional fields first."""
    # Without `localns`, names in a lambda of an annotation would be looked up in the class.
    hints = get_type_hints(request, localns={}, include_extras=True)
    fields = [_field(field, hints[field.name]) for field in dataclasses.fields(request)]
    return tuple(sorted(fields, key=lambda field: not field.option.positional))


def _field(field: dataclasses.Field[Any], hint: Any) -> Field:  # noqa: ANN401 - any annotation
    option = next(item for item in hint.__metadata__ if isinstance(item, Option))
    annotation = plain = get_args(hint)[0]
    optional = get_origin(plain) in {Union, types.UnionType}
    if optional:
        (plain,) = (item for item in get_args(plain) if item is not type(None))
    many = get_origin(plain) in {list, tuple}
    if many:
        plain = get_args(plain)[0]
    choices = get_args(plain) if get_origin(plain) is Literal else ()
    required = field.default is dataclasses.MISSING
    return Field(
        name=field.name,
        option=option,
        kind=str if choices else plain,
        annotation=annotation,
        choices=choices,
        many=many,
        optional=optional,
        required=required,
        default=None if required else field.default,
    )


_COMMANDS: dict[str, Command] = {}
T = TypeVar("T")


def command(
    name: str,
    *,
    title: str,
    group: str,
    order: int,
    returns: Any = None,  # noqa: ANN401 - any type
    examples: tuple[str, ...] = (),
) -> Callable[[type[T]], type[T]]:
    """Return a decorator that registers a frozen dataclass as a command.

    The class has fields that are annotated with an `Option`, and a method ``run(reporter)`` that
    returns a `Result`. Its docstring is the help. `order` sorts the commands of a group, and
    `returns` is the type of the values of the result, usually a TypedDict, or its
    ``"module:name"`` if the module is slow to import; None: it has none. `examples` are command
    lines for the help.
    """
    if group not in GROUPS:
        raise InputError(f"{group!r} is no group of commands; give one of {', '.join(GROUPS)}.")

    def register(request: type[T]) -> type[T]:
        other = _COMMANDS.get(name)
        if other is not None and other.request.__module__ != request.__module__:
            raise InputError(
                f"the command {name!r} is in {other.request.__module__} and in "
                f"{request.__module__}; rename one of them."
            )
        _COMMANDS[name] = Command(
            name=name,
            title=title,
            group=group,
            order=order,
            request=request,
            returns=returns,
            examples=examples,
        )
        return request

    return register


def commands(*, installed: bool = True) -> Mapping[str, Command]:
    """Return all commands by name, in the order of their groups.

    Those of other packages are classes in the entry points ``semsig_gis.commands``, which
    `command` decorates; they are imported only if `installed`.
    """
    for module in _modules():
        importlib.import_module(module)
    if installed:
        _import_installed_commands()
    ordered = sorted(
        _COMMANDS.values(), key=lambda item: (GROUPS.index(item.group), item.order, item.name)
    )
    return {item.name: item for item in ordered}


def find_command(name: str) -> Command:
    """Return a command by its name, also one of another package; KeyError for an unknown name.

    Of this package, only the module is imported that is called like the command.
    """
    for module in _modules():
        if module.endswith((f".{name}", f".{name}_")):
            importlib.import_module(module)
    return _COMMANDS[name] if name in _COMMANDS else commands()[name]


@functools.cache
def _modules() -> list[str]:
    """Return the modules of this package."""
    package = importlib.import_module("semsig_gis.commands")
    return [
        f"{package.__name__}.{module.name}" for module in pkgutil.iter_modules(package.__path__)
    ]


@functools.cache
def _import_installed_commands() -> None:
    installed_commands(reserved=tuple(_COMMANDS))


def run_command(request: Any, reporter: Reporter = SILENT) -> Result:  # noqa: ANN401 - any request
    """Check the files of a request, run it, and return the result.

    Raises InputError if a file would be overwritten that the request reads or writes as well, the
    name of a file to write has another suffix, or its folder does not exist.
    """
    fields = fields_of(type(request))
    values = {field.name: getattr(request, field.name) for field in fields}
    used = {
        os.path.realpath(path)
        for field in fields
        if field.option.reads
        for path in _paths(values[field.name])
    }
    written = [
        (values[field.name], field.suffixes)
        for field in fields
        if field.suffixes and values[field.name] is not None
    ]
    for path, _ in written:
        if os.path.realpath(path) in used:
            raise InputError(
                f"{path} would be written, but this command uses it for something else as "
                "well; give another name."
            )
        used.add(os.path.realpath(path))
    for path, suffixes in written:
        fits = path.suffix.lower() in suffixes or "" in suffixes
        if not fits and not path.is_dir():
            raise InputError(
                f"{path} cannot be written; the name must end in {' or '.join(suffixes)}."
            )
        if suffixes != ("",) and not path.parent.is_dir():  # a folder of results is made
            raise InputError(
                f"{path} cannot be written, because there is no folder {path.parent}; make it, or "
                "give another name."
            )
    result: Result = request.run(reporter)
    return result


def _paths(value: Any) -> Iterator[str | Path]:  # noqa: ANN401 - the value of any field
    """Yield the paths in the value of a field that is read; - is the standard input."""
    for path in value if isinstance(value, (list, tuple)) else [value]:
        if path is not None and path != "-":
            yield path


def command_line(request: Any) -> str:  # noqa: ANN401 - any request
    """Return the line for a shell that runs a request.

    Examples
    --------
    >>> from semsig_gis.commands.info import Info
    >>> command_line(Info(database=Path("my city.parquet")))
    "semsig info 'my city.parquet'"
    """
    (name,) = (item.name for item in _COMMANDS.values() if item.request is type(request))
    words = [
        word
        for field in fields_of(type(request))
        for word in field.words(getattr(request, field.name))
    ]
    return shlex.join(["semsig", name, *words])
