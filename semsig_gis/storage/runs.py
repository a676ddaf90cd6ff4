"""Folders of runs that can be interrupted and resumed with the same parameters.

A run first writes its parameters (the "recipe") into its folder. A step is finished if its file
exists, because files are written atomically. So the same command continues after the last finished
step.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import TEMPORARY_PREFIX, InputError, remove_abandoned, temporary_folder
from semsig_gis.storage.text import parse_json, read_whole
from semsig_gis.storage.whole import reason, replace_folder, write_whole

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping

    Recipe = dict[str, Any]
    """Parameters of a run as plain JSON values by name."""

PARTIAL = ".partial"
CHUNK = 1 << 20


def digest(*paths: Path) -> str:
    """Return the hexadecimal SHA-256 digest of the contents of files, in their order.

    That of one file of a run is the name of the run in its other files, so that readers notice
    files of different runs, which an interruption may leave.
    """
    total = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                total.update(chunk)
    return total.hexdigest()


@dataclass(frozen=True, kw_only=True)
class RunKind:
    """Folder layout and messages of one kind of run that can be interrupted and resumed.

    `content` describes such a folder in messages, and `another` is the message for a folder with
    another recipe, with ``{folder}`` and ``{difference}`` in it. `read` returns the recipe in a
    folder or raises OSError, TypeError or ValueError; `write` writes one. `names` are the entries
    of a run without results, and `results` is the glob pattern of results.
    """

    content: str
    another: str
    read: Callable[[Path], Recipe]
    write: Callable[[Path, Recipe], None]
    names: Collection[str]
    results: str

    def begin(self, folder: Path, recipe: Recipe) -> None:
        """Start a run in a folder, or resume the one in it; a run without results is replaced.

        InputError if the folder contains anything else or cannot be written.
        """
        recipe = _plain(recipe)
        entries = self._entries(folder)
        if entries:
            stored = self._read(folder, entries)
            if stored == recipe:
                for subfolder in (folder, *filter(Path.is_dir, folder.rglob("*"))):
                    remove_abandoned(subfolder)
                return
            if not entries <= set(self.names) or not self.abandon(folder):
                self._refuse(folder, stored, recipe)
        self.write(folder, recipe)

    def require_same(self, folder: Path, recipe: Recipe) -> None:
        """Raise InputError if a folder contains another recipe, or no run."""
        recipe = _plain(recipe)
        stored = self._read(folder, self._entries(folder))
        if stored != recipe:
            self._refuse(folder, stored, recipe)

    def abandon(self, folder: Path) -> bool:
        """Remove the folder of a run if it has no results; return whether it was removed."""
        if any(folder.glob(self.results)):
            return False
        shutil.rmtree(folder, ignore_errors=True)
        return True

    def _entries(self, folder: Path) -> set[str]:
        """Return the names in a folder, without temporary ones; empty if it does not exist."""
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
    """Return a recipe as JSON returns it, with lists instead of tuples."""
    plain: Recipe = json.loads(json.dumps(recipe))
    return plain


def _difference(stored: Any, recipe: Any) -> list[str]:  # noqa: ANN401 - any value of JSON
    """Return the path of names to the first value in which two recipes differ."""
    if not (isinstance(stored, dict) and isinstance(recipe, dict)):
        return []
    names = {**recipe, **stored}
    name = next(name for name in names if stored.get(name, ...) != recipe.get(name, ...))
    return [name, *_difference(stored.get(name), recipe.get(name))]


def partial_folder(out: str | Path) -> Path:
    """Return the folder of an unfinished run, next to its final folder `out`."""
    target = Path(os.path.realpath(out))
    return target.with_name(f"{target.name}{PARTIAL}")


def finish(folder: Path, *, keep: Collection[str] | None = None) -> Path:
    """Rename the folder of a run (see `partial_folder`) to its final name, and return the new path.

    With `keep`, all other entries are removed first, and an existing final folder is replaced.
    InputError if that fails; the results then remain in `folder`.
    """
    target = folder.with_name(folder.name.removesuffix(PARTIAL))
    try:
        if keep is None:
            folder.rename(target)
        else:
            for path in folder.iterdir():
                if path.name not in keep:
                    _remove(path)
            with temporary_folder(target.parent) as temporary:
                replace_folder(folder, target, temporary=temporary)
    except OSError as error:
        raise InputError(
            f"{target} could not be put in its place ({reason(error)}); the results are in "
            f"{folder}, so run the same command again."
        ) from error
    return target


def _remove(path: Path) -> None:
    """Remove a file or a folder, also while another process removes its own files from it."""
    while path.is_dir():
        with contextlib.suppress(FileNotFoundError):
            shutil.rmtree(path)
    path.unlink(missing_ok=True)


def read_json(path: Path) -> Recipe:
    """Return the values of a JSON file; TypeError if it does not contain an object."""
    values = parse_json(read_whole(path), finite=True)
    if not isinstance(values, dict):
        raise TypeError(f"{path} contains no named values")
    return values


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write a JSON file."""
    write_whole(path, json.dumps(values, indent=2) + "\n")
