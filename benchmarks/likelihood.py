"""Time of queries by the likelihood method in random cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.comparison import compare
from semsig_gis.localization import build_index, locate, named_noise, rerank

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from benchmarks.comparison import Comparison
    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase

    _Peer = Callable[[int], object]

__all__ = ["growth_of_likelihood", "likelihood_rows"]

_NOISE = named_noise("generic")
_PEER = "rapidfuzz.process.cdist([query], cells), edit distance of types"


def likelihood_rows(
    database: SignatureDatabase,
    queries: Sequence[Signature],
    *,
    single: _Peer,
    batch: _Peer,
    repeats: int,
) -> Iterator[Comparison]:
    """Measure single queries, `repeats` of them, and all queries together.

    `single` and `batch` are the work of the peer, for one query by its number and for all.
    """
    cells = f"{len(database):,} cells"
    index = build_index(database, _NOISE)

    def score_all(_: int) -> None:
        for query in queries:
            index.scores(query)

    yield compare(
        f"{len(queries):,} likelihood queries, {cells}",
        score_all,
        batch,
        peer_name="rapidfuzz.process.cdist(queries, cells), edit distance of types",
        repeats=1,
    )

    def scored(repeat: int) -> None:
        index.scores(queries[repeat])

    def reranked(repeat: int) -> None:
        rerank(index, queries[repeat], index.scores(queries[repeat]))

    def answered(repeat: int) -> None:
        locate(index, queries[repeat])

    for what, ours in (
        ("", scored),
        (" with re-ranking", reranked),
        (" with re-ranking, chances and answer", answered),
    ):
        name = f"one likelihood query{what}, {cells}"
        yield compare(name, ours, single, peer_name=_PEER, repeats=repeats)


def growth_of_likelihood(database: SignatureDatabase, single: _Peer, *, repeats: int) -> Comparison:
    """Measure queries from the first cells of a database of another size."""
    index = build_index(database, _NOISE)
    return compare(
        f"growth: a likelihood query, {len(database):,} cells",
        lambda repeat: index.scores(database.signature(repeat)),
        single,
        peer_name=_PEER,
        repeats=repeats,
    )
