"""Run the commands and the Python code of `gallery.md`, in order, in an empty folder.

The pages that they write are copied to a folder next to the built page. They are written again only
if the text or the package has changed.
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
    """Hash of the files of the package, the same only if they are the same."""
    files = [*ROOT.glob("semsig_gis/**/*"), *ROOT.glob("data_sources/**/*")]
    digest = hashlib.sha256()
    for path in sorted(files):
        if path.is_file() and "__pycache__" not in path.parts:
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def write_gallery(folder: Path) -> None:
    """Write the pages into a folder, unless the text and the package have not changed."""
    text = PAGE.read_text(encoding="utf-8")
    mark = folder / ".made"
    state = hashlib.sha256(f"{package_hash()}{text}".encode()).hexdigest()
    if mark.is_file() and mark.read_text(encoding="utf-8") == state:
        return
    with tempfile.TemporaryDirectory() as place:
        for kind, code in BLOCK.findall(text):
            if kind == "python":
                _run([sys.executable, "-c", code], Path(place))
                continue
            for line in code.splitlines():
                _run(shlex.split(line.removeprefix("$ ")), Path(place))
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for path in Path(place).iterdir():
            if path.suffix in SHOWN:
                shutil.copy(path, folder)
    mark.write_text(state, encoding="utf-8")


def _run(command: list[str], place: Path) -> None:
    logging.getLogger(__name__).info("gallery: %s", shlex.join(command)[:100])
    subprocess.run(command, cwd=place, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
