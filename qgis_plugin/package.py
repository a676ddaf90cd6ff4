"""Write the plugin as a zip file that QGIS installs: `python qgis_plugin/package.py dist`."""

from __future__ import annotations

import argparse
import configparser
import zipfile
from pathlib import Path

__all__ = ["files", "write_zip"]

HERE = Path(__file__).parent
KINDS = {".py", ".qml", ".svg", ".txt"}
# The first moment that a zip file can tell, so that the same files make the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)


def files() -> dict[str, Path]:
    """Return the files of the plugin by their names in the zip, sorted."""
    plugin = HERE / "semsig"
    found = {path.relative_to(HERE).as_posix(): path for path in plugin.rglob("*")}
    found = {name: path for name, path in found.items() if path.suffix in KINDS}
    found["semsig/LICENSE"] = HERE.parent / "LICENSE"
    return dict(sorted(found.items()))


def write_zip(folder: Path) -> Path:
    """Write the zip file.

    Parameters
    ----------
    folder : Path
        Where to; made when missing.

    Returns
    -------
    Path
        The file. The same files give the same bytes, on every machine.
    """
    metadata = configparser.ConfigParser()
    metadata.read(HERE / "semsig" / "metadata.txt", encoding="utf-8")
    target = folder / f"semsig-qgis-{metadata['general']['version']}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w") as archive:
        for name, path in files().items():
            entry = zipfile.ZipInfo(name, MOMENT)
            entry.create_system = 3  # Unix, wherever it is made
            entry.external_attr = 0o100644 << 16
            # Not compressed: another version of the library would give other bytes.
            archive.writestr(entry, path.read_bytes())
    return target


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where to write it")
    print(write_zip(parser.parse_args().folder))
