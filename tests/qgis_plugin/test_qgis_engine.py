"""The installation of the engine by the QGIS plugin."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from semsig.command import Cancelled, CommandError, Watcher
from semsig.engine import Engine, Wishes, find_python, proxy_variables
from sentences import refused

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the stand-ins are shell scripts")

# A script in place of a Python with venv and pip.
PYTHON = """#!/bin/sh
case "$1 $2" in
"-c "*) echo python {version} {complete} ;;
"-m venv") mkdir -p "$3/bin" "$3/lib/python3.11/site-packages" && cp "$0" "$3/bin/python" ;;
"-m pip")
  echo "$@" >> {log}; env >> {log}
  echo "Collecting numpy==2.4"; echo "Processing /wheels/rtree-1.4-py3.whl"
  {pip}
  echo "Installing collected packages: numpy, rtree"
  here=$(dirname "$0")
  mkdir "$here/../lib/python3.11/site-packages/numpy.dist-info"
  sleep 0.3
  printf '#!/bin/sh\\necho semsig 1.0\\n' > "$here/semsig"; chmod +x "$here/semsig" ;;
esac
"""


def python(folder: Path, version: str = "3 11", *, complete: bool = True, pip: str = "true") -> str:
    """Write a script in place of a Python, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "python3"
    file.write_text(PYTHON.format(version=version, complete=complete, pip=pip, log=folder / "log"))
    file.chmod(0o755)
    return str(file)


@dataclass
class Log:
    """Records what a watcher receives; cancels at a line with a certain word."""

    until: str = "never"
    lines: list[str] = field(default_factory=list)
    stages: list[tuple[int, str]] = field(default_factory=list)

    def watcher(self) -> Watcher:
        return Watcher(
            lambda percent, label: self.stages.append((percent, label)),
            self.lines.append,
            lambda: any(self.until in line for line in self.lines),
        )


def install(engine: Engine, wishes: Wishes, until: str = "never") -> Log:
    log = Log(until)
    environment = {**os.environ, "PYTHONPATH": "of QGIS", "HOME": "/nowhere"}
    assert engine.install(wishes, environment, log.watcher()) == engine.command
    return log


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return Engine(tmp_path / "profile" / "semsig", "1.0")


def test_engine_is_installed_updated_and_removed(engine: Engine, tmp_path: Path) -> None:
    assert (engine.command, engine.current) == ("", False)
    proxies = {"HTTPS_PROXY": "http://proxy:3128"}
    log = install(engine, Wishes(python(tmp_path / "py"), "", proxies))
    assert Path(engine.command).is_relative_to(engine.root)
    assert engine.current
    percents = [percent for percent, _ in log.stages]
    assert percents == sorted(percents)
    assert {"gathering numpy", "gathering rtree", "installing 2 packages"} <= {
        label for _, label in log.stages
    }
    calls = (tmp_path / "py" / "log").read_text()
    assert "--constraint=" in calls
    assert calls.splitlines()[0].endswith("semsig_gis[raster,serve]==1.0")
    assert "HTTPS_PROXY=http://proxy:3128" in calls
    assert "of QGIS" not in calls
    first = engine.command
    newer = Engine(engine.root, "1.1")
    assert (newer.command, newer.current) == (first, False)
    install(newer, Wishes(python(tmp_path / "py")))
    assert newer.current
    assert newer.command != first
    assert not Path(first).exists()
    newer.remove()
    assert (newer.command, list(newer.root.iterdir())) == ("", [])


def test_folder_of_wheels_replaces_the_network(engine: Engine, tmp_path: Path) -> None:
    wheels = tmp_path / "wheels"
    with refused(CommandError, "wheels is not a folder", "Settings > Options"):
        install(engine, Wishes(wheels=str(wheels)))
    wheels.mkdir()
    install(engine, Wishes(python(tmp_path / "py"), str(wheels)))
    assert f"--no-index --find-links={wheels}" in (tmp_path / "py" / "log").read_text()
    (wheels / "numpy-2.4-cp313-cp313-manylinux.whl").touch()
    with refused(CommandError, "are for Python 3.13", "only 3.11"):
        install(engine, Wishes(python(tmp_path / "py"), str(wheels)))


