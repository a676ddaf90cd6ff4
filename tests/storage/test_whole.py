"""Files and folders are written atomically."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from pathlib import Path
from typing import NoReturn
from unittest.mock import Mock

import pytest
from sentences import assert_sentence, refused

from semsig_gis.core import InputError
from semsig_gis.storage import exchange, move_folder, whole_file, whole_folder


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """Return the only file of a folder."""
    path = tmp_path / "a.txt"
    path.write_text("old")
    return path


def assert_only_file(path: Path, text: str) -> None:
    """Check the text of a file, and that its folder contains nothing else."""
    assert path.read_text() == text
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("name", ["new/folder/a.gpkg", "a" * 250 + ".gpkg"])
def test_file_appears_after_the_block(tmp_path: Path, name: str) -> None:
    target = tmp_path / name  # the second name has the maximum length
    with whole_file(str(target)) as partial:
        assert partial.suffix == ".gpkg"
        assert partial.parent.parent == target.parent
        partial.write_text("new")
        assert not target.exists()
        # Other files in the temporary folder are removed.
        partial.with_name("a.gpkg-journal").write_text("half")
        partial.with_name("folder").mkdir()
        (partial.with_name("folder") / "more").write_text("x")
    assert_only_file(target, "new")


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, SystemExit, MemoryError])
def test_error_in_the_block_leaves_only_the_old_file(old: Path, stop: type[BaseException]) -> None:
    with pytest.raises(stop), whole_file(old) as partial:  # noqa: PT012
        partial.write_text("half")
        raise stop
    assert_only_file(old, "old")


def test_unusable_path_is_refused(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    places = [
        (old / "a.txt", "cannot be written"),
        (old / "deeper" / "a.txt", "choose a folder"),
        (old.parent, "is a folder"),
        (Path(), "is a folder"),
        (Path(os.devnull), "is a device or a pipe"),
    ]
    for path, words in places:
        with refused(InputError, str(path), words), whole_file(path):
            pytest.fail("the block must not run")
    denied = PermissionError(errno.EACCES, "Permission denied", str(old.parent))
    monkeypatch.setattr(tempfile, "mkdtemp", Mock(side_effect=denied))
    with refused(InputError, "a.txt", "Permission denied"), whole_file(old):
        pytest.fail("the block must not run")
    assert_only_file(old, "old")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipe_is_refused_and_not_removed(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with refused(InputError, "is a device or a pipe"), whole_file(tmp_path / "pipe"):
        pytest.fail("the block must not run")
    assert (tmp_path / "pipe").is_fifo()


def test_full_disk_or_failed_rename_leaves_the_old_file(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As pyarrow raises it: with a number and its own message, without a file name.
    full = OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left")
    words = f"({os.strerror(errno.ENOSPC)}); what was there before is unchanged"
    with refused(InputError, str(old), words), whole_file(old):
        raise full
    assert_only_file(old, "old")

    def busy(source: Path, _: Path) -> NoReturn:
        raise OSError(errno.EBUSY, "Device or resource busy", str(source))

    monkeypatch.setattr(os, "replace", busy)
    with refused(InputError, str(old), "unchanged"), whole_file(old) as partial:
        partial.write_text("new")
    assert_only_file(old, "old")


def test_block_that_writes_nothing_raises_and_leaves_nothing(tmp_path: Path) -> None:
    with refused(InputError, "a.txt", "could not be written"), whole_file(tmp_path / "a.txt"):
        pass
    # An error about another file keeps its own message.
    with pytest.raises(FileNotFoundError, match=r"other\.txt"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()
    assert list(tmp_path.iterdir()) == []


def test_link_remains_and_its_target_is_replaced(old: Path) -> None:
    link, folder = old.with_name("latest"), old.with_name("folder")
    link.symlink_to(old)
    with whole_file(link) as partial:
        partial.write_text("new")
    assert link.is_symlink()
    assert old.read_text() == "new"
    folder.mkdir()
    link.unlink()
    link.symlink_to(folder)
    with whole_folder(link) as partial:
        (partial / "a.txt").write_text("a")
    assert link.is_symlink()
    assert_only_file(folder / "a.txt", "a")


def test_folder_is_replaced_with_all_contents(tmp_path: Path) -> None:
    target = tmp_path / "new" / "city"
    for number in range(2):
        with whole_folder(str(target)) as partial:
            assert partial.name == "city"
            assert list(partial.iterdir()) == []
            (partial / f"{number}.txt").write_text("whole")
        assert_only_file(target / f"{number}.txt", "whole")
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, OSError(28, "No space left")])
def test_error_in_the_block_leaves_only_the_old_folder(
    tmp_path: Path, stop: type[BaseException] | OSError
) -> None:
    city = tmp_path / "city"
    city.mkdir()
    (city / "old.txt").write_text("old")

    def half() -> None:
        with whole_folder(city) as partial:
            (partial / "new.txt").write_text("half")
            raise stop

    with pytest.raises((RuntimeError, KeyboardInterrupt, InputError)) as caught:
        half()
    if isinstance(stop, OSError):
        assert_sentence(caught.value, str(city), "No space left on device")
    assert_only_file(city / "old.txt", "old")
    assert list(tmp_path.iterdir()) == [city]


def test_failed_rename_of_a_folder_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new, old = tmp_path / "new", tmp_path / "old"
    for folder in (new, old):
        folder.mkdir()
        (folder / "a.txt").write_text(folder.name)
    rename = Path.rename

    def denied(self: Path, target: Path) -> Path:
        if self.name == "new":
            raise PermissionError(errno.EACCES, "Permission denied")
        return rename(self, target)

    # As on systems that cannot exchange two folders.
    monkeypatch.setattr("semsig_gis.storage.whole.exchange", lambda *_: False)
    with monkeypatch.context() as patch, refused(InputError, "Permission denied", "is unchanged"):
        patch.setattr(Path, "rename", denied)
        move_folder(new, old)
    for folder in (new, old):
        assert_only_file(folder / "a.txt", folder.name)
    move_folder(new, old)
    assert_only_file(old / "a.txt", "new")
    assert list(tmp_path.iterdir()) == [old]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do it in two steps")
def test_two_folders_are_exchanged(tmp_path: Path) -> None:
    new, old = tmp_path / "new", tmp_path / "old"
    new.mkdir()
    assert not exchange(new, old)
    (old / "a.txt").parent.mkdir()
    (old / "a.txt").write_text("old")
    assert exchange(new, old)
    assert_only_file(new / "a.txt", "old")
    assert list(old.iterdir()) == []
