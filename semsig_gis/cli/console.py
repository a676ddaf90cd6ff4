"""The command itself, and what several of its subcommands share."""

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
from semsig_gis.localization import METRIC_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from semsig_gis.core import Table
    from semsig_gis.database import City
    from semsig_gis.evaluation import Identifiability


VARIABLE = "SEMSIG_SUPERVISED"


def supervised() -> bool:
    """Tell whether another program watches this one."""
    return bool(os.environ.get(VARIABLE))


def progress_line(label: str, percent: int) -> str:
    """Return what a supervisor reads of the progress: ``semsig progress 40% building``."""
    return f"semsig progress {percent}% {label}"


def stop_with_supervisor() -> None:
    """From now on, be interrupted when the standard input ends."""
    # A program that was itself started in the background hands on that interrupts be ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # A copy, with nothing in the place of the original: on Windows, a library that asks for the
    # kind of the standard input while it is loaded would wait for the read to end.
    watched, nothing = os.dup(0), os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    threading.Thread(target=_interrupt_at_end_of, args=(watched,), daemon=True).start()


def _interrupt_at_end_of(watched: int) -> None:
    # Not a file object, whose lock would be held when the interpreter ends.
    while os.read(watched, 1):
        pass
    if sys.platform == "win32":
        signal.raise_signal(signal.SIGINT)
    else:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


# A bar appears for work that takes longer than this.
PATIENCE_S = 2.0

_AMOUNT = r"[-+±]?(?:\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?|infinite)(?: ?(?:°|%|m|km|km²|m²|MB|s|ms))?"
NUMBER = re.compile(rf"{_AMOUNT}(?:(?:-| to ){_AMOUNT})?")
"""A number as tables have it, with its unit, or two that are the ends of an interval."""

# Whole numbers from here on are identifiers, which read better without separators.
LARGEST_COUNT = 10**9


def say(text: object, *, err: bool = False, end: str = "\n") -> None:
    """Print text on standard output, or on standard error; nothing in it moves the cursor.

    Names and messages from elsewhere may hold escape sequences, which are shown (see `visible`).
    """
    typer.echo(visible_lines([str(text)])[0] + end, err=err, nl=False)  # noqa: TID251 - the one place


Talk = Literal["quiet", "plain", "verbose"]
talk: ContextVar[Talk] = ContextVar("talk", default="plain")
"""How much is told beside the results, by `--quiet` and `--verbose` of the command that runs."""


def remark(text: str) -> None:
    """Say one sentence on standard error, after the name of the command, unless it is quiet."""
    if talk.get() != "quiet":
        complain(text)


def complain(text: str) -> None:
    """Say one sentence on standard error in any case: why the command ends."""
    say(f"semsig: {visible(text)}", err=True)


def print_json(value: Any, *, indent: int | None = 2) -> None:  # noqa: ANN401 - any JSON
    """Print plain values without NaN or infinity as JSON on standard output.

    ``indent=None`` gives a single line. Characters that the output cannot hold are escaped.
    """
    dump = functools.partial(json.dumps, value, indent=indent, allow_nan=False)
    text = dump(ensure_ascii=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = dump(ensure_ascii=True)
    say(text)


def print_rows(title: str, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Print a table on standard output; text from data is neither markup nor moves the cursor.

    Whole numbers get thousands separators. Columns of nothing but numbers stand to the right.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(visible(title)), title_justify="left")
    cells = [[_cell_text(cell) for cell in row] for row in rows]
    shown = iter(visible_lines(text for row in cells for text in row))
    texts = [[next(shown) for _ in row] for row in cells]
    for number, name in enumerate(visible_lines(header)):
        column = [one[number] for one in texts if number < len(one) and one[number]]
        right = bool(column) and all(map(NUMBER.fullmatch, column))
        table.add_column(Text(name), overflow="fold", justify="right" if right else "left")
    for row in texts:
        table.add_row(*map(Text, row))
    console = Console(file=sys.stdout)
    if not console.is_terminal:
        # A file or a pipe has no width to fold to.
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
    """Show a bar on standard error once the work in the block takes a while.

    The block gets a function, to be called with how much is done and how much there is in all. A
    program that supervises this one gets lines instead (see `cli.console`), and who wants to know
    every step gets a line when it begins and one when it is done.
    """
    if supervised():
        yield _progress_lines(label)
        return
    if talk.get() == "quiet":
        yield lambda _done, _total: None
        return
    told = talk.get() == "verbose"
    if told:
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

    def advance(done: int, total: int) -> None:
        count = f"{done:,} of {total:,}" if total else f"{done:,}"
        bar.update(task, completed=done, total=total or None, count=count)

    patience = threading.Timer(PATIENCE_S, bar.start)
    patience.daemon = True
    patience.start()
    try:
        yield advance
    finally:
        patience.cancel()
        # Stopping a bar that never showed, or shows nowhere, would print an empty line.
        if bar.live.is_started:
            bar.stop()
    if told:
        remark(f"{label}: {time.perf_counter() - start:.1f} s")


def _progress_lines(label: str) -> Callable[[int, int], None]:
    """Return what prints a line for every percent of the work."""
    told = -1

    def advance(done: int, total: int) -> None:
        nonlocal told
        percent = done * 100 // total if total else 0
        if percent != told:
            told = percent
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
    """The commands, each of which can be told to be quiet or verbose."""

    def command(  # type: ignore[override]
        self,
        name: str | None = None,
        *,
        help: str | None = None,  # noqa: A002 - as typer's
    ) -> Callable[[Callable[..., None]], Callable[..., None]]:
        """Register a function as a command with the two options more."""
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
            told = inspect.signature(function)
            own = [
                one.replace(
                    annotation=hints.get(one.name, one.annotation),
                    kind=inspect.Parameter.KEYWORD_ONLY,
                )
                for one in told.parameters.values()
            ]
            more = [
                inspect.Parameter(
                    name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=option
                )
                for name, option in (("quiet", Quiet), ("verbose", Verbose))
            ]
            run.__signature__ = inspect.Signature([*own, *more])  # type: ignore[attr-defined]
            register(run)
            return function

        return wrap


app = Commands(
    name="semsig",
    help="Find where in a city a view was taken, from the street objects in it.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(wanted: bool) -> None:  # noqa: FBT001 - typer calls it so
    if wanted:
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
        help=f"Rank by likelihood, or by distance as TYPES+ANGLES ({', '.join(METRIC_NAMES)}), "
        "types:edit or angles:edit; add :5% for two stages, :alpha=0.7, :raw or "
        f":weights=INSERT/DELETE/SUBSTITUTE.  [default: {DEFAULT_METHOD}]",
        show_default=False,
    ),
]
Paper = Annotated[
    bool, typer.Option("--paper", help=f"Rank as the paper does: --method {PAPER_METHOD}.")
]

