"""Run what `gallery.md` says: its commands and its Python, in order, in an empty folder.

The pages that they write are put beside the built page; they are made anew when the text or the
package has changed.
"""

from __future__ import annotations

import hashlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from sphinx.util import logging

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/gallery.md"
BLOCK = re.compile(r"^```(console|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHOWN = {".html", ".svg"}


def package_hash() -> str:
    """Return what tells one state of the package from another."""
    files = [*ROOT.glob("semsig_gis/**/*"), *ROOT.glob("data_sources/**/*")]
    told = hashlib.sha256()
    for path in sorted(files):
        if path.is_file() and "__pycache__" not in path.parts:
            told.update(path.read_bytes())
    return told.hexdigest()[:16]


def write_gallery(folder: Path) -> None:
    """Write the pages into a folder, unless they are there of the same text and package."""
    text = PAGE.read_text(encoding="utf-8")
    mark = folder / ".made"
    made = hashlib.sha256(f"{package_hash()}{text}".encode()).hexdigest()
    if mark.is_file() and mark.read_text(encoding="utf-8") == made:
        return
    with tempfile.TemporaryDirectory() as place:
        for kind, code in BLOCK.findall(text):
            run = _commands if kind == "console" else _python
            run(code, Path(place))
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for path in Path(place).iterdir():
            if path.suffix in SHOWN:
                shutil.copy(path, folder)
    mark.write_text(made, encoding="utf-8")


def _commands(code: str, place: Path) -> None:
    for line in code.splitlines():
        _run(shlex.split(line.removeprefix("$ ")), place)


def _python(code: str, place: Path) -> None:
    _run([sys.executable, "-c", code], place)


def _run(command: list[str], place: Path) -> None:
    logging.getLogger(__name__).info("gallery: %s", shlex.join(command)[:100])
    subprocess.run(command, cwd=place, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
