"""The command as a part of another program: lines of progress, and an end on request."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from semsig_gis.cli import console
from semsig_gis.cli.console import VARIABLE, progress_line

if TYPE_CHECKING:
    from pathlib import Path

WRITES = """
import signal, sys, time
from pathlib import Path
from semsig_gis.cli.console import stop_with_supervisor
from semsig_gis.storage.whole import whole_file
stop_with_supervisor()
with whole_file(sys.argv[1]) as partial:
    partial.write_text("half")
    print("begun", flush=True)
    {work}
"""
WORK = {
    "asleep": "time.sleep(60)",
    "busy": "while True: pass",
    "waiting for a thread": "import threading; threading.Event().wait()",
}


def start(code: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("work", WORK.values(), ids=WORK)
def test_the_end_of_the_input_ends_the_work_and_cleans_up(work: str, tmp_path: Path) -> None:
    with start(WRITES.replace("{work}", work), tmp_path / "out.txt") as process:
        assert process.stdout is not None
        assert process.stdin is not None
        assert process.stdout.readline() == "begun\n"
        assert list(tmp_path.iterdir()) != []
        process.stdin.close()
        assert process.wait(timeout=20) != 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no such signals")
def test_it_ends_even_where_interrupts_are_ignored(tmp_path: Path) -> None:
    ignoring = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    code = ignoring + WRITES.replace("{work}", WORK["asleep"])
    with start(code, tmp_path / "out.txt") as process:
        assert process.stdout is not None
        assert process.stdin is not None
        process.stdout.readline()
        process.stdin.close()
        assert process.wait(timeout=20) != 0
    assert list(tmp_path.iterdir()) == []


def test_input_that_stays_open_does_not_keep_the_program(tmp_path: Path) -> None:
    with start(WRITES.replace("{work}", "pass"), tmp_path / "out.txt") as process:
        assert process.wait(timeout=20) == 0
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert (tmp_path / "out.txt").read_text() == "half"


def test_the_command_tells_its_progress_and_ends(tmp_path: Path) -> None:
    environment = os.environ | {VARIABLE: "1"}
    with subprocess.Popen(
        [sys.executable, "-m", "semsig_gis.cli", "synthesize", "--out", str(tmp_path / "city")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        assert process.stderr is not None
        assert process.stdin is not None
        line = process.stderr.readline()
        process.stdin.close()
        assert process.wait(timeout=30) not in {0, 2}
    assert line == progress_line("making up a city", 0) + "\n"
    assert list(tmp_path.iterdir()) == []


def test_progress_is_a_line_for_every_percent(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, "1")
    with console.progress("digging") as advance:
        for done in range(1, 1001):
            advance(done, 1000)
        advance(0, 0)
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = printed.err.splitlines()
    percents = [int(re.fullmatch(r"semsig progress (\d+)% digging", line)[1]) for line in lines]  # type: ignore[index]
    assert percents == [*range(101), 0]
