"""What a signature database in parts consists of: a folder of part files and a manifest."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semsig_gis.core.errors import DatabaseError
from semsig_gis.storage.whole import whole_file

# Readers of Parquet folders, such as pyarrow, leave out what begins so.
MANIFEST = "_manifest.json"
KIND = "signature database in parts"
CHUNK = 1 << 20


@dataclass(frozen=True, slots=True, order=True)
class Part:
    """One part file, which holds the cells of one tile.

    `tile` is its column and row, counted in tiles from grid column 0 and row 0. `entries` is the
    sum of the lengths of all signatures; `bytes` and `sha256` are the size and digest of the file.
    """

    tile: tuple[int, int]
    cells: int
    entries: int
    bytes: int
    sha256: str

    @property
    def file(self) -> str:
        """Name of the file in the folder."""
        return part_name(self.tile)


@dataclass(frozen=True, slots=True)
class Manifest:
    """A signature database in parts, ordered by tile.

    `recipe` says how it was built, as plain JSON values: the specs and the digests of the inputs.
    """

    recipe: dict[str, Any]
    parts: tuple[Part, ...]

    @property
    def cells(self) -> int:
        """Number of cells in all parts."""
        return sum(part.cells for part in self.parts)

    @property
    def entries(self) -> int:
        """Sum of the lengths of all signatures."""
        return sum(part.entries for part in self.parts)

    @property
    def bytes(self) -> int:
        """Size of all part files."""
        return sum(part.bytes for part in self.parts)

    def write(self, folder: Path) -> None:
        """Write the manifest into the folder of the parts; it appears whole, by rename."""
        content = {
            "kind": KIND,
            "recipe": self.recipe,
            "parts": [{"file": part.file, **asdict(part)} for part in self.parts],
        }
        with whole_file(folder / MANIFEST) as partial:
            partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def part_name(tile: tuple[int, int]) -> str:
    """Return the name of the part file of a tile, such as ``tile_12_-3.parquet``."""
    return f"tile_{tile[0]}_{tile[1]}.parquet"


def read_manifest(folder: str | Path) -> Manifest:
    """Read what a database in parts consists of.

    Raise DatabaseError if the folder has no manifest, or it is damaged.
    """
    path = Path(folder) / MANIFEST
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        parts = tuple(
            Part(
                tile=(int(one["tile"][0]), int(one["tile"][1])),
                cells=int(one["cells"]),
                entries=int(one["entries"]),
                bytes=int(one["bytes"]),
                sha256=str(one["sha256"]),
            )
            for one in content["parts"]
        )
        recipe = dict(content["recipe"])
        ours = content["kind"] == KIND
    except (FileNotFoundError, NotADirectoryError) as error:
        msg = (
            f"{folder} is not a signature database in parts (it has no {MANIFEST}); give a "
            "folder that `semsig build --tile` wrote."
        )
        raise DatabaseError(msg) from error
    except (OSError, ValueError, LookupError, TypeError) as error:
        msg = f"{path} is damaged or cannot be read; build the database again."
        raise DatabaseError(msg) from error
    if not ours:
        msg = f"{path} is of another kind; give a folder that `semsig build --tile` wrote."
        raise DatabaseError(msg)
    return Manifest(recipe, parts)


def part_files(folder: str | Path) -> tuple[Path, ...]:
    """Return the part files of a database, ordered by tile, after checking that it is whole.

    Raise DatabaseError if a part is missing or damaged, or a Parquet file is there that is no part.
    """
    manifest = read_manifest(folder)
    folder = Path(folder)
    for part in manifest.parts:
        path = folder / part.file
        if not path.is_file():
            msg = f"{path} is missing; put the part back or build the database again."
            raise DatabaseError(msg)
        if path.stat().st_size != part.bytes or digest(path) != part.sha256:
            msg = f"{path} is not the part that was built; put it back or build the database again."
            raise DatabaseError(msg)
    others = {path.name for path in folder.glob("*.parquet")} - {p.file for p in manifest.parts}
    if others:
        msg = f"{folder / min(others)} is no part of the database in {folder}; move it elsewhere."
        raise DatabaseError(msg)
    if not manifest.parts:
        msg = f"{folder / MANIFEST} lists no parts; build the database again."
        raise DatabaseError(msg)
    return tuple(folder / part.file for part in manifest.parts)


def digest(*paths: Path) -> str:
    """Return the SHA-256 digest, in hexadecimal, of the content of files one after the other."""
    total = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                total.update(chunk)
    return total.hexdigest()
