"""What the command line prints."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
import threading

import pytest

from semsig_gis.cli import console


def test_rows_are_shown_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [("[red]a[/red]", 1234567, 7652000627500), ("x" * 300, -1, 0)]
    console.print_rows("[b]title[/b]", ("name", "count", "id"), rows)
    out = capsys.readouterr().out
    assert "[b]title[/b]" in out
    assert "[red]a[/red]" in out
    assert "1,234,567" in out
    assert " 7652000627500 " in out
    # A pipe has no width, so nothing is folded.
    assert "x" * 300 in out


def test_json_keeps_letters_and_refuses_what_json_lacks(
    capsys: pytest.CaptureFixture[str],
) -> None:
    console.print_json({"title": "Défibrillateur"})
    out = capsys.readouterr().out
    assert "Défibrillateur" in out
    assert json.loads(out) == {"title": "Défibrillateur"}
    with pytest.raises(ValueError, match="JSON"):
        console.print_json({"error": float("inf")})


def test_progress_stays_silent_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with console.progress("working") as advance:
        advance(1, 2)
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("", "")
    remaining = [thread for thread in threading.enumerate() if isinstance(thread, threading.Timer)]
    for thread in remaining:
        thread.join(timeout=1)
        assert not thread.is_alive()


@pytest.mark.parametrize(("work_s", "shown"), [(0.0, False), (0.6, True)])
def test_progress_shows_on_a_terminal_when_work_takes_a_while(work_s: float, shown: bool) -> None:  # noqa: FBT001
    code = (
        "import time\n"
        "from semsig_gis.cli import console\n"
        "console.PATIENCE_S = 0.2\n"
        "with console.progress('digging') as advance:\n"
        "    advance(3, 7)\n"
        f"    time.sleep({work_s})\n"
        "print('result')"
    )
    ours, theirs = pty.openpty()
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=theirs, text=True, check=True
    )
    os.close(theirs)
    seen = b""
    os.set_blocking(ours, False)
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:
            break
        if not part:
            break
        seen += part
    os.close(ours)
    assert done.stdout == "result\n"
    assert (b"digging" in seen) is shown
    assert (b"3/7" in seen) is shown