def test_failed_or_cancelled_installation_keeps_the_engine(engine: Engine, tmp_path: Path) -> None:
    broken = Wishes(python(tmp_path / "broken", pip="echo 'ERROR: No network.'; exit 1"))
    slow = Wishes(python(tmp_path / "slow", pip="sleep 60"))
    for existing in (False, True):
        if existing:
            install(engine, Wishes(python(tmp_path / "py")))
        before = engine.command
        with refused(CommandError, "cannot be installed: No network;", "press Install again"):
            install(engine, broken)
        with pytest.raises(Cancelled):
            install(engine, slow, until="Processing")
        assert engine.command == before
        assert len([*engine.root.glob("?")]) == existing
    warned = "echo \"WARNING: Retrying after ProxyError('refused')\"; echo 'ERROR: None.'; exit 1"
    with refused(CommandError, "the proxy cannot be reached, or refuses;"):
        install(engine, Wishes(python(tmp_path / "proxy", pip=warned)))
    (engine.root / "engine.json").write_text("{}")
    assert engine.command == ""


def test_python_is_found_or_the_error_gives_advice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semsig.engine.PYTHONS", ())
    monkeypatch.setattr("semsig.engine.sys.exec_prefix", str(tmp_path))
    old, bare = python(tmp_path / "old", "3 9"), python(tmp_path / "bare", complete=False)
    good, text = python(tmp_path / "good", "3 12"), tmp_path / "text"
    text.write_text("no program")

    def path(*folders: str) -> dict[str, str]:
        return {"PATH": os.pathsep.join(["/bin", *(str(tmp_path / folder) for folder in folders)])}

    monkeypatch.setattr("semsig.engine.PROGRAMS", ("python3",))
    monkeypatch.setattr(
        "semsig.engine.shutil.which",
        lambda name, path: next(
            (f"{place}/{name}" for place in path.split(os.pathsep) if str(tmp_path) in place), None
        ),
    )
    assert find_python(good, path()) == find_python("", path("good")) == good
    with refused(CommandError, "no Python of version 3.11 or newer", "python.org"):
        find_python("", path())
    with refused(CommandError, "only 3.9", "install one"):
        find_python("", path("old"))
    with refused(CommandError, "bare/python3 cannot make", "sudo apt install python3-venv"):
        find_python("", path("bare"))
    with refused(CommandError, "is Python 3.9; choose"):
        find_python(old, path())
    with refused(CommandError, "text is not a Python"):
        find_python(str(text), path())
    assert bare


@pytest.mark.parametrize(
    ("changes", "address"),
    [
        ({}, "http://proxy:3128"),
        ({"proxyUser": "ann@town", "proxyPassword": "a/b"}, "http://ann%40town:a%2Fb@proxy:3128"),
        ({"proxyType": "Socks5Proxy", "proxyPort": ""}, "socks5h://proxy"),
        ({"proxyEnabled": "false"}, None),
        ({"proxyType": "DefaultProxy"}, None),
        ({"proxyHost": ""}, None),
    ],
)
def test_proxy_of_qgis_becomes_variables(changes: dict[str, str], address: str | None) -> None:
    settings = {
        "proxyEnabled": "true",
        "proxyType": "HttpProxy",
        "proxyHost": "proxy",
        "proxyPort": "3128",
        "noProxyUrls": "http://maps.town/wms, inside",
    }
    variables = proxy_variables({**settings, **changes})
    assert variables.get("https_proxy") == variables.get("HTTPS_PROXY") == address
    if address is not None:
        assert variables["NO_PROXY"] == "localhost,127.0.0.1,maps.town,inside"
