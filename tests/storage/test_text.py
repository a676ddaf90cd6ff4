"""Limits for reading text and JSON files."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import pytest

from semsig_gis.storage import MAX_TEXT_BYTES, parse_json, read_text, read_whole

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.skipif(sys.platform == "win32", reason="no such files")
def test_pipe_and_device_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(OSError, match="it is a pipe or a device, not a file"):
            read_whole(path)


def test_too_large_file_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "long.json").open("wb") as file:
        file.truncate(MAX_TEXT_BYTES + 1)  # sparse: takes no space on the disk
    with pytest.raises(OSError, match=r"it has 268,435,457 bytes, and at most 268,435,456 "):
        read_whole(tmp_path / "long.json")


def test_byte_order_mark_is_removed(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes("\ufeffé".encode())
    assert read_text(tmp_path / "a.toml") == "é"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 200_000, "nested too deeply"),
        ('{"a": ' * 200_000, "nested too deeply"),
        ('{"a": NaN}', "NaN is not a finite number"),
        ("[-Infinity]", "-Infinity is not a finite number"),
        ("[1e999]", "1e999 is not a finite number"),
        (f"[{10**40}]", "10000000000000000000 is beyond 64 bits"),
        ("[" + "1" * 10_000 + "]", "digits"),
    ],
)
def test_finite_json_refuses_deep_nesting_and_unusable_numbers(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_json(text, finite=True)


def test_other_json_may_contain_any_number() -> None:
    assert parse_json("[1e999, 1.5, 7]")[1:] == [1.5, 7]
    assert parse_json("[1.5, -7]", finite=True) == [1.5, -7]
