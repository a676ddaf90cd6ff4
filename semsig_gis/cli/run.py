"""What runs the command that the arguments name."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import typer

from semsig_gis.cli.console import app
from semsig_gis.core import InputError

__all__ = ["run"]

# Modules called as a command of theirs, which needs no other one; all together load slowly.
ALONE = {
    *("build", "demo", "evaluate", "export", "learn", "load"),
    *("localize", "route", "serve", "suggest", "view"),
}
INTERRUPTED = 130


def run() -> int:
    """Run the command that the arguments name, and return its exit code.

    InputError if they name none, or an option has a value that it does not take.
    """
    first = sys.argv[1] if sys.argv[1:] else "--help"
    importlib.import_module(f"semsig_gis.cli.{first if first in ALONE else 'commands'}")
    try:
        code = app(None if sys.argv[1:] else [first], prog_name="semsig", standalone_mode=False)
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        command = "semsig" if context is None else context.command_path
        fault = error.format_message().rstrip(".?").replace(". ", "; ")
        raise InputError(_out_of_range(error) or f"{fault}; see {command} --help.") from error
    except SystemExit as end:
        if end.code:  # so typer ends where nobody reads the output any more
            raise BrokenPipeError from end
        return 0  # a script of completion, or what completes a line
    if code == INTERRUPTED:  # which typer makes of the interrupt key
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _out_of_range(error: typer.TyperException) -> str:
    """Return which number was given and which are accepted, or nothing if it is another fault."""
    option: Any = getattr(error, "param", None)
    least, most = getattr(option, "min", None), getattr(option, "max", None)
    faults: list[dict[str, Any]] = getattr(error.__cause__, "errors", list)()  # of pydantic
    if not faults or least is None or most is None:
        return ""
    kind, given = faults[0]["type"], faults[0]["input"]
    number = "a whole number" if kind.startswith("int") else "a number"
    shown = repr(given) if kind.endswith("parsing") else given
    return f"{option.opts[0]} was given as {shown}; give {number} from {least:,} to {most:,}."
