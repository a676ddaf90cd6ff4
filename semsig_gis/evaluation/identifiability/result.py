"""Result of `identify`: how well a query from each cell will be located; its columns and files."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NotRequired

import numpy as np
import pyarrow as pa
from typing_extensions import TypedDict

from semsig_gis.core import (
    DatabaseError,
    Displayed,
    InputError,
    SemsigError,
    brief,
    map_with,
    percent,
    plot_with,
)
from semsig_gis.database import City
from semsig_gis.localization import index_fingerprint, noise_from_dict
from semsig_gis.storage import require_kinds

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from semsig_gis.core import Axes, MapFrame
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Noise
    from semsig_gis.storage import ColumnKind


NAME = "identifiability"
FORMAT = 2  # increase if the same cells and noise give other numbers, or other columns

BANDS = (0.0, 0.1, 0.5, 0.9)  # lower ends of the ranges of `found` in which cells are counted


BandRecord = TypedDict("BandRecord", {"from": float, "to": float, "cells": int, "share": float})
"""The cells with a probability in a range."""


class GainRecord(TypedDict):
    """The gain of publishing a class, as plain values."""

    code: int
    symbol: str
    name: str
    title: str
    chance_near: float
    bits: float
    objects: int | None
    chance_near_per_1000: float | None


class CheckRecord(TypedDict):
    """A check as plain values, with None for NaN; `bins` have the fields of `ChanceBin`."""

    queries: int
    seed: int
    found: float
    correlations: dict[str, float | None]
    attainable: float | None
    bins: list[dict[str, float]]


class IdentifiabilityRecord(TypedDict):
    """The identifiability of a city as plain values; `check` is that of `semsig identify`."""

    cells: int
    noise: str
    radius_m: float
    view_degrees: float
    trials: int
    seed: int
    chance_itself: float
    chance_near: float
    chance_found: float
    bits_left: float
    cell_bits: float
    bands: list[BandRecord]
    classes: list[GainRecord]
    check: NotRequired[CheckRecord]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassGain:
    """Gain of the mean cell if a city publishes a class of objects.

    `near` is the gain in probability of the place within the radius, `bits` the gain in
    information.
    """

    code: int
    near: float
    bits: float


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Identifiability(Displayed):
    """How well a query from each of the n cells of a database will be located.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        Noise model of the detector.
    radius : float
        Distance that counts as near, in metres.
    view : float
        Degrees that a query sees: 360, or the field of view of a photo in any direction.
    itself, near : ndarray of float64, shape (n,)
        Expected probabilities that the answer to a query from the cell gives to the cell itself,
        and to the cells within the radius.
    found : ndarray of float64, shape (n,)
        Probability that the best place of the answer is within the radius.
    bits : ndarray of float64, shape (n,)
        Expected entropy of the probabilities of all cells: the missing information.
    lookalikes : ndarray of int64, shape (n, k)
        Row numbers of the cells, beyond the radius, with most of the remaining probability of the
        answer around them; -1 if there are no more.
    lookalike_chances : ndarray of float64, shape (n, k)
        Expected probability around each of them.
    gains : ndarray of float64, shape (n, c)
        Gain of `near` by each class that occurs, in the order of `classes`.
    classes : tuple of ClassGain
        The same for the city as a whole.
    trials, seed : int
        Number of simulated queries, and the random seed.

    Examples
    --------
    >>> from semsig_gis import build_index, identify, named_noise
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> cells = identify(index, trials=20, class_trials=5)
    >>> cells.lookalikes.shape == (len(demo_database), 3), bool((cells.itself <= cells.near).all())
    (True, True)
    """

    database: SignatureDatabase
    noise: Noise
    radius: float
    view: float
    itself: NDArray[np.float64]
    near: NDArray[np.float64]
    found: NDArray[np.float64]
    bits: NDArray[np.float64]
    lookalikes: NDArray[np.int64]
    lookalike_chances: NDArray[np.float64]
    gains: NDArray[np.float64]
    classes: tuple[ClassGain, ...]
    trials: int
    seed: int

    def _facts(self) -> dict[str, object]:
        return {
            "cells": len(self.database),
            "noise": self.noise.name,
            f"found within {self.radius:g} m": f"{percent(self.found.mean(), 1)} for the mean cell",
            "bits left": f"{self.bits.mean():.1f} of {np.log2(len(self.database)):.1f}",
            "view": f"{self.view:g}°",
            "trials": self.trials,
            "seed": self.seed,
        }

    def plot(self, *, ax: Axes | None = None, legend: bool = True) -> Axes:
        """Draw the probability of every cell to be found (see `plot_identifiability`)."""
        return plot_with("plot_identifiability", self, ax=ax, legend=legend)

    def explore(self) -> MapFrame:
        """Show the probabilities and lookalikes on a map (see `identifiability_map`)."""
        return map_with("identifiability_map", self)

    def require_cells_of(self, database: SignatureDatabase) -> None:
        """Raise InputError if a database has other cells."""
        if not np.array_equal(self.database.cell_ids, database.cell_ids):
            raise InputError(
                "the identifiability belongs to other cells; give that of this database."
            )

    def table(self, rows: slice = slice(None)) -> pa.Table:
        """Return the results of some of the cells, all by default, as a table.

        Its columns are ``chance_itself``, ``chance_near``, ``chance_found``, ``bits_left``,
        ``lookalike_1`` (cell id or null), ``lookalike_1_chance``, ..., and ``gain_NAME`` by class.
        """
        names = {item.code: item.name for item in self.database.taxonomy.classes}
        columns = {
            "chance_itself": pa.array(self.itself[rows]),
            "chance_near": pa.array(self.near[rows]),
            "chance_found": pa.array(self.found[rows]),
            "bits_left": pa.array(self.bits[rows]),
        }
        ids = self.database.cell_ids
        for place in range(self.lookalikes.shape[1]):
            cells = self.lookalikes[rows, place]
            name = f"lookalike_{place + 1}"
            columns[name] = pa.array(ids[cells], mask=cells < 0)
            columns[f"{name}_chance"] = pa.array(self.lookalike_chances[rows, place])
        for number, item in enumerate(self.classes):
            columns[f"gain_{names[item.code]}"] = pa.array(self.gains[rows, number])
        return pa.table(columns)

    @property
    def facts(self) -> dict[str, Any]:
        """Values for JSON that are needed to open `table` again."""
        return {
            "format": FORMAT,
            "belongs_to": index_fingerprint(self.database, self.noise),
            "noise": self.noise.to_dict(),
            "radius": self.radius,
            "view": self.view,
            "trials": self.trials,
            "seed": self.seed,
            "classes": [asdict(gain) for gain in self.classes],
        }

    def summary(self, *, object_counts: Mapping[int, int] | None = None) -> IdentifiabilityRecord:
        """Return a summary of the city as plain values for JSON.

        Probabilities and bits are means over the cells; ``bands`` count the cells by their
        probability to be found. ``classes``, the most useful first, have ``objects`` and
        ``chance_near_per_1000`` only with `object_counts`, the number of objects by class code.
        """
        kinds = {item.code: item for item in self.database.taxonomy.classes}
        cells = len(self.database)
        counts = np.bincount(np.digitize(self.found, BANDS) - 1, minlength=len(BANDS)).tolist()
        classes: list[GainRecord] = []
        for gain in sorted(self.classes, key=lambda item: -item.near):
            kind = kinds[gain.code]
            objects = None if object_counts is None else int(object_counts.get(gain.code, 0))
            classes.append(
                {
                    "code": kind.code,
                    "symbol": kind.symbol,
                    "name": kind.name,
                    "title": kind.title,
                    "chance_near": gain.near,
                    "bits": gain.bits,
                    "objects": objects,
                    "chance_near_per_1000": 1000.0 * gain.near / objects if objects else None,
                }
            )
        return {
            "cells": cells,
            "noise": self.noise.name,
            "radius_m": self.radius,
            "view_degrees": self.view,
            "trials": self.trials,
            "seed": self.seed,
            "chance_itself": float(self.itself.mean()),
            "chance_near": float(self.near.mean()),
            "chance_found": float(self.found.mean()),
            "bits_left": float(self.bits.mean()),
            "cell_bits": float(np.log2(cells)),
            "bands": [
                {"from": low, "to": high, "cells": count, "share": count / cells}
                for low, high, count in zip(BANDS, (*BANDS[1:], 1.0), counts, strict=True)
            ],
            "classes": classes,
        }


def save_identifiability(identifiability: Identifiability, path: str | Path) -> None:
    """Add the identifiability of the cells to the files of their database.

    Parameters
    ----------
    identifiability : Identifiability
        The result to save.
    path : str or Path
        File of the database, or folder of its parts; it is replaced as a whole.

    Raises
    ------
    DatabaseError
        If it is damaged, or has other cells.
    InputError
        If it is not writable; then it is unchanged.

    Notes
    -----
    The columns are those of `Identifiability.table`. They are lost if the database is built again
    or updated.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import build_index, identify, named_noise, save_database
    >>> index = build_index(demo_database, named_noise("medium"))
    >>> columns = identify(index, trials=5, class_trials=2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_database(demo_database, f"{folder}/city.parquet")
    ...     save_identifiability(columns, f"{folder}/city.parquet")
    ...     open_identifiability(demo_database, f"{folder}/city.parquet").radius
    50.0
    """
    City(path).put_columns(
        NAME,
        identifiability.table(),
        cell_ids=identifiability.database.cell_ids,
        facts=identifiability.facts,
    )


def open_identifiability(database: SignatureDatabase, path: str | Path) -> Identifiability | None:
    """Read the identifiability from the files of a database.

    Parameters
    ----------
    database : SignatureDatabase
        The open database.
    path : str or Path
        Its file, or the folder of its parts.

    Returns
    -------
    Identifiability or None
        The result that `save_identifiability` wrote; None if there is none.

    Raises
    ------
    DatabaseError
        If the files are damaged, or the result belongs to other signatures.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import build_index, identify, named_noise, save_database
    >>> index = build_index(demo_database, named_noise("light"))
    >>> cells = identify(index, trials=20, class_trials=5)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.parquet"
    ...     save_database(demo_database, path)
    ...     save_identifiability(cells, path)
    ...     same = open_identifiability(demo_database, path)
    >>> bool((same.found == cells.found).all())
    True
    """
    columns = City(path).columns(NAME)
    return None if columns is None else identifiability_of(database, *columns, path)


def identifiability_of(
    database: SignatureDatabase, table: pa.Table, facts: dict[str, Any], path: str | Path
) -> Identifiability:
    """Return the result with a table and facts that were read from `path`.

    DatabaseError if they are damaged, or belong to other signatures or to another format.
    """
    try:
        noise = noise_from_dict(facts["noise"])
        belongs = facts["format"] == FORMAT and (
            facts["belongs_to"] == index_fingerprint(database, noise)
        )
        identifiability = _parsed(database, noise, table, facts) if belongs else None
    except (KeyError, TypeError, ValueError, SemsigError) as error:
        raise DatabaseError(
            f"the identifiability in {path} is damaged ({brief(error)}); run semsig identify again."
        ) from error
    if identifiability is None:
        raise DatabaseError(
            f"the identifiability in {path} belongs to other signatures or to another version of "
            "semsig; run semsig identify again."
        )
    return identifiability


def _parsed(
    database: SignatureDatabase, noise: Noise, table: pa.Table, facts: dict[str, Any]
) -> Identifiability:
    classes = tuple(ClassGain(**item) for item in facts["classes"])
    names = {item.code: item.name for item in database.taxonomy.classes}
    ids = database.cell_ids
    places = [name for name in table.column_names if name.endswith("_chance")]
    rows_of = [name.removesuffix("_chance") for name in places]
    gains = [f"gain_{names[item.code]}" for item in classes]
    numbers = ["chance_itself", "chance_near", "chance_found", "bits_left", *places, *gains]
    kinds: dict[str, ColumnKind] = {
        **dict.fromkeys(numbers, "number"),
        **dict.fromkeys(rows_of, "whole"),
    }
    require_kinds(table, kinds, may_lack=rows_of)

    def stacked(columns: list[str]) -> np.ndarray:
        return np.stack([table[name].to_numpy() for name in columns], axis=1)

    def rows(name: str) -> np.ndarray:
        cells = table[name]
        numbers_of = cells.fill_null(ids[0]).to_numpy()
        places_of = np.minimum(np.searchsorted(ids, numbers_of), len(ids) - 1)
        if not np.array_equal(ids[places_of], numbers_of):
            raise ValueError(f"its column {name} names cells that are not in the database")
        return np.where(cells.is_valid().to_numpy(), places_of, -1)

    return Identifiability(
        database=database,
        noise=noise,
        radius=float(facts["radius"]),
        view=float(facts["view"]),
        itself=table["chance_itself"].to_numpy(),
        near=table["chance_near"].to_numpy(),
        found=table["chance_found"].to_numpy(),
        bits=table["bits_left"].to_numpy(),
        lookalikes=np.stack([rows(name) for name in rows_of], axis=1),
        lookalike_chances=stacked(places),
        gains=stacked(gains),
        classes=classes,
        trials=int(facts["trials"]),
        seed=int(facts["seed"]),
    )