# The ranges of numbers are those of the core (`core.ranges` and the specs), which loads slowly.
MOST_SEED, MOST_METRES, MOST_WORKERS, MOST_QUERIES = 10**18, 1_000_000, 1024, 10_000_000

Workers = Annotated[
    int, typer.Option(min=0, max=MOST_WORKERS, help="Number of processes on this machine.")
]
Scheduler = Annotated[str | None, typer.Option(help="Dask scheduler, as tcp://HOST:PORT.")]


def chosen_method(method: str | None, *, paper: bool) -> str:
    """Return the text of the method that the options name."""
    if method is not None and paper:
        raise InputError(f"--paper was given with --method {method}; give one of them.")
    return PAPER_METHOD if paper else method or DEFAULT_METHOD


def command_line() -> str:
    """Return the command that is run, as a shell would read it."""
    return shlex.join(["semsig", *sys.argv[1:]])


def city_name(database: Path) -> str:
    """Return what a city is called in headings, by the name of its file."""
    return database.stem.replace("_", " ").capitalize()


def keep_inputs(*written: Path | None, read: Iterable[str | Path | None]) -> None:
    """Refuse to write over a file that is read, or two results to one file."""
    taken = {os.path.realpath(path) for path in read if path is not None}
    for path in written:
        if path is None:
            continue
        if os.path.realpath(path) in taken:
            raise InputError(
                f"{path} would be written, but this command uses it for something else as "
                "well; give another name."
            )
        taken.add(os.path.realpath(path))


def require_suffix(suffix: str, *written: Path | None) -> None:
    """Refuse a name that says that a file is of another kind than it will be."""
    for path in written:
        if path is not None and path.suffix.lower() != suffix and not path.is_dir():
            raise InputError(f"{path} cannot be written; the name must end in {suffix}.")


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of an option, which stand between commas."""
    try:
        return [float(part) for part in text.split(",")] if text.strip() else []
    except ValueError as error:
        raise InputError(
            f"{option} was given as {text!r}; give numbers with commas between them."
        ) from error


def known_identifiability(city: City) -> Identifiability | None:
    """Return what the columns of a database tell; None, and say so, where they do not fit it."""
    try:
        if not city.has_columns:
            return None
        from semsig_gis.evaluation import open_identifiability

        return open_identifiability(city.database, city.path)
    except DatabaseError as error:
        remark(str(error))
        return None


def tell_if_online(offline: bool, *, tiles: str | None = None) -> None:  # noqa: FBT001
    """Remark that a map needs a network, where it does."""
    if not offline:
        what = "Leaflet" if tiles is None else "its tiles"
        remark(f"the map takes {what} from the web, so it needs a network to be displayed")


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables with their notes."""
    for table in tables:
        print_rows(table.title, table.columns, table.rows)
        if table.note:
            say(table.note)
