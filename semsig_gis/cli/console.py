"""The typer application, its output, and options and checks that several commands share."""

from __future__ import annotations

import contextlib
import functools
import inspect
import json
import os
import re
import shlex
import signal
import sys
import threading
import time
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import typer

from semsig_gis import __version__
from semsig_gis.core import (
    DEFAULT_METHOD,
    PAPER_METHOD,
    DatabaseError,
    InputError,
    visible,
    visible_lines,
)
from semsig_gis.localization import METRICS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from semsig_gis.core import Table
    from semsig_gis.database import City
    from semsig_gis.evaluation import Identifiability


VARIABLE = "SEMSIG_SUPERVISED"


def supervised() -> bool:
    """Whether another program supervises this one."""
    return bool(os.environ.get(VARIABLE))


def progress_line(label: str, percent: int) -> str:
    """Return a line of progress for a supervisor: ``semsig progress 40% building``."""
    return f"semsig progress {percent}% {label}"


def stop_with_supervisor() -> None:
    """Interrupt this program when its standard input ends."""
    # A background process may have inherited that interrupts are ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Read a copy and replace the original with the null device: on Windows, a library that checks
    # the type of the standard input while it is imported would wait for the read to end.
    standard_input, null = os.dup(0), os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    threading.Thread(target=_interrupt_at_end_of, args=(standard_input,), daemon=True).start()


def _interrupt_at_end_of(descriptor: int) -> None:
    """Interrupt the main thread when a file descriptor has no more data."""
    # os.read, since a file object would hold its lock when the interpreter ends.
    while os.read(descriptor, 1):
        pass
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


PATIENCE_S = 2.0  # a progress bar appears only if the work takes longer

_AMOUNT = r"[-+±]?(?:\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?|infinite)(?: ?(?:°|%|m|km|km²|m²|MB|s|ms))?"
NUMBER = re.compile(rf"{_AMOUNT}(?:(?:-| to ){_AMOUNT})?")
"""A number in a table with its unit, or the two ends of an interval."""

LARGEST_COUNT = 10**9  # larger whole numbers are identifiers and get no thousands separators


def say(text: object, *, err: bool = False, end: str = "\n") -> None:
    """Print text on standard output or standard error, with escape sequences made visible.

    Names and messages from files may contain them (see `visible`).
    """
    shown = visible_lines([str(text)])[0] + end
    typer.echo(shown, err=err, nl=False)  # noqa: TID251 - the only place


Talk = Literal["quiet", "plain", "verbose"]
talk: ContextVar[Talk] = ContextVar("talk", default="plain")
"""How much is printed in addition to results, from `--quiet` and `--verbose`."""


def remark(text: str) -> None:
    """Print a sentence on standard error after ``semsig:``, unless `--quiet` was given."""
    if talk.get() != "quiet":
        complain(text)


def complain(text: str) -> None:
    """Print a sentence on standard error in any case: why the command ends."""
    say(f"semsig: {visible(text)}", err=True)


