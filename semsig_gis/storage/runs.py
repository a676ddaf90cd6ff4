"""Runs that can be interrupted: the folder of a run, which only the same recipe takes up again.

A run writes its recipe into the folder first. A step is done when its file is there, and every file
appears whole, so the same command goes on after the last finished step.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import TEMPORARY_PREFIX, InputError, remove_abandoned, temporary_folder
from semsig_gis.storage.text import parse_json, read_whole
from semsig_gis.storage.whole import put_in_place, reason, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    Recipe = dict[str, Any]
    """What a run is, as plain JSON values by name."""

PARTIAL = ".partial"


@dataclass(frozen=True, kw_only=True)
class RunKind:
    """One kind of run, and how its folders are recognized.

    `content` says what such a folder holds, and `another` is the refusal of a run of another
    recipe, with ``{folder}`` and ``{difference}`` in it. `read` returns the recipe in a folder or
    raises OSError, TypeError or ValueError; `write` puts one there. `names` are the entries of a
    run that has no results yet, and `results` is the pattern of these.
    """

    content: str
    another: str
    read: Callable[[Path], Recipe]
    write: Callable[[Path, Recipe], None]
    names: Collection[str]
    results: str

    def begin(self, folder: Path, recipe: Recipe) -> None:
        """Begin a run in a folder, or take up the one in it; one without results is replaced.

        InputError if the folder holds something else or cannot be written.
        """
        recipe = _plain(recipe)
        entries = self._entries(folder)
        if entries:
            stored = self._read(folder, entries)
            if stored == recipe:
                for place in (folder, *filter(Path.is_dir, folder.rglob("*"))):
                    remove_abandoned(place)
                return
            if not entries <= set(self.names) or not self.abandon(folder):
                self._refuse(folder, stored, recipe)
        self.write(folder, recipe)

    def require_same(self, folder: Path, recipe: Recipe) -> None:
        """Refuse a folder with results of another recipe, or with something else."""
        recipe = _plain(recipe)
        stored = self._read(folder, self._entries(folder))
        if stored != recipe:
            self._refuse(folder, stored, recipe)

    def abandon(self, folder: Path) -> bool:
        """Remove the folder of a run without results, and return whether it was one."""
        if any(folder.glob(self.results)):
            return False
        shutil.rmtree(folder, ignore_errors=True)
        return True

    def _entries(self, folder: Path) -> set[str]:
        """Return the names in a folder; none if it does not exist."""
        try:
            names = {path.name for path in folder.iterdir()} if folder.exists() else set()
        except OSError as error:
            raise InputError(
                f"{folder} cannot be read ({reason(error)}); choose another folder."
            ) from error
        return {name for name in names if not name.startswith(TEMPORARY_PREFIX)}

    def _read(self, folder: Path, entries: set[str]) -> Recipe:
        try:
            return self.read(folder)
        except (OSError, TypeError, ValueError) as error:
            first = min(entries - set(self.names) or entries, default="nothing")
            raise InputError(
                f"{folder} contains {first!r}, but no {self.content} that can be read; choose "
                "another folder."
            ) from error

    def _refuse(self, folder: Path, stored: Recipe, recipe: Recipe) -> None:
        difference = ", ".join(_difference(stored, recipe))
        raise InputError(self.another.format(folder=folder, difference=difference))


def _plain(recipe: Recipe) -> Recipe:
    """Return a recipe as it is read again from JSON: with lists in the place of tuples."""
    plain: Recipe = json.loads(json.dumps(recipe))
    return plain


def _difference(one: Any, other: Any) -> list[str]:  # noqa: ANN401 - whatever JSON holds
    """Return the names that lead to the first value in which two recipes differ."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return []
    name = next(name for name in {**other, **one} if one.get(name, ...) != other.get(name, ...))
    return [name, *_difference(one.get(name), other.get(name))]


def partial_folder(out: str | Path) -> Path:
    """Return the folder beside `out` in which a run works until it is finished."""
    target = Path(os.path.realpath(out))
    return target.with_name(f"{target.name}{PARTIAL}")


def finish(folder: Path, *, keep: Collection[str] | None = None) -> Path:
    """Rename the folder of a run (see `partial_folder`) to its place, and return that.

    With `keep`, all other entries are removed first, and what is in the place is replaced. Raise
    InputError if that fails; the results then stay in the folder.
    """
    target = folder.with_name(folder.name.removesuffix(PARTIAL))
    try:
        if keep is None:
            folder.rename(target)
        else:
            for path in folder.iterdir():
                if path.name not in keep:
                    _remove(path)
            with temporary_folder(target.parent) as box:
                put_in_place(folder, target, box=box)
    except OSError as error:
        raise InputError(
            f"{target} could not be put in its place ({reason(error)}); the results are in "
            f"{folder}, so run the same command again."
        ) from error
    return target


def _remove(path: Path) -> None:
    """Remove a file or a folder, while a late process may remove of it what it had made."""
    while path.is_dir():
        with contextlib.suppress(FileNotFoundError):
            shutil.rmtree(path)
    path.unlink(missing_ok=True)


def read_json(path: Path) -> Recipe:
    """Return the values of a JSON file; TypeError if it holds anything but an object."""
    values = parse_json(read_whole(path), finite=True)
    if not isinstance(values, dict):
        raise TypeError(f"{path} contains no named values")
    return values


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write values into a JSON file."""
    write_whole(path, json.dumps(values, indent=2) + "\n")
