"""The door of the command line: what goes wrong ends in one sentence and a fitting exit code."""

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
    """Run a command in which an error is raised."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def call(error: BaseException) -> list[object]:
        def suggest(*_: object, **__: object) -> str:
            raise error

        monkeypatch.setattr("semsig_gis.objects.draft.draft_catalog", suggest)
        return [*run("draft x.gpkg")]

    return call


def test_a_fault_of_ours_is_written_down(
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
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "semsig: interrupted\n"),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 141, ""),
        (MemoryError(), 2, "semsig: this machine is short of memory"),
        (np.exceptions.DTypePromotionError("x"), 1, "semsig: a fault in semsig"),
        (OSError(errno.ENAMETOOLONG, "File name too long", "x"), 2, "semsig: the system refuses"),
        (OSError("no reason"), 1, "semsig: a fault in semsig"),
    ],
)
def test_each_end_has_a_code(
    error: BaseException, code: int, said: str, failing: Callable[[BaseException], list[object]]
) -> None:
    found, out, err = failing(error)
    assert (found, out) == (code, "")
    assert str(err).startswith(said)
    assert str(err).count("\n") == bool(said)


CALLBACK = """
import ctypes, signal, sys, time
from semsig_gis import cli
from semsig_gis.cli import run as command

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
    ("error", "seconds", "code", "said"),
    [
        ("KeyboardInterrupt", 60, 130, "semsig: interrupted\n"),
        ("ValueError('x')", 0, 0, "semsig: a library ignored an error (ValueError: x)\n"),
    ],
)
def test_what_a_library_cannot_raise(error: str, seconds: int, code: int, said: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", CALLBACK.format(error=error, seconds=seconds)],
        capture_output=True,
        check=False,
        text=True,
        timeout=PATIENCE_S,
    )
    assert (done.returncode, done.stderr) == (code, said)


TIDYING = """
import atexit, signal
from semsig_gis import cli
from semsig_gis.cli import run as command

signal.signal(signal.SIGINT, signal.default_int_handler)
atexit.register(signal.raise_signal, signal.SIGINT)  # as when Python closes what is open
command.run = lambda: 0
cli.main()
"""


def test_an_interrupt_after_the_work_is_done() -> None:
    done = subprocess.run(
        [sys.executable, "-c", TIDYING],
        capture_output=True,
        check=False,
        text=True,
        timeout=PATIENCE_S,
    )
    assert (done.returncode, done.stderr) == (0, "")


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
def test_what_cannot_be_meant_is_refused(
    line: str, words: list[str], run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sentence(run(line), *words)


@pytest.mark.skipif(sys.platform == "win32", reason="a folder in use cannot be removed")
def test_a_working_folder_that_is_gone(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    sentence(run("sources"), "working folder", "change to another")


def test_a_terminal_without_the_letters() -> None:
    done = subprocess.run(
        [*COMMAND, "sources", "opendata_paris"],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=True,
    )
    assert b"les-arbres" in done.stdout
    assert done.stderr == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no such device")
def test_output_that_nobody_takes() -> None:
    def outcome(reader: object) -> tuple[int, str]:
        command = subprocess.Popen(
            [*COMMAND, "--version"],
            stdout=reader,  # type: ignore[call-overload]
            stderr=subprocess.PIPE,
            text=True,
        )
        if command.stdout:
            command.stdout.close()
        with command:
            return command.wait(), command.stderr.read()

    assert outcome(subprocess.PIPE) == (141, "")
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        code, said = outcome(full)
    assert (code, said.count("\n"), "No space left" in said) == (2, 1, True)
