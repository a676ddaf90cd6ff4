"""What the tests of reports share: texts that are compared with stored ones."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

SNAPSHOTS = Path(__file__).with_name("snapshots")


@pytest.fixture
def snapshot() -> Callable[[str, str], None]:
    """Return a check of a text against a stored one; SEMSIG_SNAPSHOTS=1 stores it anew."""

    def check(name: str, text: str) -> None:
        if os.environ.get("SEMSIG_SNAPSHOTS"):
            (SNAPSHOTS / name).write_bytes(text.encode())
        assert text == (SNAPSHOTS / name).read_bytes().decode()

    return check
