"""`semsig serve`: start, stop and errors."""

from __future__ import annotations

import http.client
import os
import re
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from machine import PATIENCE_S
from sentences import sentence
from worlds import save_town

from semsig_gis import serve

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's jobs may ignore it
from semsig_gis.cli import main
sys.argv = ["semsig", *sys.argv[1:]]
main()
"""


@pytest.fixture
def town(tmp_path: Path) -> Path:
    return save_town(tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="interrupts are sent in another way")
def test_workbench_opens_and_ends_with_the_interrupt_key(town: Path, map_files: None) -> None:  # noqa: ARG001
    command = [sys.executable, "-c", START, "serve", str(town), "--no-browser"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:(\d+)(/\?token=[\w-]{43})$", line.strip())
        assert address
        server = http.client.HTTPConnection("127.0.0.1", int(address[1]), timeout=PATIENCE_S)
        server.request("GET", address[2])
        assert b"workbench" in server.getresponse().read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
        server.close()  # the browser keeps it open until then
    assert (process.returncode, out) == (130, "")
    assert err.splitlines() == ["semsig: it runs until you press Ctrl-C", "semsig: interrupted"]


def test_missing_libraries_are_named(town: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "semsig_gis.serve.server", raising=False)
    # The front of a package keeps what it has loaded.
    for name in ("server", "make_server", "open_listener", "server_address"):
        monkeypatch.delitem(vars(serve), name, raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    sentence(run("serve", town, "--no-browser"), "semsig_gis[serve]")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--port", "70000"), ("--port", "65,535")),
        (("--noise", "loud"), ("loud", "generic")),
        (("--objects", "nowhere.parquet"), ("nowhere.parquet",)),
    ],
)
def test_invalid_options_are_refused(
    town: Path, run: Run, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    sentence(run("serve", town, "--no-browser", *options), *words)
    sentence(run("serve", "nowhere.parquet"), "nowhere.parquet")
