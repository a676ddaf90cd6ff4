"""Write the plugin as a zip file that QGIS installs: `python qgis_plugin/package.py dist`.

The zip file holds the engine, too, as a wheel that is built here with hatchling.
"""

from __future__ import annotations

import argparse
import configparser
import io
import os
import re
import struct
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit
from xml.etree import ElementTree as ET

__all__ = [
    "build_wheel",
    "compiled",
    "faults",
    "files",
    "metadata",
    "read_words",
    "write_zip",
]

if TYPE_CHECKING:
    from collections.abc import Mapping

HERE = Path(__file__).parent
ROOT = HERE.parent
KINDS = {".py", ".qml", ".svg", ".txt"}
# The first moment that a zip file can tell, so that the same files make the same bytes.
MOMENT = (1980, 1, 1, 0, 0, 0)
ADDRESSES = ("tracker", "repository", "homepage")
# What the official repository of plugins asks of metadata.txt, and how large a zip file it takes.
REQUIRED = (
    *("name", "description", "version", "qgisMinimumVersion", "author", "email", "about"),
    *ADDRESSES,
)
MOST_BYTES = 25_000_000
# How files of compiled translations begin.
QM = bytes.fromhex("3cb86418caef9c95cd211cbf60a1bddd")


def files(email: str = "") -> dict[str, bytes]:
    """Return the files of the plugin by their names in the zip, sorted; all but the engine.

    Parameters
    ----------
    email : str, optional
        Where its authors can be reached.

    Returns
    -------
    dict
        What each file holds.
    """
    plugin = HERE / "semsig"
    found = {path.relative_to(HERE).as_posix(): path for path in plugin.rglob("*")}
    found = {name: path for name, path in found.items() if path.suffix in KINDS}
    found["semsig/LICENSE"] = ROOT / "LICENSE"
    found["semsig/constraints.txt"] = ROOT / "constraints.txt"
    found["semsig/help.md"] = ROOT / "docs" / "qgis.md"
    told = {name: path.read_bytes() for name, path in found.items()}
    for path in (HERE / "i18n").glob("*.ts"):
        told[f"semsig/i18n/{path.stem}.qm"] = compiled(read_words(path))
    told["semsig/metadata.txt"] = metadata(email).encode()
    return dict(sorted(told.items()))


def read_words(path: Path) -> dict[str, str]:
    """Return the translations that a file of Qt Linguist has, by their sources.

    Parameters
    ----------
    path : Path
        The file, which ends in ``.ts``.

    Returns
    -------
    dict
        Those that are finished.
    """
    messages = ET.parse(path).iterfind("context/message")  # noqa: S314 - our own file
    told = {
        str(one.findtext("source")): str(one.findtext("translation") or "")
        for one in messages
        if one.find("translation[@type]") is None
    }
    return {source: text for source, text in told.items() if text}


def compiled(words: Mapping[str, str], context: str = "Semsig") -> bytes:
    """Return translations as Qt reads them, as `lrelease` does, the same on every machine.

    Parameters
    ----------
    words : mapping of str to str
        The translations by their sources.
    context : str, default "Semsig"
        Whose they are.

    Returns
    -------
    bytes
        The contents of a file that ends in ``.qm``.
    """
    messages, places = b"", []
    for source, text in words.items():
        places.append((_elf(source.encode()), len(messages)))
        for tag, value in (
            (3, text.encode("utf-16-be")),
            (6, source.encode()),
            (7, context.encode()),
        ):
            messages += struct.pack(">BI", tag, len(value)) + value
        messages += b"\x01"  # the end of a message
    hashes = b"".join(struct.pack(">II", *place) for place in sorted(places))
    sections = ((0x42, hashes), (0x69, messages))
    return QM + b"".join(struct.pack(">BI", tag, len(part)) + part for tag, part in sections)


def _elf(text: bytes) -> int:
    """Return the hash by which Qt looks a text up: that of ELF files, never 0."""
    value = 0
    for byte in text:
        value = (value << 4) + byte
        high = value & 0xF0000000
        value = (value ^ (high >> 24)) & ~high
    return value or 1


def metadata(email: str = "") -> str:
    """Return metadata.txt, with the addresses of the project that SEMSIG_REPOSITORY tells.

    Parameters
    ----------
    email : str, optional
        Where its authors can be reached.

    Returns
    -------
    str
        The text; without a line for what is not told.
    """
    told = {"email": email}
    if repository := os.environ.get("SEMSIG_REPOSITORY", "").rstrip("/"):
        told |= {"homepage": repository, "repository": repository}
        told["tracker"] = f"{repository}/issues"
    text = (HERE / "semsig" / "metadata.txt").read_text("utf-8")
    return text + "".join(f"{name}={value}\n" for name, value in told.items() if value)


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
    missing = [name for name in REQUIRED if not general.get(name)]
    if missing:
        found.append(
            f"metadata.txt has no {', '.join(missing)}; give the address of the project in "
            "SEMSIG_REPOSITORY and that of its authors as --email (with make, SEMSIG_EMAIL)."
        )
    for name in set(ADDRESSES) - set(missing):
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


def write_zip(folder: Path, wheel: Path | None = None, *, email: str = "") -> Path:
    """Write the zip file.

    Parameters
    ----------
    folder : Path
        Where to; made when missing.
    wheel : Path, optional
        The engine. Without it, the plugin asks the package index for one of its version.
    email : str, optional
        Where its authors can be reached.

    Returns
    -------
    Path
        The file. The same files give the same bytes, on every machine.
    """
    packed = files(email)
    if wheel is not None:
        with zipfile.ZipFile(wheel) as archive:
            held = {name: archive.read(name) for name in archive.namelist()}
        packed[f"semsig/{wheel.name}"] = _archive(held)
    told = configparser.ConfigParser()
    told.read_string(packed["semsig/metadata.txt"].decode())
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
    parser.add_argument("--email", default="", help="where its authors can be reached")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        engine = None if given.without_engine else build_wheel(Path(place))
        plugin = write_zip(given.folder, engine, email=given.email)
    print(plugin)
    for fault in faults(plugin):
        print(f"The official repository would refuse it: {fault}", file=sys.stderr)
