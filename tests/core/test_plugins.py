"""Plugins: a real package that is built and installed here, and entries that are broken."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import warnings
from typing import TYPE_CHECKING

import pytest
from sentences import assert_sentence, refused

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.core.plugins import CATALOGS, READERS, installed_catalogs, installed_readers
from semsig_gis.objects.table import open_objects

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PYPROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "semsig-testville"
version = "1.0"

[project.entry-points."semsig_gis.catalogs"]
testville = "semsig_testville:CATALOG"
testville_again = "semsig_testville:find_catalog"
testville_lost = "semsig_testville:LOST"

[project.entry-points."semsig_gis.readers"]
testville_lines = "semsig_testville.reader:read_layers"
testville_broken = "semsig_testville.broken:read_layers"
"""
CATALOG = """
name = "testville"
title = "Testville"
reader = "testville_lines"

[[layers]]
name = "benches"
class = "bench"
files = ["*.benches"]
"""
# All that the package does is in these files; nothing of it is imported by the tests themselves.
PACKAGE = {
    "pyproject.toml": PYPROJECT,
    "semsig_testville/__init__.py": """
from pathlib import Path

CATALOG = Path(__file__).with_name("testville.toml")
LOST = str(CATALOG.with_name("lost.toml"))


def find_catalog():
    return str(CATALOG)
""",
    "semsig_testville/testville.toml": CATALOG,
    "semsig_testville/reader.py": """
import geopandas as gpd
from semsig_gis.sources import RawLayer, RowCounts


def read_layers(path, specs, *, filters=True, crs=None):
    rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    table = gpd.GeoDataFrame(
        {"class_name": "bench", "source_id": [name for name, _, _ in rows]},
        geometry=gpd.points_from_xy([row[1] for row in rows], [row[2] for row in rows]),
        crs=crs or "EPSG:2154",
    )
    counts = RowCounts(read=len(rows))
    return tuple(RawLayer(spec=spec, table=table, counts=counts) for spec in specs)
""",
    "semsig_testville/broken.py": "import a_module_that_is_not_there\n",
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package, install it into a folder of its own, and return that."""
    folder = tmp_path_factory.mktemp("plugin")
    for name, content in PACKAGE.items():
        path = folder / "source" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")
    pip = [sys.executable, "-m", "pip", "--isolated", "--disable-pip-version-check", "-q"]
    offline = ["--no-deps", "--no-index", "--no-cache-dir"]
    build = ["wheel", *offline, "--no-build-isolation", "-w", str(folder), str(folder / "source")]
    subprocess.run([*pip, *build], check=True)
    (wheel,) = folder.glob("*.whl")
    target = folder / "site"
    subprocess.run([*pip, "install", *offline, "--target", str(target), str(wheel)], check=True)
    return target


def test_an_installed_package_is_shown_and_used(installed: Path, tmp_path: Path) -> None:
    data, out = tmp_path / "town.benches", tmp_path / "objects.parquet"
    data.write_text("a7 770000 6280000\nb8 770020 6280000\n", encoding="utf-8")
    paths = [str(installed), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]

    def semsig(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "semsig_gis.cli", *arguments, "--json"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
            check=True,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )

    shown = semsig("sources")
    listed = json.loads(shown.stdout)
    # Packages that the machine has beside it do no harm.
    catalogs = {item["name"]: item["title"] for item in listed["catalogs"]}
    assert catalogs["testville"] == "Testville"
    assert "testville_lines" in listed["readers"]
    assert not {"testville_lost", "testville_broken"} & {*catalogs, *listed["readers"]}
    for name, group in (("testville_broken", READERS), ("testville_lost", CATALOGS)):
        assert f"semsig: '{name}' of {group}" in shown.stderr
    assert "Traceback" not in shown.stderr
    assert ".py:" not in shown.stderr
    loaded = semsig("load", str(data), "--catalog", "testville_again", "--out", str(out))
    assert json.loads(loaded.stdout)["objects"] == 2
    assert open_objects(out).table["source_id"].tolist() == ["a7", "b8"]


# --- Entries without a package around them ----------------------------------------------------


class Site:
    """A folder on the path in which distributions stand, as an installer leaves them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, package: str, group: str, **entries: str) -> None:
        info = self.folder / f"{package}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
        (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")

    def module(self, name: str, code: str) -> None:
        (self.folder / f"{name}.py").write_text(code, encoding="utf-8")
        importlib.invalidate_caches()


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    (tmp_path / "site").mkdir()
    monkeypatch.syspath_prepend(tmp_path / "site")
    before = set(sys.modules)
    yield Site(tmp_path / "site")
    for name in set(sys.modules) - before:  # another test may have a module of that name
        if name.startswith("a_"):
            del sys.modules[name]


def test_without_plugins_there_is_nothing(site: Site) -> None:
    site.add("other", "console_scripts", other="os:getcwd")
    assert "other" not in installed_catalogs()
    assert "other" not in installed_readers()


def test_names_come_sorted_and_paths_are_paths(site: Site, tmp_path: Path) -> None:
    city = tmp_path / "city.toml"
    city.touch()
    site.module("a_two_cities_module", f"def one(): return {str(city)!r}\nTWO = {str(city)!r}\n")
    site.add("cities", CATALOGS, zz_one="a_two_cities_module:one", aa_two="a_two_cities_module:TWO")
    names = [name for name, path in installed_catalogs().items() if path == city]
    assert names == ["aa_two", "zz_one"]


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import a_module_that_is_not_there", ("No module named 'a_module_that_is_not_there'",)),
        ("x = 1", ("has no attribute 'value'",)),
        ("raise SystemExit", ("SystemExit",)),
        ("raise SystemExit('Bye.\\nGo home.')", ("Go home",)),
        ("def value(): raise ValueError", ("ValueError",)),
        ("this is no Python!", ("invalid syntax",)),
        ("value = None", ("None", "not the path of a .toml file")),
        ("def value(): return 3", ("3", "not the path of a .toml file")),
        ("value = 'nowhere.toml'", ("nowhere.toml does not exist",)),
        ("value = __file__", ("is not a .toml file",)),
    ],
)
def test_a_broken_catalogue_is_told_and_skipped(
    site: Site, tmp_path: Path, code: str, words: tuple[str, ...]
) -> None:
    good = tmp_path / "good.toml"
    good.touch()
    site.module("a_good_module", f"value = {str(good)!r}")
    site.module("a_bad_module", code)
    site.add("good", CATALOGS, good="a_good_module:value")
    site.add("bad", CATALOGS, bad="a_bad_module:value")
    with pytest.warns(UserWarning, match="'bad' of semsig_gis.catalogs, brought by bad") as caught:
        catalogs = installed_catalogs()
    assert catalogs["good"] == good
    assert "bad" not in catalogs
    assert [warning.filename for warning in caught] == [__file__]
    (warning,) = caught
    assert isinstance(warning.message, UserWarning)
    assert all(word in str(warning.message) for word in words)


