"""Write the plugin as a zip file that QGIS installs: `python qgis_plugin/package.py dist`.

The zip file holds the engine, too, as a wheel that is built here with hatchling.
"""

from __future__ import annotations

import argparse
import configparser
import io
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

__all__ = ["build_wheel", "files", "write_zip"]

HERE = Path(__file__).parent
ROOT = HERE.parent
KINDS = {".html", ".py", ".qm", ".qml", ".svg", ".txt"}
# The first moment that a zip file can tell, so that the same files make the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)


def files() -> dict[str, bytes]:
    """Return the files of the plugin by their names in the zip, sorted; all but the engine."""
    plugin = HERE / "semsig"
    found = {path.relative_to(HERE).as_posix(): path for path in plugin.rglob("*")}
    found = {name: path for name, path in found.items() if path.suffix in KINDS}
    found["semsig/LICENSE"] = ROOT / "LICENSE"
    found["semsig/constraints.txt"] = ROOT / "constraints.txt"
    return {name: path.read_bytes() for name, path in sorted(found.items())}


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
    metadata = configparser.ConfigParser()
    metadata.read(HERE / "semsig" / "metadata.txt", encoding="utf-8")
    target = folder / f"semsig-qgis-{metadata['general']['version']}.zip"
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
        print(write_zip(given.folder, engine))
