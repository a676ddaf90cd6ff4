"""Time of queries by distance in a city of the size of Paris, compared with RapidFuzz."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from pyproj import CRS
from rapidfuzz.distance import Levenshtein
from rapidfuzz.process import cdist

from benchmarks.comparison import compare
from benchmarks.likelihood import growth_of_likelihood, likelihood_rows
from semsig_gis.core import BEARING_UNITS, GridSpec, SignatureSpec
from semsig_gis.database import SignatureDatabase
from semsig_gis.evaluation import published as paris
from semsig_gis.localization import Method, score_cells
from semsig_gis.sources import paper_taxonomy

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from benchmarks.comparison import Comparison
    from semsig_gis.core import Signature

__all__ = ["comparisons", "random_database"]

# Occurrences of the paper's eleven classes over all signatures of Paris, by code.
_OCCURRENCES = [1752696, 6713, 2299639, 36333, 102240, 14397, 8006, 4421, 2537, 135748, 32320]
_MEAN_LENGTH = 14.0
_SPREAD = 2.5  # shape of the gamma distribution of lengths: two cells in five see under ten
_COPIED = 0.34  # share of cells that look like another: the paper has 66 % distinct by angle
_SEED = 20


@dataclass(frozen=True, slots=True)
class _Size:
    """Numbers of cells, queries and repeats."""

    cells: int
    batch: int
    repeats: int
    others: tuple[int, ...]  # numbers of cells that show how time grows


_SIZES = {
    "full": _Size(312_134, 1000, 15, (10_000, 100_000, 1_000_000, 3_000_000)),
    "small": _Size(2_000, 20, 2, (500, 1_000)),
}


def random_database(cells: int, *, seed: int = _SEED) -> SignatureDatabase:
    """Make a database of random signatures, as long, skewed and repeated as in Paris.

    The cells are in one column of the grid.
    """
    rng = np.random.default_rng(seed)
    lengths = 1 + rng.poisson(rng.gamma(_SPREAD, (_MEAN_LENGTH - 1) / _SPREAD, cells))
    starts = np.cumsum(lengths) - lengths
    shares = np.array(_OCCURRENCES) / sum(_OCCURRENCES)
    codes = 1 + rng.choice(len(shares), lengths.sum(), p=shares).astype(np.uint8)
    units = rng.integers(0, BEARING_UNITS, lengths.sum()).astype(np.uint16)
    owner = np.repeat(np.arange(cells), lengths)
    order = np.lexsort((units, owner))
    # A copied cell has the signature of an earlier cell.
    copied = rng.random(cells) < _COPIED
    copied[0] = False
    source = np.where(copied, rng.integers(0, np.maximum(np.arange(cells), 1)), np.arange(cells))
    lengths = lengths[source]
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    inside = np.arange(offsets[-1]) - np.repeat(offsets[:-1], lengths)
    entries = order[np.repeat(starts[source], lengths) + inside]
    return SignatureDatabase(
        columns=np.zeros(cells, np.int32),
        rows=np.arange(cells, dtype=np.int32),
        offsets=offsets,
        codes=codes[entries],
        bearing_units=units[entries],
        distance_units=np.zeros(len(entries), np.uint8),
        grid=GridSpec(),
        spec=SignatureSpec(),
        taxonomy=paper_taxonomy(),
        crs=CRS("EPSG:2154"),
    )


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure single queries, a batch, and how the time of a query grows with the cells."""
    scale = _SIZES[size]
    database = random_database(scale.cells)
    picked = np.random.default_rng(_SEED).integers(0, scale.cells, scale.batch).tolist()
    queries = [database.signature(cell) for cell in picked]
    of_cells = {
        "types": _texts(database.codes, database.offsets),
        "angles": _texts(database.levels, database.offsets),
    }
    of_queries = {part: [texts[cell] for cell in picked] for part, texts in of_cells.items()}
    for part, texts in of_cells.items():
        _check_equal(database, queries[0], part, of_queries[part][0], texts)

    def score(count: int, method: str, repeat: int) -> None:
        batch = queries[repeat : repeat + count]
        deque(score_cells(database, batch, Method.parse(method)), maxlen=0)

    def peer(count: int, parts: tuple[str, ...], repeat: int) -> None:
        for part in parts:
            batch = of_queries[part][repeat : repeat + count]
            cdist(batch, of_cells[part], scorer=Levenshtein.distance, dtype=np.uint8)

    cells = f"{scale.cells:,} cells"
    for part, measure, bar in [
        ("types", "edit", 10.0),
        ("angles", "edit", 10.0),
        ("types", "jaccard", None),
        ("angles", "jaccard", None),
        ("types", "histogram", None),
        ("angles", "histogram", None),
    ]:
        yield compare(
            f"one {measure} query by {part}, {cells}",
            partial(score, 1, f"{part}:{measure}"),
            partial(peer, 1, (part,)),
            peer_name="rapidfuzz.process.cdist([query], cells), edit distance",
            repeats=scale.repeats,
            bar=bar,
            paper=paris.QUERY_MS[f"{part}:{measure}"],
        )
    for method in ("edit+edit", "edit+edit:5%", "jaccard+jaccard:5%", "histogram+histogram:5%"):
        yield compare(
            f"one {method} query, {cells}",
            partial(score, 1, method),
            partial(peer, 1, tuple(of_cells)),
            peer_name="rapidfuzz.process.cdist([query], cells), by types and by angles",
            repeats=scale.repeats,
            paper=paris.QUERY_MS.get(method),
        )

    for part in of_cells:
        yield compare(
            f"{scale.batch:,} edit queries by {part}, {cells}",
            partial(score, scale.batch, f"{part}:edit"),
            partial(peer, scale.batch, (part,)),
            peer_name="rapidfuzz.process.cdist(queries, cells)",
            repeats=1,
            bar=2.0,
        )
    yield from likelihood_rows(
        database,
        queries,
        single=partial(peer, 1, ("types",)),
        batch=partial(peer, scale.batch, ("types",)),
        repeats=scale.repeats,
    )
    for count in scale.others:
        yield from _growth(count, min(scale.repeats, 7))


