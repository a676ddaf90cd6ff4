"""The file of a likelihood index: beside its database, mapped into memory, renewed when stale.

A line of JSON, padded to whole pages, tells what the file belongs to; then come the constants
(float32) and the columns (uint8), so that a query touches only the pages of its own columns.
"""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import DatabaseError, InputError
from semsig_gis.database.city import City
from semsig_gis.likelihood.index import (
    build_index,
    index_fingerprint,
    index_of_columns,
    index_shape,
)
from semsig_gis.storage.whole import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable

    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.index import LikelihoodIndex
    from semsig_gis.likelihood.noise.model import Noise

KIND = "semsig likelihood index"
PARQUET = b"PAR1"
PAGE = 4096
HEADER_PAGES = 4


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
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.likelihood.noise.model import named_noise
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=200.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = f"{folder}/city.likelihood"
    ...     index = ready_index(database, named_noise("light"), path, note=print)
    ...     again = ready_index(database, named_noise("light"), path, note=print)
    The likelihood index does not exist yet and is built.
    """

    def say(sentence: str) -> None:
        if note is not None:
            note(sentence)

    _keep_database(path, noise)
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
    shape = index_shape(database)
    start = _columns_start(len(database))
    with whole_file(path) as partial:
        size = start + math.prod(shape)
        with partial.open("wb") as file:
            file.truncate(size)
        columns = np.memmap(partial, np.uint8, "r+", offset=start, shape=shape)
        index = build_index(database, noise, out=columns, progress=progress, threads=threads)
        columns.flush()
        del columns
        header = {
            "kind": KIND,
            "fingerprint": index.fingerprint,
            "shape": list(shape),
            "step": index.step,
            "constants": zlib.crc32(index.constants.tobytes()),
        }
        with partial.open("r+b") as file:
            file.write(json.dumps(header).encode().ljust(HEADER_PAGES * PAGE - 1) + b"\n")
            file.write(index.constants.tobytes())


def open_index(
    database: SignatureDatabase,
    noise: Noise,
    path: str | Path,
    *,
    fingerprint: str | None = None,
) -> LikelihoodIndex:
    """Map a file that `save_index` wrote; its columns are read when a query needs them.

    Raises `DatabaseError` if the file is missing or damaged, or belongs to another database, noise
    model or version. Give the fingerprint of the database and the noise model if it is known.
    """
    wanted = fingerprint or index_fingerprint(database, noise)
    shape = index_shape(database)
    start = _columns_start(len(database))
    try:
        with Path(path).open("rb") as file:
            header = json.loads(file.read(HEADER_PAGES * PAGE))
            constants = np.fromfile(file, np.float32, len(database))
        same = header["fingerprint"] == wanted
        step = float(header["step"])
        whole = (
            header["kind"] == KIND
            and header["shape"] == list(shape)
            and Path(path).stat().st_size == start + math.prod(shape)
            and zlib.crc32(constants.tobytes()) == header["constants"]
            and 0 < step < math.inf
        )
        columns = np.memmap(path, np.uint8, "r", offset=start, shape=shape) if whole else None
    except (OSError, KeyError, TypeError, ValueError) as error:
        msg = f"{path} is missing or damaged ({_reason(error)}); build the index again."
        raise DatabaseError(msg) from error
    if not same:
        msg = f"{path} belongs to another database, noise model or version; build it again."
        raise DatabaseError(msg)
    if columns is None:
        msg = f"{path} is damaged (its parts do not fit each other); build the index again."
        raise DatabaseError(msg)
    return index_of_columns(
        database,
        noise,
        columns=np.asarray(columns),
        constants=constants,
        step=step,
        fingerprint=wanted,
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


def _columns_start(cells: int) -> int:
    """Return the byte at which the columns begin: a whole page."""
    return HEADER_PAGES * PAGE + -(-4 * cells // PAGE) * PAGE


def _reason(error: BaseException) -> Any:  # noqa: ANN401
    return error.strerror if isinstance(error, OSError) and error.strerror else error
