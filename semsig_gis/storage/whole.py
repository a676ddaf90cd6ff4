"""Write files and folders atomically: they appear completely or not at all."""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from semsig_gis.core import BACKUP_FOLDER, TEMPORARY_PREFIX, InputError, temporary_folder

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Provide a temporary path to write to; it replaces `path` if the block succeeds.

    The temporary file has the same name, in a temporary folder next to `path`. Missing folders are
    created, and the permissions of an old file are kept. InputError if the folder is not writable,
    or `path` is a folder, a device or a pipe.
    """
    # If `path` is a link, the link remains and its target is replaced.
    target = Path(os.path.realpath(path))
    if os.path.isdir(target):  # noqa: PTH112 - Path.is_dir raises for some names
        raise InputError(f"{path} is a folder; give the name of a file to write.")
    if os.path.exists(target) and not os.path.isfile(target):  # noqa: PTH110, PTH113
        raise InputError(f"{path} is a device or a pipe; give the name of a file to write.")
    with contextlib.ExitStack() as stack:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            # A folder, because some formats write further files next to the file (-journal).
            folder = stack.enter_context(temporary_folder(target.parent))
        except OSError as error:
            raise InputError(
                f"{_plain_name(path)} cannot be written ({reason(error)}); choose a folder you can "
                "write to."
            ) from error
        partial = folder / Path(path).name
        try:
            yield partial
            _keep_permissions(target, partial)
            os.replace(partial, target)  # noqa: PTH105 - the rename is the point
        except OSError as error:
            # An error about another file is not about writing this one.
            if error.errno is None or error.filename not in {None, str(partial), str(target)}:
                raise
            raise _not_written(path, error) from error


@contextlib.contextmanager
def whole_files(*paths: str | Path) -> Iterator[list[Path]]:
    """Provide temporary paths for files that belong together (see `whole_file`).

    None of the files is replaced before all are written, for example if the disk is full.
    """
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(whole_file(path)) for path in paths]


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write bytes, or text in UTF-8, to a file atomically (see `whole_file`)."""
    with whole_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)


@contextlib.contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty temporary folder, which replaces `path` if the block succeeds.

    An existing folder is replaced with all its contents; files of the same name keep their
    permissions. InputError if it cannot be written.
    """
    target = Path(os.path.realpath(path))
    with _temporary_next_to(target) as temporary:
        partial = temporary / target.name
        partial.mkdir()
        yield partial
        replace_folder(partial, target, temporary=temporary)


def move_folder(new: Path, target: Path) -> None:
    """Rename a folder to `target`, and replace an existing `target` only if that succeeds."""
    with _temporary_next_to(target) as temporary:
        replace_folder(new, target, temporary=temporary)


@contextlib.contextmanager
def _temporary_next_to(target: Path) -> Iterator[Path]:
    """Create a temporary folder in the parent folder of `target`; remove it at the end."""
    backup = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder(target.parent) as temporary:
            backup = temporary / BACKUP_FOLDER / target.name
            yield temporary
    except OSError as error:
        if backup is not None and backup.exists():
            raise InputError(
                f"{target} could not be written ({reason(error)}), and what was there before is in "
                f"{backup}; the next command that writes to {target.parent} puts it back."
            ) from error
        raise _not_written(target, error) from error


def _not_written(path: str | Path, error: OSError) -> InputError:
    return InputError(
        f"{_plain_name(path)} could not be written ({reason(error)}); what was there before is "
        "unchanged, so make room or choose another place."
    )


def _plain_name(path: str | Path) -> Path:
    """Return a path without the temporary folders in it, as the user knows it."""
    parts = [part for part in Path(path).parts if not part.startswith(TEMPORARY_PREFIX)]
    return Path(*parts)


def _keep_permissions(old: Path, new: Path) -> None:
    """Give a file or folder the permissions of the one that it replaces, if there is one."""
    if not old.exists():
        return
    shutil.copymode(old, new)
    for path in new.rglob("*") if new.is_dir() else ():
        if (before := old / path.relative_to(new)).exists():
            shutil.copymode(before, path)


def replace_folder(new: Path, target: Path, *, temporary: Path) -> None:
    """Rename a folder to `target`; an existing one is moved to a folder in `temporary` first.

    If the system can exchange two folders, `target` exists all the time. Otherwise, if the process
    is killed in between, `remove_abandoned` moves the old folder back. OSError if `target` is not
    replaced.
    """
    backup = temporary / BACKUP_FOLDER / target.name
    backup.parent.mkdir()
    _keep_permissions(target, new)
    if exchange(new, target):
        try:
            new.rename(backup)
        except OSError:
            if exchange(new, target):
                raise
            shutil.rmtree(new, ignore_errors=True)
        return
    with contextlib.suppress(FileNotFoundError):
        target.rename(backup)
    try:
        new.rename(target)
    except OSError:
        with contextlib.suppress(OSError):  # the end of the temporary folder tries it again
            if backup.exists():
                backup.rename(target)
        raise


AT_FDCWD = -100
RENAME_EXCHANGE = 2


def exchange(first: Path, second: Path) -> bool:
    """Exchange two files or folders in one step; return False if that is impossible."""
    if sys.platform != "linux":
        return False
    renameat2 = getattr(ctypes.CDLL(None), "renameat2", None)
    if renameat2 is None:
        return False
    sys.audit("os.rename", str(first), str(second), -1, -1)  # as os.rename does
    names = os.fsencode(first), os.fsencode(second)
    return bool(renameat2(AT_FDCWD, names[0], AT_FDCWD, names[1], RENAME_EXCHANGE) == 0)


def reason(error: OSError) -> str:
    """Return the system's message of an error, such as "Permission denied"."""
    return os.strerror(error.errno) if error.errno else str(error)
