"""The typer application, made from the commands, and the printing of their results."""

from __future__ import annotations

import inspect
from typing import Annotated, Any

import typer

from semsig_gis.cli.console import REPORTER, app, print_json, print_table, remark, say, talk
from semsig_gis.commands import Command, Field, Result, commands, run_command
from semsig_gis.core import InputError


def _show_all(context: typer.Context, value: bool) -> None:  # noqa: FBT001 - typer calls it so
    """Print the help with the advanced options."""
    if value:
        for parameter in context.command.params:
            parameter.hidden = False  # type: ignore[attr-defined]
        say(context.get_help())
        raise typer.Exit


SHARED = {
    "as_json": (typer.Option("--json", help="Print JSON instead of tables."), False),
    "quiet": (
        typer.Option("--quiet", "-q", help="Print results only, without progress and remarks."),
        False,
    ),
    "verbose": (
        typer.Option("--verbose", "-v", help="Report each step and how long it took."),
        False,
    ),
    "help_all": (
        typer.Option(
            "--help-all", is_eager=True, callback=_show_all, help="Show all options and exit."
        ),
        False,
    ),
}
"""Options of the command line that are not fields of a request."""


def register(command: Command) -> None:
    """Add a command to the application."""
    shared = ["quiet", "verbose"]
    if command.returns is not None:
        shared.insert(0, "as_json")
    if any(field.option.advanced for field in command.fields):
        shared.append("help_all")
    parameters = [_parameter(field) for field in command.fields]
    parameters += [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=SHARED[name][1],
            annotation=Annotated[bool, SHARED[name][0]],
        )
        for name in shared
    ]

    def run(
        *,
        quiet: bool,
        verbose: bool,
        as_json: bool = False,
        help_all: bool = False,  # noqa: ARG001 - its callback prints
        **values: Any,  # noqa: ANN401 - any fields
    ) -> None:
        if quiet and verbose:
            raise InputError("--quiet and --verbose were given; give one of them.")
        before = talk.set("quiet" if quiet else "verbose" if verbose else "plain")
        try:
            show(run_command(command.request(**values), REPORTER), as_json=as_json)
        finally:
            talk.reset(before)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    typer.Typer.command(app, command.name, help=command.help)(run)


def _parameter(field: Field) -> inspect.Parameter:
    """Return a field as a parameter that typer reads."""
    option = field.option
    text = option.help + (f"  [default: {option.default}]" if option.default else "")
    about: dict[str, Any] = {
        "help": text,
        "metavar": None if field.kind is bool else field.metavar,
        "min": option.low,
        "max": option.high,
        "show_default": not option.default,
    }
    if (suggestions := option.suggestions) is not None:

        def complete(incomplete: str) -> list[str]:
            return [name for name in suggestions() if name.startswith(incomplete)]

        about["autocompletion"] = complete
    if field.kind is int:
        about |= {
            name: None if about[name] is None else int(about[name]) for name in ("min", "max")
        }
    if option.positional:
        about["metavar"] = option.metavar or None
        parameter = typer.Argument(**about)
    else:
        names = [field.flag, option.short] if option.short else [field.flag]
        if field.kind is bool and (field.optional or field.default):
            names[0] += f"/{field.flag.replace('--', '--no-', 1)}"
        parameter = typer.Option(*names, hidden=option.advanced, **about)
    return inspect.Parameter(
        field.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if field.required else field.default,
        annotation=Annotated[field.annotation, parameter],
    )


def show(result: Result, *, as_json: bool) -> None:
    """Print a result on standard output, as JSON or as text, and its notes."""
    if result.values is None or (result.text is not None and not as_json):
        for part in result.text or ():
            if isinstance(part, str):
                say(part)
            else:
                print_table(part)
    elif result.stream:
        for value in result.values():
            print_json(value, indent=None)
    else:
        print_json(result.values())
    for note in result.notes:
        remark(note)


for _command in commands().values():
    register(_command)
