"""Output of the command line: results, remarks and progress."""

from __future__ import annotations

import contextlib
import functools
import itertools
import json
import os
import re
import shutil
import signal
import sys
import textwrap
import threading
import time
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import typer

from semsig_gis.core import LONG_S, duration, shortened, visible, visible_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from rich.progress import Progress

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


duration_said = threading.Event()
"""Whether a remark has said how long the present work takes."""
MEASURED_S = 2.0  # of work, two times, before the rest is estimated
STEADY = 1.5  # largest ratio of the two rates
PATIENCE_S = 2.0  # a progress bar appears only if the work takes longer

_AMOUNT = r"[-+±]?(?:\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?|infinite)(?: ?(?:°|%|m|km|km²|m²|MB|s|ms))?"
NUMBER = re.compile(rf"{_AMOUNT}(?:(?:-| to ){_AMOUNT})?")
"""A number in a table with its unit, or the two ends of an interval."""
UNIT_SPACE = re.compile(r"(?<=\d) (?=(?:°|%|m|km|km²|m²|MB|s|ms)(?!\w))")
NO_BREAK = "\N{NO-BREAK SPACE}"
WIDEST_WORD = 30  # longer words in a column, such as addresses, may be broken


def say(text: object, *, err: bool = False) -> None:
    """Print text on standard output or standard error, with escape sequences made visible.

    Names and messages from files may contain them (see `visible`).
    """
    typer.echo(visible_lines([str(text)])[0], err=err)  # noqa: TID251 - the only place


PIPED_WIDTH = 120  # columns of a pipe or a file


def say_sentence(text: str) -> None:
    """Print a sentence on standard output, in lines as wide as the terminal.

    Indented lines, such as commands to copy, are left as they are.
    """
    width = shutil.get_terminal_size((PIPED_WIDTH, 0)).columns
    for line in visible_lines([text])[0].split("\n"):
        say(line if line.startswith(" ") else _wrapped(line, width))


def _wrapped(line: str, width: int) -> str:
    """Return a line with breaks between words, but not between a number and its unit."""
    joined = UNIT_SPACE.sub(NO_BREAK, line)
    broken = textwrap.fill(joined, width, break_long_words=False, break_on_hyphens=False)
    return broken.replace(NO_BREAK, " ")


Talk = Literal["quiet", "plain", "verbose"]
talk: ContextVar[Talk] = ContextVar("talk", default="plain")
"""How much is printed in addition to results, from `--quiet` and `--verbose`."""


def remark(text: str) -> None:
    """Print a sentence on standard error after ``semsig:``, unless `--quiet` was given."""
    if talk.get() != "quiet":
        complain(shortened(text))


def complain(text: str) -> None:
    """Print a sentence on standard error in any case: why the command ends."""
    sentence = f"semsig: {visible(text)}"
    if sys.stderr is not None and sys.stderr.isatty():  # programs read lines
        sentence = _wrapped(sentence, os.get_terminal_size(sys.stderr.fileno()).columns)
    say(sentence, err=True)


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


@dataclass
class _Column:
    """A column of a table, with the width that it gets and the least one."""

    name: str
    texts: list[str]
    numeric: bool
    width: int
    least: int

    @classmethod
    def of(cls, name: str, texts: list[str]) -> _Column:
        """Return a column as wide as its texts."""
        from rich.cells import cell_len

        filled = [text for text in texts if text]
        numeric = bool(filled) and all(map(NUMBER.fullmatch, filled))
        lines = [] if numeric else filled  # may be broken between words
        words = [word for text in (name, *lines) for word in text.split()]
        longest = max(map(cell_len, words), default=0)
        content = max(map(cell_len, filled), default=0)
        return cls(
            name=name,
            texts=texts,
            numeric=numeric,
            width=max(cell_len(name), content),
            least=max(longest, content) if numeric else min(longest, WIDEST_WORD),
        )


