"""Features that other systems than Linux lack are disabled (see docs/reliability.md)."""

from __future__ import annotations

import errno
import os
import sys
from typing import TYPE_CHECKING, NoReturn

import filelock
import pytest

from semsig_gis import open_cache
from semsig_gis.core import cores, free_address_space, place_locked, temporary_folder
from semsig_gis.storage import exchange

if TYPE_CHECKING:
    from pathlib import Path


def test_without_cpu_affinity_all_processors_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert cores() == os.cpu_count()


def test_without_resource_limits_there_is_no_address_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    assert free_address_space() is None


def test_without_locks_temporary_folders_are_created_and_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_locks(*_: object, **__: object) -> NoReturn:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(filelock, "lock_descriptor", no_locks)
    with temporary_folder(tmp_path) as first, temporary_folder(tmp_path) as second:
        assert {*tmp_path.iterdir()} == {first, second}
    assert list(tmp_path.iterdir()) == []
    with place_locked(tmp_path / "city") as is_locked:
        assert not is_locked


def test_folder_that_cannot_be_opened_is_not_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> NoReturn:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(os, "open", refuse)
    with place_locked(tmp_path / "city") as is_locked:
        assert not is_locked


def test_without_exchange_folders_are_not_exchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder is then replaced in two steps, as the tests of whole folders show."""
    monkeypatch.setattr(sys, "platform", "darwin")
    assert not exchange(tmp_path, tmp_path)


@pytest.mark.skipif(sys.platform != "linux", reason="its cache folder is elsewhere")
@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "HOME"])
def test_downloads_are_in_the_cache_folder_of_the_system(
    variable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    expected = tmp_path if variable == "XDG_CACHE_HOME" else tmp_path / ".cache"
    assert open_cache()[0].folder == expected / "semsig"
