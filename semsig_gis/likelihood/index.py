"""The likelihood index: what each symbol adds to the score of every cell, in memory and in a file.

A column holds, for a class t and a step of bearings, ``log(1 + sum_i o_i C(i, t) N / lambda(t))``:
what a detection there adds, less ``log(lambda(t))``, which is the same for all cells. N is the mean
density over the step.

The file lies beside its database, is mapped into memory, and renewed when stale. A line of JSON,
padded to whole pages, tells what it belongs to; then come the constants (float32), the CRC-32 of
every column and the columns (uint8), so that a query touches only the pages of its own columns, and
checks those.
"""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.core.scratch import remove_abandoned
from semsig_gis.core.signature import BEARING_UNITS
from semsig_gis.core.view import check_north
from semsig_gis.database.city import City
from semsig_gis.likelihood.noise.table import database_tables, mean_table
from semsig_gis.storage.text import parse_json
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable

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
VERSION = 2  # of the index: raised whenever the same database and noise give other columns
MOST_OBJECTS = 257  # whose bytes add up within 16 bits
LEAST_PRIOR = 1e-7  # turns that are less likely than this, against the likeliest, are left out
LEAST_MASS = 1e-6  # below which a turn adds nothing to the sum

KIND = "semsig likelihood index"
PARQUET = b"PAR1"
PAGE = 4096
HEADER_PAGES = 4


@dataclass(frozen=True, eq=False, kw_only=True)
class CellScores:
    """The log-likelihood (natural logarithm) of a query in every cell, and the likeliest headings.

    `heading` is in degrees clockwise, in [-180, 180), to add to the bearings of the query; None if
    north was known or the query has no bearings.
    """

    loglik: NDArray[np.floating]
    heading: NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class IndexFile:
    """A file that columns are mapped from, and their sums, which the first use of each checks."""

    path: Path
    sums: NDArray[np.uint32]
    checked: NDArray[np.bool_]

    def require_intact(self, columns: NDArray[np.uint8], numbers: NDArray[np.int64]) -> None:
        """Raise DatabaseError if a column of these numbers is not the one that was written."""
        new = numbers[~self.checked[numbers]]
        for number in {*new.tolist()}:
            if zlib.crc32(columns[number].data) != self.sums[number]:
                msg = f"{self.path} is damaged; delete it, and the index is built again."
                raise DatabaseError(msg)
            self.checked[number] = True


