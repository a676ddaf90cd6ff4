"""Parse, call, print: a module a command.

Results go to standard output, progress and remarks to standard error. The exit code is 0 when the
work is done, 2 when the input cannot be used (with one plain sentence), 1 when the fault is ours.
Heavy modules are imported by the commands that need them, so that the help appears at once.
"""

from __future__ import annotations

import sys
import warnings
from typing import Annotated

import typer

from semsig_gis import __version__
from semsig_gis.cli.console import app, remark, stop_with_supervisor, supervised

# The order of these imports is that of the help.
# isort: off
from semsig_gis.cli import (  # noqa: F401
    demo,
    load,
    build,
    maps,
    localize,
    learn,
    evaluate,
    export,
)

# isort: on
from semsig_gis.core.errors import SemsigError


def main() -> None:
    """Run the command; an unusable input ends it with one sentence and exit code 2."""
    if supervised():
        stop_with_supervisor()
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            app()
        except SemsigError as error:
            remark(str(error))
            sys.exit(2)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """Show a warning as one sentence, without the line of code that it comes from."""
    remark(str(message))


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer calls it so
    if wanted:
        typer.echo(f"semsig {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Tell where in a city a view was taken from the street objects in it."""
