"""A signature database in parts, opened one part after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import join_databases
from semsig_gis.database_file import KIND, open_database
from semsig_gis.manifest import part_files, read_manifest
from semsig_gis.storage import read_geoparquet

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.taxonomy import Taxonomy

__all__ = ["PartitionedDatabase", "open_dataset"]


@dataclass(frozen=True, slots=True)
class PartitionedDatabase:
    """A signature database of which one part at a time is in memory.

    Parameters
    ----------
    files : tuple of Path
        The part files; no cell is in two of them.
    cells : int
        Number of cells in all parts.
    """

    files: tuple[Path, ...]
    cells: int

    def __len__(self) -> int:  # noqa: D105
        return self.cells

    def parts(self) -> Iterator[SignatureDatabase]:
        """Open the parts one after the other.

        Yields
        ------
        SignatureDatabase
            A part.

        Raises
        ------
        DatabaseError
            If a part is damaged, or was made in another way than the first.
        """
        none = None
        for file in self.files:
            part = open_database(file)
            if none is None:
                none = part.select(slice(0))
            yield join_databases([none, part])  # refuses a part that differs

    @property
    def taxonomy(self) -> Taxonomy:
        """The classes that the parts know."""
        return next(self.parts()).taxonomy

    def row_numbers(self, cell_ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row that each cell has in the database that `open_database` returns.

        Parameters
        ----------
        cell_ids : ndarray of int64, shape (n,)
            Numbers of cells of the database.

        Returns
        -------
        ndarray of int64, shape (n,)
            Rows from 0.
        """
        rows = np.zeros(len(cell_ids), np.int64)
        for file in self.files:
            table, _, _ = read_geoparquet(file, kind=KIND, columns=["cell_id"])
            rows += np.searchsorted(table["cell_id"].to_numpy(), cell_ids)
        return rows


def open_dataset(folder: str | Path) -> PartitionedDatabase:
    """Open a folder that holds a database in parts, without reading the parts into memory.

    Parameters
    ----------
    folder : str or Path
        Folder of the database.

    Returns
    -------
    PartitionedDatabase
        The parts. For all cells at once, use `semsig_gis.database_file.open_database`.

    Raises
    ------
    DatabaseError
        If it is no such folder, or a part is missing or is not the one that was built.

    Examples
    --------
    >>> open_dataset("nowhere")
    Traceback (most recent call last):
    ...
    semsig_gis.errors.DatabaseError: nowhere is not a signature database in parts (it has no \
_manifest.json); give a folder that `semsig build --tile` wrote.
    """
    return PartitionedDatabase(part_files(folder), read_manifest(folder).cells)
