"""Install the engine: `semsig` in a virtual environment in the profile of QGIS.

The engine is in one of two folders, and a file next to them says in which. A new engine is
installed in the other folder, so that the old one works until the new one is ready.

This module does not import QGIS.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Optional
from urllib.parse import quote

from .command import (
    ENGINE,
    SETTINGS,
    CommandError,
    clean_environment,
    matching_folders,
    run_program,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from .command import Watcher

__all__ = ["Engine", "Wishes", "find_python", "proxy_variables"]

OLDEST = (3, 11)
HERE = Path(__file__).parent
CONSTRAINTS = HERE / "constraints.txt"
STATE = "engine.json"
FOLDERS = ("a", "b")
# Versions with pinned packages first, the newest of them first; then any other.
PROGRAMS = ("python3.13", "python3.12", "python3.11", "python3.14", "python3", "python")
PYTHONS = (
    "/usr/local/bin",
    "/opt/*/bin",
    "/Library/Frameworks/Python.framework/Versions/3.*/bin",
    "~/.local/bin",
    "~/.pyenv/versions/3.*/bin",
    "~/AppData/Local/Programs/Python/Python3*",
    "~/mini*3",
    "~/mini*3/bin",
    "~/anaconda3",
    "~/anaconda3/bin",
    "C:/Python3*",
    "C:/Program Files/Python3*",
)
# A program that prints the version of a Python and whether it can create virtual environments.
PROBE = (
    "import importlib.util as u, sys; print('python', *sys.version_info[:2], "
    "all(u.find_spec(name) for name in ('venv', 'ensurepip')))"
)
PROBE_OUTPUT = re.compile(r"python (\d+) (\d+) (True|False)")
WHEEL_TAG = re.compile(r"-cp3(\d+)-cp3\d+-")
PIP_COLLECTING = re.compile(r"(?:Collecting|Processing) (\S+)")
PIP_INSTALLING = "Installing collected packages: "
NETWORK_ERRORS = {
    "ProxyError": "the proxy cannot be reached, or refuses",
    "SSLError": "the package index has no certificate that is trusted",
    "NewConnectionError": "the package index cannot be reached",
    "ConnectTimeoutError": "the package index cannot be reached",
    "NameResolutionError": "the package index cannot be reached",
}
"""Reasons for names of errors in the warnings of pip."""
USUAL_COUNT = 76  # packages that pip collects before it installs them, for the progress bar
# Percent of the work when the environment exists, and all packages are collected and installed.
CREATED, COLLECTED, INSTALLED = 8, 70, 95
# Names of proxy types in QGIS.
SOCKS = "Socks5Proxy"
HTTP = ("HttpProxy", "HttpCachingProxy")


class Wishes(NamedTuple):
    """Options of the installation of the engine."""

    python: str = ""
    """The Python to use; empty to search for one."""
    wheels: str = ""
    """Folder with all wheels, to download nothing; empty for the package index."""
    proxies: Optional[Mapping[str, str]] = None  # noqa: UP045 - QGIS's Python may be 3.9
    """Environment variables that name proxies, see `proxy_variables`."""


class Engine:
    """The engine of a QGIS profile.

    Parameters
    ----------
    root : Path
        Folder of the plugin in the profile, created when needed.
    version : str
        Version of the plugin.
    """

    def __init__(self, root: Path, version: str) -> None:
        self.root, self.version = root, version

    def _state(self) -> dict[str, str]:
        try:
            state: dict[str, str] = json.loads((self.root / STATE).read_text("utf-8"))
            folder, version = state["folder"], state["version"]
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        return {"folder": folder, "version": str(version)} if folder in FOLDERS else {}

    @property
    def command(self) -> str:
        """The path of the program; empty if not installed."""
        state = self._state()
        program = _program(self.root / state["folder"], "semsig") if state else None
        return str(program) if program is not None and program.is_file() else ""

    @property
    def current(self) -> bool:
        """Whether it is installed in the version of the plugin."""
        return bool(self.command) and self._state()["version"] == self.version

    def install(self, wishes: Wishes, environment: Mapping[str, str], watcher: Watcher) -> str:
        """Install the engine, or install it again, and return the program.

        Parameters
        ----------
        wishes : Wishes
            The Python, the wheels and the proxies.
        environment : mapping of str to str
            Environment variables of QGIS.
        watcher : Watcher
            Callbacks for progress, remarks and cancelling.

        Returns
        -------
        str
            The path of the program.

        Raises
        ------
        CommandError
            If it cannot be installed. An engine from before still works; no files are left.
        Cancelled
            If the watcher cancelled the work; likewise.
        """
        if wishes.wheels and not Path(wishes.wheels).is_dir():
            message = (
                f"{wishes.wheels} is not a folder; choose the folder of the wheels in {SETTINGS}, "
                "or leave it empty to download them."
            )
            raise CommandError(message)
        watcher.progress(0, "looking for Python")
        clean = {**clean_environment(environment), **(wishes.proxies or {})}
        python = find_python(wishes.python, clean, wheels=wishes.wheels)
        old = self._state().get("folder")
        name = next(folder_name for folder_name in FOLDERS if folder_name != old)
        folder = self.root / name
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            _remove(folder)
            watcher.remark(f"Python: {python}")
            self._create(folder, python, wishes, clean, watcher)
            # Switch to the new folder in one step.
            part = self.root / f"{STATE}.part"
            part.write_text(json.dumps({"folder": name, "version": self.version}), "utf-8")
            part.replace(self.root / STATE)
        except OSError as error:
            _remove(folder)
            message = (
                f"The engine cannot be written to {folder} ({error.strerror or error}); make room "
                "there, or start QGIS with another profile."
            )
            raise CommandError(message) from error
        except BaseException:
            _remove(folder)
            raise
        if old:
            _remove(self.root / old)
        watcher.progress(100, "ready")
        return self.command

    def _create(
        self,
        folder: Path,
        python: str,
        wishes: Wishes,
        environment: Mapping[str, str],
        watcher: Watcher,
    ) -> None:
        """Create a virtual environment and install the packages in it."""
        step = _Step(watcher, environment)
        watcher.progress(1, "making a virtual environment")
        step.run([python, "-m", "venv", str(folder)], "The virtual environment cannot be made")
        packages = _Packages(watcher, folder)
        line = [str(_program(folder, "python")), "-m", "pip", "install", "--no-input"]
        line += ["--disable-pip-version-check", "--progress-bar=off", f"--constraint={CONSTRAINTS}"]
        if wishes.wheels:
            line += ["--no-index", f"--find-links={wishes.wheels}"]
        # The wheel in the plugin if there is one, else the package index.
        wheels = sorted(HERE.glob("semsig_gis-*.whl"))
        extras = "[raster,serve]"
        package = f"{wheels[-1]}{extras}" if wheels else f"semsig_gis{extras}=={self.version}"
        watcher.progress(CREATED, "gathering packages")
        step.run(
            [*line, package],
            "The packages cannot be installed",
            hear=packages.hear,
            look=packages.look,
        )
        watcher.progress(INSTALLED, "checking")
        step.run([str(_program(folder, "semsig")), "--version"], "The engine does not start")

    def remove(self) -> None:
        """Remove the engine."""
        (self.root / STATE).unlink(missing_ok=True)
        for folder in FOLDERS:
            _remove(self.root / folder)


class _Step:
    """Runs the programs of the installation."""

    def __init__(self, watcher: Watcher, environment: Mapping[str, str]) -> None:
        self.watcher, self.environment = watcher, environment

    def run(
        self,
        command: list[str],
        failure: str,
        hear: Callable[[str], None] | None = None,
        look: Callable[[], None] | None = None,
    ) -> None:
        """Run a program; raise CommandError with its reason if it fails."""
        lines: list[str] = []

        def listen(line: str) -> None:
            lines.append(line)
            self.watcher.remark(line)
            if hear is not None:
                hear(line)

        def cancelled() -> bool:
            if look is not None:
                look()
            return self.watcher.cancelled()

        code = run_program(command, self.environment, listen, cancelled)
        if code != 0:
            reason = _reason(lines) or f"exit code {code}"
            message = (
                f"{failure}: {reason}; see the log, check the network, the proxy or the folder of "
                f"wheels in {SETTINGS}, and press Install again."
            )
            raise CommandError(message)


def _reason(lines: list[str]) -> str:
    """Return why a program failed; pip reports network errors in warnings only."""
    for name, reason in NETWORK_ERRORS.items():
        if any(name in line for line in lines):
            return reason
    errors = [line[7:] for line in lines if line.startswith("ERROR: ")]
    return (errors[:1] or lines[-1:] or [""])[0].rstrip(".")


class _Packages:
    """The progress of pip."""

    def __init__(self, watcher: Watcher, folder: Path) -> None:
        self.watcher, self.folder = watcher, folder
        self.collected, self.total, self.installed = 0, 0, -1

    def hear(self, line: str) -> None:
        """Count the packages in the output of pip."""
        stripped = line.strip()
        collecting = PIP_COLLECTING.match(stripped)
        if stripped.startswith(PIP_INSTALLING):
            self.total = len(stripped.removeprefix(PIP_INSTALLING).split(", "))
        elif collecting is not None:
            self.collected += 1
            share = min(1.0, self.collected / USUAL_COUNT)
            name = re.split(r"[^\w.]", Path(collecting[1]).name)[0]
            percent = int(CREATED + share * (COLLECTED - CREATED))
            self.watcher.progress(percent, f"gathering {name}")

    def look(self) -> None:
        """Count the packages on disk, since pip prints nothing while it installs them."""
        if not self.total:
            return
        packages = "Lib/site-packages" if sys.platform == "win32" else "lib/python*/site-packages"
        installed = sum(1 for _ in self.folder.glob(f"{packages}/*.dist-info"))
        if installed != self.installed:
            self.installed = installed
            share = min(1.0, installed / self.total)
            percent = int(COLLECTED + share * (INSTALLED - COLLECTED))
            self.watcher.progress(percent, f"installing {self.total} packages")


def _program(folder: Path, name: str) -> Path:
    """Return the path of a program in a virtual environment."""
    if sys.platform == "win32":
        return folder / "Scripts" / f"{name}.exe"
    return folder / "bin" / name


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def find_python(setting: str, environment: Mapping[str, str], *, wheels: str = "") -> str:
    """Return a Python that can create the environment of the engine.

    Parameters
    ----------
    setting : str
        The Python in the settings; empty if not set.
    environment : mapping of str to str
        See `command.clean_environment`.
    wheels : str, optional
        Folder of wheels; some may be for certain versions of Python only.

    Returns
    -------
    str
        The path of the program.

    Raises
    ------
    CommandError
        If there is none, with what to do.
    """
    incomplete = ""
    versions: list[str] = []
    # Versions of Python in the names of the wheels.
    names = [wheel.name for wheel in Path(wheels).glob("*.whl")] if wheels else []
    fitting = {(3, int(tag[1])) for tag in map(WHEEL_TAG.search, names) if tag is not None}
    others = False
    for program in [setting] if setting else _pythons(environment):
        answer = _probe(program, environment)
        if answer is None:
            continue
        version, complete = answer
        fits = not fitting or version in fitting
        if version >= OLDEST and complete and fits:
            return program
        if version >= OLDEST and not complete:
            incomplete = incomplete or program
        others = others or not fits
        versions.append(".".join(map(str, version)))
    if others:
        wheel_versions = " or ".join(".".join(map(str, version)) for version in sorted(fitting))
        message = (
            f"The wheels in {wheels} are for Python {wheel_versions}, and there is only "
            f"{', '.join(dict.fromkeys(versions))}; install that Python, or get wheels for this "
            "one."
        )
    elif incomplete:
        message = (
            f"{incomplete} cannot make virtual environments; install what is missing (on Debian "
            "and Ubuntu: sudo apt install python3-venv), then press Install again."
        )
    elif setting:
        what = f"is Python {versions[0]}" if versions else "is not a Python that can be run"
        message = (
            f"{setting} {what}; choose a Python of version 3.11 or newer in {SETTINGS}, or leave "
            "it empty to look for one."
        )
    else:
        existing = f", only {', '.join(sorted(set(versions)))}" if versions else ""
        message = (
            f"There is no Python of version 3.11 or newer on this computer{existing}; install one "
            f"from python.org or your system's packages, then press Install in {ENGINE}"
        )
    raise CommandError(message)


def _pythons(environment: Mapping[str, str]) -> Iterator[str]:
    """Yield programs that may be a Python, each once; the Python of QGIS last, as it may move."""
    folders = [str(folder) for place in PYTHONS for folder in matching_folders(place)]
    path = os.pathsep.join([environment.get("PATH", ""), *folders])
    programs = [shutil.which(name, path=path) for name in PROGRAMS]
    # On Windows, all versions have the same name, in different folders.
    programs += [shutil.which("python", path=folder) for folder in reversed(folders)]
    own = Path(sys.exec_prefix)
    programs += [str(own / name) for name in ("python3.exe", "python.exe", "bin/python3")]
    for program in dict.fromkeys(filter(None, programs)):
        if Path(program).is_file():
            yield program


def _probe(program: str, environment: Mapping[str, str]) -> tuple[tuple[int, int], bool] | None:
    """Return the version of a Python, and whether it can create virtual environments."""
    lines: list[str] = []
    try:
        run_program([program, "-c", PROBE], environment, lines.append, lambda: False)
    except CommandError:
        return None
    output = PROBE_OUTPUT.fullmatch("\n".join(lines[-1:]))
    return None if output is None else ((int(output[1]), int(output[2])), output[3] == "True")


def proxy_variables(settings: Mapping[str, str]) -> dict[str, str]:
    """Return the environment variables for the proxy in the settings of QGIS.

    Parameters
    ----------
    settings : mapping of str to str
        Settings of QGIS: ``proxyEnabled``, ``proxyType``, ``proxyHost``, ``proxyPort``,
        ``proxyUser``, ``proxyPassword`` and ``noProxyUrls`` (separated by commas).

    Returns
    -------
    dict
        The variables; empty if QGIS has no proxy, so that the variables of the system apply.

    Examples
    --------
    >>> proxy = {"proxyEnabled": "true", "proxyType": "HttpProxy", "proxyHost": "proxy.town"}
    >>> proxy_variables({**proxy, "proxyPort": "3128"})["HTTPS_PROXY"]
    'http://proxy.town:3128'
    """
    kind, host = settings.get("proxyType", ""), settings.get("proxyHost", "")
    enabled = settings.get("proxyEnabled", "").lower() == "true"
    if not (enabled and host and kind in {SOCKS, *HTTP}):
        return {}
    scheme = "socks5h" if kind == SOCKS else "http"
    user, password = settings.get("proxyUser", ""), settings.get("proxyPassword", "")
    login = quote(user, safe="") + (f":{quote(password, safe='')}" if password else "")
    port = settings.get("proxyPort", "")
    address = f"{scheme}://{login + '@' if user else ''}{host}{':' + port if port else ''}"
    excluded = filter(None, map(str.strip, settings.get("noProxyUrls", "").split(",")))
    hosts = [re.sub(r"^\w+://", "", url).split("/")[0] for url in excluded]
    variables = dict.fromkeys(("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"), address)
    variables["NO_PROXY"] = ",".join(["localhost", "127.0.0.1", *hosts])
    # Some programs read these names only in lower case.
    return {**variables, **{name.lower(): value for name, value in variables.items()}}
