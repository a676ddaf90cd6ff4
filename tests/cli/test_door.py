"""The outermost handler of the command line: one sentence and an exit code for each error."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from machine import PATIENCE_S
from sentences import sentence

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import Run

COMMAND = [sys.executable, "-m", "semsig_gis.cli"]


@pytest.fixture
def failing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[[BaseException], list[object]]:
    """Return a function that runs a command which raises an error."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def call(error: BaseException) -> list[object]:
        def suggest(*_: object, **__: object) -> str:
            raise error

        monkeypatch.setattr("semsig_gis.objects.draft_catalog", suggest)
        return [*run("draft x.gpkg")]

    return call


def test_bug_is_written_to_a_log_file(
    failing: Callable[[BaseException], list[object]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    code, out, err = failing(KeyError("a\nb"))
    (log,) = tmp_path.iterdir()
    assert (code, out) == (1, "")
    assert err == (
        "semsig: a fault in semsig, not in your input (KeyError: 'a\\nb'); please report it to the "
        f"authors of semsig_gis, with {log}.\n"
    )
    assert "Traceback" in log.read_text(encoding="utf-8")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    code, _, err = failing(KeyError("a"))
    assert (code, str(err).count("\n")) == (1, 1)


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (KeyboardInterrupt(), 130, "semsig: interrupted\n"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 141, ""),
        (MemoryError(), 2, "semsig: this machine is short of memory"),
        (np.exceptions.DTypePromotionError("x"), 1, "semsig: a fault in semsig"),
        (OSError(errno.ENAMETOOLONG, "File name too long", "x"), 2, "semsig: the system refuses"),
        (OSError("no reason"), 1, "semsig: a fault in semsig"),
    ],
)
def test_each_kind_of_error_has_an_exit_code(
    error: BaseException, code: int, message: str, failing: Callable[[BaseException], list[object]]
) -> None:
    exit_code, out, err = failing(error)
    assert (exit_code, out) == (code, "")
    assert str(err).startswith(message)
    assert str(err).count("\n") == bool(message)


CALLBACK = """
import ctypes, signal, sys, time
from semsig_gis import cli
from semsig_gis.cli import app as command

@ctypes.CFUNCTYPE(None)
def callback():
    raise {error}

def run():
    callback()
    time.sleep({seconds})
    return 0

command.run = run
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's jobs may ignore it
cli.main()
"""


@pytest.mark.parametrize(
    ("error", "seconds", "code", "message"),
    [
        ("KeyboardInterrupt", 60, 130, "semsig: interrupted\n"),
        ("ValueError('x')", 0, 0, "semsig: a library ignored an error (ValueError: x)\n"),
    ],
)
def test_error_in_a_callback_is_reported(error: str, seconds: int, code: int, message: str) -> None:
    assert outcome(CALLBACK.format(error=error, seconds=seconds)) == (code, message)


def outcome(code: str) -> tuple[int, str]:
    """Run a program; return its exit code and what it prints on standard error."""
    process = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        check=False,
        text=True,
        timeout=PATIENCE_S,
    )
    return process.returncode, process.stderr


AT_EXIT = """
import atexit, signal
from semsig_gis import cli
from semsig_gis.cli import app as command

signal.signal(signal.SIGINT, signal.default_int_handler)
atexit.register(signal.raise_signal, signal.SIGINT)  # during the clean-up of Python
command.run = lambda: 0
cli.main()
"""


def test_interrupt_at_exit_is_ignored() -> None:
    assert outcome(AT_EXIT) == (0, "")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("build", ["Missing argument 'objects'", "see semsig build --help"]),
        ("bulid", ["Did you mean 'build'", "see semsig --help"]),
        ("build o --out c --frob", ["--frob"]),
        ("info \udcff.parquet", ["not valid UTF-8"]),
        ("info a\0.parquet", ["null byte"]),
        (f"load {'n' * 300} --catalog openstreetmap --out o.parquet", ["File name too long"]),
        (f"draft {'n' * 300}", ["File name too long"]),
    ],
)
def test_invalid_command_lines_are_refused(
    line: str, words: list[str], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sentence(run(line), *words)


@pytest.mark.skipif(sys.platform == "win32", reason="a folder in use cannot be removed")
def test_missing_working_folder_is_refused(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    sentence(run("sources"), "working folder", "change to another")


def test_characters_that_the_terminal_cannot_show_are_escaped() -> None:
    process = subprocess.run(
        [*COMMAND, "sources", "opendata_paris", "--tables"],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=True,
    )
    assert b"les-arbres" in process.stdout
    assert process.stderr == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no such device")
def test_closed_output_and_full_disk_have_an_exit_code() -> None:
    def run_into(output: object) -> tuple[int, str]:
        command = subprocess.Popen(
            [*COMMAND, "--version"],
            stdout=output,  # type: ignore[call-overload]
            stderr=subprocess.PIPE,
            text=True,
        )
        if command.stdout:
            command.stdout.close()
        with command:
            return command.wait(), command.stderr.read()

    assert run_into(subprocess.PIPE) == (141, "")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        code, message = run_into(full)
    assert (code, message.count("\n"), "No space left" in message) == (2, 1, True)
