"""Write the plugin as a zip file that QGIS installs: `python qgis_plugin/package.py dist`.

The zip file also contains the engine, as a wheel that is built here with hatchling.
"""

from __future__ import annotations

import argparse
import configparser
import io
import json
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
    "commands_schema",
    "compiled",
    "faults",
    "files",
    "metadata",
    "read_translations",
    "write_zip",
]

if TYPE_CHECKING:
    from collections.abc import Mapping

HERE = Path(__file__).parent
ROOT = HERE.parent
SUFFIXES = {".py", ".svg", ".txt"}
# The earliest time in a zip file, so that the same files give the same bytes.
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
ADDRESSES = ("tracker", "repository", "homepage")
# Limits of the official repository of plugins: fields of metadata.txt, and the size of a zip file.
REQUIRED = (
    *("name", "description", "version", "qgisMinimumVersion", "author", "email", "about"),
    *ADDRESSES,
)
MOST_BYTES = 25_000_000
# The first bytes of compiled translations.
QM_HEADER = bytes.fromhex("3cb86418caef9c95cd211cbf60a1bddd")


def files(email: str = "") -> dict[str, bytes]:
    """Return the files of the plugin except the engine, sorted by their names in the zip file.

    Parameters
    ----------
    email : str, optional
        Address of the authors.

    Returns
    -------
    dict
        The contents of each file.
    """
    plugin = HERE / "semsig"
    paths = {
        path.relative_to(HERE).as_posix(): path
        for path in plugin.rglob("*")
        if path.suffix in SUFFIXES
    }
    paths["semsig/LICENSE"] = ROOT / "LICENSE"
    paths["semsig/constraints.txt"] = ROOT / "constraints.txt"
    paths["semsig/help.md"] = ROOT / "docs" / "qgis.md"
    contents = {name: path.read_bytes() for name, path in paths.items()}
    for path in (HERE / "i18n").glob("*.ts"):
        contents[f"semsig/i18n/{path.stem}.qm"] = compiled(read_translations(path))
    contents["semsig/metadata.txt"] = metadata(email).encode()
    contents["semsig/commands.json"] = commands_schema()
    return dict(sorted(contents.items()))


def commands_schema() -> bytes:
    """Return the schema of the requests of all commands, from which the tools are made, as JSON."""
    printed = _run("semsig_gis.cli", "schema", what="The schema of the commands")
    commands = json.loads(printed)["commands"]
    for command in commands.values():
        del command["result"]
    return json.dumps({"commands": commands}, ensure_ascii=False, indent=1).encode()


def _run(*words: str, what: str) -> str:
    """Run a module of Python in the project, and return what it prints."""
    line = [sys.executable, "-m", *words]
    process = subprocess.run(line, cwd=ROOT, check=False, capture_output=True, encoding="utf-8")  # noqa: S603
    if process.returncode != 0:
        sys.exit(f"{what} cannot be made: {process.stderr.strip()}")
    return process.stdout


def read_translations(path: Path) -> dict[str, str]:
    """Return the finished translations in a file of Qt Linguist, by their sources.

    Parameters
    ----------
    path : Path
        The file, with the suffix ``.ts``.

    Returns
    -------
    dict
        The translations.
    """
    messages = ET.parse(path).iterfind("context/message")  # noqa: S314 - our own file
    texts = {
        str(message.findtext("source")): str(message.findtext("translation") or "")
        for message in messages
        if message.find("translation[@type]") is None
    }
    return {source: text for source, text in texts.items() if text}


def compiled(translations: Mapping[str, str], context: str = "Semsig") -> bytes:
    """Return translations in the binary format of Qt, as `lrelease` writes it.

    Parameters
    ----------
    translations : mapping of str to str
        The translations by their sources.
    context : str, default "Semsig"
        The context of the translations.

    Returns
    -------
    bytes
        The contents of a ``.qm`` file, the same on every machine.
    """
    messages, places = b"", []
    for source, text in translations.items():
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
    return QM_HEADER + b"".join(struct.pack(">BI", tag, len(part)) + part for tag, part in sections)


def _elf(text: bytes) -> int:
    """Return the hash of a text in Qt's index: the hash of ELF files, but never 0."""
    value = 0
    for byte in text:
        value = (value << 4) + byte
        high = value & 0xF0000000
        value = (value ^ (high >> 24)) & ~high
    return value or 1


