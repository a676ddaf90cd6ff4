"""The typer application, made from the commands: parse the arguments, run, print the result."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

import semsig_gis.cli.serve  # noqa: F401 - its command needs a package above `commands`
from semsig_gis import __version__
from semsig_gis.cli.console import (
    REPORTER,
    print_json,
    print_table,
    remark,
    say,
    say_sentence,
    talk,
)
from semsig_gis.commands import (
    GROUPS,
    OUTPUT,
    PANELS,
    Command,
    Field,
    Option,
    Result,
    commands,
    fields_of,
    find_command,
    run_command,
)
from semsig_gis.core import InputError, installed_command_names

INTERRUPTED = 130
ABOUT = "Find where in a city a view was taken, from the street objects in it."
PLAIN: dict[str, Any] = {"pretty_exceptions_enable": False, "rich_markup_mode": None}
SHOW_ALL = "semsig_gis.show_all"


def _show_all(context: typer.Context, value: bool) -> None:  # noqa: FBT001 - typer calls it so
    """Print the help with the advanced options."""
    if value:
        context.meta[SHOW_ALL] = True
        say(context.get_help())
        raise typer.Exit


HELP_ALL = typer.Option(
    "--help-all", is_eager=True, callback=_show_all, help="Show all options and exit."
)


@dataclass(frozen=True, kw_only=True)
class Printing:
    """Options of the command line that are not fields of a request."""

    json: Annotated[bool, Option("Print JSON for other programs.", panel=OUTPUT)] = False
    quiet: Annotated[
        bool,
        Option(
            "Print only the paths of the written files, or only the result if there are none.",
            short="-q",
            panel=OUTPUT,
        ),
    ] = False
    tables: Annotated[bool, Option("Print tables with the details as well.", panel=OUTPUT)] = False
    verbose: Annotated[
        bool,
        Option(
            "Print the tables, and report each step and how long it took.",
            short="-v",
            panel=OUTPUT,
        ),
    ] = False


def printing_of(command: Command) -> list[Field]:
    """Return the options of a command for what is printed: --json only if it has values."""
    fields = fields_of(Printing)
    return [field for field in fields if command.returns is not None or field.name != "json"]


class _Command(TyperCommand):
    """A command: its help has the usual options, and words for values instead of types."""

    fields: Mapping[str, Field]
    examples: tuple[str, ...]

    def format_options(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - of typer
        sections: dict[str, list[tuple[str, str]]] = {panel: [] for panel in (*PANELS, "Help")}
        for parameter in self.get_params(ctx):
            field = self.fields.get(parameter.name)
            if field is None:  # --help and --help-all
                sections["Help"].append(parameter.get_help_record(ctx) or ("", ""))
            elif not field.option.advanced or SHOW_ALL in ctx.meta:
                details = f"  [{'; '.join(field.details)}]" if field.details else ""
                sections[field.panel].append((field.usage, field.option.help + details))
        _write_sections(formatter, sections)
        if self.examples:
            with formatter.section("Examples"):
                for example in self.examples:
                    formatter.write_text(example)


class _Commands(Mapping[str, Any]):
    """The commands as typer's, made when they are looked up."""

    def __init__(self) -> None:
        self.parsed: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - of typer
        if name not in self.parsed:
            self.parsed[name] = _typer_command(find_command(name))
        return self.parsed[name]

    def __iter__(self) -> Iterator[str]:
        names = [*commands(installed=False), *installed_command_names()]
        return iter(dict.fromkeys(names))

    def __len__(self) -> int:
        return sum(1 for _ in self)


class _Group(TyperGroup):
    """All commands; the help lists them by group."""

    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - of typer
        super().__init__(**options)
        self.commands = _Commands()  # type: ignore[assignment]

    def list_commands(self, _ctx: object) -> list[str]:
        return [*self.commands]

    def format_commands(self, _ctx: object, formatter: Any) -> None:  # noqa: ANN401 - of typer
        here = commands(installed=False)
        width = max(map(len, self.commands))
        sections: dict[str, list[tuple[str, str]]] = {group: [] for group in GROUPS}
        for item in here.values():
            sections[item.group].append((item.name.ljust(width), item.line))
        sections["Other packages"] = [
            (name.ljust(width), f"Command of {package}.")
            for name, package in installed_command_names().items()
            if name not in here
        ]
        _write_sections(formatter, sections)


def _write_sections(formatter: Any, sections: Mapping[str, list[tuple[str, str]]]) -> None:  # noqa: ANN401
    """Write the sections of a help that are not empty."""
    for heading, rows in sections.items():
        if rows:
            with formatter.section(heading):
                formatter.write_dl(rows)


app = typer.Typer(name="semsig", cls=_Group, help=ABOUT, **PLAIN)


