"""What a signature database in parts consists of: a folder of part files and a manifest."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semsig_gis.errors import DatabaseError
from semsig_gis.storage import whole_file

__all__ = ["MANIFEST", "Manifest", "Part", "digest", "part_files", "part_name", "read_manifest"]

# Readers of Parquet folders, such as pyarrow, leave out what begins so.
MANIFEST = "_manifest.json"
KIND = "signature database in parts"
CHUNK = 1 << 20


@dataclass(frozen=True, slots=True, order=True)
class Part:
    """One part file.

    Parameters
    ----------
    tile : tuple of (int, int)
        Column and row of the tile, a square of so many cells from column 0 and row 0.
    cells : int
        Cells in the file.
    entries : int
        What they see in all: the sum of the lengths of their signatures.
    bytes : int
        Size of the file.
    sha256 : str
        Digest of its content.

    Examples
    --------
    >>> Part((12, -3), 1, 1, 1, "").file
    'tile_12_-3.parquet'
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
    """A signature database in parts.

    Parameters
    ----------
    recipe : dict
        How it was built, as plain JSON values: the specs and the digests of the inputs.
    parts : tuple of Part
        The parts, ordered by tile.

    Examples
    --------
    >>> Manifest({}, (Part((0, 0), 2, 9, 1, ""), Part((0, 1), 3, 6, 1, ""))).cells
    5
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
        """Write the manifest into the folder of the parts; it appears whole, by rename.

        Parameters
        ----------
        folder : Path
            The folder.
        """
        content = {
            "kind": KIND,
            "recipe": self.recipe,
            "parts": [{"file": part.file, **asdict(part)} for part in self.parts],
        }
        with whole_file(folder / MANIFEST) as partial:
            partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def part_name(tile: tuple[int, int]) -> str:
    """Return the name of the part file of a tile.

    Parameters
    ----------
    tile : tuple of (int, int)
        Column and row of the tile.

    Returns
    -------
    str
        The name.

    Examples
    --------
    >>> part_name((12, -3))
    'tile_12_-3.parquet'
    """
    return f"tile_{tile[0]}_{tile[1]}.parquet"


def read_manifest(folder: str | Path) -> Manifest:
    """Read what a database in parts consists of.

    Parameters
    ----------
    folder : str or Path
        Folder of the database.

    Returns
    -------
    Manifest
        The manifest.

    Raises
    ------
    DatabaseError
        If the folder has no manifest, or it is damaged.

    Examples
    --------
    >>> read_manifest("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.errors.DatabaseError: nowhere is not a signature database in parts (it has no \
_manifest.json); give a folder that `semsig build --tile` wrote.
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
    """Return the part files of a database, after checking that it is whole.

    Parameters
    ----------
    folder : str or Path
        Folder of the database.

    Returns
    -------
    tuple of Path
        The files, ordered by tile.

    Raises
    ------
    DatabaseError
        If a part is missing or damaged, or a Parquet file is there that is no part.
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
    """Return the SHA-256 digest of the content of some files, one after the other.

    Parameters
    ----------
    *paths : Path
        The files.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    total = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK):
                total.update(chunk)
    return total.hexdigest()
