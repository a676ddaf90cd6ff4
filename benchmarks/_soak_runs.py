"""Run `semsig` in a forked process, which may be killed or interrupted."""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import importlib
import json
import os
import pkgutil
import shlex
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import semsig_gis
from semsig_gis import evaluation
from semsig_gis.cli import main as semsig

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

LIMIT_S = 600.0
"""Seconds after which a command counts as hanging, even on a busy machine."""

# Audit events of Python before it changes files; `open` counts only for writing.
_CHANGES = frozenset(
    {"open", "os.link", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.symlink",
     "os.truncate"}
)  # fmt: skip
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True, slots=True)
class Stop:
    """The moment of a signal: before the n-th change of a file, or after some seconds."""

    change: int | None = None
    after_s: float | None = None
    signal: int = signal.SIGKILL


@dataclass(frozen=True, slots=True)
class Ending:
    """The end of a command: exit code, output, its changes of files, and its seconds."""

    code: int  # below zero: the signal that ended it
    out: str
    err: str
    changes: tuple[str, ...]  # lines such as "os.rename /folder/a /folder/b"
    seconds: float
    hung: bool = False

    @property
    def fault(self) -> str:
        """Kind of fault that no command may have; empty if there is none."""
        if self.hung:
            return "hangs"
        if self.code < 0:
            return "crashes"
        if self.code == 1 or "Traceback" in self.err:
            return "tracebacks"
        last = self.err.strip().rpartition("\n")[2]
        if self.code not in {0, 130} and not (last.startswith("semsig: ") and last.endswith(".")):
            return "tracebacks"
        return ""


def load_all() -> None:
    """Import all modules, so that forked processes need not import them."""
    modules = [module.name for module in pkgutil.walk_packages(semsig_gis.__path__, "semsig_gis.")]
    for name in (*modules, "rich.progress", "rich.table"):
        if not name.endswith("__main__"):
            importlib.import_module(name)
    shorten()
    gc.freeze()  # or each process would copy the memory that its garbage collector visits


def shorten() -> None:
    """Reduce the trials of `identify`, which does not change the size of its results."""
    evaluation.identify = functools.partial(evaluation.identify, trials=60, class_trials=5)


def main() -> None:
    """Run the command in the arguments of this process."""
    shorten()
    semsig()


def run(
    command: str,
    folder: Path,
    *,
    environment: Mapping[str, str] | None = None,
    stop: Stop | None = None,
    pipe: bool = False,
) -> Ending:
    """Run a command in a folder, with new HOME and TMPDIR; with `pipe`, its output is closed."""
    own = {"HOME": f"{folder}.home", "TMPDIR": f"{folder}.tmp"}
    for path in own.values():
        with contextlib.suppress(OSError):  # a read-only disk
            Path(path).mkdir(exist_ok=True)
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(3)]
        start = time.perf_counter()
        child = os.fork()
        if child == 0:
            numbers = [file.fileno() for file in files]
            _child(command, folder, own | dict(environment or {}), numbers, stop, pipe=pipe)
        hung, code = _wait(child, stop)
        seconds = time.perf_counter() - start
        out, err, changes = (_text(file) for file in files)
    return Ending(code, out, err, tuple(changes.splitlines()), seconds, hung)


def _text(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read().decode(errors="backslashreplace")


def _wait(child: int, stop: Stop | None) -> tuple[bool, int]:
    """Wait for a process, and kill its children; return whether it hung, and its exit code."""
    start, hung = time.perf_counter(), False
    due = None if stop is None else stop.after_s
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        passed = time.perf_counter() - start
        if due is not None and stop is not None and passed >= due:
            due = None
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, stop.signal)
        if passed > LIMIT_S:
            hung = True
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.002)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return hung, os.waitstatus_to_exitcode(status)


def _child(
    command: str,
    folder: Path,
    environment: Mapping[str, str],
    files: Sequence[int],
    stop: Stop | None,
    *,
    pipe: bool,
) -> None:
    """Run the command in this process, and end the process."""
    code = 1
    out, err, changes = files
    try:
        os.setpgid(0, 0)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # until the command begins
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        if pipe:
            reader, out = os.pipe()
            os.close(reader)
        os.dup2(out, 1)
        os.dup2(err, 2)
        os.chdir(folder)
        os.environ.update(environment)
        tempfile.tempdir = None
        _note_changes(changes, stop)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = exit_code(command)
    except BaseException:  # noqa: BLE001 - printed, and the process ends
        sys.excepthook(*sys.exc_info())
    finally:
        with contextlib.suppress(BaseException):
            atexit._run_exitfuncs()  # noqa: SLF001 - as the end of Python would
            sys.stderr.flush()
        os._exit(code)


def exit_code(command: str) -> int:
    """Run a command in this process and return its exit code."""
    sys.argv = ["semsig", *shlex.split(command)]
    code = 0
    try:
        semsig()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - what a user would see
        sys.excepthook(*sys.exc_info())
        code = 1
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        code = 120  # as Python's own end does
    return code


def _note_changes(file: int, stop: Stop | None) -> None:
    """Write a line before every change of a file from now on, and stop before the n-th."""
    count = 0

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if event not in _CHANGES:
            return
        if event == "open":
            path = os.fsdecode(arguments[0]) if isinstance(arguments[0], str | bytes) else "/dev/"
            if not arguments[2] & _WRITING or path.startswith(("/dev/", "/proc/")):
                return
        count += 1
        names = [os.fsdecode(name) for name in arguments if isinstance(name, str | bytes | Path)]
        os.write(file, (" ".join([event, *names]) + "\n").encode(errors="backslashreplace"))
        if stop is not None and stop.change == count:
            os.killpg(os.getpgrp(), stop.signal)

    sys.addaudithook(hook)


def forked(task: Callable[[], Any]) -> Any:  # noqa: ANN401 - any JSON
    """Run a task in a new process, and return its result by way of JSON.

    A process with threads, which reading Parquet starts, must not fork.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with open(writing, "w", encoding="utf-8") as file:  # noqa: PTH123 - a descriptor
                json.dump(task(), file)
            code = 0
        except BaseException:  # noqa: BLE001 - printed, and the parent raises
            sys.excepthook(*sys.exc_info())
        finally:
            os._exit(code)
    os.close(writing)
    with open(reading, encoding="utf-8") as file:  # noqa: PTH123 - a descriptor
        text = file.read()
    if os.waitpid(child, 0)[1]:
        raise RuntimeError("a part of the soak failed; see above.")
    return json.loads(text)
