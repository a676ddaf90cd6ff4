"""Checks of the project: tracked files, contents of the wheel, documentation."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import shutil
import socket
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from numpydoc.validate import validate
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import semsig_gis
from semsig_gis.output.html import page

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "semsig_gis"
INFO = f"semsig_gis-{semsig_gis.__version__}.dist-info"

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="the tests do not run from a checkout"
)

# Written so that the patterns do not match this file.
REGISTRY_HOST = re.compile(r"py(?:pi[.]org|thonhosted[.])|npm(?:js)[.]|proxy[.]golang|crates[.]io")
MACHINE_PATH = re.compile(r"(?<![\w.~:/-])/(?:home|root|work|tmp|opt|mnt|Users)[/]\w")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build the wheel and return the text of each file in it (empty for other files)."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
        env={"PATH": ""},  # no npm, thus no download; existing files are packed
    )
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        return {
            name: archive.read(name).decode("utf-8") if "dist-info" in name else ""
            for name in archive.namelist()
        }


def tracked_files() -> list[Path]:
    """Return the files that git tracks, or would track after ``git add``."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    command = [git, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


@pytest.mark.parametrize("pattern", [REGISTRY_HOST, MACHINE_PATH], ids=["host", "path"])
def test_no_tracked_file_names_a_registry_or_a_machine(pattern: re.Pattern[str]) -> None:
    matches = []
    for path in tracked_files():
        content = path.read_bytes()
        if b"\0" not in content:
            lines = content.decode("utf-8", errors="replace").splitlines()
            matches += [f"{path.name}: {line.strip()}" for line in lines if pattern.search(line)]
    assert matches == []


def test_patterns_match_hosts_and_paths() -> None:
    assert REGISTRY_HOST.search("https://" + "pypi" + ".org/simple")
    assert REGISTRY_HOST.search("registry." + "npmjs" + ".org")
    assert MACHINE_PATH.search('open("/' + 'home/me/x")')
    assert not MACHINE_PATH.search("https://example.org/home/x, docs/work/x, ~/tmp/x")


def test_data_sources_contain_only_data() -> None:
    suffixes = {path.suffix for path in (ROOT / "data_sources").rglob("*") if path.is_file()}
    assert suffixes <= {".json", ".md", ".toml"}
    assert ".toml" in suffixes


def test_the_wheel_is_complete(wheel: dict[str, str]) -> None:
    files = (path for path in ROOT.glob("data_sources/**/*") if path.is_file())
    data = {f"semsig_gis/{path.relative_to(ROOT)}" for path in files}
    suffixes = {".css", ".html", ".js", ".py", ".qgs", ".qml", ".xml"}
    code = {str(path.relative_to(ROOT)) for path in PACKAGE.rglob("*") if path.suffix in suffixes}
    others = {"py.typed", "assets/manifest.toml"}
    assert data | code | {f"semsig_gis/{name}" for name in others} <= wheel.keys()
    if page.available():
        assert {f"semsig_gis/assets/{name}" for name in page.assets()} <= wheel.keys()
    assert {name.partition("/")[0] for name in wheel} == {"semsig_gis", INFO}


def test_the_wheel_has_entry_point_licences_and_materials(wheel: dict[str, str]) -> None:
    assert "semsig = semsig_gis.cli:main" in wheel[f"{INFO}/entry_points.txt"]
    assert "BSD 3-Clause License" in wheel[f"{INFO}/licenses/LICENSE"]
    available = page.available()
    others = " AND BSD-2-Clause AND MIT" if available else ""
    assert f"\nLicense-Expression: BSD-3-Clause{others}\n" in wheel[f"{INFO}/METADATA"]
    for name in ("leaflet", "jquery"):
        assert (f"{INFO}/licenses/semsig_gis/assets/{name}.LICENSE.txt" in wheel) == available
        assert (f"pkg:npm/{name}@" in wheel.get(f"{INFO}/sboms/assets.cdx.json", "")) == available


def test_every_dependency_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    required = [*project["dependencies"], *(name for extra in extras for name in extra)]
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [Requirement(line) for line in lines if line and not line.startswith("#")]
    assert all(str(pin.specifier).startswith("==") and pin.url is None for pin in pins)
    names = {canonicalize_name(pin.name) for pin in pins}
    required_names = {canonicalize_name(Requirement(name).name) for name in required}
    assert required_names - names == {"semsig-gis"}


def test_the_version_is_the_same_everywhere() -> None:
    version = semsig_gis.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    codemeta = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert citation["version"] == codemeta["version"] == version
    day = str(citation["date-released"])
    assert codemeta["datePublished"] == day
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d.*)\] - (.*)$", changes, re.MULTILINE)
    assert released[0] == (version, day)


