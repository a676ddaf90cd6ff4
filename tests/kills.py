"""Commands that die in the middle: killed just before the n-th thing that they do to files.

A process of its own has loaded all modules, and forks a child for every command, so that one kill
takes a tenth of a second. Only what Python does is counted: libraries write into files that Python
code has made room for and renames afterwards.
"""

from __future__ import annotations

import atexit
import functools
import gc
import importlib
import json
import os
import pkgutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import semsig_gis
from semsig_gis.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

LONGEST_S = 300
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {"os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate"}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a command ended: its exit code (-9 where it was killed), output, and changes to files.

    `changes` are lines such as ``os.rename /folder/a /folder/b``; the last one was not done where
    the command was killed.
    """

    code: int
    out: str
    err: str
    changes: tuple[str, ...]

    @property
    def killed(self) -> bool:
        return self.code == -signal.SIGKILL


def killed_at(
    number: int, argv: Sequence[object], *, cwd: Path, env: Mapping[str, str] | None = None
) -> Outcome:
    """Run a command that is killed just before its change to files of that number, from 1 on.

    With 0, or where there are not so many, it runs to its end. `argv` is what stands behind
    ``semsig``; `env` is put into the environment.
    """
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    order = {"number": number, "argv": [*map(str, argv)], "cwd": str(cwd), "env": dict(env or {})}
    server.stdin.write(json.dumps(order) + "\n")
    server.stdin.flush()
    answer = json.loads(server.stdout.readline())
    return Outcome(**{**answer, "changes": tuple(answer["changes"])})


def operations(argv: Sequence[object], *, cwd: Path, env: Mapping[str, str] | None = None) -> int:
    """Run a command to its end, which must be good, and return how often it changes files."""
    outcome = killed_at(0, argv, cwd=cwd, env=env)
    assert outcome.code == 0, outcome.err
    return len(outcome.changes)


@functools.cache
def _server() -> subprocess.Popen[str]:
    server = subprocess.Popen(
        [sys.executable, "-B", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    atexit.register(server.kill)
    return server


def _serve() -> None:
    """Answer each order on the standard input with how the command ended."""
    modules = [module.name for module in pkgutil.walk_packages(semsig_gis.__path__, "semsig_gis.")]
    for name in (*modules, "rich.progress", "rich.table"):
        if not name.endswith("__main__"):
            importlib.import_module(name)
    gc.freeze()  # or else every child would copy what it looks through
    for line in sys.stdin:
        order = json.loads(line)
        with (
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as err,
            tempfile.TemporaryFile() as changes,
        ):
            child = os.fork()
            if child == 0:
                _run(order, *(file.fileno() for file in (out, err, changes)))
            _, status = os.waitpid(child, 0)
            texts = []
            for file in (out, err, changes):
                file.seek(0)
                texts.append(file.read().decode())
        answer = {
            "code": os.waitstatus_to_exitcode(status),
            "out": texts[0],
            "err": texts[1],
            "changes": texts[2].splitlines(),
        }
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def _run(order: dict[str, Any], out: int, err: int, changes: int) -> None:
    signal.alarm(LONGEST_S)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(out, 1)
    os.dup2(err, 2)
    os.chdir(order["cwd"])
    os.environ.update(order["env"])
    tempfile.tempdir = None
    count = 0

    def note(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if event == "open" and isinstance(arguments[0], (str, bytes)):
            path = os.fsdecode(arguments[0])
            if not arguments[2] & WRITING or path.startswith(("/dev/", "/proc/")):
                return
        elif event not in CHANGES:
            return
        count += 1
        os.write(changes, (" ".join([event, *_names(arguments)]) + "\n").encode())
        if count == order["number"]:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(note)
    sys.argv = ["semsig", *order["argv"]]
    code = 1
    try:
        main()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:  # noqa: BLE001 - told as Python would
        sys.excepthook(*sys.exc_info())
    finally:
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _names(arguments: tuple[Any, ...]) -> Iterator[str]:
    return (os.fsdecode(value) for value in arguments if isinstance(value, (str, bytes, Path)))


if __name__ == "__main__":
    _serve()
