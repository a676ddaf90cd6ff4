"""Output of the command line: results, remarks and progress."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import signal
import sys
import threading
import time
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal

import typer

from semsig_gis.core import visible, visible_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from semsig_gis.core import Table


VARIABLE = "SEMSIG_SUPERVISED"
INTERRUPT_AGAIN_S = 3.0


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
    while True:
        if sys.platform == "win32":
            signal.raise_signal(signal.SIGINT)
        else:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        time.sleep(INTERRUPT_AGAIN_S)  # a library may have ignored the interrupt


PATIENCE_S = 2.0  # a progress bar appears only if the work takes longer

_AMOUNT = r"[-+±]?(?:\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?|infinite)(?: ?(?:°|%|m|km|km²|m²|MB|s|ms))?"
NUMBER = re.compile(rf"{_AMOUNT}(?:(?:-| to ){_AMOUNT})?")
"""A number in a table with its unit, or the two ends of an interval."""


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


def print_table(table: Table) -> None:
    """Print a table with its note; markup and escape sequences in it have no effect.

    Columns with only numbers are right-aligned.
    """
    from rich import table as parts
    from rich.console import Console
    from rich.text import Text

    grid = parts.Table(title=Text(visible(table.title)), title_justify="left")
    # Escape all cells in one call, which is faster.
    shown = iter(visible_lines(text for row in table.rows for text in row))
    texts = [[next(shown) for _ in row] for row in table.rows]
    for number, name in enumerate(table.columns):
        column = [row[number] for row in texts if number < len(row) and row[number]]
        right = bool(column) and all(map(NUMBER.fullmatch, column))
        grid.add_column(Text(visible(name)), overflow="fold", justify="right" if right else "left")
    for row in texts:
        grid.add_row(*map(Text, row))
    console = Console(file=sys.stdout)
    if not console.is_terminal:
        # A file or a pipe has no width; make the table as wide as it needs.
        wide = Console(file=sys.stdout, width=10_000)
        width = max(wide.measure(grid).maximum, wide.measure(table.title).maximum)
        console = Console(file=sys.stdout, width=width)
    console.print(grid)
    if table.note:
        say(table.note)


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


class _Console:
    """Shows progress and remarks on standard error."""

    def progress(
        self, label: str, *, unit: Literal["steps", "bytes"] = "steps"
    ) -> contextlib.AbstractContextManager[Callable[[int, int], None]]:
        return progress(label, unit=unit)

    def remark(self, text: str) -> None:
        remark(text)


REPORTER = _Console()
