"""Detections drawn from a noise model: what a detector would give at the middle of a cell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.database import BEARING_UNITS
from semsig_gis.geometry import wrap_degrees
from semsig_gis.noise_table import database_tables
from semsig_gis.signatures import Signature

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.noise import Noise
    from semsig_gis.noise_table import NoiseTable

__all__ = ["draw_detections"]


def draw_detections(
    database: SignatureDatabase, cells: Iterable[int], noise: Noise, *, seed: int = 0
) -> Iterator[Signature]:
    """Give what a detector sees in cells, if it fails as a noise model says.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    cells : iterable of int
        Row numbers in the database; a cell may come several times.
    noise : NoiseSpec or NoiseMixture
        The noise model; of a mixture, each query has one of the models.
    seed : int, default 0
        Seed of all chances. Query number i is the same whatever the number of queries.

    Yields
    ------
    Signature
        The detections in one cell, in clockwise order; perhaps none.

    Raises
    ------
    InputError
        If the noise model does not fit the classes of the database.

    Notes
    -----
    Every object is detected with its chance, named by the confusion of its class and given a
    normal error of its bearing; the false objects of a class are Poisson in number and anywhere
    all round: just what `semsig_gis.likelihood` supposes.

    Examples
    --------
    >>> from semsig_gis.catalog import paper_taxonomy
    >>> from semsig_gis.building import build_database
    >>> from semsig_gis.noise import NoiseSpec
    >>> from semsig_gis.objects import build_objects
    >>> from semsig_gis.sources.synthetic import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> careful = NoiseSpec(detection=1.0, misnamed=0.0, clutter=0.0, bearing_sigma=0.01)
    >>> (seen,) = draw_detections(database, [0], careful)
    >>> database.taxonomy.decode(seen.codes) == database.types(0)
    True
    """
    tables, weights = database_tables(database, noise)
    reach = database.reach
    sigmas = [table.sigmas(reach) for table in tables]
    for number, cell in enumerate(cells):
        # Its own generator, so that no query depends on what happened to another.
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        which = int(rng.choice(len(tables), p=weights))
        yield _detections(database, cell, tables[which], sigmas[which], rng)


def _detections(
    database: SignatureDatabase,
    cell: int,
    table: NoiseTable,
    sigmas: NDArray[np.float64],
    rng: np.random.Generator,
) -> Signature:
    """Return the detections in one cell."""
    part = slice(database.offsets[cell], database.offsets[cell + 1])
    kinds = table.row_of[database.codes[part]]
    length = min(len(kinds), len(table.missed) - 1)
    seen = rng.random(len(kinds)) >= table.missed[length, kinds]
    kinds = kinds[seen]
    chances = table.named[length, kinds].cumsum(axis=1)
    given = (rng.random((len(kinds), 1)) > chances[:, :-1]).sum(axis=1)
    middle = (database.bearing_units[part][seen] + 0.5) * (360.0 / BEARING_UNITS)
    sigma = sigmas[kinds, database.distance_units[part][seen]]
    bearings = middle + rng.normal(0.0, 1.0, len(kinds)) * sigma
    false = np.repeat(np.arange(len(table.codes)), rng.poisson(table.clutter))
    rows = np.concatenate([given, false])
    everything = wrap_degrees(np.concatenate([bearings, rng.uniform(0.0, 360.0, len(false))]))
    order = np.argsort(everything, kind="stable")
    return Signature(table.codes[rows[order]], everything[order])
