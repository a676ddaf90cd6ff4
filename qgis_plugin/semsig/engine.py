"""The engine: `semsig` in a virtual environment of its own, in the profile of QGIS.

It lies in one of two folders, and a file beside them says in which. A new one is made in the other
folder, so that what was there keeps working until the new one does.

Nothing here imports QGIS.
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

from .command import ENGINE, SETTINGS, CommandError, clean_environment, run_program

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from .command import Watcher

__all__ = ["Engine", "Wishes", "find_python", "proxy_variables"]

OLDEST = (3, 11)
HERE = Path(__file__).parent
CONSTRAINTS = HERE / "constraints.txt"
STATE = "engine.json"
FOLDERS = ("a", "b")
# Newest first, among those that the pinned versions are for; then any other.
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
# What a Python says of itself: its version, and whether it can make virtual environments.
ASK = (
    "import importlib.util as u, sys; print('python', *sys.version_info[:2], "
    "all(u.find_spec(name) for name in ('venv', 'ensurepip')))"
)
TOLD = re.compile(r"python (\d+) (\d+) (True|False)")
TAG = re.compile(r"-cp3(\d+)-cp3\d+-")
FOUND = re.compile(r"(?:Collecting|Processing) (\S+)")
INSTALLING = "Installing collected packages: "
UNREACHED = {
    "ProxyError": "the proxy cannot be reached, or refuses",
    "SSLError": "the package index has no certificate that is trusted",
    "NewConnectionError": "the package index cannot be reached",
    "ConnectTimeoutError": "the package index cannot be reached",
    "NameResolutionError": "the package index cannot be reached",
}
"""What pip's warnings say of the network."""
# Packages that pip looks for before it installs them, for the bar of progress.
USUAL = 76
# Percent of the work when the environment is there, when all is found, and when all is installed.
MADE, GATHERED, INSTALLED = 8, 70, 95
# What QGIS calls kinds of proxies.
SOCKS = "Socks5Proxy"
HTTP = ("HttpProxy", "HttpCachingProxy")


class Wishes(NamedTuple):
    """How the engine shall be installed."""

    python: str = ""
    """Program to make it with; empty to look for one."""
    wheels: str = ""
    """Folder with all that is needed; nothing is downloaded then. Empty for the package index."""
    proxies: Optional[Mapping[str, str]] = None  # noqa: UP045 - QGIS's Python may be 3.9
    """Environment variables that name proxies, see `proxy_variables`."""


class Engine:
    """The engine of a profile.

    Parameters
    ----------
    root : Path
        Folder of the plugin in the profile, made when it is needed.
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
        """The program, or nothing where there is none."""
        state = self._state()
        program = _program(self.root / state["folder"], "semsig") if state else None
        return str(program) if program is not None and program.is_file() else ""

    @property
    def current(self) -> bool:
        """Whether it is there and of the version of the plugin."""
        return bool(self.command) and self._state()["version"] == self.version

    def install(self, wishes: Wishes, environment: Mapping[str, str], watcher: Watcher) -> str:
        """Install the engine, or install it anew, and return the program.

        Parameters
        ----------
        wishes : Wishes
            From where.
        environment : mapping of str to str
            That of QGIS.
        watcher : Watcher
            Who hears of it.

        Returns
        -------
        str
            The program.

        Raises
        ------
        CommandError
            If it cannot be installed. What was there is as it was, and nothing is half-made.
        Cancelled
            If the watcher wished so; likewise.
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
        name = next(one for one in FOLDERS if one != old)
        folder = self.root / name
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            _remove(folder)
            watcher.remark(f"Python: {python}")
            self._make(folder, python, wishes, clean, watcher)
            self._point_to(name)
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

    def _make(
        self,
        folder: Path,
        python: str,
        wishes: Wishes,
        environment: Mapping[str, str],
        watcher: Watcher,
    ) -> None:
        """Make a virtual environment and install the packages in it."""
        step = _Step(watcher, environment)
        watcher.progress(1, "making a virtual environment")
        step.run([python, "-m", "venv", str(folder)], "The virtual environment cannot be made")
        packages = _Packages(watcher, folder)
        line = [str(_program(folder, "python")), "-m", "pip", "install", "--no-input"]
        line += ["--disable-pip-version-check", "--progress-bar=off", f"--constraint={CONSTRAINTS}"]
        if wishes.wheels:
            line += ["--no-index", f"--find-links={wishes.wheels}"]
        watcher.progress(MADE, "gathering packages")
        step.run(
            [*line, _requirement(self.version)],
            "The packages cannot be installed",
            hear=packages.hear,
            look=packages.look,
        )
        watcher.progress(INSTALLED, "checking")
        step.run([str(_program(folder, "semsig")), "--version"], "The engine does not start")

    def _point_to(self, folder: str) -> None:
        part = self.root / f"{STATE}.part"
        part.write_text(json.dumps({"folder": folder, "version": self.version}), "utf-8")
        part.replace(self.root / STATE)

    def remove(self) -> None:
        """Take the engine away."""
        (self.root / STATE).unlink(missing_ok=True)
        for folder in FOLDERS:
            _remove(self.root / folder)