@dataclass(frozen=True, eq=False, kw_only=True)
class LikelihoodIndex:
    """What the cells of a database add to the likelihood of each symbol.

    Parameters
    ----------
    database, noise : SignatureDatabase, and NoiseSpec or NoiseMixture
        The cells and the noise model; the columns hold the mean of a mixture.
    columns : ndarray of uint8, shape (k + 1, 72, n)
        Inner logarithms in steps, by class and bearing; the last class is "not known".
    constants : ndarray of float32, shape (n,)
        What each cell adds to any query.
    step : float
        Size of a step.
    fingerprint : str
        Stands for the database, the noise model and the version of the index.
    file : IndexFile, optional
        Where the columns are mapped from.

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> longest = int(demo_database.lengths.argmax())
    >>> int(index.scores(demo_database.signature(longest)).loglik.argmax()) == longest
    True
    """

    database: SignatureDatabase
    noise: Noise
    columns: NDArray[np.uint8]
    constants: NDArray[np.float32]
    step: float
    fingerprint: str
    file: IndexFile | None = None

    @functools.cached_property
    def models(self) -> tuple[tuple[NoiseTable, ...], NDArray[np.float64]]:
        """The noise model in numbers, or each model of the mixture, and the chance of each."""
        return database_tables(self.database, self.noise)

    @functools.cached_property
    def table(self) -> NoiseTable:
        """The noise model that the columns hold."""
        return mean_table(*self.models)

    def flat_columns(self, symbols: NDArray[np.int64] | None = None) -> NDArray[np.uint8]:
        """Return the columns, shape ((k + 1) * 72, n), of which some, or all, will be looked at.

        DatabaseError if one of those is not the one that was written.
        """
        flat = self.columns.reshape(-1, len(self.constants))
        if self.file is not None:
            self.file.require_intact(flat, np.arange(len(flat)) if symbols is None else symbols)
        return flat

    def scores(self, query: Signature, *, north_sigma: float = 0.0) -> CellScores:
        """Return the log-likelihood of a query in every cell, and the likeliest turn for each.

        Types may be unknown, all or those of code 0; bearings may be unknown, and then the order of
        the types plays no part. `north_sigma` is the standard deviation in degrees of the north of
        the query, infinite where it is not known at all; the likelihood is summed over its turns in
        steps of five degrees. Raises `InputError` if the query is empty or has a class that no cell
        sees, or `north_sigma` is negative.
        """
        check_north(north_sigma)
        rows = self.table.query_rows(query)
        if query.bearings is None:
            return CellScores(loglik=self._by_counts(rows))
        base = float(np.log(self.table.density[rows]).sum())
        bins = np.floor(query.bearings / BIN_DEGREES).astype(np.int64)
        if north_sigma > 0:
            return self._turned(rows, bins, base, north_sigma)
        from semsig_gis.likelihood.kernels import scan  # noqa: PLC0415 - numba loads slowly

        symbols = rows * BINS + bins
        flat = self.flat_columns(symbols)
        scores = np.empty(len(self.constants), np.float32)
        constants = self.constants
        for low in range(0, len(symbols), MOST_OBJECTS):
            scan(flat, symbols[low : low + MOST_OBJECTS], constants, base, self.step, scores)
            constants, base = scores, 0.0
        return CellScores(loglik=scores)

    def _turned(
        self, rows: NDArray[np.int64], bins: NDArray[np.int64], base: float, north_sigma: float
    ) -> CellScores:
        """Return the scores of a query whose north is uncertain, and its likeliest turns."""
        from semsig_gis.likelihood.kernels import scan_turned  # noqa: PLC0415

        turns = np.arange(-BINS // 2, BINS // 2)
        priors = np.exp(-0.5 * (turns * BIN_DEGREES / north_sigma) ** 2)
        likely = priors > LEAST_PRIOR * priors.max()
        turns, priors = turns[likely], priors[likely] / priors[likely].sum()
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
            self.flat_columns(symbols),
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
        """Return the scores of a query without bearings."""
        from semsig_gis.likelihood.kernels import count_types  # noqa: PLC0415

        types = self.database.type_sequences
        distinct = np.empty(len(types), np.float32)
        count_types(
            types.offsets,
            types.values,
            self.table.row_of,
            np.bincount(rows, minlength=len(self.table.codes) + 1),
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
    out : ndarray of uint8, shape (k + 1, 72, n), optional
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

    Examples
    --------
    >>> from semsig_gis import named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> len(index.database) == len(demo_database)
    True
    """
    table = mean_table(*database_tables(database, noise))
    unseen = table.nothing_seen(database.offsets, table.row_of[database.codes])
    columns = np.empty(_shape(database), np.uint8) if out is None else out
    return LikelihoodIndex(
        database=database,
        noise=noise,
        columns=columns,
        constants=unseen.astype(np.float32),
        step=_write_columns(database, table, columns, progress, threads),
        fingerprint=index_fingerprint(database, noise),
    )


def index_fingerprint(database: SignatureDatabase, noise: Noise) -> str:
    """Return 32 hexadecimal digits that change with the database, the noise model and `VERSION`."""
    specs = json.dumps([VERSION, noise.to_dict(), database.taxonomy.to_list(), database.reach])
    digest = hashlib.blake2b(specs.encode(), digest_size=16)
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


def _shape(database: SignatureDatabase) -> tuple[int, int, int]:
    """Return the shape of the columns: classes seen and one for unknown, bearing steps, cells."""
    return len(database.present_codes) + 1, BINS, len(database)


def _write_columns(
    database: SignatureDatabase,
    table: NoiseTable,
    columns: NDArray[np.uint8],
    progress: Callable[[int, int], None] | None,
    threads: int,
) -> float:
    """Fill `columns`, perhaps a mapped file, and return the size of their steps."""
    from semsig_gis.likelihood.kernels import LINE, fill_columns  # noqa: PLC0415

    spread_of, spread = _spreads(database, table)
    # 255 steps reach what four objects in one direction add.
    peak = float(spread.max() * (table.odds[:, :, None] * table.naming).max())
    step = math.log1p(4.0 * peak) / 255.0
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


def _spreads(
    database: SignatureDatabase, table: NoiseTable
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Return which bearing noise each entry has, and the density of each in every bin."""
    sigma = table.sigmas(database.reach)
    if table.position_sigma == 0:
        levels, level = np.unique(sigma, return_inverse=True)
    else:
        levels = np.geomspace(sigma.min(), sigma.max(), LEVELS)
        middle = np.sqrt(levels[1:] * levels[:-1])
        level = np.searchsorted(middle, sigma)
    level_of = np.zeros((256, 256), np.uint8)
    level_of[table.codes] = level.reshape(sigma.shape)
    spread_of = level_of[database.codes, database.distance_units]
    inside = (np.arange(BIN_UNITS) + 0.5) * (BIN_DEGREES / BIN_UNITS)
    edges = np.arange(BINS + 1) * BIN_DEGREES
    away = edges[None, None, :] - inside[None, :, None]
    below = np.zeros((len(levels), BIN_UNITS, BINS + 1))
    erf = np.vectorize(math.erf, otypes=[np.float64])
    for turn in range(-3, 4):  # 180 degrees of deviation reach three turns
        deviations = (away + 360.0 * turn) / levels[:, None, None]
        below += 0.5 * (1.0 + erf(deviations / math.sqrt(2.0)))
    return spread_of, (np.diff(below, axis=2) / BIN_DEGREES).astype(np.float32)


def _logs(step: float) -> NDArray[np.uint8]:
    """Return the logarithm in steps, by the leading bits of a float32 from 1 up."""
    from semsig_gis.likelihood.kernels import MANTISSA_BITS  # noqa: PLC0415

    octaves = math.ceil(255 * step / math.log(2.0))
    octave, part = np.divmod(np.arange(octaves << MANTISSA_BITS), 1 << MANTISSA_BITS)
    value = np.log((1.0 + (part + 0.5) / (1 << MANTISSA_BITS)) * 2.0**octave)
    value[0] = 0.0  # where nothing is near, exactly nothing is added
    return np.minimum(np.rint(value / step), 255).astype(np.uint8)


# --- The file ---------------------------------------------------------------------------------


def ready_index(
    database: SignatureDatabase,
    noise: Noise,
    path: str | Path,
    *,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
    threads: int = 1,
) -> LikelihoodIndex:
    """Open the index of a database, and build and save it first where that is needed.

    Parameters
    ----------
    database : SignatureDatabase
        The cells.
    noise : NoiseSpec or NoiseMixture
        The noise model.
    path : str or Path
        File of the index, such as `City.index_path` gives.
    note : callable, optional
        Called with a sentence where the index is built or cannot be saved.
    progress : callable, optional
        Called with the number of cells done and in all while it is built.
    threads : int, default 1
        How many blocks of cells are worked out at once.

    Returns
    -------
    LikelihoodIndex
        The index; mapped from the file, or in memory where no file can be written.

    Raises
    ------
    InputError
        If the file is a database, which the index would replace.

    Examples
    --------
    >>> import tempfile
    >>> from semsig_gis import named_noise, ready_index
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.likelihood"
    ...     index = ready_index(demo_database, named_noise("light"), path, note=print)
    ...     again = ready_index(demo_database, named_noise("light"), path, note=print)
    The likelihood index does not exist yet and is built.
    """
    _keep_database(path, noise)
    remove_abandoned(Path(path).parent)  # else only who writes does
    say = note or (lambda _: None)
    fingerprint = index_fingerprint(database, noise)
    if not Path(path).exists():
        say("The likelihood index does not exist yet and is built.")
    else:
        try:
            return open_index(database, noise, path, fingerprint=fingerprint)
        except DatabaseError as error:
            say(f"The likelihood index is built again: {error}")
    try:
        save_index(database, noise, path, progress=progress, threads=threads)
        return open_index(database, noise, path, fingerprint=fingerprint)
    except (InputError, OSError) as error:
        say(f"The likelihood index is kept in memory only: {error}")
        return build_index(database, noise, progress=progress, threads=threads)


def save_index(
    database: SignatureDatabase,
    noise: Noise,
    path: str | Path,
    *,
    progress: Callable[[int, int], None] | None = None,
    threads: int = 1,
) -> None:
    """Build an index straight into its file, which appears whole, by rename.

    Raises `InputError` if the file is a database, which the index would replace, or not writable.
    """
    _keep_database(path, noise)
    shape = _shape(database)
    start = _columns_start(shape)
    with whole_file(path) as partial:
        with partial.open("wb") as file:
            file.truncate(start + math.prod(shape))
            if hasattr(os, "posix_fallocate"):  # where there is no room, a mapped file crashes
                os.posix_fallocate(file.fileno(), 0, start + math.prod(shape))
        columns = np.memmap(partial, np.uint8, "r+", offset=start, shape=shape)
        index = build_index(database, noise, out=columns, progress=progress, threads=threads)
        columns.flush()
        flat = columns.reshape(-1, shape[-1])
        sums = np.array([zlib.crc32(column.data) for column in flat], np.uint32)
        del flat, columns
        header = {
            "kind": KIND,
            "fingerprint": index.fingerprint,
            "shape": list(shape),
            "step": index.step,
            "sum": _sum(index.step, index.constants, sums),
        }
        with partial.open("r+b") as file:
            file.write(json.dumps(header).encode().ljust(HEADER_PAGES * PAGE - 1) + b"\n")
            file.write(index.constants.tobytes() + sums.tobytes())


def open_index(
    database: SignatureDatabase,
    noise: Noise,
    path: str | Path,
    *,
    fingerprint: str | None = None,
) -> LikelihoodIndex:
    """Map a file that `save_index` wrote; its columns are read when a query needs them.

    Raises `DatabaseError` if the file is missing or damaged, or belongs to another database, noise
    model or version, which the `fingerprint` tells.
    """
    fingerprint = fingerprint or index_fingerprint(database, noise)
    shape = _shape(database)
    start = _columns_start(shape)
    try:
        with Path(path).open("rb") as file:
            header = parse_json(file.read(HEADER_PAGES * PAGE), finite=True)
            constants = np.fromfile(file, np.float32, shape[-1])
            sums = np.fromfile(file, np.uint32, math.prod(shape[:-1]))
        same = header["fingerprint"] == fingerprint
        step = float(header["step"])
        whole = (
            header["kind"] == KIND
            and header["shape"] == list(shape)
            and Path(path).stat().st_size == start + math.prod(shape)
            and header["sum"] == _sum(step, constants, sums)
            and 0 < step < math.inf
        )
        columns = np.memmap(path, np.uint8, "r", offset=start, shape=shape) if whole else None
    except (OSError, KeyError, TypeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        msg = f"{path} is missing or damaged ({reason}); build the index again."
        raise DatabaseError(msg) from error
    if not same:
        msg = f"{path} belongs to another database, noise model or version; build it again."
        raise DatabaseError(msg)
    if columns is None:
        msg = f"{path} is damaged (its parts do not fit each other); build the index again."
        raise DatabaseError(msg)
    return LikelihoodIndex(
        database=database,
        noise=noise,
        columns=np.asarray(columns),
        constants=constants,
        step=step,
        fingerprint=fingerprint,
        file=IndexFile(path=Path(path), sums=sums, checked=np.zeros(len(sums), np.bool_)),
    )


def _keep_database(path: str | Path, noise: Noise) -> None:
    """Refuse to put an index in the place of a database: both are named by one argument."""
    try:
        with Path(path).open("rb") as file:
            begin = file.read(len(PARQUET))
    except OSError:
        return  # nothing there, or nothing that can be replaced
    if begin == PARQUET:
        msg = (
            f"{path} is a Parquet file, such as a database, and no likelihood index; "
            f"give a place of its own, such as {City(path).index_path(noise)}."
        )
        raise InputError(msg)


def _sum(step: float, constants: NDArray[np.float32], sums: NDArray[np.uint32]) -> int:
    """Return the CRC-32 of what stands before the columns."""
    return zlib.crc32(sums.data, zlib.crc32(constants.data, zlib.crc32(repr(step).encode())))


def _columns_start(shape: tuple[int, int, int]) -> int:
    """Return the byte at which the columns begin: a whole page."""
    sums, cells = math.prod(shape[:-1]), shape[-1]
    return HEADER_PAGES * PAGE + -(-4 * (cells + sums) // PAGE) * PAGE
