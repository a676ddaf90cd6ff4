"""Temporary folders exist as long as their process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

import pytest

from semsig_gis.core import (
    BACKUP_FOLDER,
    LOCK_FILE,
    MACHINE_PREFIX,
    TEMPORARY_PREFIX,
    place_locked,
    remove_abandoned,
    temporary,
    temporary_folder,
)

if TYPE_CHECKING:
    from pathlib import Path


def killed(parent: Path, name: str = MACHINE_PREFIX) -> Path:
    """Create the folder of a killed process."""
    folder = parent / f"{name}killed"
    (folder / "deep").mkdir(parents=True)
    (folder / "deep" / "half.txt").write_text("half")
    (folder / LOCK_FILE).touch()
    return folder


def test_folder_exists_in_the_block(tmp_path: Path) -> None:
    with temporary_folder(tmp_path) as folder:
        assert folder.parent == tmp_path
        (folder / "deep").mkdir()
        (folder / "deep" / "a.txt").touch()
        (folder / "link").symlink_to(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_interrupt_during_creation_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: int, **_options: bool) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(temporary, "locked", interrupt)
    with pytest.raises(KeyboardInterrupt), temporary_folder(tmp_path):
        pytest.fail("there is no folder to work in")
    assert list(tmp_path.iterdir()) == []


def test_only_folders_of_killed_processes_are_removed(tmp_path: Path) -> None:
    other_machine = killed(tmp_path, f"{TEMPORARY_PREFIX}0a1b2c3d-")  # may be locked there
    unknown = tmp_path / f"{MACHINE_PREFIX}unknown"
    (unknown / "deep").mkdir(parents=True)
    killed(tmp_path)
    (tmp_path / f"{MACHINE_PREFIX}empty").mkdir()  # killed at once
    with temporary_folder(tmp_path) as first, temporary_folder(tmp_path) as second:
        assert {*tmp_path.iterdir()} == {first, second, other_machine, unknown}
    assert {*tmp_path.iterdir()} == {other_machine, unknown}


def test_backup_is_restored_if_nothing_replaced_it(tmp_path: Path) -> None:
    for number, expected in enumerate(["old", "old"]):
        backup = killed(tmp_path) / BACKUP_FOLDER
        backup.mkdir()
        (backup / "city").write_text("old" if number == 0 else "older")
        remove_abandoned(tmp_path)
        assert (tmp_path / "city").read_text() == expected
        assert [path.name for path in tmp_path.iterdir()] == ["city"]


@pytest.mark.parametrize("name", ["nowhere", "n" * 5000])
def test_folder_that_cannot_be_created_raises(tmp_path: Path, name: str) -> None:
    remove_abandoned(tmp_path / name)
    with pytest.raises(OSError, match=name), temporary_folder(tmp_path / name):
        pytest.fail("the block must not run")


def test_a_place_is_locked_for_one_writer_and_others_name_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(temporary, "PATIENCE_S", 0.1)
    place, order = tmp_path / "city", list[int]()
    ready, ended = threading.Event(), threading.Event()

    def hold() -> None:
        with place_locked(place) as is_locked:
            order.append(is_locked)
            ready.set()
            ended.wait(10)
            order.append(2)

    holder = threading.Thread(target=hold)
    holder.start()
    ready.wait(10)
    with place_locked(tmp_path / "another"):
        remove_abandoned(tmp_path)  # not a folder of a process at work
    threading.Timer(0.3, ended.set).start()
    owner = rf"process {os.getpid()} has since .* been writing {place}; waiting for it$"
    with pytest.warns(UserWarning, match=owner), place_locked(place) as is_locked:
        order.append(3 * is_locked)
    holder.join()
    assert order == [1, 2, 3]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="processes cannot be stopped")
def test_a_stopped_owner_and_an_unknown_one_are_described(tmp_path: Path) -> None:
    file = tmp_path / "owner"
    assert temporary._owner(file) == "another program is writing"
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        file.write_text(f"{process.pid} 0")
        assert f"process {process.pid} has since" in temporary._owner(file)
        process.send_signal(signal.SIGSTOP)
        try:
            for _ in range(100):
                if "stopped" in (text := temporary._owner(file)):
                    break
                time.sleep(0.01)
            assert f"kill -CONT {process.pid}" in text
        finally:
            process.kill()