class _Step:
    """Runs programs, and tells why one failed."""

    def __init__(self, watcher: Watcher, environment: Mapping[str, str]) -> None:
        self.watcher, self.environment = watcher, environment

    def run(
        self,
        command: list[str],
        failure: str,
        hear: Callable[[str], None] | None = None,
        look: Callable[[], None] | None = None,
    ) -> None:
        """Run a program; CommandError with what it said of its failure."""
        said: list[str] = []

        def listen(line: str) -> None:
            said.append(line)
            self.watcher.remark(line)
            if hear is not None:
                hear(line)

        def cancelled() -> bool:
            if look is not None:
                look()
            return self.watcher.cancelled()

        code = run_program(command, self.environment, listen, cancelled)
        if code != 0:
            reason = _reason(said) or f"exit code {code}"
            message = (
                f"{failure}: {reason}; see the log, check the network, the proxy or the folder of "
                f"wheels in {SETTINGS}, and press Install again."
            )
            raise CommandError(message)


def _reason(said: list[str]) -> str:
    """Return why a program failed by what it said; pip tells of the network in warnings alone."""
    for sign, reason in UNREACHED.items():
        if any(sign in line for line in said):
            return reason
    errors = [line[7:] for line in said if line.startswith("ERROR: ")]
    return (errors[:1] or said[-1:] or [""])[0].rstrip(".")


class _Packages:
    """How far pip is."""

    def __init__(self, watcher: Watcher, folder: Path) -> None:
        self.watcher, self.folder = watcher, folder
        self.found, self.wanted, self.there = 0, 0, -1

    def hear(self, line: str) -> None:
        """Count a line of pip."""
        stripped = line.strip()
        named = FOUND.match(stripped)
        if stripped.startswith(INSTALLING):
            self.wanted = len(stripped.removeprefix(INSTALLING).split(", "))
        elif named is not None:
            self.found += 1
            share = min(1.0, self.found / USUAL)
            name = re.split(r"[^\w.]", Path(named[1]).name)[0]
            self.watcher.progress(int(MADE + share * (GATHERED - MADE)), f"gathering {name}")

    def look(self) -> None:
        """Count what is installed, of which pip says nothing."""
        if not self.wanted:
            return
        packages = "Lib/site-packages" if sys.platform == "win32" else "lib/python*/site-packages"
        there = sum(1 for _ in self.folder.glob(f"{packages}/*.dist-info"))
        if there != self.there:
            self.there = there
            share = min(1.0, there / self.wanted)
            percent = int(GATHERED + share * (INSTALLED - GATHERED))
            self.watcher.progress(percent, f"installing {self.wanted} packages")


def _program(folder: Path, name: str) -> Path:
    """Return where a virtual environment has a program."""
    if sys.platform == "win32":
        return folder / "Scripts" / f"{name}.exe"
    return folder / "bin" / name


def _requirement(version: str) -> str:
    """Return what pip shall install: the wheel that is packed with the plugin, or else by name."""
    packed = sorted(HERE.glob("semsig_gis-*.whl"))
    return f"{packed[-1]}[raster,serve]" if packed else f"semsig_gis[raster,serve]=={version}"