def _version(value: bool) -> None:  # noqa: FBT001 - typer calls it so
    if value:
        say(f"semsig {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def _typer_command(command: Command) -> Any:  # noqa: ANN401 - of typer
    """Return a command as typer's."""

    def run(**values: Any) -> None:  # noqa: ANN401 - any fields
        values.pop("help_all", None)  # its callback prints
        printing = Printing(**{field.name: values.pop(field.name) for field in shared})
        for name in ("verbose", "tables"):
            if printing.quiet and getattr(printing, name):
                raise InputError(f"--quiet and --{name} were given; give one of them.")
        before = talk.set("quiet" if printing.quiet else "verbose" if printing.verbose else "plain")
        try:
            show(run_command(command.request(**values), REPORTER), printing)
        finally:
            talk.reset(before)

    shared = printing_of(command)
    fields = [*command.fields, *shared]
    parameters = [*map(_parameter, fields)]
    if any(field.option.advanced for field in fields):
        help_all = inspect.Parameter(
            "help_all",
            inspect.Parameter.KEYWORD_ONLY,
            default=False,
            annotation=Annotated[bool, HELP_ALL],
        )
        parameters.append(help_all)
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    single = typer.Typer(add_completion=False, **PLAIN)
    single.command(command.name, cls=_Command, help=command.help)(run)
    parsed: Any = typer.main.get_command(single)
    parsed.fields = {field.name: field for field in fields}
    parsed.examples = command.examples
    return parsed


def _parameter(field: Field) -> inspect.Parameter:
    """Return a field as a parameter that typer reads."""
    option = field.option
    whole = field.kind is int
    about: dict[str, Any] = {
        "metavar": None if option.positional else field.metavar,
        "min": int(option.low) if whole and option.low is not None else option.low,
        "max": int(option.high) if whole and option.high is not None else option.high,
    }
    if (suggestions := option.suggestions) is not None:

        def complete(incomplete: str) -> list[str]:
            return [name for name in suggestions() if name.startswith(incomplete)]

        about["autocompletion"] = complete
    if option.positional:
        parameter = typer.Argument(**about)
    else:
        names = [field.flag, option.short] if option.short else [field.flag]
        if field.kind is bool:
            about["metavar"] = None
            if field.opposite:
                names[0] += f"/{field.opposite}"
        parameter = typer.Option(*names, **about)
    return inspect.Parameter(
        field.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if field.required else field.default,
        annotation=Annotated[field.annotation, parameter],
    )


def show(result: Result, printing: Printing) -> None:
    """Print a result on standard output, as JSON or as text, and its notes."""
    as_text = result.values is None or (result.summary is not None and not printing.json)
    if not as_text:
        _print_values(result)
    elif not (printing.quiet and result.files):
        details = result.tables if printing.tables or printing.verbose else ()
        for part in (*(result.summary or ()), *details):
            if not isinstance(part, str):
                print_table(part)
            elif result.values is None:
                say(part)  # a text for a file
            else:
                say_sentence(part)
    for note in result.notes:
        remark(note)
    if as_text:
        for what, path in result.files.items():
            say(path if printing.quiet else f"{what}: {path}")


def _print_values(result: Result) -> None:
    """Print the values of a result as JSON, or as a line of it for each of them."""
    if result.values is not None and result.stream:
        for value in result.values():
            print_json(value, indent=None)
    elif result.values is not None:
        print_json(result.values())


def run() -> int:
    """Run the command that the arguments name, and return its exit code.

    Raises InputError for an unknown command or an invalid value of an option.
    """
    arguments = None if sys.argv[1:] else ["--help"]
    try:
        code = app(arguments, prog_name="semsig", standalone_mode=False)
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        command = "semsig" if context is None else context.command_path
        fault = error.format_message().rstrip(".?").replace(". ", "; ")
        raise InputError(_out_of_range(error) or f"{fault}; see {command} --help.") from error
    except SystemExit as end:
        if end.code:  # typer exits so if the reader has closed the output
            raise BrokenPipeError from end
        return 0  # shell completion
    if code == INTERRUPTED:  # typer returns it after the interrupt key
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _out_of_range(error: typer.TyperException) -> str:
    """Return the message for an option value out of range; an empty text for other errors."""
    option: Any = getattr(error, "param", None)
    least, most = getattr(option, "min", None), getattr(option, "max", None)
    faults: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()  # of pydantic
    if not faults or least is None or most is None:
        return ""
    kind, value = faults[0]["type"], faults[0]["input"]
    number = "a whole number" if kind.startswith("int") else "a number"
    shown = repr(value) if kind.endswith("parsing") else value
    return f"{option.opts[0]} was given as {shown}; give {number} from {least:,} to {most:,}."
