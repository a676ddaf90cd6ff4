"""Long texts that are expected, in files; SEMSIG_SNAPSHOTS=write brings them up to date."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def assert_snapshot(text: str, file: Path) -> None:
    """Check that a text is that of a file."""
    if os.environ.get("SEMSIG_SNAPSHOTS") == "write":
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")