def _remove(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


def find_python(chosen: str, environment: Mapping[str, str], *, wheels: str = "") -> str:
    """Return a Python that can make the engine's environment.

    Parameters
    ----------
    chosen : str
        What the settings say; empty where nothing was chosen.
    environment : mapping of str to str
        See `command.clean_environment`.
    wheels : str, optional
        Folder of wheels, some of which may be for one version of Python alone.

    Returns
    -------
    str
        The program.

    Raises
    ------
    CommandError
        If there is none, with what to do.
    """
    incomplete = ""
    seen: list[str] = []
    fitting = _versions(wheels) if wheels else set()
    others = False
    for program in [chosen] if chosen else _pythons(environment):
        told = _ask(program, environment)
        if told is None:
            continue
        version, complete = told
        fits = not fitting or version in fitting
        if version >= OLDEST and complete and fits:
            return program
        if version >= OLDEST and not complete:
            incomplete = incomplete or program
        others = others or not fits
        seen.append(".".join(map(str, version)))
    if others:
        message = (
            f"The wheels in {wheels} are for Python {_listed(fitting)}, and there is only "
            f"{', '.join(dict.fromkeys(seen))}; install that Python, or get wheels for this one."
        )
    elif incomplete:
        message = (
            f"{incomplete} cannot make virtual environments; install what is missing (on Debian "
            "and Ubuntu: sudo apt install python3-venv), then press Install again."
        )
    elif chosen:
        what = f"is Python {seen[0]}" if seen else "is not a Python that can be run"
        message = (
            f"{chosen} {what}; choose a Python of version 3.11 or newer in {SETTINGS}, or leave it "
            "empty to look for one."
        )
    else:
        there = f", only {', '.join(sorted(set(seen)))}" if seen else ""
        message = (
            f"There is no Python of version 3.11 or newer on this computer{there}; install one "
            f"from python.org or your system's packages, then press Install in {ENGINE}"
        )
    raise CommandError(message)


def _versions(wheels: str) -> set[tuple[int, int]]:
    """Return the versions of Python that wheels of a folder name, if any do."""
    names = (TAG.search(wheel.name) for wheel in Path(wheels).glob("*.whl"))
    return {(3, int(tag[1])) for tag in names if tag is not None}


def _listed(versions: set[tuple[int, int]]) -> str:
    return " or ".join(".".join(map(str, version)) for version in sorted(versions))


def _pythons(environment: Mapping[str, str]) -> Iterator[str]:
    """Yield the programs that may be a Python, each once: QGIS's own last, since it may move."""
    folders = [str(folder) for place in PYTHONS for folder in _matching(place)]
    path = os.pathsep.join([environment.get("PATH", ""), *folders])
    named = [shutil.which(name, path=path) for name in PROGRAMS]
    # Python 3 of Windows has one name in many folders.
    named += [shutil.which("python", path=folder) for folder in reversed(folders)]
    own = Path(sys.exec_prefix)
    named += [str(own / name) for name in ("python3.exe", "python.exe", "bin/python3")]
    for program in dict.fromkeys(one for one in named if one):
        if Path(program).is_file():
            yield program


def _matching(place: str) -> list[Path]:
    path = Path(place).expanduser()
    if not path.is_absolute():
        return []
    return sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))


def _ask(program: str, environment: Mapping[str, str]) -> tuple[tuple[int, int], bool] | None:
    """Return the version of a Python, and whether it can make virtual environments."""
    said: list[str] = []
    try:
        run_program([program, "-c", ASK], environment, said.append, lambda: False)
    except CommandError:
        return None
    told = TOLD.fullmatch("\n".join(said[-1:]))
    return None if told is None else ((int(told[1]), int(told[2])), told[3] == "True")


def proxy_variables(settings: Mapping[str, str]) -> dict[str, str]:
    """Return the environment variables for the proxy that QGIS is told to use.

    Parameters
    ----------
    settings : mapping of str to str
        Those of QGIS: ``proxyEnabled``, ``proxyType``, ``proxyHost``, ``proxyPort``,
        ``proxyUser``, ``proxyPassword`` and ``noProxyUrls``, with commas between the last ones.

    Returns
    -------
    dict
        The variables. None where QGIS has no proxy of its own: those of the system count then.

    Examples
    --------
    >>> told = {"proxyEnabled": "true", "proxyType": "HttpProxy", "proxyHost": "proxy.town"}
    >>> proxy_variables({**told, "proxyPort": "3128"})["HTTPS_PROXY"]
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
    excluded = [one.strip() for one in settings.get("noProxyUrls", "").split(",") if one.strip()]
    hosts = [re.sub(r"^\w+://", "", one).split("/")[0] for one in excluded]
    told = dict.fromkeys(("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY"), address)
    told["NO_PROXY"] = ",".join(["localhost", "127.0.0.1", *hosts])
    # Some programs know these names in small letters alone.
    return {**told, **{name.lower(): value for name, value in told.items()}}
