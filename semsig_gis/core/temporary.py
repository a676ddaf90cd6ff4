"""Hidden temporary folders, each locked by its process, and removed later if that is killed.

A killed process cannot remove its folders. So each folder contains a file that its process keeps
locked, and the next process that needs such a folder in the same place removes all folders with
an unlocked file.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import filelock

if TYPE_CHECKING:
    from collections.abc import Iterator

TEMPORARY_PREFIX = ".semsig-"
"""First part of the names of these folders."""

# Locks may be invisible to other machines, so each removes only its own folders.
MACHINE_PREFIX = (
    f"{TEMPORARY_PREFIX}{hashlib.blake2b(platform.node().encode(), digest_size=4).hexdigest()}-"
)
LOCK_FILE = f"{TEMPORARY_PREFIX}owner"
BACKUP_FOLDER = f"{TEMPORARY_PREFIX}aside"
"""Subfolder for a folder that is being replaced; it is put back if the process is killed."""


@contextlib.contextmanager
def temporary_folder(parent: Path) -> Iterator[Path]:
    """Create a hidden folder in `parent`, and remove it after the block.

    OSError if `parent` is not writable.
    """
    remove_abandoned(parent)
    folder, lock = _create_locked(parent)
    try:
        yield folder
    finally:
        _remove(folder, lock)


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders in `parent` of processes of this machine that were killed.

    The contents of a backup folder are put back if nothing has replaced them yet.
    """
    folders: list[Path] = []
    with contextlib.suppress(OSError):  # a name that no folder can have
        folders += parent.glob(f"{MACHINE_PREFIX}*")
    for folder in folders:
        with contextlib.suppress(OSError):
            try:
                lock = _lock_abandoned(folder)
            except FileNotFoundError:
                folder.rmdir()  # if it is empty
                continue
            if lock is None:
                continue
            for backup in (folder / BACKUP_FOLDER).glob("*"):
                if not os.path.lexists(parent / backup.name):
                    backup.rename(parent / backup.name)
            _remove(folder, lock)


def is_abandoned(folder: Path) -> bool:
    """Whether a folder is a temporary one of a killed process of this machine."""
    if not folder.name.startswith(MACHINE_PREFIX):
        return False
    try:
        lock = _lock_abandoned(folder)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    if lock is not None:
        os.close(lock)
    return lock is not None


def _lock_abandoned(folder: Path) -> int | None:
    """Return the opened and locked file of a folder; None if its process still locks it."""
    lock = os.open(folder / LOCK_FILE, os.O_RDWR)
    if locked(lock, wait=False):
        return lock
    os.close(lock)
    return None


def locked(file: int, *, wait: bool) -> bool:
    """Lock an open file or folder until it is closed; return False if that is impossible."""
    try:
        return filelock.lock_descriptor(file, blocking=wait)
    except OSError:
        return False


def _create_locked(parent: Path) -> tuple[Path, int]:
    """Create a folder, and return it with its open and locked file."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=MACHINE_PREFIX, dir=parent))
        try:
            lock = os.open(folder / LOCK_FILE, os.O_CREAT | os.O_RDWR, 0o600)
        except FileNotFoundError:  # another process has just removed it as abandoned
            continue
        except OSError:
            folder.rmdir()
            raise
        try:
            locked(lock, wait=True)
        except KeyboardInterrupt:
            _remove(folder, lock)
            raise
        if (folder / LOCK_FILE).exists():
            return folder, lock
        os.close(lock)


def _remove(folder: Path, lock: int) -> None:
    """Remove a folder, its locked file last; if that fails, the next process tries again."""
    try:
        for entry in [*folder.iterdir()]:
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            elif entry.name != LOCK_FILE:
                entry.unlink()
    except OSError:
        return
    finally:
        os.close(lock)
    with contextlib.suppress(OSError):
        (folder / LOCK_FILE).unlink()
        folder.rmdir()
