"""A database in parts while it is built: beside its place, whole or not at all, resumable.

The run works in ``OUT.partial``. Its recipe is written there first, so that the same command finds
the tiles that an interrupted run has left; when all are there, the folder is renamed to ``OUT``.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.file import open_database
from semsig_gis.database.parts import MANIFEST, Manifest, Part, digest, part_name, read_manifest
from semsig_gis.storage.runs import (
    PARTIAL,
    RunKind,
    finish,
    partial_folder,
    read_json,
    write_json,
)
from semsig_gis.storage.whole import HALF_WRITTEN

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.database.database import SignatureDatabase

RECIPE = "_recipe.json"
# Copies of inputs that can be read by box.
INPUTS = "_inputs"
EMPTY = ".empty"

RUN = RunKind(
    content="unfinished run",
    another=(
        "{folder} holds an unfinished run that differs in {difference}; delete that folder to "
        "start anew, or finish it with the same command and inputs as before."
    ),
    read=lambda folder: read_json(folder / RECIPE),
    write=lambda folder, recipe: write_json(folder / RECIPE, recipe),
    names={RECIPE, INPUTS},
    results="tile_*",
)


def start(out: str | Path, recipe: dict[str, Any]) -> Path:
    """Begin a run, or take up an unfinished one, and return its folder: `out` with ``.partial``.

    `recipe` says how the database is built. Raise InputError if `out` holds something that may not
    be replaced, the folder cannot be written to, or it holds tiles of an unfinished run by another
    recipe, which are never thrown away unasked.
    """
    _require_replaceable(Path(os.path.realpath(out)))
    folder = partial_folder(out)
    RUN.begin(folder, recipe)
    return folder


def _require_replaceable(target: Path) -> None:
    """Refuse to put a database in the place of anything but a database."""
    if not target.is_dir():
        if target.exists() and not target.is_file():
            msg = f"{target} is a device or a pipe; give the name of a folder to write."
            raise InputError(msg)
        return
    others = {path.name for path in target.iterdir() if not path.name.startswith(HALF_WRITTEN)}
    if MANIFEST in others:
        others -= {MANIFEST, RECIPE, *(part.file for part in read_manifest(target).parts)}
    if others:
        msg = (
            f"{target} holds {min(others)!r}, which is no part of a signature database; give the "
            "name of a new folder, or move that elsewhere."
        )
        raise InputError(msg)


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
    manifest = Manifest(read_json(folder / RECIPE), tuple(parts))
    _require_replaceable(folder.with_name(folder.name.removesuffix(PARTIAL)))
    manifest.write(folder)
    target = finish(folder, keep={MANIFEST, RECIPE, *(part.file for part in manifest.parts)})
    (target / RECIPE).unlink()
    return manifest
