"""The columns of the likelihood index: what each symbol adds to the score of every cell."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import InputError
from semsig_gis.database.database import BEARING_UNITS
from semsig_gis.likelihood.noise.table import database_tables, mean_table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from concurrent.futures import Future

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.noise.model import Noise
    from semsig_gis.likelihood.noise.table import NoiseTable


BINS = 72
"""Bearing steps of five degrees."""


BIN_DEGREES = 360.0 / BINS
"""Width of one."""


BIN_UNITS = BEARING_UNITS // BINS


LEVELS = 128  # of bearing noise, where it depends on the distance


LINES_A_TASK = 64


def index_shape(database: SignatureDatabase) -> tuple[int, int, int]:
    """Return the shape of the columns: classes seen and one for unknown, bearing steps, cells."""
    return len(database.present_codes) + 1, BINS, len(database)


def write_columns(
    database: SignatureDatabase,
    table: NoiseTable,
    columns: NDArray[np.uint8],
    *,
    progress: Callable[[int, int], None] | None = None,
    threads: int = 1,
) -> float:
    """Fill `columns`, shape `index_shape`, for a noise model, and return the size of their steps.

    A column holds, for a class t and a step of bearings, ``log(1 + sum_i o_i C(i, t) N /
    lambda(t))``: what a detection there adds, less ``log(lambda(t))``, which is the same for all
    cells. N is the mean density over the step. `columns` may be a mapped file; `progress` is called
    with the number of cells done and in all.
    """
    from semsig_gis.likelihood.kernels import LINE, fill_columns  # noqa: PLC0415

    spread_of, spread = _spreads(database, table)
    step = _step(table, spread)
    arguments = (
        database.offsets,
        table.row_of.astype(np.uint8)[database.codes],
        database.bearing_units,
        spread_of,
        spread,
        table.odds.astype(np.float32),
        table.naming.astype(np.float32),
        _logs(step),
        columns,
    )
    cells = len(database)
    lines = -(-cells // LINE)
    parts = [
        np.array([low, min(low + LINES_A_TASK, lines)]) for low in range(0, lines, LINES_A_TASK)
    ]
    with ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(fill_columns, part, *arguments) for part in parts]
        for part, task in zip(parts, tasks, strict=True):
            task.result()
            if progress is not None:
                progress(min(int(part[1]) * LINE, cells), cells)
    return step


def _step(table: NoiseTable, spread: NDArray[np.float32]) -> float:
    """Return the size of a step: 255 of them reach what four objects in one direction add."""
    peak = float(spread.max() * (table.odds[:, :, None] * table.naming).max())
    return math.log1p(4.0 * peak) / 255.0


def _spreads(
    database: SignatureDatabase, table: NoiseTable
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return which bearing noise each entry has, and the density of each in every bin."""
    sigma = table.sigmas(database.reach)
    if table.position_sigma == 0:
        levels, index = np.unique(sigma, return_inverse=True)
    else:
        levels = np.geomspace(sigma.min(), sigma.max(), LEVELS)
        middle = np.sqrt(levels[1:] * levels[:-1])
        index = np.searchsorted(middle, sigma)
    level_of = np.zeros((256, 256), np.uint8)
    level_of[table.codes] = index.reshape(sigma.shape)
    spread_of = level_of[database.codes, database.distance_units]
    inside = (np.arange(BIN_UNITS) + 0.5) * (BIN_DEGREES / BIN_UNITS)
    edges = np.arange(BINS + 1) * BIN_DEGREES
    away = edges[None, None, :] - inside[None, :, None]
    below = np.zeros((len(levels), BIN_UNITS, BINS + 1))
    for turn in range(-3, 4):  # 180 degrees of deviation reach three turns
        below += _normal_cdf((away + 360.0 * turn) / levels[:, None, None])
    return spread_of, (np.diff(below, axis=2) / BIN_DEGREES).astype(np.float32)