def _fit(columns: list[_Column], width: int, *, minor: tuple[str, ...]) -> list[_Column]:
    """Return the columns that fit into a width, made as narrow as necessary.

    All minor ones are left out first, then the last ones; two stay.
    """
    room = width - 1  # a column has two spaces and a line in addition to its width

    def fits(some: list[_Column]) -> bool:
        return len(some) <= 2 or sum(item.least + 3 for item in some) <= room  # noqa: PLR2004

    fitting = list(columns)
    if not fits(fitting):
        fitting = [column for column in fitting if column.name not in minor]
    while not fits(fitting):
        fitting.pop()
    while (excess := sum(item.width + 3 for item in fitting) - room) > 0:
        wide = [item for item in fitting if item.width > item.least]
        if not wide:
            break
        widest = max(wide, key=lambda item: item.width)
        others = [item.width for item in wide if item.width < widest.width]
        target = max([widest.least, widest.width - excess, *others])
        widest.width = target if target < widest.width else widest.width - 1
    return fitting


def print_table(table: Table) -> None:
    """Print a table with its note; markup and escape sequences in it have no effect.

    Columns with only numbers are right-aligned and never folded. If the terminal is too narrow,
    columns are left out, and named below the table.
    """
    from rich import table as parts
    from rich.console import Console
    from rich.text import Text

    width = shutil.get_terminal_size((PIPED_WIDTH, 0)).columns
    # Escape all cells in one call, which is faster.
    shown = iter(visible_lines(text for row in table.rows for text in row))
    texts = [[next(shown) for _ in row] for row in table.rows]
    columns = [
        _Column.of(visible(name), [row[number] for row in texts])
        for number, name in enumerate(table.columns)
    ]
    fitting = _fit(columns, width, minor=table.minor)
    grid = parts.Table()
    for column in fitting:
        justify: Literal["left", "right"] = "right" if column.numeric else "left"
        grid.add_column(Text(column.name), overflow="fold", justify=justify, width=column.width)
    for row in zip(*(column.texts for column in fitting), strict=True):
        grid.add_row(*map(Text, row))
    say_sentence(table.title)
    Console(file=sys.stdout, width=width).print(grid)
    if left_out := [column.name for column in columns if column not in fitting]:
        say_sentence(f"Not shown, for lack of room: {', '.join(left_out)}.")
    if table.note:
        say_sentence(table.note)


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
    duration_said.clear()
    marks: list[tuple[float, int]] = []
    state: dict[str, Any] = {"total": None, "completed": 0, "count": ""}
    bars: list[Progress] = []

    def show() -> None:
        bars.extend(_shown_bars(label, state, start=start, unit=unit))

    def advance(completed: int, total: int) -> None:
        left = 0.0 if duration_said.is_set() else _seconds_left(marks, completed, total)
        if left > LONG_S:
            duration_said.set()
            remark(f"{label} takes {duration(left)} more")
        count = f"{completed:,} of {total:,}" if total else f"{completed:,}"
        state.update(total=total or None, completed=completed, count=count)
        for bar in bars:
            bar.update(bar.task_ids[0], **state)

    patience = threading.Timer(PATIENCE_S, show)
    patience.daemon = True
    patience.start()
    try:
        yield advance
    finally:
        patience.cancel()
        patience.join()
        for bar in bars:
            bar.stop()
    if verbose:
        remark(f"{label}: {time.perf_counter() - start:.1f} s")


def _shown_bars(label: str, state: Mapping[str, Any], *, start: float, unit: str) -> list[Progress]:
    """Show a progress bar for work since a time, and return it; none without a terminal."""
    from rich import progress as parts
    from rich.console import Console

    screen = Console(stderr=True)
    if not screen.is_terminal:
        return []
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
        get_time=time.perf_counter,
    )
    bar.add_task(label, **state)
    bar.tasks[0].start_time = start
    bar.start()
    return [bar]


def _seconds_left(marks: list[tuple[float, int]], completed: int, total: int) -> float:
    """Return how long work takes from now on, 0 before its rate is steady.

    The first parts may take longer than the others, for example to compile or to load. `marks` are
    times and what was finished, which this function continues.
    """
    now = time.perf_counter()
    if marks and (completed <= marks[-1][1] or now - marks[-1][0] < MEASURED_S):
        return 0.0
    marks.append((now, completed))
    paces = [
        (later - earlier) / (after - before)
        for (earlier, before), (later, after) in itertools.pairwise(marks[-3:])
    ]
    if len(paces) < 2 or max(paces) > STEADY * min(paces):  # noqa: PLR2004 - two rates
        return 0.0
    return sum(paces) / len(paces) * (total - completed)


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
