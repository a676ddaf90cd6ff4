"""Write the plugin as a zip file that QGIS installs: `python qgis_plugin/package.py dist`.

The zip file holds the engine, too, as a wheel that is built here with hatchling.
"""

from __future__ import annotations

import argparse
import configparser
import io
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import tomllib

__all__ = ["build_wheel", "faults", "files", "metadata", "write_zip"]

HERE = Path(__file__).parent
ROOT = HERE.parent
KINDS = {".html", ".py", ".qm", ".qml", ".svg", ".txt"}
# The first moment that a zip file can tell, so that the same files make the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)
# What the official repository of plugins asks of metadata.txt, and how large a zip file it takes.
REQUIRED = (
    *("name", "description", "version", "qgisMinimumVersion", "author", "email", "about"),
    *("tracker", "repository", "homepage"),
)
MOST_BYTES = 25_000_000
# What metadata.txt calls the addresses of the project, by their names in pyproject.toml.
ADDRESSES = {"Homepage": "homepage", "Issues": "tracker", "Repository": "repository"}


def files() -> dict[str, bytes]:
    """Return the files of the plugin by their names in the zip, sorted; all but the engine."""
    plugin = HERE / "semsig"
    found = {path.relative_to(HERE).as_posix(): path for path in plugin.rglob("*")}
    found = {name: path for name, path in found.items() if path.suffix in KINDS}
    found["semsig/LICENSE"] = ROOT / "LICENSE"
    found["semsig/constraints.txt"] = ROOT / "constraints.txt"
    told = {name: path.read_bytes() for name, path in found.items()}
    told["semsig/metadata.txt"] = metadata().encode()
    return dict(sorted(told.items()))


def metadata() -> str:
    """Return metadata.txt, with the addresses of the project that pyproject.toml names."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    urls = project.get("urls", {})
    told = {field: urls[name] for name, field in ADDRESSES.items() if name in urls}
    told["email"] = next((one["email"] for one in project["authors"] if "email" in one), "none")
    text = (HERE / "semsig" / "metadata.txt").read_text("utf-8")
    return text + "".join(f"{name}={value}\n" for name, value in told.items())


def faults(plugin: Path) -> list[str]:
    """Return why the official repository of plugins would refuse a zip file.

    That the addresses can be reached, which it tries, is left out.

    Parameters
    ----------
    plugin : Path
        The zip file.

    Returns
    -------
    list of str
        Sentences; none where it would take it.
    """
    found = []
    if plugin.stat().st_size > MOST_BYTES:
        found.append(f"It is larger than {MOST_BYTES:,} bytes.")
    with zipfile.ZipFile(plugin) as archive:
        names = archive.namelist()
        told = configparser.ConfigParser()
        told.read_string(archive.read("semsig/metadata.txt").decode())
    general = told["general"]
    missing = [name for name in REQUIRED if not general.get(name) or general[name] == "none"]
    if missing:
        found.append(
            f"metadata.txt has no {', '.join(missing)}; name them in pyproject.toml, the addresses "
            "as Homepage, Issues and Repository of [project.urls], the e-mail with the authors."
        )
    for name in set(ADDRESSES.values()) - set(missing):
        parts = urlsplit(general[name])
        if not (parts.scheme and parts.netloc):
            found.append(f"The {name} {general[name]} is not an address.")
    if "semsig/LICENSE" not in names:
        found.append("It has no LICENSE.")
    unwanted = re.compile(
        r"\.\.|^/|\.pyc|__pycache__|__MACOSX|/\.|\.(exe|dll|so|dylib|bat|sh|cmd)$"
    )
    found += [f"It holds {name}." for name in names if unwanted.search(name)]
    return found


def build_wheel(folder: Path) -> Path:
    """Build the engine as a wheel.

    Parameters
    ----------
    folder : Path
        Where to.

    Returns
    -------
    Path
        The wheel.
    """
    line = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder.absolute())]
    done = subprocess.run(line, cwd=ROOT, check=False, capture_output=True, text=True)  # noqa: S603
    if done.returncode != 0:
        sys.exit(f"The engine cannot be built (hatchling builds it): {done.stderr.strip()}")
    (wheel,) = folder.glob("semsig_gis-*.whl")
    return wheel


def write_zip(folder: Path, wheel: Path | None = None) -> Path:
    """Write the zip file.

    Parameters
    ----------
    folder : Path
        Where to; made when missing.
    wheel : Path, optional
        The engine. Without it, the plugin asks the package index for one of its version.

    Returns
    -------
    Path
        The file. The same files give the same bytes, on every machine.
    """
    packed = files()
    if wheel is not None:
        with zipfile.ZipFile(wheel) as archive:
            held = {name: archive.read(name) for name in archive.namelist()}
        packed[f"semsig/{wheel.name}"] = _archive(held)
    told = configparser.ConfigParser()
    told.read_string(metadata())
    target = folder / f"semsig-qgis-{told['general']['version']}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    target.write_bytes(_archive(packed))
    return target


def _archive(contents: dict[str, bytes]) -> bytes:
    """Return a zip file of contents by their names."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.create_system = 3  # Unix, wherever it is made
            entry.external_attr = 0o100644 << 16
            # Not compressed: another version of the library would give other bytes.
            archive.writestr(entry, content)
    return made.getvalue()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where to write it")
    parser.add_argument("--without-engine", action="store_true", help="leave the wheel out")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        engine = None if given.without_engine else build_wheel(Path(place))
        plugin = write_zip(given.folder, engine)
    print(plugin)
    for fault in faults(plugin):
        print(f"The official repository would refuse it: {fault}", file=sys.stderr)
