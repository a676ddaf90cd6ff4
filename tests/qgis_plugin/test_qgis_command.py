"""The parts of the QGIS plugin that need no QGIS: the command, its arguments, its answers."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import typer
from machine import PATIENCE_S
from semsig.answers import doubt
from semsig.arguments import check_output, command_line
from semsig.command import (
    Cancelled,
    CommandError,
    Watcher,
    clean_environment,
    find_command,
    run_command,
)
from sentences import refused

from semsig_gis.cli.app import app
from semsig_gis.cli.console import VARIABLE
from semsig_gis.commands import commands
from semsig_gis.commands.schema import command_schema
from semsig_gis.localization.answers import doubt_sentence

unix = pytest.mark.skipif(sys.platform == "win32", reason="the stand-ins are shell scripts")


# The beginning of each program.
SAY = "import sys\nsay = lambda text: print(text, file=sys.stderr, flush=True)\n"


@dataclass
class Log:
    """Runs programs and records what a watcher receives; can cancel at its first line."""

    cancelling: bool = False
    lines: list[object] = field(default_factory=list)

    def run(self, *command: object, written: str | None = None) -> str:
        watcher = Watcher(
            lambda *progress: self.lines.append(progress),
            self.lines.append,
            lambda: self.cancelling and bool(self.lines),
        )
        arguments = [str(part) for part in command]
        return run_command(arguments, clean_environment(os.environ), watcher, written=written)

    def run_code(self, code: str, *arguments: object, written: str | None = None) -> str:
        return self.run(sys.executable, "-c", SAY + code, *arguments, written=written)


def program(folder: Path, name: str = "semsig") -> str:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_text("#!/bin/sh\n")
    file.chmod(0o755)
    return str(file)


@unix
def test_command_is_from_the_settings_then_the_path_then_usual_folders(tmp_path: Path) -> None:
    preferred = program(tmp_path / "chosen", "semsig-of-mine")
    on_path, usual = program(tmp_path / "path"), program(tmp_path / "py3.12" / "bin")
    path, places = {"PATH": f"{tmp_path}/path"}, (f"{tmp_path}/none", f"{tmp_path}/py3.*/bin")
    assert find_command(preferred, path, places) == preferred
    assert find_command("", path, places) == on_path
    for variables in ({"PATH": str(tmp_path)}, {}):
        assert find_command("", variables, places) == usual


@unix
def test_usual_folders_are_in_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    expected = program(tmp_path / ".local" / "bin")
    assert find_command("", {"PATH": ""}) == expected
    for folder in ("Scripts", "bin"):  # of the environment in the documentation
        first = program(tmp_path / "semsig" / folder)
        assert find_command("", {"PATH": ""}) == first
    assert find_command("~/.local/bin/semsig", {}) == expected


def test_missing_command_is_an_error(tmp_path: Path) -> None:
    with refused(
        CommandError, "Plugins > Semantic signatures > Engine...", "Settings > Options > Processing"
    ):
        find_command("", {"PATH": str(tmp_path)}, [])
    (tmp_path / "text").write_text("not a program")
    for name in ("text", "missing"):
        with refused(CommandError, name, "choose the semsig command"):
            find_command(str(tmp_path / name), {"PATH": os.defpath})
    with refused(CommandError, "text cannot be run"):
        Log().run(tmp_path / "text")


def test_variables_of_qgis_are_removed() -> None:
    foreign = dict.fromkeys(
        (
            *("PYTHONPATH", "PYTHONHOME", "PythonPath", "GDAL_DATA", "GDAL_DRIVER_PATH"),
            *("PROJ_LIB", "PROJ_DATA", "PROJ_NETWORK", "LD_LIBRARY_PATH", "LD_PRELOAD"),
            *("DYLD_LIBRARY_PATH", "QT_QPA_PLATFORM", "QT_PLUGIN_PATH", "QGIS_PREFIX_PATH"),
            *("OGR_SKIP", "CPL_LOG", "GISBASE", "OSGEO4W_ROOT", "__PYVENV_LAUNCHER__"),
        ),
        "qgis",
    )
    own = {"PATH": "a:b", "HOME": "c", "SYSTEMROOT": "d", "HTTPS_PROXY": "e", "LANG": "f"}
    assert clean_environment(foreign | own) == own | {"PYTHONUTF8": "1", VARIABLE: "1"}


def test_results_progress_and_remarks_are_separated() -> None:
    log = Log()
    printed = log.run_code(
        "say('semsig: a remark')\n"
        "say('semsig progress 0% digging')\n"
        "say('semsig progress 40% filling')\n"
        "say('')\n"
        "say('a bare line about 40%')\n"
        "print('Défibrillateur ┃ 1')\n"
        "print('x' * 300_000)\n"
    )
    assert printed == "Défibrillateur ┃ 1\n" + "x" * 300_000 + "\n"
    # Only the last remark waits for the end.
    assert log.lines == ["a remark", (0, "digging"), (40, "filling"), "a bare line about 40%"]


FAILED, SILENT = "The semsig command failed with exit code", "did not say why."


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("say('semsig: a'); say('semsig: x is wrong; give y.'); exit(2)", "x is wrong; give y."),
        ("say('semsig: a'); say('KeyError: 3'); exit(1)", f"{FAILED} 1: KeyError: 3"),
        ("say('semsig: a'); say('semsig progress 0% b'); exit(9)", f"{FAILED} 9 and {SILENT}"),
    ],
)
def test_a_failure_is_reported_once(code: str, message: str) -> None:
    log = Log()
    with pytest.raises(CommandError) as caught:
        log.run_code(code)
    assert str(caught.value) == message
    assert [line for line in log.lines if isinstance(line, str)] == ["a"]


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("exit(2)", "(exit code 2)"),
        ("sys.exit('usage: python')", "(exit code 1: usage: python)"),
        ("print('hello')", "(it did not write {place})"),
    ],
)
@pytest.mark.parametrize("old", [False, True])
def test_another_program_is_reported(tmp_path: Path, code: str, why: str, old: bool) -> None:  # noqa: FBT001
    place = tmp_path / "city.parquet"
    if old:
        place.write_text("from an earlier run")
    why = why.replace("{place}", str(place))
    words = (f"{sys.executable} is not the semsig command", why, "Settings > ")
    with refused(CommandError, *words):
        Log().run_code(code, written=str(place))


def test_file_that_is_written_again_is_recognized(tmp_path: Path) -> None:
    place = tmp_path / "city.parquet"
    code = (
        "from pathlib import Path; part, place = map(Path, sys.argv[1:]); "
        "part.write_text('city'); part.replace(place)"
    )
    for _ in range(2):
        Log().run_code(code, tmp_path / "part", place, written=str(place))
    assert place.read_text() == "city"


def test_cancelling_closes_the_input_of_the_command(tmp_path: Path) -> None:
    code = (
        "say('semsig progress 0% waiting')\n"
        "try: sys.stdin.read()\n"
        "finally: open(sys.argv[1], 'w').write('cleaned up')\n"
    )
    with pytest.raises(Cancelled):
        Log(cancelling=True).run_code(code, tmp_path / "log")
    assert (tmp_path / "log").read_text() == "cleaned up"


@unix
def test_command_that_does_not_end_is_killed_with_its_children(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig.command.PATIENCE_S", 0.3)
    script = tmp_path / "deaf"
    script.write_text(
        "#!/bin/sh\n"
        f"sleep 86400 & echo $! > {tmp_path}/child\n"
        f"echo $$ > {tmp_path}/parent\n"
        "echo 'semsig progress 0% sleeping' >&2\nwait\n"
    )
    script.chmod(0o755)
    with pytest.raises(Cancelled):
        Log(cancelling=True).run(script)
    for name in ("parent", "child"):
        assert_ended(int((tmp_path / name).read_text()))


def assert_ended(process: int) -> None:
    """Check that a process has ended; it may remain as a zombie if nobody waited for it."""
    status = Path(f"/proc/{process}/stat")
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        if status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.1)
    pytest.fail(f"process {process} is still running")


def test_error_in_a_watcher_ends_the_command() -> None:
    def fail(_percent: int, _label: str) -> None:
        raise ZeroDivisionError

    command = [sys.executable, "-c", SAY + "say('semsig progress 1% a'); sys.stdin.read()"]
    with pytest.raises(ZeroDivisionError):
        run_command(command, clean_environment(os.environ), Watcher(fail, print, lambda: False))


def test_command_line_quotes_any_value() -> None:
    nasty = ["--out=x", "-", "--", "a b", "=", "é \u202e'\"`$(x)\\", "*", "\n"]
    command = command_schema(commands()["load"])
    values = {"files": nasty, "catalog": nasty, "out": nasty[0], "crs": nasty[5], "layer": []}
    line = command_line("load", command, {**values, "filter": False, "merge": True})
    assert line[0] == "load"
    load = typer.main.get_command(app).commands["load"]  # type: ignore[attr-defined]
    parsed = load.make_context("load", line[1:]).params
    assert [str(path) for path in parsed["files"]] == parsed["catalog"] == nasty
    assert (str(parsed["out"]), parsed["crs"]) == (nasty[0], nasty[5])
    assert (parsed["filter"], parsed["merge"]) == (False, True)
    assert not parsed["layer"]
    with refused(CommandError, "Files was not given"):
        command_line("load", command, {"out": "objects.parquet"})


@pytest.mark.parametrize("elsewhere", [0.0, 0.0999, 0.1, 0.5, 0.999])
@pytest.mark.parametrize("fit", [None, 0.0, 0.00999, 0.01, 0.7])
def test_doubts_are_those_of_the_command(elsewhere: float, fit: float | None) -> None:
    assert doubt({"elsewhere": elsewhere, "fit": fit}) == doubt_sentence(elsewhere, fit)


def test_outputs_are_checked_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text").write_text("a file")
    (tmp_path / "folder.gpkg").mkdir()
    for path, suffix in (("a.gpkg", ".gpkg"), (f"{tmp_path}/A.GPKG", ".gpkg"),
                         ("new/folder", ""), (str(tmp_path), "")):  # fmt: skip
        check_output(path, [suffix])
    check_output("tiles", [".parquet", ""])
    for path, suffix, words in (
        ("b.shp", ".gpkg", "does not end in .gpkg"),
        ("gpkg", ".gpkg", "does not end in .gpkg"),
        ("folder.gpkg", ".gpkg", "is a folder"),
        ("text/b.gpkg", ".gpkg", "text is not a folder"),
        ("new/b.gpkg", ".gpkg", "there is no folder new; make it"),
        ("text/deep/results", "", "text is not a folder"),
        ("text", "", "text is not a folder"),
    ):
        with refused(CommandError, path, words):
            check_output(path, [suffix])
    monkeypatch.setattr("semsig.arguments.os.access", lambda _path, _mode: False)
    for path, suffix in (("b.gpkg", ".gpkg"), ("new/folder", "")):
        with refused(CommandError, path, f"{tmp_path} is read-only"):
            check_output(path, [suffix])
