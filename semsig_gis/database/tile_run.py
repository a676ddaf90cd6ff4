"""A database in parts while it is built: beside its place, whole or not at all, resumable.

The run works in ``OUT.partial``. Its recipe is written there first, so that the same command finds
the tiles that an interrupted run has left; when all are there, the folder is renamed to ``OUT``.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.file import open_database
from semsig_gis.database.parts import MANIFEST, Manifest, Part, digest, part_name, read_manifest
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.database.database import SignatureDatabase

RECIPE = "_recipe.json"
# Copies of inputs that can be read by box.
INPUTS = "_inputs"
EMPTY = ".empty"
# Files that were being written when a run was killed (see semsig_gis.storage.geoparquet).
HALF_WRITTEN = ".semsig-"


def start(out: str | Path, recipe: dict[str, Any]) -> Path:
    """Begin a run, or take up an unfinished one, and return its folder: `out` with ``.partial``.

    `recipe` says how the database is built, as plain JSON values. Raise InputError if `out` holds
    something that may not be replaced, the folder cannot be written to, or it holds tiles of an
    unfinished run by another recipe, which are never thrown away unasked.
    """
    target = Path(os.path.realpath(out))
    _require_replaceable(target)
    folder = target.with_name(f"{target.name}.partial")
    wanted = json.loads(json.dumps(recipe))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for left in folder.glob(f"{HALF_WRITTEN}*"):
            shutil.rmtree(left, ignore_errors=True)
        names = {path.name for path in folder.iterdir()}
    except OSError as error:
        msg = f"{folder} cannot be written ({os.strerror(error.errno or 0)}); choose another place."
        raise InputError(msg) from error
    if not names:
        with whole_file(folder / RECIPE) as partial:
            partial.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")
        return folder
    try:
        found = json.loads((folder / RECIPE).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        msg = f"{folder} is not an unfinished run; move it elsewhere or choose another name."
        raise InputError(msg) from error
    if found != wanted and abandon(folder):
        return start(out, recipe)
    if found != wanted:
        msg = (
            f"{folder} holds an unfinished run that differs in {_difference(found, wanted)}; "
            "delete that folder to start anew, or finish it with the same command and inputs as "
            "before."
        )
        raise InputError(msg)
    return folder


def abandon(folder: Path) -> bool:
    """Remove the folder of a run that has not done a single tile, and tell whether it was."""
    if any(folder.glob("tile_*")):
        return False
    shutil.rmtree(folder, ignore_errors=True)
    return True


def _require_replaceable(target: Path) -> None:
    """Refuse to put a database in the place of anything but a database."""
    if not target.is_dir():
        if target.exists() and not target.is_file():
            msg = f"{target} is a device or a pipe; give the name of a folder to write."
            raise InputError(msg)
        return
    found = {path.name for path in target.iterdir() if not path.name.startswith(HALF_WRITTEN)}
    if MANIFEST in found:
        ours = {part.file for part in read_manifest(target).parts}
        others = found - ours - {MANIFEST, RECIPE}
    else:
        others = found
    if others:
        msg = (
            f"{target} holds {min(others)!r}, which is no part of a signature database; give the "
            "name of a new folder, or move that elsewhere."
        )
        raise InputError(msg)


def _difference(found: Any, wanted: dict[str, Any]) -> str:  # noqa: ANN401 - whatever JSON holds
    """Return the name of the first thing in which two recipes differ."""
    if isinstance(found, dict):
        for name, value in wanted.items():
            if found.get(name) != value:
                inner = isinstance(value, dict)
                return f"{name}, {_difference(found.get(name), value)}" if inner else name
    return "what it was given"


def describe(tile: tuple[int, int], database: SignatureDatabase, path: Path) -> Part:
    """Return the manifest's entry for a part that was saved to a path."""
    return Part(tile, len(database), len(database.codes), path.stat().st_size, digest(path))


def mark_empty(folder: Path, tile: tuple[int, int]) -> None:
    """Note that a tile is done and that none of its cells sees anything."""
    (folder / part_name(tile)).with_suffix(EMPTY).touch()


def finished_tiles(
    folder: Path, tiles: Iterable[tuple[int, int]]
) -> dict[tuple[int, int], Part | None]:
    """Return the parts of the tiles that are done, None where no cell sees anything.

    A damaged file is deleted, and its tile is not done.
    """
    done: dict[tuple[int, int], Part | None] = {}
    for tile in tiles:
        path = folder / part_name(tile)
        if path.with_suffix(EMPTY).exists():
            done[tile] = None
        elif path.exists():
            try:
                done[tile] = describe(tile, open_database(path), path)
            except DatabaseError:
                path.unlink()
    return done


def publish(folder: Path, parts: Sequence[Part]) -> Manifest:
    """Put a database whose tiles are all done in its place; one that was there is replaced.

    The parts are ordered by tile. Raise InputError if the folder cannot be renamed; the parts then
    stay in it.
    """
    target = folder.with_name(folder.name.removesuffix(".partial"))
    before = target.with_name(f"{HALF_WRITTEN}{target.name}")
    recipe = json.loads((folder / RECIPE).read_text(encoding="utf-8"))
    manifest = Manifest(recipe, tuple(parts))
    kept = {MANIFEST, RECIPE, *(part.file for part in manifest.parts)}
    _require_replaceable(target)
    manifest.write(folder)
    try:
        for path in folder.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name not in kept:
                path.unlink()
        # Killed between the two renames, the next run finds all parts and does this again.
        if target.exists():
            target.rename(before)
        try:
            folder.rename(target)
        except OSError:
            if before.exists():
                before.rename(target)
            raise
        (target / RECIPE).unlink()
        if before.is_dir():
            shutil.rmtree(before)
        before.unlink(missing_ok=True)
    except OSError as error:
        msg = (
            f"{target} could not be put in its place ({os.strerror(error.errno or 0)}); its parts "
            f"are in {folder}, so run the same command again."
        )
        raise InputError(msg) from error
    return manifest