def metadata(email: str = "") -> str:
    """Return metadata.txt with the addresses of the project, from SEMSIG_REPOSITORY.

    Parameters
    ----------
    email : str, optional
        Address of the authors.

    Returns
    -------
    str
        The text, without lines for unknown addresses.
    """
    addresses = {"email": email}
    if repository := os.environ.get("SEMSIG_REPOSITORY", "").rstrip("/"):
        addresses |= {"homepage": repository, "repository": repository}
        addresses["tracker"] = f"{repository}/issues"
    text = (HERE / "semsig" / "metadata.txt").read_text("utf-8")
    return text + "".join(f"{name}={value}\n" for name, value in addresses.items() if value)


def faults(plugin: Path) -> list[str]:
    """Return the reasons why the official repository of plugins would refuse a zip file.

    The repository also checks that the addresses can be reached; this function does not.

    Parameters
    ----------
    plugin : Path
        The zip file.

    Returns
    -------
    list of str
        Sentences; empty if it would be accepted.
    """
    reasons = []
    if plugin.stat().st_size > MOST_BYTES:
        reasons.append(f"It is larger than {MOST_BYTES:,} bytes.")
    with zipfile.ZipFile(plugin) as archive:
        names = archive.namelist()
        parser = configparser.ConfigParser()
        parser.read_string(archive.read("semsig/metadata.txt").decode())
    general = parser["general"]
    missing = [name for name in REQUIRED if not general.get(name)]
    if missing:
        reasons.append(
            f"metadata.txt has no {', '.join(missing)}; give the address of the project in "
            "SEMSIG_REPOSITORY and that of its authors as --email (with make, SEMSIG_EMAIL)."
        )
    for name in set(ADDRESSES) - set(missing):
        parts = urlsplit(general[name])
        if not (parts.scheme and parts.netloc):
            reasons.append(f"The {name} {general[name]} is not an address.")
    if "semsig/LICENSE" not in names:
        reasons.append("It has no LICENSE.")
    unwanted = re.compile(
        r"\.\.|^/|\.pyc|__pycache__|__MACOSX|/\.|\.(exe|dll|so|dylib|bat|sh|cmd)$"
    )
    reasons += [f"It contains {name}." for name in names if unwanted.search(name)]
    return reasons


def build_wheel(folder: Path) -> Path:
    """Build the engine as a wheel.

    Parameters
    ----------
    folder : Path
        Folder to write to.

    Returns
    -------
    Path
        The path of the wheel.
    """
    words = ("build", "-t", "wheel", "-d", str(folder.absolute()))
    _run("hatchling", *words, what="The engine (hatchling builds it)")
    (wheel,) = folder.glob("semsig_gis-*.whl")
    return wheel


def write_zip(folder: Path, wheel: Path | None = None, *, email: str = "") -> Path:
    """Write the zip file.

    Parameters
    ----------
    folder : Path
        Folder to write to, created if missing.
    wheel : Path, optional
        The engine. Without it, the plugin installs the engine from the package index.
    email : str, optional
        Address of the authors.

    Returns
    -------
    Path
        The path of the file, which has the same bytes on every machine.
    """
    contents = files(email)
    if wheel is not None:
        # Written again, so that it has the same bytes on every machine.
        with zipfile.ZipFile(wheel) as archive:
            wheel_contents = {name: archive.read(name) for name in archive.namelist()}
        contents[f"semsig/{wheel.name}"] = _archive(wheel_contents)
    parser = configparser.ConfigParser()
    parser.read_string(contents["semsig/metadata.txt"].decode())
    target = folder / f"semsig-qgis-{parser['general']['version']}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    target.write_bytes(_archive(contents))
    return target


def _archive(contents: dict[str, bytes]) -> bytes:
    """Return a zip file with these contents by their names."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in contents.items():
            entry = zipfile.ZipInfo(name, ZIP_TIME)
            entry.create_system = 3  # Unix, on every machine
            entry.external_attr = 0o100644 << 16
            # Not compressed, since compressed bytes depend on the version of the library.
            archive.writestr(entry, content)
    return buffer.getvalue()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder to write to")
    parser.add_argument("--without-engine", action="store_true", help="leave the wheel out")
    parser.add_argument("--email", default="", help="address of the authors")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        engine = None if options.without_engine else build_wheel(Path(place))
        plugin = write_zip(options.folder, engine, email=options.email)
    print(plugin)
    for fault in faults(plugin):
        print(f"The official repository would refuse it: {fault}", file=sys.stderr)
