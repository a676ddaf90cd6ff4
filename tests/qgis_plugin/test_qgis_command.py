"""The parts of the QGIS plugin that need no QGIS: the command, its arguments, its answers."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import sys
import time
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from semsig import answers, arguments
from semsig.answers import answer_lines, candidate_rows, parse_answer, place_row, ring
from semsig.arguments import check_output, command_line, require_likelihood
from semsig.command import (
    Cancelled,
    CommandError,
    Watcher,
    clean_environment,
    find_command,
    run_command,
)
from sentences import assert_sentence, refused

from semsig_gis.cli.console import VARIABLE, app
from semsig_gis.likelihood.noise.model import NOISES
from semsig_gis.matching.method import Method
from semsig_gis.queries.chain import parse_chain
from semsig_gis.sources.catalog import catalog_names

unix = pytest.mark.skipif(sys.platform == "win32", reason="the stand-ins are shell scripts")


@dataclasses.dataclass
class Heard:
    """What a watcher heard; it cancels when there are so many of something."""

    percents: list[tuple[int, str]] = dataclasses.field(default_factory=list)
    remarks: list[str] = dataclasses.field(default_factory=list)
    cancel_at: float = math.inf

    def watcher(self) -> Watcher:
        return Watcher(
            lambda percent, label: self.percents.append((percent, label)),
            self.remarks.append,
            lambda: len(self.percents) >= self.cancel_at,
        )


def run_code(code: str, heard: Heard) -> str:
    return run_command([sys.executable, "-c", code], clean_environment(os.environ), heard.watcher())


# --- Where the command is -----------------------------------------------------------------------


def program(folder: Path, name: str = "semsig") -> str:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / name
    file.write_text("#!/bin/sh\n")
    file.chmod(0o755)
    return str(file)


@unix
def test_what_was_chosen_comes_first_then_the_path_then_the_usual_places(tmp_path: Path) -> None:
    chosen = program(tmp_path / "chosen", "semsig-of-mine")
    on_path, usual = program(tmp_path / "path"), program(tmp_path / "py3.12" / "bin")
    path = {"PATH": str(tmp_path / "path")}
    places = (str(tmp_path / "nowhere"), str(tmp_path / "py3.*" / "bin"))
    assert find_command(chosen, path, places) == chosen
    assert find_command("", path, places) == on_path
    assert find_command("", {"PATH": str(tmp_path)}, places) == usual
    assert find_command("", {}, places) == usual


@unix
def test_the_usual_places_are_in_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    expected = program(tmp_path / ".local" / "bin")
    assert find_command("", {"PATH": ""}) == expected
    for folder in ("Scripts", "bin"):  # those of the environment of the documentation
        first = program(tmp_path / "semsig" / folder)
        assert find_command("", {"PATH": ""}) == first
    assert find_command("~/.local/bin/semsig", {}) == expected


def test_a_command_that_is_nowhere(tmp_path: Path) -> None:
    with refused(CommandError, "install semsig_gis", "Settings > Options > Processing"):
        find_command("", {"PATH": str(tmp_path)}, [])
    (tmp_path / "text").write_text("not a program")
    for chosen in ("text", "missing"):
        with refused(CommandError, chosen, "choose the semsig command"):
            find_command(str(tmp_path / chosen), {"PATH": os.defpath})


# --- The environment ----------------------------------------------------------------------------


def test_nothing_of_qgis_is_handed_on() -> None:
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


# --- Running ------------------------------------------------------------------------------------


def test_results_progress_and_remarks_are_told_apart() -> None:
    heard = Heard()
    code = (
        "import sys\n"
        "say = lambda text: print(text, file=sys.stderr)\n"
        "say('semsig: a remark')\n"
        "say('semsig progress 0% digging')\n"
        "say('semsig progress 40% digging')\n"
        "say('')\n"
        "say('a bare line about 40%')\n"
        "print('Défibrillateur ┃ 1')\n"
        "print('x' * 300_000)\n"
    )
    printed = run_code(code, heard)
    assert printed == "Défibrillateur ┃ 1\n" + "x" * 300_000 + "\n"
    assert heard.percents == [(0, "digging"), (40, "digging")]
    assert heard.remarks == ["a remark", "a bare line about 40%"]


def test_a_remark_is_not_held_back_until_the_end() -> None:
    heard: list[str] = []
    watcher = Watcher(lambda _percent, label: heard.append(label), heard.append, lambda: False)
    code = (
        "import sys\n"
        "for line in ('semsig: a remark', 'semsig progress 0% digging', 'semsig: the last'):\n"
        "    print(line, file=sys.stderr)\n"
    )
    run_command([sys.executable, "-c", code], clean_environment(os.environ), watcher)
    assert heard == ["a remark", "digging", "the last"]


FAILED = "The semsig command failed with exit code"


@pytest.mark.parametrize(
    ("code", "message", "remarks"),
    [
        ("say('semsig: a'); say('semsig: x is wrong; give y.'); exit(2)", "x is wrong; give y.", 1),
        ("say('semsig: a'); say('KeyError: 3'); exit(1)", f"{FAILED} 1: KeyError: 3", 1),
        ("say('semsig progress 0% a'); exit(9)", f"{FAILED} 9 and did not say why.", 0),
    ],
)
def test_a_failure_is_told_once(code: str, message: str, remarks: int) -> None:
    heard = Heard()
    begin = "import sys\nsay = lambda text: print(text, file=sys.stderr)\n"
    with pytest.raises(CommandError) as caught:
        run_code(begin + code, heard)
    assert str(caught.value) == message
    assert heard.remarks == ["a"] * remarks


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("exit(2)", "(exit code 2)"),
        ("sys.exit('usage: python')", "(exit code 1: usage: python)"),
        ("print('hello')", "(it did not write {place})"),
    ],
)
@pytest.mark.parametrize("old", [False, True])
def test_another_program_than_the_command(tmp_path: Path, code: str, why: str, old: bool) -> None:  # noqa: FBT001
    place = tmp_path / "city.parquet"
    if old:
        place.write_text("from an earlier run")
    command = [sys.executable, "-c", f"import sys\n{code}"]
    with pytest.raises(CommandError) as caught:
        run_command(command, clean_environment(os.environ), Heard().watcher(), written=str(place))
    why = why.replace("{place}", str(place))
    assert_sentence(caught.value, f"{sys.executable} is not the semsig command", why, "Settings > ")


def test_a_file_that_was_written_anew(tmp_path: Path) -> None:
    place = tmp_path / "city.parquet"
    code = (
        f"import os; from pathlib import Path; part = Path({str(tmp_path / 'part')!r}); "
        f"part.write_text('city'); os.replace(part, {str(place)!r})"
    )
    command = [sys.executable, "-c", code]
    for _ in range(2):
        run_command(command, clean_environment(os.environ), Heard().watcher(), written=str(place))
    assert place.read_text() == "city"


def test_a_program_that_cannot_be_run(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("not a program")
    with refused(CommandError, "text cannot be run"):
        run_command([str(tmp_path / "text")], {}, Heard().watcher())


WAITS = """
import sys, threading, _thread
from pathlib import Path
print("semsig progress 0% waiting", file=sys.stderr, flush=True)
try:
    {wait}
