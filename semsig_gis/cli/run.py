"""Run the command that the arguments name."""

from __future__ import annotations

import sys
from typing import Any

import typer

from semsig_gis.cli.commands import app
from semsig_gis.core import InputError

__all__ = ["run"]

INTERRUPTED = 130


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
