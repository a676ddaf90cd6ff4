"""Hidden temporary folders, each locked by its process, and removed later if that is killed.

A killed process cannot remove its folders. So each folder contains a file that its process keeps
locked, and the next process that needs such a folder in the same place removes all folders with
an unlocked file. A folder with a fixed name is the lock of a place (`place_locked`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import shutil
import tempfile
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

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
PATIENCE_S = 3.0
"""Time to wait for another process before saying so."""
LOOK_S = 0.05


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
            if lock is not None:
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
    import filelock  # noqa: PLC0415 - 8 ms, and most commands lock nothing

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
    """Remove a folder, its locked file last; if that fails, the next process tries again.

    The contents of a backup folder are put back first if nothing has replaced them.
    """
    removes_open_files = os.name != "nt"
    is_empty = False
    with contextlib.suppress(OSError):
        for backup in (folder / BACKUP_FOLDER).glob("*"):
            if not os.path.lexists(folder.parent / backup.name):
                backup.rename(folder.parent / backup.name)
        for entry in [*folder.iterdir()]:
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            elif entry.name != LOCK_FILE:
                entry.unlink()
        is_empty = True
        if removes_open_files:
            # While it is locked: a process that waits for it must not get a lock without a name.
            (folder / LOCK_FILE).unlink()
    with contextlib.suppress(OSError):
        os.close(lock)
    if is_empty:
        with contextlib.suppress(OSError):
            if not removes_open_files:
                (folder / LOCK_FILE).unlink()
            folder.rmdir()


@contextlib.contextmanager
def place_locked(target: Path) -> Iterator[bool]:
    """Lock the name of a file or folder for this process; give whether that succeeded.

    If another process of this machine has locked it, wait, and after a few seconds name it in a
    warning. It does not succeed where files cannot be locked, or the parent folder is not writable.
    The block must not lock the same name again.
    """
    name = hashlib.blake2b(os.fsencode(target.name), digest_size=8).hexdigest()
    folder = target.with_name(f"{MACHINE_PREFIX}{name}")
    try:
        lock = _lock_folder(folder, target)
    except OSError:
        lock = None
    if lock is None:
        with contextlib.suppress(OSError):
            folder.rmdir()
        yield False
        return
    try:
        yield True
    finally:
        _remove(folder, lock)


def _lock_folder(folder: Path, target: Path) -> int | None:
    """Return the open and locked file of a folder with a fixed name; None if it cannot be locked.

    The file has the number of the process, and the time.
    """
    path = folder / LOCK_FILE
    while True:
        folder.mkdir(exist_ok=True)
        try:
            lock = os.open(path, os.O_CREAT | os.O_RDWR, 0o644)
        except FileNotFoundError:  # another process has just removed it
            continue
        try:
            if not _locked_in_time(lock, path, target):
                path.unlink()
                return None
            # The last owner has removed the file that this process waited for.
            if path.exists() and os.path.samestat(os.fstat(lock), path.stat()):
                with contextlib.suppress(OSError):  # a full disk
                    os.truncate(lock, 0)
                    os.write(lock, f"{os.getpid()} {time.time():.0f}".encode())
                result, lock = lock, -1
                return result
        finally:
            if lock >= 0:
                os.close(lock)


def _locked_in_time(lock: int, path: Path, target: Path) -> bool:
    """Lock an open file as `locked` does; after a few seconds, warn which process has it."""
    import filelock  # noqa: PLC0415 - as above

    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        try:
            if filelock.lock_descriptor(lock, blocking=False):
                return True
        except OSError:
            return False
        time.sleep(LOOK_S)
    warnings.warn(f"{_owner(path)} {target}; waiting for it", stacklevel=2)
    return locked(lock, wait=True)


def _owner(path: Path) -> str:
    """Return who has locked the file of `_lock_folder`, as the start of a sentence."""
    try:
        number, since = map(int, path.read_bytes().split())
    except (OSError, ValueError):  # Windows lets nobody read a locked file
        return "another program is writing"
    import psutil  # noqa: PLC0415 - 16 ms, and most commands do not wait

    with contextlib.suppress(psutil.Error):
        if psutil.Process(number).status() == psutil.STATUS_STOPPED:
            return f"process {number} is stopped (kill -CONT {number} continues it) while writing"
    clock = time.strftime("%H:%M:%S", time.localtime(since))
    return f"process {number} has since {clock} been writing"
