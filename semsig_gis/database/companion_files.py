"""Companions of a database: its object store, and files next to it that are no longer needed."""

from __future__ import annotations

import glob
import os
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import (
    TEMPORARY_PREFIX,
    InputError,
    is_abandoned,
    place_locked,
    remove_abandoned,
)
from semsig_gis.database.city import open_city
from semsig_gis.database.store import store_path, waiting_store
from semsig_gis.storage import reason

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.database.city import City

OLD_INDEX = "likelihood index of an older version"
STORE = "street objects"
ABANDONED_STORE = "street objects of a build that was killed"
ABANDONED = "files left by a run that was killed"
IN_USE = "files that a run is writing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Companion:
    """A file or folder next to a database.

    `what` is its kind, `bytes` its total size, and `needed` is whether something still reads it.
    """

    path: Path
    what: str
    bytes: int
    needed: bool

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "path": str(self.path)}


def companions(database: str | Path) -> tuple[Companion, ...]:
    """Return the companions of a database, in a file or in parts.

    DatabaseError if there is no database.
    """
    return tuple(
        Companion(path=path, what=what, bytes=_size(path), needed=what in {STORE, IN_USE})
        for path, what in _paths(open_city(database))
    )


def remove_companions(
    database: str | Path, *, objects: bool = False, dry_run: bool = False
) -> tuple[Companion, ...]:
    """Remove the companions of a database that are not needed, and return them.

    The street objects are needed for updates, for places between the centres of cells, and for the
    names of objects; only `objects` removes them. A dry run removes nothing. InputError if a
    companion cannot be removed.
    """
    unneeded = tuple(
        companion
        for companion in companions(database)
        if not companion.needed or (objects and companion.what == STORE)
    )
    if dry_run or not unneeded:
        return unneeded
    # After the wait, a store that another program was moving to its final folder is gone.
    with place_locked(store_path(database)):
        removed = tuple(companion for companion in unneeded if os.path.lexists(companion.path))
        for companion in removed:
            try:
                _remove(companion)
            except OSError as error:
                raise InputError(
                    f"{companion.path} cannot be removed ({reason(error)}); ask its owner for "
                    "access."
                ) from error
    return removed


def _paths(city: City) -> Iterator[tuple[Path, str]]:
    """Yield the files and folders of companions and their kinds."""
    file = Path(os.path.realpath(city.path))
    current = city.store_path
    for place in (current,) if file.is_dir() else (store_path(file), waiting_store(file)):
        if place.is_dir():
            yield place, STORE if place == current else ABANDONED_STORE
    # Older versions wrote an index for a link to a database too.
    for name in sorted({str(city.path.absolute()), str(file)}):
        for index in sorted(glob.glob(f"{glob.escape(name)}.*.likelihood")):  # noqa: PTH207
            yield Path(index), OLD_INDEX
    for folder in sorted(file.parent.glob(f"{TEMPORARY_PREFIX}*")):
        if folder.is_dir():
            yield folder, ABANDONED if is_abandoned(folder) else IN_USE


def _size(path: Path) -> int:
    """Return the size in bytes of a file, or of all files in a folder."""
    if path.is_symlink() or not path.is_dir():
        return path.lstat().st_size
    files = (Path(folder, name) for folder, _, names in os.walk(path) for name in names)
    return sum(file.lstat().st_size for file in files)


def _remove(companion: Companion) -> None:
    path = companion.path
    if companion.what == ABANDONED:
        remove_abandoned(path.parent)  # which moves replaced files back first
    elif path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()