def _normal_cdf(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal distribution function."""
    erf = np.vectorize(math.erf, otypes=[np.float64])
    return np.asarray(0.5 * (1.0 + erf(value / math.sqrt(2.0))))


def _logs(step: float) -> NDArray[np.uint8]:
    """Return the logarithm in steps, by the leading bits of a float32 from 1 up."""
    from semsig_gis.likelihood.kernels import MANTISSA_BITS  # noqa: PLC0415

    octaves = math.ceil(255 * step / math.log(2.0))
    octave, part = np.divmod(np.arange(octaves << MANTISSA_BITS), 1 << MANTISSA_BITS)
    value = np.log((1.0 + (part + 0.5) / (1 << MANTISSA_BITS)) * 2.0**octave)
    value[0] = 0.0  # where nothing is near, exactly nothing is added
    return np.minimum(np.rint(value / step), 255).astype(np.uint8)


VERSION = 1  # of the index: raised whenever the same database and noise give other columns


MOST_OBJECTS = 257  # whose bytes add up within 16 bits


LEAST_PRIOR = 1e-7  # turns that are less likely than this, against the likeliest, are left out


LEAST_MASS = 1e-6  # below which a turn adds nothing to the sum


@dataclass(frozen=True, eq=False, kw_only=True)
class CellScores:
    """The log-likelihood (natural logarithm) of a query in every cell, and the likeliest headings.

    `heading` is in degrees clockwise, in [-180, 180), to add to the bearings of the query; None if
    north was known or the query has no bearings.
    """

    loglik: NDArray[np.floating]
    heading: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LikelihoodIndex:
    """What the cells of a database add to the likelihood of each symbol.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        The noise model; the index holds the mean of a mixture (see `likelihood.rerank` for
        the mixture itself).
    columns : ndarray of uint8, shape (k + 1, 72, n)
        Inner logarithms in steps, by class and bearing; the last class is "not known".
    constants : ndarray of float32, shape (n,)
        What each cell adds to any query.
    step : float
        Size of a step.
    tables : tuple of NoiseTable
        The noise model in numbers, or each model of the mixture.
    weights : ndarray of float64
        Chance of each of them.
    fingerprint : str
        Stands for the database, the noise model and the version of the index.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> index = build_index(database, named_noise("light"))
    >>> longest = int(database.lengths.argmax())
    >>> int(index.scores(database.signature(longest)).loglik.argmax()) == longest
    True
    """

    database: SignatureDatabase
    noise: Noise
    columns: NDArray[np.uint8]
    constants: NDArray[np.float32]
    step: float
    tables: tuple[NoiseTable, ...]
    weights: NDArray[np.float64]
    fingerprint: str

    @functools.cached_property
    def table(self) -> NoiseTable:
        """The noise model that the columns hold."""
        return mean_table(self.tables, self.weights)

    def scores(self, query: Signature, *, north_sigma: float = 0.0) -> CellScores:
        """Return the log-likelihood of a query in every cell.

        Parameters
        ----------
        query : Signature
            At least one object. Types may be unknown, all or those of code 0; bearings
            may be unknown, and then the order of the types plays no part.
        north_sigma : float, default 0
            Standard deviation in degrees of the north of the query: 0 where it is known,
            infinite where it is not known at all. The likelihood is summed over the turns of the
            query in steps of five degrees.

        Returns
        -------
        CellScores
            Log-likelihoods, and the likeliest turn for each cell.

        Raises
        ------
        InputError
            If the query is empty or has a class that no cell sees, or `north_sigma` is negative.
        """
        if not north_sigma >= 0:
            msg = f"the deviation of north is {north_sigma} degrees; give 0 or more, or infinity."
            raise InputError(msg)
        rows = self.table.query_rows(query)
        if query.bearings is None:
            return CellScores(loglik=self._by_counts(rows))
        base = float(np.log(self.table.density[rows]).sum())
        bins = np.floor(query.bearings / BIN_DEGREES).astype(np.int64)
        if north_sigma == 0:
            return CellScores(loglik=self._known(rows, bins, base))
        return self._turned(rows, bins, base, north_sigma)

    def scores_of(
        self, queries: Iterable[Signature], *, north_sigma: float = 0.0, threads: int = 1
    ) -> Iterator[CellScores]:
        """Give the log-likelihood of many queries in every cell, one query after the other.

        Parameters
        ----------
        queries : iterable of Signature
            Queries as `scores` takes them.
        north_sigma : float, default 0
            Standard deviation in degrees of the north of each query.
        threads : int, default 1
            How many queries are worked on at once.

        Yields
        ------
        CellScores
            What `scores` returns for each query, in their order. Few are held at once, whatever
            the number of queries.

        Raises
        ------
        InputError
            As `scores`, when the query has its turn, or if `threads` is below 1.
        """
        # One query after the other: to go over the cells once for many queries gains nothing, as
        # adding takes longer than fetching.
        if threads < 1:
            msg = f"{threads} threads were asked for; give a whole number from 1."
            raise InputError(msg)
        with ThreadPoolExecutor(threads) as pool:
            ahead: deque[Future[CellScores]] = deque()
            for query in queries:
                ahead.append(pool.submit(self.scores, query, north_sigma=north_sigma))
                if len(ahead) > threads:
                    yield ahead.popleft().result()
            while ahead:
                yield ahead.popleft().result()

    def _known(
        self, rows: NDArray[np.int64], bins: NDArray[np.int64], base: float
    ) -> NDArray[np.float32]:
        from semsig_gis.likelihood.kernels import scan  # noqa: PLC0415 - numba loads slowly

        flat = self.columns.reshape(-1, len(self.constants))
        symbols = rows * BINS + bins
        scores = np.empty(len(self.constants), np.float32)
        constants = self.constants
        for low in range(0, len(symbols), MOST_OBJECTS):
            scan(flat, symbols[low : low + MOST_OBJECTS], constants, base, self.step, scores)
            constants, base = scores, 0.0
        return scores

    def _turned(
        self, rows: NDArray[np.int64], bins: NDArray[np.int64], base: float, north_sigma: float
    ) -> CellScores:
        from semsig_gis.likelihood.kernels import scan_turned  # noqa: PLC0415

        turns = np.arange(-BINS // 2, BINS // 2)
        priors = np.exp(-0.5 * (turns * BIN_DEGREES / north_sigma) ** 2)
        kept = priors > LEAST_PRIOR * priors.max()
        turns, priors = turns[kept], priors[kept] / priors[kept].sum()
        # Likelier turns first, so that sums are rarely rescaled.
        order = np.argsort(-priors, kind="stable")
        turns, priors = turns[order], priors[order].astype(np.float32)
        symbols = rows * BINS + (bins + turns[:, None]) % BINS
        if symbols.shape[1] > MOST_OBJECTS:
            msg = (
                f"the query has {symbols.shape[1]} objects and its north is not known; give at "
                f"most {MOST_OBJECTS} objects."
            )
            raise InputError(msg)
        decay = np.exp(-self.step * np.arange(math.ceil(-math.log(LEAST_MASS) / self.step)))
        scores = np.empty(len(self.constants), np.float32)
        best = np.empty(len(self.constants), np.int16)
        scan_turned(
            self.columns.reshape(-1, len(self.constants)),
            symbols,
            turns,
            priors,
            decay.astype(np.float32),
            self.constants,
            base,
            self.step,
            scores,
            best,
        )
        return CellScores(loglik=scores, heading=best * np.float32(BIN_DEGREES))

    def _by_counts(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        from semsig_gis.likelihood.kernels import count_types  # noqa: PLC0415

        types = self.database.type_sequences
        wanted = np.bincount(rows, minlength=len(self.table.codes) + 1)
        distinct = np.empty(len(types), np.float32)
        count_types(
            types.offsets,
            types.values,
            self.table.row_of,
            wanted,
            1.0 - self.table.missed,
            self.table.named,
            self.table.clutter,
            distinct,
        )
        return distinct[types.inverse]


def build_index(
    database: SignatureDatabase,
    noise: Noise,
    *,
    out: NDArray[np.uint8] | None = None,
    progress: Callable[[int, int], None] | None = None,
    threads: int = 1,
) -> LikelihoodIndex:
    """Work out the index of a database for a noise model.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        The noise model.
    out : ndarray of uint8, shape `index_shape`, optional
        Where to put the columns, such as a mapped file.
    progress : callable, optional
        Called with the number of cells done and in all.
    threads : int, default 1
        How many blocks of cells are worked out at once.

    Returns
    -------
    LikelihoodIndex
        The index.

    Raises
    ------
    InputError
        If the noise model does not fit the classes of the database.
    """
    table = mean_table(*database_tables(database, noise))
    columns = np.empty(index_shape(database), np.uint8) if out is None else out
    step = write_columns(database, table, columns, progress=progress, threads=threads)
    return index_of_columns(
        database,
        noise,
        columns=columns,
        constants=table.nothing_seen(database.offsets, database.codes).astype(np.float32),
        step=step,
        fingerprint=index_fingerprint(database, noise),
    )


def index_of_columns(
    database: SignatureDatabase,
    noise: Noise,
    *,
    columns: NDArray[np.uint8],
    constants: NDArray[np.float32],
    step: float,
    fingerprint: str,
) -> LikelihoodIndex:
    """Return the index whose columns and constants are there already, such as those of a file."""
    tables, weights = database_tables(database, noise)
    return LikelihoodIndex(
        database=database,
        noise=noise,
        columns=columns,
        constants=constants,
        step=step,
        tables=tables,
        weights=weights,
        fingerprint=fingerprint,
    )


def index_fingerprint(database: SignatureDatabase, noise: Noise) -> str:
    """Return 32 hexadecimal digits that change with the database, the noise model and `VERSION`."""
    said = json.dumps([VERSION, noise.to_dict(), database.taxonomy.to_list(), database.reach])
    digest = hashlib.blake2b(said.encode(), digest_size=16)
    for array in (
        database.columns,
        database.rows,
        database.offsets,
        database.codes,
        database.bearing_units,
        database.distance_units,
    ):
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