finally:
    Path(sys.argv[1]).write_text("cleaned up")
"""


def test_a_cancel_ends_the_command_by_the_end_of_its_input(tmp_path: Path) -> None:
    heard = Heard(cancel_at=1)
    code = WAITS.replace("{wait}", "sys.stdin.read()")
    command = [sys.executable, "-c", code, str(tmp_path / "log")]
    with pytest.raises(Cancelled):
        run_command(command, clean_environment(os.environ), heard.watcher())
    assert (tmp_path / "log").read_text() == "cleaned up"


@unix
def test_a_command_that_does_not_end_is_ended_with_all_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig.command.PATIENCE_S", 0.3)
    script = tmp_path / "deaf"
    script.write_text(
        "#!/bin/sh\n"
        f"sleep 100 & echo $! > {tmp_path}/child\n"
        f"echo $$ > {tmp_path}/parent\n"
        "echo 'semsig progress 0% sleeping' >&2\nwait\n"
    )
    script.chmod(0o755)
    begin = time.monotonic()
    with pytest.raises(Cancelled):
        run_command([str(script)], {"PATH": os.defpath}, Heard(cancel_at=1).watcher())
    assert time.monotonic() - begin < 20
    for name in ("parent", "child"):
        assert_ended(int((tmp_path / name).read_text()))


def assert_ended(process: int) -> None:
    """Check that a process has ended; one that nobody waited for may be left as a zombie."""
    status = Path(f"/proc/{process}/stat")
    for _ in range(100):
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        if status.exists() and status.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.1)
    pytest.fail(f"process {process} is still there")


def test_a_watcher_that_fails_ends_the_command_too() -> None:
    def fail(_percent: int, _label: str) -> None:
        raise ZeroDivisionError

    code = (
        "import sys; print('semsig progress 1% a', file=sys.stderr, flush=True); sys.stdin.read()"
    )
    with pytest.raises(ZeroDivisionError):
        run_command(
            [sys.executable, "-c", code],
            clean_environment(os.environ),
            Watcher(fail, print, lambda: False),
        )


# --- Arguments ----------------------------------------------------------------------------------


def test_the_command_understands_any_value() -> None:
    nasty = ["--out=x", "-", "--", "a b", "=", "é \u202e'\"`$(x)\\", "*", "\n"]
    line = command_line(
        "load", *nasty, catalog=nasty, out=nasty[0], crs=nasty[5], layer=[], filter=True, merge=None
    )
    assert line[0] == "load"
    load = typer.main.get_command(app).commands["load"]  # type: ignore[attr-defined]
    values = load.make_context("load", line[1:]).params
    assert [str(path) for path in values["files"]] == nasty
    assert values["catalog"] == nasty
    assert str(values["out"]) == nasty[0]
    assert values["crs"] == nasty[5]
    assert values["filters"] is True
    assert not values["layer"]


def test_the_lists_are_those_of_the_command() -> None:
    assert set(arguments.CATALOGS) == set(catalog_names())
    assert set(arguments.NOISES) == set(NOISES)
    for method in arguments.METHODS:
        assert method == arguments.LIKELIHOOD or str(Method.parse(method))
    for name in arguments.DISTORTIONS:
        assert parse_chain(name)


def test_what_only_the_likelihood_has() -> None:
    require_likelihood("likelihood", "Place")
    with refused(CommandError, "Place", "types:edit", "choose the method likelihood"):
        require_likelihood("types:edit", "Place")


def test_outputs_are_checked_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text").write_text("a file")
    (tmp_path / "folder.gpkg").mkdir()
    for path, suffix in (
        ("a.gpkg", "gpkg"),
        (str(tmp_path / "new" / "folder" / "A.GPKG"), "gpkg"),
        ("new/folder", ""),
        (str(tmp_path), ""),
    ):
        check_output(path, suffix)
    for path, suffix, words in (
        ("b.shp", "gpkg", "does not end in .gpkg"),
        ("gpkg", "gpkg", "does not end in .gpkg"),
        ("folder.gpkg", "gpkg", "is a folder"),
        ("text/b.gpkg", "gpkg", "text is not a folder"),
        ("text/deep/results", "", "text is not a folder"),
        ("text", "", "text is not a folder"),
    ):
        with refused(CommandError, path, words):
            check_output(path, suffix)
    monkeypatch.setattr("semsig.arguments.os.access", lambda _path, _mode: False)
    for path, suffix in (("b.gpkg", "gpkg"), ("new/folder", "")):
        with refused(CommandError, path, f"{tmp_path} is read-only"):
            check_output(path, suffix)


# --- Answers ------------------------------------------------------------------------------------


@given(
    centre=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
    shorter=st.floats(1.0, 50.0),
    stretch=st.floats(1.0, 5.0),
    bearing=st.floats(0.0, 180.0),
)
def test_an_ellipse_has_its_axes_and_its_middle(
    centre: tuple[float, float], shorter: float, stretch: float, bearing: float
) -> None:
    corners = ring(centre, shorter * stretch, shorter, bearing)
    assert corners[0] == corners[-1]
    distances = [math.dist(centre, corner) for corner in corners]
    assert max(distances) == pytest.approx(shorter * stretch, rel=1e-6)
    assert min(distances) == pytest.approx(shorter, rel=1e-6)
    far = corners[distances.index(max(distances))]
    seen = math.degrees(math.atan2(far[0] - centre[0], far[1] - centre[1]))
    if stretch > 1.01:
        assert math.cos(2 * math.radians(seen - bearing)) == pytest.approx(1, abs=1e-6)


def test_rows_have_the_fields_that_they_say() -> None:
    ranked = {"rank_low": 1, "rank_high": 20, "distance": 0.3}
    likely = {"rank": 2, "chance": 0.5}
    common = {"cell_id": 7, "types": "DD", "length": 2, "x": 1.0, "y": 2.0}
    told = [
        dict(zip(answers.CANDIDATE_FIELDS, values, strict=True))
        for _, _, values in candidate_rows({"candidates": [common | ranked, common | likely]})
    ]
    assert [one["rank"] for one in told] == [1, 2]
    assert [one["rank_high"] for one in told] == [20, 2]
    assert [one["chance"] for one in told] == [None, 0.5]
    assert [one["distance"] for one in told] == [0.3, None]
    assert place_row({"candidates": []}) is None


def test_what_there_is_to_say_of_an_answer() -> None:
    ranked = {"candidates": [{"rank_high": 1}], "tied_beyond": 1}
    assert answer_lines(ranked) == [
        "The best cell ties with no other.",
        "1 further cell ties with the last candidate.",
    ]
    searched = {"regions": 1, "cells": 13, "km2": 0.0013, "percent": 0.00493, "chance": 0.951}
    placed = {
        "answered": False,
        "place": {"within_m": 50.0, "chance": 0.05},
        "candidates": [],
        "searched": searched,
    }
    assert answer_lines(placed) == [
        "Cannot tell: the best place is within 50 m of the ellipse's middle with a chance of 5.0%.",
        "To search: 1 region, 0.0013 km2, 0.00493 % of the city, with 95.1% of the chance.",
    ]
    del searched["chance"]
    ranked = {"candidates": [{"rank_high": 1200}], "tied_beyond": 0, "searched": searched}
    assert answer_lines(ranked) == [
        "The best 1,200 cells share the ranks 1 to 1,200.",
        "To search: 1 region, 0.0013 km2, 0.00493 % of the city.",
    ]


@pytest.mark.parametrize("printed", ["", "{}", "[]", "3", '{"crs": 1}', "{"])
def test_something_else_than_an_answer(printed: str) -> None:
    with refused(CommandError, "same version"):
        parse_answer(printed)
    assert parse_answer(json.dumps({"crs": "EPSG:2154", "candidates": []}))["crs"] == "EPSG:2154"
