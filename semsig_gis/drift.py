"""A city's drift report: what an update has changed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.changes import ClassChange
from semsig_gis.database import require_same

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.quality import PlainTable

__all__ = ["CellChanges", "UpdateReport", "compare_cells"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateReport:
    """How far a city has drifted.

    `replaced` layers were loaded anew, `kept` ones were not. The other numbers count cells:
    `recomputed` ones lie within range of a change, whether they see it or not; `changed` ones have
    another signature; `appeared` ones see something for the first time, and `vanished` ones nothing
    any more.
    """

    classes: tuple[ClassChange, ...]
    replaced: tuple[str, ...]
    kept: tuple[str, ...]
    cells_before: int
    cells: int
    recomputed: int
    changed: int
    appeared: int
    vanished: int
    notes: tuple[str, ...] = ()

    @property
    def share(self) -> float:
        """Share of all cells, before or after, that are not what they were."""
        drifted = self.changed + self.appeared + self.vanished
        return drifted / (self.cells_before + self.appeared)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and ``share`` as plain values, ready for JSON."""
        return {**asdict(self), "share": self.share}

    def tables(self) -> tuple[PlainTable, ...]:
        """Return the report as tables to print, in the form of `semsig_gis.tables.Table`.

        They show objects by class, and cells.
        """
        names = [name for name in ClassChange.__slots__ if name not in {"class_name", "moved_m"}]
        numbers = [[getattr(item, name) for name in names] for item in self.classes]
        totals = np.array(numbers, np.int64).reshape(-1, len(names)).sum(axis=0).tolist()
        rows = [
            (item.class_name, *(f"{number:,}" for number in row), _metres(item.moved_m))
            for item, row in zip(self.classes, numbers, strict=True)
        ]
        rows.append(("all", *(f"{number:,}" for number in totals), ""))
        cells = (
            ("before", self.cells_before),
            ("after", self.cells),
            ("computed again", self.recomputed),
            ("changed", self.changed),
            ("appeared", self.appeared),
            ("vanished", self.vanished),
        )
        layers = f"Layers replaced: {', '.join(self.replaced)}."
        if self.kept:
            layers += f" Layers that stay as they were: {', '.join(self.kept)}."
        return (
            ("Objects by class", ("class", *names, "moved by, m"), tuple(rows), layers),
            (
                "Cells",
                ("what", "cells"),
                tuple((name, f"{number:,}") for name, number in cells),
                f"The city has drifted by {self.share:.2%} of its cells.",
            ),
        )


def _metres(number: float | None) -> str:
    return "" if number is None else f"{number:,.2f}"


@dataclass(frozen=True, eq=False, kw_only=True)
class CellChanges:
    """Which cells of two databases of one city see what they saw.

    `same` and `changed`, shape (n, 2), are rows in the old and in the new database of cells whose
    signatures are equal, or differ in classes, bearings or distances. `vanished` and `appeared`,
    shape (n,), are the other rows of the old and of the new database.
    """

    same: NDArray[np.int64]
    changed: NDArray[np.int64]
    vanished: NDArray[np.int64]
    appeared: NDArray[np.int64]


def compare_cells(before: SignatureDatabase, after: SignatureDatabase) -> CellChanges:
    """Compare the cells of two databases of one city, those of each kind in their order.

    Raise DatabaseError if the databases were not made in the same way, or differ in their longest
    visibility range.
    """
    require_same(before, after)
    require_same(before, after, {"reach": "longest visibility range"})
    _, first, second = np.intersect1d(
        before.cell_ids, after.cell_ids, assume_unique=True, return_indices=True
    )
    differs = before.lengths[first] != after.lengths[second]
    alike = np.flatnonzero(~differs)
    one, other = before.select(first[alike]), after.select(second[alike])
    entry_differs = np.zeros(len(one.codes), bool)
    for name in ("codes", "bearing_units", "distance_units"):
        entry_differs |= getattr(one, name) != getattr(other, name)
    differs[np.repeat(alike, one.lengths)[entry_differs]] = True
    common = np.stack([first, second], axis=1)
    return CellChanges(
        same=common[~differs],
        changed=common[differs],
        vanished=np.setdiff1d(np.arange(len(before)), first, assume_unique=True),
        appeared=np.setdiff1d(np.arange(len(after)), second, assume_unique=True),
    )