def _growth(cells: int, repeats: int) -> Iterator[Comparison]:
    """Measure one query by types and one by likelihood over a number of cells."""
    database = random_database(cells)
    texts = _texts(database.codes, database.offsets)
    method = Method.parse("types:edit")

    def ours(repeat: int) -> None:
        deque(score_cells(database, [database.signature(repeat)], method), maxlen=0)

    def peer(repeat: int) -> None:
        cdist([texts[repeat]], texts, scorer=Levenshtein.distance, dtype=np.uint8)

    ours(0)  # a large table is converted to bit planes before its second query
    yield compare(
        f"growth: an edit query by types, {cells:,} cells",
        ours,
        peer,
        peer_name="rapidfuzz.process.cdist([query], cells), edit distance",
        repeats=repeats,
    )
    yield growth_of_likelihood(database, peer, repeats=repeats)


def _texts(values: NDArray[np.uint8], offsets: NDArray[np.int64]) -> list[str]:
    """Return the sequence of every cell as text, which RapidFuzz compares fastest."""
    text, ends = values.tobytes().decode("latin-1"), offsets.tolist()
    return [text[low:high] for low, high in pairwise(ends)]


def _check_equal(
    database: SignatureDatabase, query: Signature, part: str, text: str, texts: list[str]
) -> None:
    """Raise if ours and the peer have different results."""
    theirs = cdist([text], texts, scorer=Levenshtein.distance)[0]
    for _ in range(2):  # the second query uses the kernel for large tables
        (ours,) = score_cells(database, [query], Method.parse(f"{part}:edit:raw"))
        if not np.array_equal(ours, theirs):
            raise ArithmeticError(f"the edit distances by {part} differ from those of RapidFuzz.")
