"""Test the package as users install it: each Python, oldest and newest dependencies, both archives.

`make test-all` runs it for all Pythons of the machine. Each session installs an archive in an
environment of its own and tests the installed package. The results go into
``benchmarks/installs.json`` and, as a table, into ``docs/install.md``, unless only some tests were
chosen. `make oldest` writes ``constraints-oldest.txt``.
"""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import nox

nox.options.default_venv_backend = "uv"
nox.options.sessions = ["matrix"]
nox.options.error_on_missing_interpreters = False
HERE = Path(__file__).parent
PROJECT = nox.project.load_toml("pyproject.toml")
PYTHONS = nox.project.python_versions(PROJECT)
CONSTRAINTS = {"oldest": "constraints-oldest.txt", "newest": "constraints.txt"}
EXTRAS = "cluster,detect,heic,plot,raster,serve,stac"
TOOLS = (
    "colour-science",
    "hatchling",
    "hypothesis",
    "jsonschema",
    "onnx",
    "pip",
    "pytest",
    "pytest-xdist",
    "scipy",
    "selenium",
)
# Both archives install the same files, so a few tests are enough for the second.
TESTS = {"wheel": ("core", "localization", "objects", "storage"), "sdist": ("storage",)}
RESULTS = HERE / "benchmarks" / "installs.json"
PAGE = HERE / "docs" / "install.md"
MARKS = ("<!-- make test-all -->\n", "<!-- end -->")
COLUMNS = ("Python", "versions", "archive", "installed", "passed", "failed", "skipped", "tested")


@nox.session(python=False)
def build(session: nox.Session) -> None:
    """Build both archives."""
    dist = Path(session.cache_dir, "dist")
    shutil.rmtree(dist, ignore_errors=True)
    session.run("uv", "build", "--quiet", "--out-dir", str(dist), str(HERE), external=True)


@nox.session(python=PYTHONS, requires=["build"])
@nox.parametrize("archive", ["wheel", "sdist"])
@nox.parametrize("versions", [nox.param(name, tags=[name]) for name in CONSTRAINTS])
def matrix(session: nox.Session, versions: str, archive: str) -> None:
    """Install an archive and test the installation; arguments are the tests to run."""
    dist = Path(session.cache_dir, "dist").resolve()
    work = Path(session.create_tmp(), "checkout").resolve()
    (file,) = dist.glob("*.whl" if archive == "wheel" else "*.tar.gz")
    row: dict[str, object] = {
        "python": session.python,
        "versions": versions,
        "archive": archive,
        "installed": False,
    }
    try:
        start = time.perf_counter()
        session.install(f"semsig_gis[{EXTRAS}] @ {file.as_uri()}", "-c", CONSTRAINTS[versions])
        row |= {"installed": True, "install_s": round(time.perf_counter() - start, 1)}
        session.install(*TOOLS, "-c", CONSTRAINTS[versions])
        # Outside of the checkout, or its package would be imported instead of the installed one.
        shutil.rmtree(work, ignore_errors=True)
        for name in ("tests", "qgis_plugin", "data_sources", "benchmarks"):
            shutil.copytree(HERE / name, work / name)
        for name in ("conftest.py", "pyproject.toml"):
            shutil.copy(HERE / name, work)
        report = work / "report.xml"
        arguments = session.posargs or [f"tests/{name}" for name in TESTS[archive]]
        # Old packages warn of each other.
        arguments = [*arguments, "-W", "default"] if versions == "oldest" else arguments
        with session.chdir(work):
            start = time.perf_counter()
            # As a module, so that the tests can import the benchmarks from this folder.
            command = ("python", "-m", "pytest", "-q", f"--junit-xml={report}")
            session.run(*command, *arguments, success_codes=[0, 1])
        row |= {"test_s": round(time.perf_counter() - start, 1), **_counts(report)}
    finally:
        if not session.posargs:
            _record(row)
    if row["failed"]:
        session.error(f"{row['failed']} tests failed")


@nox.session(python=False)
def oldest(session: nox.Session) -> None:
    """Write the oldest allowed versions that have a wheel, by Python where they differ."""
    pins: dict[str, dict[str, str]] = {}
    extras = [part for name in EXTRAS.split(",") for part in ("--extra", name)]
    for python in PYTHONS:
        text = session.run(
            *("uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate", "pyproject.toml"),
            *("--resolution", "lowest-direct", "--only-binary", ":all:"),
            *("--python-version", python, *extras),
            external=True,
            silent=True,
        )
        for line in str(text).splitlines():
            name, _, version = line.partition("==")
            pins.setdefault(name, {})[python] = version
    lines = [
        "# The oldest versions that pyproject.toml allows and that have wheels; `make test-all`",
        "# tests with them, and `make oldest` writes them.",
    ]
    for name, versions in sorted(pins.items()):
        for version in dict.fromkeys(versions.values()):
            pythons = [python for python in versions if versions[python] == version]
            marker = " or ".join(f"python_version == '{python}'" for python in pythons)
            lines.append(f"{name}=={version}" + (f"; {marker}" if pythons != PYTHONS else ""))
    (HERE / CONSTRAINTS["oldest"]).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _counts(report: Path) -> dict[str, int]:
    (suite,) = ET.parse(report).getroot().iter("testsuite")  # noqa: S314 - pytest's own
    total, skipped = int(suite.get("tests", 0)), int(suite.get("skipped", 0))
    failed = int(suite.get("failures", 0)) + int(suite.get("errors", 0))
    return {"passed": total - skipped - failed, "failed": failed, "skipped": skipped}


def _record(row: dict[str, object]) -> None:
    """Save a row in the results, replacing a row of the same kind, and write the table."""
    rows = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else []
    of_kind = {tuple(map(str, _kind(item))): item for item in [*rows, row]}
    rows = [of_kind[kind] for kind in sorted(of_kind)]
    RESULTS.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    table = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    for item in rows:
        cells = [
            *_kind(item),
            f"{item['install_s']} s" if item["installed"] else "no",
            *(item.get(name, "") for name in ("passed", "failed", "skipped")),
            f"{item['test_s']} s" if "test_s" in item else "",
        ]
        table.append("| " + " | ".join(map(str, cells)) + " |")
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    after = rest.partition(MARKS[1])[2]
    text = f"{before}{MARKS[0]}\n" + "\n".join(table) + f"\n\n{MARKS[1]}{after}"
    PAGE.write_text(text, encoding="utf-8")


def _kind(row: dict[str, object]) -> tuple[object, object, object]:
    return row["python"], row["versions"], row["archive"]