def test_metadata_of_the_software_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    codemeta = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))
    assert codemeta["description"] == project["description"]
    assert codemeta["license"].rpartition("/")[2] == citation["license"]
    assert codemeta["keywords"] == citation["keywords"]
    assert set(codemeta["keywords"]) <= set(project["keywords"])
    authors = (project["authors"], codemeta["author"], citation["authors"])
    first, *others = ([author["name"] for author in listed] for listed in authors)
    assert all(names == first for names in others)
    (article,) = codemeta["referencePublication"]
    assert article["id"].endswith(citation["references"][0]["doi"])


def test_the_picture_of_the_architecture_is_current() -> None:
    check = [sys.executable, str(ROOT / "docs/architecture.py"), "--check"]
    assert subprocess.run(check, check=False, cwd=ROOT).returncode == 0


EXPORTED = {name: getattr(semsig_gis, name) for name in dir(semsig_gis)}
FUNCTIONS = [name for name, value in EXPORTED.items() if inspect.isfunction(value)]


@pytest.mark.parametrize("name", [name for name, value in EXPORTED.items() if callable(value)])
def test_exported_functions_and_classes_have_an_example(name: str) -> None:
    assert "\n>>> " in (inspect.getdoc(EXPORTED[name]) or "")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_exported_functions_document_parameters_and_results(name: str) -> None:
    signature = inspect.signature(EXPORTED[name])
    checks = {"GL08"}
    if "options" not in signature.parameters:  # options are documented one by one
        checks |= {"PR01", "PR02"}
    if not signature.return_annotation.startswith("Iterator"):
        checks |= {"RT01", "RT03"}
    faults = validate(f"semsig_gis.{name}")["errors"]
    assert [fault for fault in faults if fault[0] in checks] == []


def test_allowed_lines_with_avoided_words_are_still_in_use() -> None:
    allowed = ROOT / ".ci/words/allowed.txt"
    lines: set[str] = set()
    for path in tracked_files():
        if path.suffix in {".py", ".md", ".js", ".toml", ".ipynb", ".html", ".qml"}:
            lines |= {line.rstrip() for line in path.read_text("utf-8").splitlines()}
    assert set(allowed.read_text("utf-8").splitlines()) - lines == set()


@pytest.mark.parametrize("front", [path.parent for path in PACKAGE.rglob("__init__.pyi")])
def test_no_exported_name_is_also_a_module(front: Path) -> None:
    # Importing such a module would replace the exported name on the package.
    package = importlib.import_module(".".join(front.relative_to(PACKAGE.parent).parts))
    assert {path.stem for path in front.iterdir()} & {*dir(package)} == set()


@pytest.mark.parametrize("front", [path.parent for path in PACKAGE.rglob("__init__.pyi")])
def test_exported_names_exist(front: Path) -> None:
    package = importlib.import_module(".".join(front.relative_to(PACKAGE.parent).parts))
    assert all(hasattr(package, name) for name in dir(package))


# Whole packages, as `from semsig_gis import database as databases`, are fronts.
FRONTS = "|".join(path.parent.name for path in PACKAGE.glob("*/__init__.pyi"))
ROOT_IMPORT = re.compile(
    rf"^ *(import semsig_gis$|from semsig_gis import (?!__version__$|({FRONTS}) as ))", re.MULTILINE
)


def test_no_module_imports_the_root() -> None:
    """Modules import from fronts; only `core.presentation` gets public functions, by name."""
    modules = [
        path for path in PACKAGE.rglob("*.py") if ROOT_IMPORT.search(path.read_text("utf-8"))
    ]
    assert modules == []


def test_results_import_no_plotting_library() -> None:
    lines = [
        "import sys",
        "import semsig_gis.database.database",
        "import semsig_gis.objects.table",
        "import semsig_gis.localization.likelihood.locate",
        "import semsig_gis.evaluation.result",
    ]
    lines += ["sys.exit(bool({'matplotlib', 'folium'} & sys.modules.keys()))"]
    assert subprocess.run([sys.executable, "-c", "; ".join(lines)], check=False).returncode == 0


def test_no_test_reaches_the_network() -> None:
    refused = pytest.raises(RuntimeError, match=r"tried to reach \('192\.0\.2\.1', 80\)")
    with socket.socket() as outward, refused:
        outward.connect(("192.0.2.1", 80))
    with pytest.raises(RuntimeError, match=r"tried to reach \('example\.org',\)"):
        socket.getaddrinfo("example.org", 80)
    with socket.create_server(("127.0.0.1", 0)) as server:
        socket.create_connection(server.getsockname()).close()
