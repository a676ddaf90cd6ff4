"""Plugins: a real package that is built and installed here, and entries that are broken."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from sentences import refused

from semsig_gis.core import (
    CATALOGS,
    COMMANDS,
    READERS,
    CatalogError,
    InputError,
    SourceError,
    installed_catalogs,
    installed_commands,
    installed_readers,
)
from semsig_gis.objects import open_objects

if TYPE_CHECKING:
    from collections.abc import Callable


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package, install it into a folder of its own, and return that."""
    folder = tmp_path_factory.mktemp("plugin")
    shutil.copytree(Path(__file__).parent / "data" / "testville", folder / "source")
    pip = [sys.executable, "-m", "pip", "--isolated", "--disable-pip-version-check", "-q"]
    offline = ["--no-deps", "--no-index", "--no-cache-dir"]
    build = ["wheel", *offline, "--no-build-isolation", "-w", str(folder), str(folder / "source")]
    subprocess.run([*pip, *build], check=True)
    (wheel,) = folder.glob("*.whl")
    target = folder / "site"
    subprocess.run([*pip, "install", *offline, "--target", str(target), str(wheel)], check=True)
    return target


@pytest.fixture
def python(installed: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return a function that runs Python with the package."""
    paths = [str(installed), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            check=True,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )

    return run


@pytest.fixture
def benches(tmp_path: Path) -> Path:
    path = tmp_path / "town.benches"
    path.write_text("a7 770000 6280000\nb8 770020 6280000\n", encoding="utf-8")
    return path


SEMSIG = "-m", "semsig_gis.cli"


def test_installed_package_is_listed_and_used(
    python: Callable[..., subprocess.CompletedProcess[str]], benches: Path, tmp_path: Path
) -> None:
    shown = python(*SEMSIG, "sources", "--json")
    listed = json.loads(shown.stdout)
    # Other installed packages do not matter.
    catalogs = {item["name"]: item["title"] for item in listed["catalogs"]}
    assert catalogs["testville"] == "Testville"
    assert "testville_lines" in listed["readers"]
    assert not {"testville_lost", "testville_broken"} & {*catalogs, *listed["readers"]}
    for name, group in (("testville_broken", READERS), ("testville_lost", CATALOGS)):
        assert f"semsig: '{name}' of {group}" in shown.stderr
    assert "Traceback" not in shown.stderr
    assert ".py:" not in shown.stderr
    out = tmp_path / "objects.parquet"
    options = "--catalog", "testville_again", "--out", out, "--json"
    loaded = python(*SEMSIG, "load", benches, *options)
    assert json.loads(loaded.stdout)["objects"] == 2
    assert open_objects(out).table["source_id"].tolist() == ["a7", "b8"]


HELP = """
import sys
sys.argv = ["semsig", "--help"]
from semsig_gis.cli import main
try: main()
except SystemExit: pass
print("semsig_testville" in sys.modules)
"""


def test_installed_command_is_listed_and_runs_and_is_imported_only_then(
    python: Callable[..., subprocess.CompletedProcess[str]], benches: Path
) -> None:
    out = python("-c", HELP).stdout
    assert re.search(r"^ +count-benches +Command of semsig-testville\.$", out, re.MULTILINE)
    assert out.endswith("\nFalse\n")
    assert python(*SEMSIG, "count-benches", benches).stdout == "2\n"
    assert "Count the benches" in python(*SEMSIG, "count-benches", "--help").stdout
    schema = json.loads(python(*SEMSIG, "schema").stdout)["commands"]
    assert schema["count-benches"]["request"]["required"] == ["file"]
    assert schema["info"]["title"] == "Properties of a database"


# --- Entries without a package around them ----------------------------------------------------


def test_names_are_sorted_and_values_are_paths(
    install: Callable[..., None], tmp_path: Path
) -> None:
    city = tmp_path / "city.toml"
    city.touch()
    code = f"def one(): return {str(city)!r}\nTWO = {str(city)!r}\n"
    install("cities", CATALOGS, code, zz_one="one", aa_two="TWO")
    names = [name for name, path in installed_catalogs().items() if path == city]
    assert names == ["aa_two", "zz_one"]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import a_module_that_is_not_there", "No module named 'a_module_that_is_not_there'"),
        ("x = 1", "has no attribute 'value'"),
        ("raise SystemExit", "SystemExit"),
        ("raise SystemExit('Bye.\\nGo home.')", "Go home"),
        ("def value(): raise ValueError", "ValueError"),
        ("this is no Python!", "invalid syntax"),
        ("value = None", "None, not the path of a .toml file"),
        ("def value(): return 3", "3, not the path of a .toml file"),
        ("value = 'nowhere.toml'", "nowhere.toml does not exist"),
        ("value = __file__", "is not a .toml file"),
    ],
)
def test_broken_catalogue_is_skipped_with_a_warning(
    install: Callable[..., None], tmp_path: Path, code: str, words: str
) -> None:
    good = tmp_path / "good.toml"
    good.touch()
    install("good", CATALOGS, f"value = {str(good)!r}", good="value")
    install("bad", CATALOGS, code, bad="value")
    with pytest.warns(UserWarning, match="'bad' of semsig_gis.catalogs, provided by bad") as caught:
        catalogs = installed_catalogs()
    assert catalogs["good"] == good
    assert "bad" not in catalogs
    (warning,) = caught
    assert warning.filename == __file__
    assert words in str(warning.message)


def test_reader_that_is_no_function_is_skipped_with_a_warning(install: Callable[..., None]) -> None:
    install("bad", READERS, "read_layers = 'x'", bad="read_layers")
    words = r"'bad' of semsig_gis.readers.*it gives 'x', not a function.*; correct or uninstall"
    with pytest.warns(UserWarning, match=words):
        assert "bad" not in installed_readers()


def test_package_may_use_a_name_in_both_groups(install: Callable[..., None]) -> None:
    install("north", READERS, "def read_layers(): pass", city="read_layers")
    install("south", CATALOGS, "def read_layers(): pass", other="read_layers")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "city" in installed_readers()


def test_reserved_name_is_refused(install: Callable[..., None]) -> None:
    for package, group, name in (
        ("north", CATALOGS, "city"),
        ("south", CATALOGS, "city"),
        ("east", READERS, "osm_file"),
        ("west", COMMANDS, "info"),
    ):
        install(package, group, "raise AssertionError", **{name: "value"})
    with refused(CatalogError, "'city'", "by north and by south", "uninstall"):
        installed_catalogs()
    with refused(SourceError, "'osm_file'", "semsig_gis itself", "by east"):
        installed_readers(reserved=["osm_file"])
    with refused(InputError, "'info'", "semsig_gis itself", "by west"):
        installed_commands(reserved=["info"])
