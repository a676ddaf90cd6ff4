"""The command itself, and what several of its subcommands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semsig_gis.cli.console import print_rows, remark
from semsig_gis.core.errors import DatabaseError, InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.database.city import City
    from semsig_gis.evaluation.identify.result import Identifiability
    from semsig_gis.evaluation.result import Evaluation
    from semsig_gis.reports.tables import Table


app = typer.Typer(
    name="semsig",
    help="Tell where in a city a view was taken from the street objects in it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Database = Annotated[Path, typer.Argument(help="Signature database written by `semsig build`.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

MethodText = Annotated[
    str,
    typer.Option(
        "--method",
        help="Rank by likelihood, or by distance as TYPES+ANGLES (edit, histogram, jaccard), "
        "types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or "
        ":weights=INSERT/DELETE/SUBSTITUTE.",
    ),
]

Workers = Annotated[int, typer.Option(help="Number of processes on this machine.")]
Scheduler = Annotated[str | None, typer.Option(help="Dask scheduler, as tcp://HOST:PORT.")]
LIKELIHOOD = "likelihood"
"""What `--method` says for the likelihood method."""


def keep_inputs(*written: Path | None, read: Iterable[str | Path | None]) -> None:
    """Refuse to write over a file that is read, or two results to one file."""
    taken = {os.path.realpath(path) for path in read if path is not None}
    for path in written:
        if path is None:
            continue
        if os.path.realpath(path) in taken:
            msg = (
                f"{path} is to be written, but it is also another file of this command; "
                "give it a name of its own."
            )
            raise InputError(msg)
        taken.add(os.path.realpath(path))


def require_suffix(suffix: str, *written: Path | None) -> None:
    """Refuse a name that says that a file is of another kind than it will be."""
    for path in written:
        if path is not None and path.suffix.lower() != suffix and not path.is_dir():
            msg = f"{path} cannot be written; the name must end in {suffix}."
            raise InputError(msg)


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option, which stand between commas."""
    try:
        return [float(part) for part in text.split(",")] if text.strip() else []
    except ValueError as error:
        msg = f"{option} was given as {text!r}; give numbers with commas between them."
        raise InputError(msg) from error


def known_identifiability(city: City) -> Identifiability | None:
    """Return what the columns of a database tell; None, and say so, where they do not fit it."""
    from semsig_gis.evaluation.identify.result import open_identifiability

    try:
        return open_identifiability(city.database, city.path)
    except DatabaseError as error:
        remark(str(error))
        return None


def tell_if_online(offline: bool) -> None:  # noqa: FBT001
    """Remark that a map needs a network, where it does."""
    if not offline:
        remark("the map takes Leaflet from the web, so it needs a network to be seen")


def print_evaluation(evaluation: Evaluation) -> None:
    """Print the tables of an evaluation."""
    from semsig_gis.reports.evaluation import evaluation_tables

    for table in evaluation_tables(evaluation):
        print_table(table)


def print_table(table: Table) -> None:
    """Print a table with its note."""
    print_rows(table.title, table.columns, table.rows)
    if table.note:
        typer.echo(table.note)