def test_a_reader_that_is_no_function_is_told_and_skipped(site: Site) -> None:
    site.module("a_reader_module", "read_layers = 'x'")
    site.add("bad", READERS, bad="a_reader_module:read_layers")
    with pytest.warns(UserWarning, match="it gives 'x', not a function") as caught:
        assert "bad" not in installed_readers()
    assert isinstance(caught[0].message, UserWarning)
    assert_sentence(caught[0].message, "'bad'", READERS, "correct or uninstall")


def test_two_packages_with_one_name_are_an_error(site: Site) -> None:
    site.add("north", CATALOGS, city="nothing_to_import:value")
    site.add("south", CATALOGS, city="nothing_to_import:other")
    with refused(CatalogError, "'city'", "by north and by south", "uninstall"):
        installed_catalogs()


def test_one_package_may_use_a_name_in_both_groups(site: Site) -> None:
    site.module("a_shared_module", "def read_layers(): pass")
    site.add("north", READERS, city="a_shared_module:read_layers")
    site.add("south", CATALOGS, other="a_shared_module:read_layers")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "city" in installed_readers()


def test_the_name_of_a_built_in_is_an_error(site: Site) -> None:
    site.add("north", READERS, osm_file="nothing_to_import:value")
    with refused(SourceError, "'osm_file'", "semsig_gis itself", "by north"):
        installed_readers(taken=["osm_file"])
