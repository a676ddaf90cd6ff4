"""Shared fixtures: optional parts of a machine, no network, the command line, a browser."""

from __future__ import annotations

import functools
import gc
import importlib
import json
import logging
import os
import shutil
import socket
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import hypothesis
import jsonschema
import pytest
from browser_coverage import BrowserCoverage
from filelock import FileLock
from machine import PATIENCE_S, Part, qgis_variables, required, unavailable

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator

    from distributed import LocalCluster
    from selenium.webdriver import Chrome
    from servers import Server

    Run = Callable[..., tuple[int, str, str]]
    RunOk = Callable[..., str]

# QGIS runs the first with its own Python; importing the second would register its command.
collect_ignore = ["qgis_plugin/qgis_session.py", "core/data"]

# Twenty examples are enough in a suite that is run many times. To try five hundred:
# pytest -m hypothesis --hypothesis-profile semsig-soak
plain = hypothesis.settings(deadline=None, max_examples=20)
hypothesis.settings.register_profile("semsig-soak", plain, max_examples=500)
hypothesis.settings.register_profile("semsig", plain)
hypothesis.settings.register_profile("semsig-ci", plain, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("semsig-ci" if os.environ.get("CI") else "semsig")

LONGEST = {"project", "qgis_plugin", "test_draft.py"}  # folders and files of tests

BROWSER_COVERAGE = BrowserCoverage()


def pytest_configure(config: pytest.Config) -> None:
    # The workers of the tests keep all processors busy already.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if config.getoption("cov_source", None):
        config.pluginmanager.register(BROWSER_COVERAGE)
    unknown = required() - {*get_args(Part)}
    if unknown:
        raise pytest.UsageError(
            f"SEMSIG_REQUIRE names {sorted(unknown)}; it may name {get_args(Part)}."
        )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest tests, so that none is still running when all others are finished."""
    items.sort(key=lambda item: LONGEST.isdisjoint({item.path.parent.name, item.path.name}))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Exclude imported objects from garbage collection, which would take a third of the time.

    Objects of the tests are collected less often than usual, too.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 20, 50)
        gc.enable()


def is_local(address: object) -> bool:
    """Whether a socket address is on this machine."""
    if not isinstance(address, tuple):
        return True  # a Unix socket
    host = str(address[0] or "localhost")
    return host in {"localhost", "::1"} or host.startswith("127.")


@pytest.fixture(autouse=True, scope="session")
def _no_terminal() -> None:
    """Remove the size of a terminal from the environment, which Python's readline puts there."""
    for name in ("COLUMNS", "LINES"):
        os.environ.pop(name, None)


@pytest.fixture(autouse=True, scope="session")
def _no_network() -> Iterator[None]:
    """Refuse every connection and name look-up that would leave the machine."""

    def guarded(original: Callable[..., Any], pick: Callable[..., object]) -> Callable[..., Any]:
        def call(*args: object, **options: object) -> object:
            address = pick(*args)
            if not is_local(address):
                raise RuntimeError(
                    f"a test tried to reach {address!r}; tests do not use the network"
                )
            return original(*args, **options)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in ("connect", "connect_ex"):
            original = getattr(socket.socket, name)
            patch.setattr(socket.socket, name, guarded(original, lambda _, address: address))
        resolve = guarded(socket.getaddrinfo, lambda host, *_: (host,))
        patch.setattr(socket, "getaddrinfo", resolve)
        yield


@pytest.fixture(scope="session")
def geodata() -> Path:
    """Return the folder of real open data, SEMSIG_GEODATA."""
    folder = os.environ.get("SEMSIG_GEODATA", "")
    if not folder or not Path(folder).is_dir():
        unavailable("geodata", f"SEMSIG_GEODATA is {folder!r}, not the folder of real data")
    return Path(folder)


@pytest.fixture(scope="session")
def qgis_process() -> Path:
    """Return QGIS's command-line program; run it with `qgis_environment`."""
    # The plain name is a shell script in Debian that sets variables for a desktop session.
    program = shutil.which("qgis_process.bin") or shutil.which("qgis_process")
    if program is None:
        unavailable("qgis", "qgis_process is not on this machine")
    return Path(program)


@pytest.fixture(scope="session")
def qgis_python(qgis_process: Path) -> str:  # noqa: ARG001
    """Return QGIS's own Python."""
    python = shutil.which("python3", path=os.defpath)
    if python is None:
        unavailable("qgis", "the system has no Python, in which QGIS could run")
    return python


@pytest.fixture
def qgis_environment(tmp_path: Path) -> dict[str, str]:
    """Return the environment for QGIS."""
    return qgis_variables(tmp_path)


@functools.cache
def result_validator(command: str) -> jsonschema.Draft202012Validator:
    """Return the validator of the JSON that a command prints."""
    from semsig_gis.commands import commands
    from semsig_gis.commands.schema import result_schema

    schema = result_schema(commands()[command])
    assert schema is not None
    return jsonschema.Draft202012Validator(schema)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command in this process: exit code, standard output, standard error.

    The first argument is a line as it is typed; those after it may contain spaces. JSON is
    compared with the schema of the command.
    """
    from semsig_gis.cli import console, main

    def print_json(value: object, *, indent: int | None = 2) -> None:
        try:
            result_validator(sys.argv[1]).validate(json.loads(json.dumps(value)))
        except jsonschema.ValidationError as error:
            pytest.fail(f"semsig {sys.argv[1]} printed {error.json_path}: {error.message[:2000]}")
        console.print_json(value, indent=indent)

    monkeypatch.setattr("semsig_gis.cli.app.print_json", print_json)

    def call(line: object, *arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["semsig", *str(line).split(), *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        printed = capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err

    return call


@pytest.fixture
def run_ok(run: Run) -> RunOk:
    """Run the command in this process, which must succeed, and return its standard output."""

    def call(*arguments: object) -> str:
        code, out, err = run(*arguments)
        assert code == 0, err
        return out

    return call


@pytest.fixture
def server() -> Iterator[Server]:
    """Return a server on this machine."""
    from servers import Server

    with Server() as running:
        yield running


@pytest.fixture
def snapshot(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """Return a function that compares a text with a stored one; SEMSIG_SNAPSHOTS=1 replaces it."""
    folder = request.path.with_name("snapshots")

    def check(name: str, text: str) -> None:
        if os.environ.get("SEMSIG_SNAPSHOTS"):
            folder.mkdir(exist_ok=True)
            (folder / name).write_bytes(text.encode())
        assert text == (folder / name).read_bytes().decode()

    return check


@pytest.fixture
def map_files() -> None:
    """Require the map files of a package that was built with npm."""
    from semsig_gis.output.html import page

    if not page.available():
        unavailable("browser", "the package was built without npm, so it carries no map files")


@pytest.fixture(scope="session")
def _chromium(
    pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Chrome]:
    from map_pages import UNPACKING
    from selenium import webdriver

    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        unavailable("browser", "chromium and chromedriver are not both on this machine")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    switches = (
        "--headless=new --no-sandbox --disable-dev-shm-usage --disable-gpu --disable-quic "
        "--enable-unsafe-swiftshader "  # WebGL, drawn by the processor
        "--disable-component-update --window-size=1200,900 "
        "--force-prefers-reduced-motion"  # a map that glides is drawn thirty times
    )
    for argument in (
        *switches.split(),
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        f"--user-data-dir={tmp_path_factory.mktemp('chromium')}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService(executable_path=driver)
    browser = webdriver.Chrome(options=options, service=service)
    browser.set_script_timeout(PATIENCE_S)
    counted = pytestconfig.pluginmanager.is_registered(BROWSER_COVERAGE)
    if counted:
        BROWSER_COVERAGE.start(browser)
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": UNPACKING})
    yield browser
    if counted:
        BROWSER_COVERAGE.take(browser)
    browser.quit()


@pytest.fixture
def browser(_chromium: Chrome) -> Chrome:
    """Return a headless Chromium without network and stored data, with empty logs.

    ``browser.get_log("browser")`` gives the console messages since then and
    ``browser.get_log("performance")`` what was requested.
    """
    _chromium.get("about:blank")
    # All pages from files share their storage, for example the choice of light or dark.
    storage = {"origin": "file://", "storageTypes": "local_storage"}
    _chromium.execute_cdp_cmd("Storage.clearDataForOrigin", storage)
    for log in ("browser", "performance"):
        _chromium.get_log(log)
    return _chromium


@pytest.fixture(scope="session")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    import dask
    from distributed import LocalCluster

    settings = {
        "temporary-directory": str(tmp_path_factory.mktemp("dask")),
        # On a busy machine, a worker takes a while to start again after it was killed.
        "distributed.deploy.lost-worker-timeout": f"{PATIENCE_S} s",
    }
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            host="127.0.0.1",
            memory_limit=0,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as running,
    ):
        yield running


@pytest.fixture(scope="session")
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the results of the paper's experiments on a small town.

    One test worker runs them; the others copy the results.
    """
    from worlds import QUERIES, save_town

    from semsig_gis.evaluation import reproduce

    place = tmp_path_factory.mktemp("reproduced")
    base = tmp_path_factory.getbasetemp()
    whole = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "reproduced"
    with FileLock(whole.with_suffix(".lock")):
        if not whole.exists():
            reproduce(place / "out", database=save_town(place), queries=QUERIES)
            shutil.copytree(place, whole)
            return place / "out"
    shutil.copytree(whole, place, dirs_exist_ok=True)
    return place / "out"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Return what puts a distribution on the path, with one module, as an installer leaves it."""
    site, modules = tmp_path / "site", []
    monkeypatch.syspath_prepend(site)

    def install(package: str, group: str, code: str, **entries: str) -> None:
        info = site / f"{package}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        modules.append(f"a_module_of_{package}")
        lines = [f"[{group}]", *(f"{name} = {modules[-1]}:{it}" for name, it in entries.items())]
        (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")
        (site / f"{modules[-1]}.py").write_text(code, encoding="utf-8")
        importlib.invalidate_caches()

    yield install
    for module in modules:  # another test may have a module of that name
        sys.modules.pop(module, None)
