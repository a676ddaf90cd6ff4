"""Files and folders that appear whole or not at all."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import BACKUP_FOLDER, InputError, locked, temporary_folder

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Give a temporary path that replaces `path` if, and only if, the block succeeds.

    The path ends in the same name, in a folder of its own beside the file; missing folders are
    made. InputError if there is no writing there, or `path` is a folder, a device or a pipe.
    """
    # A link stays, and the file that it names is replaced.
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):  # noqa: PTH112 - it answers where Path.is_dir raises
        raise InputError(f"{path} is a folder; give the name of a file to write.")
    if os.path.exists(target) and not os.path.isfile(target):  # noqa: PTH110, PTH113
        raise InputError(f"{path} is a device or a pipe; give the name of a file to write.")
    with contextlib.ExitStack() as stack:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            folder = stack.enter_context(temporary_folder(target.parent))
        except OSError as error:
            raise InputError(
                f"{path} cannot be written ({reason(error)}); choose a folder you can write to."
            ) from error
        # A folder of its own, because some formats write companions beside the file (-journal).
        partial = folder / Path(path).name
        try:
            yield partial
            os.replace(partial, target)  # noqa: PTH105 - the rename is the point
        except OSError as error:
            if error.errno is None or error.filename not in {None, str(partial), str(target)}:
                raise
            raise InputError(
                f"{path} could not be written ({reason(error)}); what was there before is "
                "unchanged, so make room or choose another place."
            ) from error


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write bytes, or text in UTF-8, as a whole file (see `whole_file`)."""
    with whole_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder that replaces `path` if, and only if, the block succeeds.

    A folder that is there is replaced with all that is in it. InputError if it cannot be written.
    """
    target = Path(os.path.realpath(path))
    with _box(target) as box:
        partial = box / target.name
        partial.mkdir()
        yield partial
        put_in_place(partial, target, box=box)


def move_folder(new: Path, place: Path) -> None:
    """Rename a folder to its place beside it; what is there is replaced, or stays if that fails."""
    with _box(place) as box:
        put_in_place(new, place, box=box)


@contextlib.contextmanager
def _box(target: Path) -> Iterator[Path]:
    """Give a temporary folder beside a folder that is being written."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder(target.parent) as box:
            yield box
    except OSError as error:
        raise InputError(
            f"{target} could not be written ({reason(error)}); what was there before is "
            "unchanged, so make room or choose another place."
        ) from error


def put_in_place(new: Path, place: Path, *, box: Path) -> None:
    """Rename a folder to its place; what is there is put into a temporary folder beside it.

    The place is never empty where the system lets two folders change places. Else a run that is
    killed in between leaves the old one aside, from where `remove_abandoned` puts it back.
    """
    aside = box / BACKUP_FOLDER / place.name
    aside.parent.mkdir()
    if exchanged(new, place):
        new.rename(aside)
        return
    with contextlib.suppress(FileNotFoundError):
        place.rename(aside)
    try:
        new.rename(place)
    except OSError:
        if aside.exists():
            aside.rename(place)
        raise


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[bool]:
    """Wait until no other program is in such a block with a folder; give whether that is sure.

    It is not where the system does not lock folders.
    """
    try:
        file = os.open(folder, os.O_RDONLY)
    except OSError:
        yield False
        return
    try:
        yield locked(file, wait=True)
    finally:
        os.close(file)


AT_FDCWD = -100
RENAME_EXCHANGE = 2


def exchanged(one: Path, other: Path) -> bool:
    """Let two files or folders change places in one step; False where that is impossible."""
    if sys.platform != "linux":
        return False
    renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)
    if renameat2 is None:
        return False
    sys.audit("os.rename", str(one), str(other), -1, -1)  # as Python's own renames are told
    names = os.fsencode(one), os.fsencode(other)
    return bool(renameat2(AT_FDCWD, names[0], AT_FDCWD, names[1], RENAME_EXCHANGE) == 0)


def reason(error: OSError) -> str:
    """Return the system's few words about an error, such as "Permission denied"."""
    return os.strerror(error.errno) if error.errno else str(error)
