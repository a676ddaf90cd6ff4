from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path
from typing import NoReturn

import pytest
from sentences import assert_sentence, refused

from semsig_gis.core.errors import InputError
from semsig_gis.storage.whole import move_folder, whole_file, whole_folder


def test_a_file_appears_when_the_block_is_done(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "a.gpkg"
    with whole_file(str(target)) as partial:
        assert partial.suffix == ".gpkg"
        assert partial.parent.parent == target.parent
        partial.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, SystemExit, MemoryError])
def test_an_error_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, stop: type[BaseException]
) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(stop), whole_file(target) as partial:  # noqa: PT012
        partial.write_text("half")
        raise stop
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_companions_of_the_file_are_removed(tmp_path: Path) -> None:
    target = tmp_path / "a.gpkg"
    with whole_file(target) as partial:
        partial.write_text("whole")
        partial.with_name("a.gpkg-journal").write_text("half")
        partial.with_name("folder").mkdir()
        (partial.with_name("folder") / "more").write_text("x")
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_writes_nothing_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    with refused(InputError, "a.txt", "could not be written"), whole_file(tmp_path / "a.txt"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_place_for_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for path, words in (
        (tmp_path / "file" / "a.txt", "cannot be written"),
        (tmp_path / "file" / "deeper" / "a.txt", "choose a folder"),
        (tmp_path, "is a folder"),
        (Path(), "is a folder"),
        (Path(os.devnull), "is a device or a pipe"),
    ):
        with refused(InputError, str(path), words), whole_file(path):
            pytest.fail("the block must not run")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_refused_and_stays(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with refused(InputError, "is a device or a pipe"), whole_file(tmp_path / "pipe"):
        pytest.fail("the block must not run")
    assert (tmp_path / "pipe").is_fifo()


def test_a_folder_that_may_not_be_written_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(**_: object) -> NoReturn:
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path))

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    with refused(InputError, "a.txt", "Permission denied"), whole_file(tmp_path / "a.txt"):
        pytest.fail("the block must not run")


def test_a_full_disk_leaves_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    # As pyarrow raises it: with a number, without a file name, and with words of its own.
    full = OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space left")
    with pytest.raises(InputError) as caught, whole_file(target):
        raise full
    assert_sentence(caught.value, str(target), os.strerror(errno.ENOSPC), "unchanged")
    assert "Detail" not in str(caught.value)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_rename_that_fails_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def refuse(source: Path, _: Path) -> NoReturn:
        raise OSError(errno.EBUSY, "Device or resource busy", str(source))

    monkeypatch.setattr(os, "replace", refuse)
    with refused(InputError, str(target), "unchanged"), whole_file(target) as partial:
        partial.write_text("new")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_error_about_another_file_keeps_its_own_message(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"other\.txt"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()
    assert list(tmp_path.iterdir()) == []


def test_a_link_stays_and_the_file_that_it_names_is_replaced(tmp_path: Path) -> None:
    real, link = tmp_path / "city-2.txt", tmp_path / "latest.txt"
    real.write_text("old")
    link.symlink_to(real)
    with whole_file(link) as partial:
        partial.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_as_long_a_name_as_the_system_takes_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("a" * 251 + ".txt")
    with whole_file(target) as partial:
        partial.write_text("new")
    assert target.read_text() == "new"


def contents(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def test_a_folder_replaces_all_that_was_there(tmp_path: Path) -> None:
    target = tmp_path / "new" / "city"
    for number in range(2):
        with whole_folder(str(target)) as partial:
            assert partial.name == "city"
            assert list(partial.iterdir()) == []
            (partial / f"{number}.txt").write_text("whole")
        assert contents(target) == {f"{number}.txt": "whole"}
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("stop", [RuntimeError, KeyboardInterrupt, OSError(28, "No space left")])
def test_an_error_leaves_the_old_folder_and_nothing_else(
    tmp_path: Path, stop: type[BaseException] | OSError
) -> None:
    target = tmp_path / "city"
    target.mkdir()
    (target / "old.txt").write_text("old")

    def half() -> None:
        with whole_folder(target) as partial:
            (partial / "new.txt").write_text("half")
            raise stop

    with pytest.raises((RuntimeError, KeyboardInterrupt, InputError)) as caught:
        half()
    if isinstance(stop, OSError):
        assert_sentence(caught.value, str(target), "No space left on device")
    assert contents(target) == {"old.txt": "old"}
    assert list(tmp_path.iterdir()) == [target]


def test_a_link_to_a_folder_stays(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with whole_folder(tmp_path / "link") as partial:
        (partial / "a.txt").write_text("a")
    assert (tmp_path / "link").is_symlink()
    assert contents(tmp_path / "real") == {"a.txt": "a"}


def test_a_folder_that_cannot_be_renamed_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("new", "old"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.txt").write_text(name)
    rename = Path.rename

    def denied(self: Path, target: Path) -> Path:
        if self.name == "new":
            raise PermissionError(errno.EACCES, "Permission denied")
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", denied)
        with pytest.raises(InputError) as caught:
            move_folder(tmp_path / "new", tmp_path / "old")
    assert_sentence(caught.value, "Permission denied", "is unchanged")
    assert {name: contents(tmp_path / name)["a.txt"] for name in ("new", "old")} == {
        "new": "new",
        "old": "old",
    }
    move_folder(tmp_path / "new", tmp_path / "old")
    assert contents(tmp_path / "old") == {"a.txt": "new"}
    assert list(tmp_path.iterdir()) == [tmp_path / "old"]
