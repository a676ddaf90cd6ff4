"""Hidden folders for what is half done: each belongs to one process and does not outlive it.

A process that is killed cannot tidy up. So each folder holds a file that its process keeps locked,
and whoever makes a folder beside it removes those that nobody holds any more.
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

if TYPE_CHECKING:
    from collections.abc import Iterator

HALF_DONE = ".semsig-"
"""How the names of these folders begin."""

# Locks may be seen by one machine only, so that those of others are left alone.
MACHINE = f"{HALF_DONE}{hashlib.blake2b(platform.node().encode(), digest_size=4).hexdigest()}-"
OWNER = f"{HALF_DONE}owner"
ASIDE = f"{HALF_DONE}aside"
"""Folder in such a folder; what it holds belongs in the place of that name beside the folder."""


@contextlib.contextmanager
def own_folder(parent: Path) -> Iterator[Path]:
    """Give a new hidden folder in another, which is removed after the block.

    OSError if there is no writing there.
    """
    remove_abandoned(parent)
    folder, owner = _claimed(parent)
    try:
        yield folder
    finally:
        _remove(folder, owner)


def remove_abandoned(parent: Path) -> None:
    """Remove from a folder the hidden folders of processes of this machine that were killed.

    What such a process had put aside, with nothing in its place yet, is put back.
    """
    folders: list[Path] = []
    with contextlib.suppress(OSError):  # a name that no folder can have
        folders += parent.glob(f"{MACHINE}*")
    for folder in folders:
        with contextlib.suppress(OSError):
            try:
                owner = _freed(folder)
            except FileNotFoundError:
                folder.rmdir()  # if it is empty
                continue
            if owner is None:
                continue
            for kept in (folder / ASIDE).glob("*"):
                if not os.path.lexists(parent / kept.name):
                    kept.rename(parent / kept.name)
            _remove(folder, owner)


def is_abandoned(folder: Path) -> bool:
    """Tell whether a hidden folder is one of a process of this machine that was killed."""
    if not folder.name.startswith(MACHINE):
        return False
    try:
        owner = _freed(folder)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    if owner is not None:
        os.close(owner)
    return owner is not None


def _freed(folder: Path) -> int | None:
    """Return the open, locked file that says whose a folder is; None where its process holds it."""
    owner = os.open(folder / OWNER, os.O_RDWR)
    if locked(owner, wait=False):
        return owner
    os.close(owner)
    return None


def locked(file: int, *, wait: bool) -> bool:
    """Lock an open file or folder until it is closed; False where that is impossible."""
    from filelock import lock_descriptor  # noqa: PLC0415 - a query alone writes nothing

    try:
        return lock_descriptor(file, blocking=wait)
    except OSError:
        return False


def _claimed(parent: Path) -> tuple[Path, int]:
    """Make a folder, and return it with the open file that says so."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=MACHINE, dir=parent))
        try:
            owner = os.open(folder / OWNER, os.O_CREAT | os.O_RDWR, 0o600)
        except FileNotFoundError:  # another process took it for abandoned just now
            continue
        except OSError:
            folder.rmdir()
            raise
        try:
            locked(owner, wait=True)
        except KeyboardInterrupt:  # likely here, as a module is loaded
            _remove(folder, owner)
            raise
        if (folder / OWNER).exists():
            return folder, owner
        os.close(owner)


def _remove(folder: Path, owner: int) -> None:
    """Remove a folder, and at last what says whose it is; a later run does what fails."""
    try:
        for entry in [*folder.iterdir()]:
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            elif entry.name != OWNER:
                entry.unlink()
    except OSError:
        return
    finally:
        os.close(owner)
    with contextlib.suppress(OSError):
        (folder / OWNER).unlink()
        folder.rmdir()