def print_json(value: Any, *, indent: int | None = 2) -> None:  # noqa: ANN401 - any JSON
    """Print plain values without NaN or infinity as JSON on standard output.

    ``indent=None`` gives a single line. Characters that the output cannot encode are escaped.
    """
    dump = functools.partial(json.dumps, value, indent=indent, allow_nan=False)
    text = dump(ensure_ascii=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = dump(ensure_ascii=True)
    say(text)


def print_rows(title: str, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Print a table on standard output; markup and escape sequences in it have no effect.

    Whole numbers get thousands separators. Columns with only numbers are right-aligned.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(visible(title)), title_justify="left")
    cells = [[_cell_text(cell) for cell in row] for row in rows]
    # Escape all cells in one call, which is faster.
    shown = iter(visible_lines(text for row in cells for text in row))
    texts = [[next(shown) for _ in row] for row in cells]
    for number, name in enumerate(header):
        column = [row[number] for row in texts if number < len(row) and row[number]]
        right = bool(column) and all(map(NUMBER.fullmatch, column))
        table.add_column(Text(visible(name)), overflow="fold", justify="right" if right else "left")
    for row in texts:
        table.add_row(*map(Text, row))
    console = Console(file=sys.stdout)
    if not console.is_terminal:
        # A file or a pipe has no width; make the table as wide as it needs.
        wide = Console(file=sys.stdout, width=10_000)
        width = max(wide.measure(table).maximum, wide.measure(title).maximum)
        console = Console(file=sys.stdout, width=width)
    console.print(table)


def _cell_text(cell: object) -> str:
    counts = isinstance(cell, int) and abs(cell) < LARGEST_COUNT
    return f"{cell:,}" if counts else str(cell)


@contextlib.contextmanager
def progress(
    label: str, *, unit: Literal["steps", "bytes"] = "steps"
) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on standard error if the work in the block takes a while.

    The block gets a function to call with the amount of finished work and the total. A program
    that supervises this one gets lines instead. With `--verbose`, a line is printed at the
    beginning and at the end of the work.
    """
    if supervised():
        yield _progress_lines(label)
        return
    if talk.get() == "quiet":
        yield lambda _count, _total: None
        return
    verbose = talk.get() == "verbose"
    if verbose:
        remark(f"{label} ...")
    start = time.perf_counter()
    from rich import progress as parts
    from rich.console import Console

    screen = Console(stderr=True)
    bar = parts.Progress(
        parts.TextColumn("{task.description}"),
        parts.BarColumn(),
        parts.TimeElapsedColumn(),
        *(
            (parts.DownloadColumn(), parts.TransferSpeedColumn())
            if unit == "bytes"
            else (parts.TextColumn("{task.fields[count]}"), parts.TimeRemainingColumn())
        ),
        console=screen,
        transient=True,
        disable=not screen.is_terminal,
    )
    task = bar.add_task(label, total=None, count="")

    def advance(completed: int, total: int) -> None:
        count = f"{completed:,} of {total:,}" if total else f"{completed:,}"
        bar.update(task, completed=completed, total=total or None, count=count)

    patience = threading.Timer(PATIENCE_S, bar.start)
    patience.daemon = True
    patience.start()
    try:
        yield advance
    finally:
        patience.cancel()
        # Stopping a bar that was never shown would print an empty line.
        if bar.live.is_started:
            bar.stop()
    if verbose:
        remark(f"{label}: {time.perf_counter() - start:.1f} s")


def _progress_lines(label: str) -> Callable[[int, int], None]:
    """Return a function that prints a line for every percent of the work."""
    last_percent = -1

    def advance(completed: int, total: int) -> None:
        nonlocal last_percent
        percent = completed * 100 // total if total else 0
        if percent != last_percent:
            last_percent = percent
            say(progress_line(label, percent), err=True)

    advance(0, 1)
    return advance


Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print results only, without progress and remarks.")
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Report each step and how long it took.")
]


class Commands(typer.Typer):
    """A typer application that adds `--quiet` and `--verbose` to each command."""

    def command(  # type: ignore[override]
        self,
        name: str | None = None,
        *,
        help: str | None = None,  # noqa: A002 - as typer's
    ) -> Callable[[Callable[..., None]], Callable[..., None]]:
        """Return a decorator that registers a function as a command with these two options."""
        register = super().command(name, help=help)

        def wrap(function: Callable[..., None]) -> Callable[..., None]:
            @functools.wraps(function)
            def run(*, quiet: bool, verbose: bool, **values: Any) -> None:  # noqa: ANN401 - any options
                if quiet and verbose:
                    raise InputError("--quiet and --verbose were given; give one of them.")
                before = talk.set("quiet" if quiet else "verbose" if verbose else "plain")
                try:
                    function(**values)
                finally:
                    talk.reset(before)

            hints = get_type_hints(function, include_extras=True)
            parameters = [
                parameter.replace(
                    annotation=hints.get(parameter.name, parameter.annotation),
                    kind=inspect.Parameter.KEYWORD_ONLY,
                )
                for parameter in inspect.signature(function).parameters.values()
            ]
            parameters += [
                inspect.Parameter(
                    name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=option
                )
                for name, option in (("quiet", Quiet), ("verbose", Verbose))
            ]
            run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
            register(run)
            return function

        return wrap


app = Commands(
    name="semsig",
    help="Find where in a city a view was taken, from the street objects in it.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


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
    """Find where in a city a view was taken, from the street objects in it."""


Database = Annotated[Path, typer.Argument(help="Signature database written by `semsig build`.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]

MethodText = Annotated[
    str | None,
    typer.Option(
        "--method",
        help=f"Rank by likelihood, or by distance as TYPES+ANGLES ({', '.join(METRICS)}), "
        "types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or "
        f":weights=INSERT/DELETE/SUBSTITUTE.  [default: {DEFAULT_METHOD}]",
        show_default=False,
    ),
]
Paper = Annotated[
    bool, typer.Option("--paper", help=f"Rank as the paper does: --method {PAPER_METHOD}.")
]

# The same limits as in `core` and the specs, which are slow to import.
MOST_SEED, MOST_METRES, MOST_WORKERS, MOST_QUERIES = 10**18, 1_000_000, 1024, 10_000_000

Workers = Annotated[
    int, typer.Option(min=0, max=MOST_WORKERS, help="Number of processes on this machine.")
]
Scheduler = Annotated[str | None, typer.Option(help="Dask scheduler, as tcp://HOST:PORT.")]


def chosen_method(method: str | None, *, paper: bool) -> str:
    """Return the name of the method from --method and --paper."""
    if method is not None and paper:
        raise InputError(f"--paper was given with --method {method}; give one of them.")
    return PAPER_METHOD if paper else method or DEFAULT_METHOD


def command_line() -> str:
    """Return this command as a line for a shell."""
    return shlex.join(["semsig", *sys.argv[1:]])


def city_name(database: Path) -> str:
    """Return the name of a city for headings, from the name of its file."""
    return database.stem.replace("_", " ").capitalize()


def keep_inputs(*written: Path | None, read: Iterable[str | Path | None]) -> None:
    """Raise InputError if an input file would be overwritten, or a file written twice."""
    used = {os.path.realpath(path) for path in read if path is not None}
    for path in written:
        if path is None:
            continue
        if os.path.realpath(path) in used:
            raise InputError(
                f"{path} would be written, but this command uses it for something else as "
                "well; give another name."
            )
        used.add(os.path.realpath(path))


def require_suffix(suffix: str, *written: Path | None) -> None:
    """Raise InputError if the name of a file to write has another suffix."""
    for path in written:
        if path is not None and path.suffix.lower() != suffix and not path.is_dir():
            raise InputError(f"{path} cannot be written; the name must end in {suffix}.")


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option that are separated by commas."""
    try:
        return [float(part) for part in text.split(",")] if text.strip() else []
    except ValueError as error:
        raise InputError(
            f"{option} was given as {text!r}; give numbers with commas between them."
        ) from error


def known_identifiability(city: City) -> Identifiability | None:
    """Return the columns of `semsig identify`; None if missing, with a remark if outdated."""
    try:
        if not city.has_columns:
            return None
        from semsig_gis.evaluation import open_identifiability

        return open_identifiability(city.database, city.path)
    except DatabaseError as error:
        remark(str(error))
        return None


def warn_if_online(offline: bool, *, tiles: str | None = None) -> None:  # noqa: FBT001
    """Print a remark if a map needs a network."""
    if not offline:
        what = "Leaflet" if tiles is None else "its tiles"
        remark(f"the map takes {what} from the web, so it needs a network to be displayed")


def print_tables(tables: Iterable[Table | str]) -> None:
    """Print tables with their notes, and sentences between them."""
    for table in tables:
        if isinstance(table, str):
            say(table)
            continue
        print_rows(table.title, table.columns, table.rows)
        if table.note:
            say(table.note)


def print_table(table: Table) -> None:
    """Print a table with its note."""
    print_rows(table.title, table.columns, table.rows)
    if table.note:
        say(table.note)


class _Console:
    """Shows progress and remarks on standard error."""

    def progress(
        self, label: str, *, unit: Literal["steps", "bytes"] = "steps"
    ) -> contextlib.AbstractContextManager[Callable[[int, int], None]]:
        return progress(label, unit=unit)

    def remark(self, text: str) -> None:
        remark(text)


REPORTER = _Console()
