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
from sentences import assert_sentence

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.core.plugins import CATALOGS, READERS, installed_catalogs, installed_readers

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
SHOW = """
import sys, warnings
from pathlib import Path
from semsig_gis.core.plugins import installed_catalogs, installed_readers
from semsig_gis.sources.catalog import load_catalog
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    catalogs, readers = installed_catalogs(), installed_readers()
print(*catalogs)
print(*readers)
catalog = load_catalog(catalogs["testville"])
layer, = readers[catalog.reader](Path(sys.argv[1]), catalog.layers)
print(layer.spec.name, layer.counts.read, *layer.table["source_id"])
for warning in caught:
    print(warning.message)
"""


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


def test_an_installed_package_is_seen_by_a_fresh_program(installed: Path, tmp_path: Path) -> None:
    data = tmp_path / "town.benches"
    data.write_text("a7 1 2\nb8 3 4\n", encoding="utf-8")
    paths = [str(installed), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    shown = subprocess.run(
        [sys.executable, "-c", SHOW, str(data)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        check=True,
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    catalogs, readers, layer, *warned = shown.stdout.splitlines()
    # Packages that the machine has beside it do no harm.
    assert {"testville", "testville_again"} <= set(catalogs.split())
    assert "testville_lines" in readers.split()
    assert "lost" not in catalogs
    assert "broken" not in readers
    assert layer == "benches 2 a7 b8"
    assert sorted(line.partition(" ")[0] for line in warned) == [
        "'testville_broken'",
        "'testville_lost'",
    ]


def test_the_command_line_shows_and_uses_an_installed_package(
    installed: Path, tmp_path: Path
) -> None:
    data = tmp_path / "town.benches"
    data.write_text("a7 770000 6280000\nb8 770020 6280000\n", encoding="utf-8")
    paths = [str(installed), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}

    def semsig(*arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "semsig_gis.cli", *arguments],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
            encoding="utf-8",
        )

    shown = semsig("sources")
    assert "testville" in shown.stdout
    assert "testville_lines" in shown.stdout
    assert "semsig: 'testville_broken' of semsig_gis.readers" in shown.stderr
    assert "Traceback" not in shown.stderr
    assert ".py:" not in shown.stderr
    out = tmp_path / "objects.parquet"
    loaded = semsig("load", str(data), "--catalog", "testville", "--out", str(out), "--json")
    assert json.loads(loaded.stdout)["objects"] == 2


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
    found = {name: path for name, path in installed_catalogs().items() if path == city}
    assert list(found) == ["aa_two", "zz_one"]


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
        found = installed_catalogs()
    assert found["good"] == good
    assert "bad" not in found
    assert [warning.filename for warning in caught] == [__file__]
    (warning,) = caught
    assert isinstance(warning.message, UserWarning)
    assert all(word in str(warning.message) for word in words)


def test_a_reader_that_is_no_function_is_told_and_skipped(site: Site) -> None:
    site.module("a_reader_module", "read_layers = 'x'")
    site.add("bad", READERS, bad="a_reader_module:read_layers")
    with pytest.warns(UserWarning, match="it gives 'x', not a function") as caught:
        found = installed_readers()
    assert "bad" not in found
    assert isinstance(caught[0].message, UserWarning)
    assert_sentence(caught[0].message, "'bad'", READERS, "correct or uninstall")


def test_two_packages_with_one_name_are_an_error(site: Site) -> None:
    site.add("north", CATALOGS, city="nothing_to_import:value")
    site.add("south", CATALOGS, city="nothing_to_import:other")
    with pytest.raises(CatalogError) as caught:
        installed_catalogs()
    assert_sentence(caught.value, "'city'", "by north and by south", "uninstall")


def test_one_package_may_use_a_name_in_both_groups(site: Site) -> None:
    site.module("a_shared_module", "def read_layers(): pass")
    site.add("north", READERS, city="a_shared_module:read_layers")
    site.add("south", CATALOGS, other="a_shared_module:read_layers")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "city" in installed_readers()


def test_the_name_of_a_built_in_is_an_error(site: Site) -> None:
    site.add("north", READERS, osm_file="nothing_to_import:value")
    with pytest.raises(SourceError) as caught:
        installed_readers(taken=["osm_file"])
    assert_sentence(caught.value, "'osm_file'", "semsig_gis itself", "by north")
