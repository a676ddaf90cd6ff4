"""Output of the command line, and the command as a part of another program."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import pytest
from machine import PATIENCE_S
from sentences import sentence

from semsig_gis.cli import console
from semsig_gis.cli.console import VARIABLE, progress_line
from semsig_gis.core import Table

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


# --- Output -------------------------------------------------------------------------------------


def test_rows_are_printed_without_markup_or_folding(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [("[red]a[/red]", 1234567, 7652000627500), ("x" * 300, -1, 0)]
    console.print_table(Table.of("[b]title[/b]", ("name", "count", "id"), rows))
    out = capsys.readouterr().out
    for text in ("[b]title[/b]", "[red]a[/red]", "1,234,567", " 7652000627500 "):
        assert text in out
    assert out.count("x") == 300
    assert max(map(len, out.splitlines())) <= console.PIPED_WIDTH


PLACES = Table.of(
    "12 places of 1,234,567 cells in a city that has a long name, by a method with a long name",
    ("rank", "cell", "x", "y", "lat", "lon", "share", "seen from there"),
    [
        (
            1,
            3728500484285,
            "372875.0",
            "4842825.0",
            "43.727858",
            "7.421317",
            "0.1 to 0.2",
            "tree " * 9,
        )
    ]
    * 2,
    minor=("cell", "x", "y"),
)


@pytest.mark.parametrize("width", [200, 80, 40])
def test_a_narrow_terminal_leaves_out_columns_and_folds_no_number(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    console.print_table(PLACES)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= width
    rows = [line for line in lines if line.startswith("│") and " 1 " in line]
    shown = [text for text in PLACES.rows[0] if all(f" {text} " in row for row in rows)]
    left_out = "\n".join(lines).partition("lack of room: ")[2].replace("\n", " ")
    expected = {
        200: (PLACES.rows[0], ""),
        80: (("1", "43.727858", "7.421317", "0.1 to 0.2"), "cell, x, y."),
        40: (("1", "43.727858", "7.421317"), "cell, x, y, share, seen from there."),
    }
    assert (tuple(shown), left_out) == expected[width]
    assert "1,234,567" in "\n".join(lines)


def test_sentences_are_wrapped_between_words_and_commands_are_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    command = f"  semsig localize city.parquet '{'bench at 40, ' * 4}'"
    console.say_sentence(f"Of 1,234,567 views, 12,345,678 were placed. Next:\n{command}")
    assert capsys.readouterr().out == (
        f"Of 1,234,567 views, 12,345,678\nwere placed. Next:\n{command}\n"
    )


@pytest.mark.parametrize("width", range(20, 60))
def test_numbers_stay_with_their_units(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    text = "Within 50 m with a chance of 98 %, in 7 cells, 700 m², 16.7 m off, in 12 ms or 3 more."
    console.say_sentence(text)
    lines = capsys.readouterr().out.splitlines()
    assert " ".join(lines) == text
    assert not any(line.startswith(("m", "%")) and line[:4] != "more" for line in lines)


HOSTILE = "a\x1b[2J\x1b]0;title\x07\u009b31m\u202eb\r\ud83d"


def test_columns_of_numbers_are_right_aligned(capsys: pytest.CaptureFixture[str]) -> None:
    header = ("name", "count", "share", "range", "mixed", "none")
    rows = [
        ("a", 7, "0.5 %", "1-20", "3", ""),
        ("b", 12345, "12.5 %", "0.0979 to 0.1558", "three", ""),
        ("c", -1, "100 %", "infinite", "", ""),
    ]
    console.print_table(Table.of("title", header, rows))
    first = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("│ a"))
    cells = [cell[1:-1] for cell in first.split("│")[1:-1]]
    assert cells == ["a   ", "     7", " 0.5 %", f"{'1-20':>16}", "3    ", "    "]


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("", "semsig: a\n"),
        ("--quiet", ""),
        ("-v", r"semsig: a\nsemsig: digging \.\.\.\nsemsig: digging: 0\.\d s\n"),
    ],
)
def test_quiet_and_verbose_change_the_remarks(
    option: str, expected: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draft(_: Path, *, crs: str | None) -> str:  # noqa: ARG001
        console.remark("a")
        with console.progress("digging") as advance:
            advance(1, 2)
        return "draft\n"

    monkeypatch.setattr("semsig_gis.objects.draft_catalog", draft)
    code, out, err = run(f"draft x.gpkg {option}")
    assert (code, out) == (0, "draft\n")
    assert re.fullmatch(expected, err)
    assert console.talk.get() == "plain"
    sentence(run("draft x.gpkg --quiet --verbose"), "--quiet and --verbose", "give one")
    sentence(run("draft x.gpkg --quiet --tables"), "--quiet and --tables", "give one")


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("semsig lo", {"load", "localize"}),
        ("semsig load --catalog open", {"opendata_paris", "openstreetmap"}),
        ("semsig fetch overt", {"overture"}),
        ("semsig localize --paper --exp", {"--explain"}),
        ("semsig info ci", set()),  # the shell completes files
    ],
)
def test_shell_completion(
    line: str, offered: set[str], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("_SEMSIG_COMPLETE", "source_bash")
    code, script, _ = run("")
    assert code == 0
    assert "complete -o default -F _semsig_completion semsig" in script
    monkeypatch.setenv("_SEMSIG_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
    code, out, _ = run("")
    assert (code, set(out.split())) == (0, offered)


def test_escape_sequences_are_made_visible(capsys: pytest.CaptureFixture[str]) -> None:
    console.remark(f"{HOSTILE}\nsemsig: all is well")
    console.say(HOSTILE)
    console.print_table(Table.of(HOSTILE, (HOSTILE,), [(HOSTILE,), ("two\nlines",)]))
    out, err = capsys.readouterr()
    shown = "a\\u001b[2J\\u001b]0;title\\u0007\\u009b31m\\u202eb\\u000d\\ud83d"
    assert err == f"semsig: {shown}\\u000asemsig: all is well\n"
    assert out.count(shown) == 4
    assert all(letter.isprintable() for letter in out.replace("\n", ""))
    console.print_json({HOSTILE: HOSTILE})
    out = capsys.readouterr().out
    assert out.count(shown.replace("\\u000d", "\\r")) == 2
    assert json.loads(out) == {HOSTILE: HOSTILE}


def test_json_keeps_accents_and_refuses_infinity(capsys: pytest.CaptureFixture[str]) -> None:
    console.print_json({"title": "Défibrillateur"})
    out = capsys.readouterr().out
    assert "Défibrillateur" in out
    assert json.loads(out) == {"title": "Défibrillateur"}
    with pytest.raises(ValueError, match="JSON"):
        console.print_json({"error": float("inf")})


def test_progress_prints_nothing_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("working") as advance:
        advance(1, 2)
    assert capsys.readouterr() == ("", "")
    remaining = [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]
    for thread in remaining:
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


WORKING = "semsig: working takes about {} minutes more\n"


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        # A slow first part, then one every second.
        ([(90, 1), (91, 2), (92, 3), (93, 4), (94, 5), (95, 6)], WORKING.format(3)),
        # Slow parts that become fast, as while code is compiled.
        ([(9, 1), (18, 2), (22, 3), (24, 60), (26, 120), (28, 190)], ""),
        ([(2, 100), (4, 150), (6, 200)], ""),
        ([(2, 20), (4, 20), (60, 20)], ""),
    ],
)
def test_long_work_is_estimated_once_it_is_steady(
    steps: list[tuple[float, int]],
    expected: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    with console.progress("working") as advance:
        for now, completed in steps:  # noqa: B007 - the clock
            advance(completed, 200)
    assert capsys.readouterr().err == expected
    with console.progress("working") as advance:
        console.duration_said.set()  # by a warning
        for now, completed in steps:  # noqa: B007
            advance(completed, 200)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("patience_s", "shown"), [(3600.0, False), (0.0, True)])
def test_progress_bar_appears_on_a_terminal_after_a_while(
    patience_s: float,
    shown: bool,  # noqa: FBT001
) -> None:
    code = (
        "import threading\n"
        "from semsig_gis.cli import console\n"
        f"console.PATIENCE_S = {patience_s}\n"
        "with console.progress('digging') as advance:\n"
        "    advance(3, 7)\n"
        "    for thread in threading.enumerate():\n"
        f"        if {shown} and isinstance(thread, threading.Timer):\n"
        "            thread.join()  # like work that takes longer than the patience\n"
        "print('result')"
    )
    ours, theirs = pty.openpty()
    process = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=theirs, text=True, check=True
    )
    os.close(theirs)
    screen = b""
    os.set_blocking(ours, False)
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:
            break
        if not part:
            break
        screen += part
    os.close(ours)
    assert process.stdout == "result\n"
    assert (b"digging" in screen) is shown
    assert (b"3 of 7" in screen) is shown


# --- In another program -----------------------------------------------------------------------

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
    "asleep": "time.sleep(3600)",
    "busy": "while True: pass",
    "waiting for a thread": "import threading; threading.Event().wait()",
}


def start(*arguments: object, **variables: str) -> Any:  # noqa: ANN401 - its pipes are not None
    """Start Python with a pipe for its input, its output and its errors."""
    return subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        env=os.environ | variables,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("work", WORK.values(), ids=WORK)
def test_end_of_input_ends_the_work_and_cleans_up(work: str, tmp_path: Path) -> None:
    with start("-c", WRITES.replace("{work}", work), tmp_path / "out.txt") as process:
        assert process.stdout.readline() == "begun\n"
        assert list(tmp_path.iterdir()) != []
        process.stdin.close()
        assert process.wait(PATIENCE_S) != 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no such signals")
def test_end_of_input_works_if_interrupts_are_ignored(tmp_path: Path) -> None:
    ignoring = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    code = ignoring + WRITES.replace("{work}", WORK["asleep"])
    with start("-c", code, tmp_path / "out.txt") as process:
        process.stdout.readline()
        process.stdin.close()
        assert process.wait(PATIENCE_S) != 0
    assert list(tmp_path.iterdir()) == []


def test_open_input_does_not_delay_the_exit(tmp_path: Path) -> None:
    with start("-c", WRITES.replace("{work}", "pass"), tmp_path / "out.txt") as process:
        assert process.wait(PATIENCE_S) == 0
        assert process.stderr.read() == ""
    assert (tmp_path / "out.txt").read_text() == "half"


def test_supervised_command_prints_progress_and_ends(tmp_path: Path) -> None:
    command = ("-m", "semsig_gis.cli", "synthesize", "--out", tmp_path / "city")
    with start(*command, **{VARIABLE: "1"}) as process:
        line = process.stderr.readline()
        process.stdin.close()
        assert process.wait(PATIENCE_S) not in {0, 2}
    assert line == progress_line("making up a city", 0) + "\n"
    assert list(tmp_path.iterdir()) == []


def test_progress_is_a_line_for_every_percent(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, "1")
    with console.progress("digging") as advance:
        for count in range(1, 1001):
            advance(count, 1000)
        advance(0, 0)
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = printed.err.splitlines()
    percents = [int(re.fullmatch(r"semsig progress (\d+)% digging", line)[1]) for line in lines]  # type: ignore[index]
    assert percents == [*range(101), 0]
