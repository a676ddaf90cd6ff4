"""Trials as if a class of street objects had not been published."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.likelihood import build_index
from semsig_gis.noise import NoiseMixture
from semsig_gis.signatures import Signature
from semsig_gis.trials import draw_trials, try_queries

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.likelihood import LikelihoodIndex
    from semsig_gis.noise import Noise, NoiseSpec

__all__ = ["leave_class_out", "try_without_classes"]


def leave_class_out(
    database: SignatureDatabase, code: int
) -> tuple[SignatureDatabase, NDArray[np.int64]]:
    """Return a database without the objects of a class.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    code : int
        Code of the class.

    Returns
    -------
    database : SignatureDatabase
        The cells that see other objects, too, and these objects; perhaps none.
    rows : ndarray of int64, shape (n,)
        For each cell of the given database, its row in the new one; -1 where it is not there.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> without, rows = leave_class_out(database, 3)
    >>> bool((without.codes == 3).any()), len(without) == int((rows >= 0).sum())
    (False, True)
    """
    kept = database.codes != code
    lengths = np.add.reduceat(kept, database.offsets[:-1], dtype=np.int64)
    some = lengths > 0
    rows = np.where(some, np.cumsum(some) - 1, -1)
    left = replace(
        database,
        columns=database.columns[some],
        rows=database.rows[some],
        offsets=np.concatenate([[0], np.cumsum(lengths[some])]),
        codes=database.codes[kept],
        bearing_units=database.bearing_units[kept],
        distance_units=database.distance_units[kept],
    )
    return left, rows


def try_without_classes(
    index: LikelihoodIndex,
    cells: NDArray[np.int64],
    *,
    radius: float = 50.0,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ask simulated queries once more for each class, as if it had not been published.

    `cells` (m,) are row numbers of the true cells, and the queries those of
    `semsig_gis.trials.try_cells` with the same seed. The results (m, k) are the chance given to the
    cells within `radius` metres of the true one, and the entropy in bits that is left, without each
    class, in the order of ``index.table.codes``. Detector and street stay the same: the database
    has no objects of the class, and detections of its name are dropped. A cell that sees nothing
    else cannot be found: no chance, and all bits are left.
    """
    codes = index.table.codes.tolist()
    queries = list(draw_trials(index, cells, seed=seed))
    near = np.zeros((len(cells), len(codes)))
    bits = np.full((len(cells), len(codes)), np.log2(len(index.database)))
    names = {item.code: item.name for item in index.database.taxonomy.classes}
    for number, code in enumerate(codes):
        without, rows = leave_class_out(index.database, code)
        asked = np.flatnonzero(rows[cells] >= 0)
        if len(asked):
            noise = _without_class(index.noise, names[code], len(codes))
            trials = try_queries(
                build_index(without, noise, threads=threads),
                rows[cells[asked]],
                [_without_code(queries[one], code) for one in asked.tolist()],
                radius=radius,
                threads=threads,
            )
            near[asked, number], bits[asked, number] = trials.near, trials.bits
        if progress is not None:
            progress((number + 1) * len(cells), len(codes) * len(cells))
    return near, bits


def _without_code(query: Signature, code: int) -> Signature:
    """Return the detections of a query that do not bear the name of a class."""
    if query.codes is None or query.bearings is None:
        return query
    kept = query.codes != code
    return Signature(query.codes[kept], query.bearings[kept])


def _without_class(noise: Noise, name: str, classes: int) -> Noise:
    """Return a noise model of so many classes for all of them but one."""

    def without(spec: NoiseSpec) -> NoiseSpec:
        confusion = {own: row for own, row in spec.confusion.items() if own != name}
        # Equal shares of the false objects are taken of the classes that are left.
        clutter = spec.clutter if spec.clutter_shares else spec.clutter * (1.0 - 1.0 / classes)
        return replace(spec, confusion=confusion, clutter=clutter)

    if isinstance(noise, NoiseMixture):
        return replace(noise, specs=tuple(without(spec) for spec in noise.specs))
    return without(noise)
