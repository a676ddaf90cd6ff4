"""What lies beside a database: its object store, and what nobody needs any more."""

from __future__ import annotations

import glob
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import TEMPORARY_PREFIX, InputError, is_abandoned, remove_abandoned
from semsig_gis.database.city import open_city
from semsig_gis.database.store import store_path, waiting_store
from semsig_gis.storage import folder_locked, reason

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.database.city import City

INDEX = "likelihood index of an older version"
STORE = "street objects"
LEFT_STORE = "street objects of a build that was killed"
LEFT = "files left by a run that was killed"
AT_WORK = "files that a run is writing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Companion:
    """A file or folder beside a database.

    `what` says what it is, `bytes` is its size with all that is in it, and `needed` tells whether
    something still reads it.
    """

    path: Path
    what: str
    bytes: int
    needed: bool

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "path": str(self.path),
            "what": self.what,
            "bytes": self.bytes,
            "needed": self.needed,
        }


def companions(database: str | Path) -> tuple[Companion, ...]:
    """Return what lies beside a database, in a file or in parts.

    DatabaseError if there is none.
    """
    return tuple(
        Companion(path=one, what=what, bytes=_size(one), needed=what in {STORE, AT_WORK})
        for one, what in _found(open_city(database))
    )


def remove_companions(
    database: str | Path, *, objects: bool = False, dry_run: bool = False
) -> tuple[Companion, ...]:
    """Remove what lies beside a database and nobody needs, and return what that was.

    The street objects are needed to update it, to refine places between the middles of cells, and
    to name objects; they go with `objects` alone. A dry run removes nothing. InputError if
    something cannot be removed.
    """
    chosen = tuple(
        one for one in companions(database) if not one.needed or (objects and one.what == STORE)
    )
    if dry_run or not chosen:
        return chosen
    # A store that another program was just putting in place is there no more after the wait.
    with folder_locked(Path(os.path.realpath(database)).parent):
        removed = tuple(one for one in chosen if os.path.lexists(one.path))
        for one in removed:
            try:
                _remove(one)
            except OSError as error:
                raise InputError(
                    f"{one.path} cannot be removed ({reason(error)}); ask its owner for access."
                ) from error
    return removed


def _found(city: City) -> Iterator[tuple[Path, str]]:
    """Give all that lies beside a database, and what it is."""
    file = Path(os.path.realpath(city.path))
    current = city.store_path
    for place in (current,) if file.is_dir() else (store_path(file), waiting_store(file)):
        if place.is_dir():
            yield place, STORE if place == current else LEFT_STORE
    for name in sorted({str(city.path.absolute()), str(file)}):  # a link had its own
        for index in sorted(glob.glob(f"{glob.escape(name)}.*.likelihood")):  # noqa: PTH207
            yield Path(index), INDEX
    for folder in sorted(file.parent.glob(f"{TEMPORARY_PREFIX}*")):
        if folder.is_dir():
            yield folder, LEFT if is_abandoned(folder) else AT_WORK


def _size(path: Path) -> int:
    """Return how many bytes a file holds, or all files in a folder."""
    if path.is_symlink() or not path.is_dir():
        return path.lstat().st_size
    files = (Path(folder, name) for folder, _, names in os.walk(path) for name in names)
    return sum(file.lstat().st_size for file in files)


def _remove(one: Companion) -> None:
    if one.what == LEFT:
        remove_abandoned(one.path.parent)  # puts back what was put aside
    elif one.path.is_dir() and not one.path.is_symlink():
        shutil.rmtree(one.path)
    else:
        one.path.unlink()
