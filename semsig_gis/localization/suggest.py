"""What to look for next: the question whose answer is expected to help most."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.localization.likelihood.priors import weight_prior

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Signature
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import LikelihoodLocator, Location


LOOKED_FOR = 0.95
"""Least chance that somebody who is asked for an object sees it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassQuestion:
    """Whether an object of a class is seen, beside those that were.

    Parameters
    ----------
    item : ObjectClass
        The class.
    metres : float
        How far it is seen.
    more : bool
        Whether one of it was seen already, so that another one is asked for.
    chance : float
        That the answer will be yes.
    gain : float
        What the answer is expected to tell of the place, in bits; 0 to 1.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise, next_questions
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> first = next_questions(index, locate(index, demo_database.signature(0)))[0]
    >>> first.text
    'Is there a public bench within 30 m?'
    """

    item: ObjectClass
    metres: float
    more: bool
    chance: float
    gain: float

    @property
    def text(self) -> str:
        """The question in words."""
        title = self.item.title.lower()
        article = "another" if self.more else "an" if title[0] in "aeiou" else "a"
        return f"Is there {article} {title} within {self.metres:g} m?"

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values that JSON can hold."""
        return {
            "class": self.item.name,
            "title": self.item.title,
            "symbol": self.item.symbol,
            "chance": round(self.chance, 4),
            "gain": round(self.gain, 4),
            "question": self.text,
        }


def next_questions(
    index: LikelihoodIndex,
    location: Location,
    *,
    unplaced: Sequence[int] = (),
    absent: Sequence[int] = (),
) -> tuple[ClassQuestion, ...]:
    """Return what to look for next, beginning with what is expected to help most.

    Parameters
    ----------
    index : LikelihoodIndex
        What the answer was found with.
    location : Location
        The answer so far.
    unplaced : sequence of int, optional
        Class codes of objects that were seen beside the query (see `unplaced_prior`).
    absent : sequence of int, optional
        Class codes of what was looked for already, and is not there.

    Returns
    -------
    tuple of ClassQuestion
        One for each class that some cell sees, and that was not looked for.

    Notes
    -----
    The gain is the mutual information of the answer, yes or no, and the cell: the entropy of the
    answer, less its mean entropy where the cell is known. That a detector misses what is there, and
    sees what is not, makes it smaller.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location = locate(index, demo_database.signature(0))
    >>> gains = [one.gain for one in next_questions(index, location)]
    >>> gains == sorted(gains, reverse=True), 0 <= gains[-1] <= gains[0] <= 1
    (True, True)
    """
    database, table = index.database, index.table
    types = database.type_sequences
    weights = np.bincount(types.inverse, location.chances, minlength=len(types))
    seen = _counts(location.query, unplaced)
    found = []
    for code in table.codes.tolist():
        if code in absent:
            continue
        yes = _yes(index, code, seen[code], least=LOOKED_FOR)
        chance = float(weights @ yes)
        item = database.taxonomy.by_code(code)
        found.append(
            ClassQuestion(
                item=item,
                metres=database.spec.radius if item.range_m is None else item.range_m,
                more=bool(seen[code]),
                chance=chance,
                gain=max(float(_bits(chance)) - float(weights @ _bits(yes)), 0.0),
            )
        )
    return tuple(sorted(found, key=lambda one: -one.gain))


def unplaced_prior(
    index: LikelihoodIndex,
    query: Signature,
    unplaced: Sequence[int] = (),
    *,
    absent: Sequence[int] = (),
) -> NDArray[np.float64]:
    """Return a prior from objects that were seen in an unknown direction, or not at all.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    query : Signature
        What was seen, and where.
    unplaced : sequence of int
        Class codes of what was seen beside it.
    absent : sequence of int, optional
        Class codes of which none was seen beside all these, though it was looked for.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell: each is a question of `next_questions` that was answered with yes, or
        with no.

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> prior = unplaced_prior(index, demo_database.signature(0), [3])
    >>> bool(np.exp(prior).sum().round(9) == 1)
    True
    """
    database = index.database
    seen = _counts(query)
    weights = np.ones(len(database.type_sequences))
    for code in unplaced:
        if code in index.table.codes:  # a class that no cell sees is false wherever it was seen
            weights *= _yes(index, code, seen[code])
        seen[code] += 1
    for code in absent:
        if code in index.table.codes:
            weights *= 1.0 - _yes(index, code, seen[code], least=LOOKED_FOR)
    return weight_prior(database, weights[database.type_sequences.inverse])


def with_unplaced(
    locator: LikelihoodLocator,
    query: Signature,
    unplaced: Sequence[int] = (),
    *,
    absent: Sequence[int] = (),
) -> LikelihoodLocator:
    """Return the locator with the prior of `unplaced_prior` for what else was seen or not."""
    if not unplaced and not absent:
        return locator
    by_code = locator.index.database.taxonomy.by_code
    told = {"seen": unplaced, "absent": absent}
    prior = unplaced_prior(locator.index, query, unplaced, absent=absent)
    return replace(
        locator,
        log_prior=prior if locator.log_prior is None else locator.log_prior + prior,
        known={
            **locator.known,
            **{
                name: [by_code(code).title.lower() for code in codes]
                for name, codes in told.items()
                if codes
            },
        },
    )


def _counts(query: Signature, unplaced: Sequence[int] = ()) -> Counter[int]:
    """Return how many objects of each class were seen."""
    return Counter([*([] if query.codes is None else query.codes.tolist()), *unplaced])


def _yes(
    index: LikelihoodIndex, code: int, seen: int, *, least: float = 0.0
) -> NDArray[np.float64]:
    """Return the chance by type sequence that one more than so many of a class are seen.

    What is there is detected with a chance of at least so much.
    """
    table, types = index.table, index.database.type_sequences
    row = int(np.flatnonzero(table.codes == code)[0])
    false = 1.0 - math.exp(-float(table.clutter[row]))
    detected = np.maximum(table.detected[table.length_rows(types.lengths), row], least)
    detected = 1.0 - (1.0 - detected) * (1.0 - false)
    return np.where(types.histogram[:, code] > seen, detected, false)


def _bits(chance: Any) -> Any:  # noqa: ANN401 - a number, or an array of them
    """Return the entropy of a question that is answered with yes by chance."""
    sure = np.clip(chance, 1e-12, 1.0 - 1e-12)
    return -(sure * np.log2(sure) + (1.0 - sure) * np.log2(1.0 - sure))
