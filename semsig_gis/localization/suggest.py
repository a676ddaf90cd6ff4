"""Suggest objects to look for next: the questions with the largest expected information gain."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.localization.likelihood.priors import weight_prior

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Signature
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import LikelihoodLocator, Location


LOOKED_FOR = 0.95
"""Minimum probability that a person who looks for an object detects it."""

QuestionRecord = TypedDict(
    "QuestionRecord",
    {
        "class": str,
        "title": str,
        "symbol": str,
        "chance": float,
        "gain": float,
        "question": str,
    },
)
"""A question as plain values; the gain is in bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassQuestion:
    """A question whether an object of a class is in sight, in addition to those of the query.

    Parameters
    ----------
    item : ObjectClass
        The class.
    metres : float
        Visibility range of the class.
    more : bool
        Whether the query has an object of the class already: the question is about another one.
    chance : float
        Probability that the answer is yes.
    gain : float
        Expected information gain of the answer about the place, in bits; 0 to 1.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> from semsig_gis.localization import next_questions
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> first = next_questions(index, locate(index, demo_database.signature(0)))[0]
    >>> first.text
    'Is there a bench within 30 m?'
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

    def to_dict(self) -> QuestionRecord:
        """Return plain values for JSON."""
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
    """Return questions about objects to look for next, in descending order of expected gain.

    Parameters
    ----------
    index : LikelihoodIndex
        The index that gave the answer.
    location : Location
        The answer so far.
    unplaced : sequence of int, optional
        Class codes of objects that were seen in an unknown direction (see `unplaced_prior`).
    absent : sequence of int, optional
        Class codes of objects that were looked for already and are not in sight.

    Returns
    -------
    tuple of ClassQuestion
        One for each class that some cell sees and that is not in `absent`.

    Notes
    -----
    The gain is the mutual information of the answer, yes or no, and the cell: the entropy of the
    answer, minus its mean entropy if the cell is known. Missed and false detections reduce it.

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location = locate(index, demo_database.signature(0))
    >>> gains = [question.gain for question in next_questions(index, location)]
    >>> gains == sorted(gains, reverse=True), 0 <= gains[-1] <= gains[0] <= 1
    (True, True)
    """
    database, table = index.database, index.table
    types = database.type_sequences
    # Cells with one type sequence give the same answer.
    weights = np.bincount(types.inverse, location.chances, minlength=len(types))
    counts = _class_counts(location.query, unplaced)
    questions = []
    for code in table.codes.tolist():
        if code in absent:
            continue
        yes = _yes_chances(index, code, counts[code], least=LOOKED_FOR)
        chance = float(weights @ yes)
        item = database.taxonomy.by_code(code)
        questions.append(
            ClassQuestion(
                item=item,
                metres=database.spec.radius if item.range_m is None else item.range_m,
                more=bool(counts[code]),
                chance=chance,
                gain=max(float(_entropy(chance)) - float(weights @ _entropy(yes)), 0.0),
            )
        )
    return tuple(sorted(questions, key=lambda question: -question.gain))


def unplaced_prior(
    index: LikelihoodIndex,
    query: Signature,
    unplaced: Sequence[int] = (),
    *,
    absent: Sequence[int] = (),
) -> NDArray[np.float64]:
    """Return a prior from objects that were seen in an unknown direction, or are not in sight.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model.
    query : Signature
        The objects with known directions.
    unplaced : sequence of int
        Class codes of objects that were seen in addition, in an unknown direction.
    absent : sequence of int, optional
        Class codes that were looked for: no more objects of these classes are in sight.

    Returns
    -------
    ndarray of float64, shape (n,)
        Log-prior by cell. Each object is a question of `next_questions` with the answer yes (in
        sight) or no (absent).

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> prior = unplaced_prior(index, demo_database.signature(0), [3])
    >>> bool(np.exp(prior).sum().round(9) == 1)
    True
    """
    database = index.database
    counts = _class_counts(query)
    weights = np.ones(len(database.type_sequences))
    for code in unplaced:
        if code in index.table.codes:  # classes that the map lacks are not used
            weights *= _yes_chances(index, code, counts[code])
        counts[code] += 1
    for code in absent:
        if code in index.table.codes:
            weights *= 1.0 - _yes_chances(index, code, counts[code], least=LOOKED_FOR)
    return weight_prior(database, weights[database.type_sequences.inverse])


def with_unplaced(
    locator: LikelihoodLocator,
    query: Signature,
    unplaced: Sequence[int] = (),
    *,
    absent: Sequence[int] = (),
) -> LikelihoodLocator:
    """Return a locator with the evidence of undirected and absent objects added to its prior."""
    if not unplaced and not absent:
        return locator
    by_code = locator.index.database.taxonomy.by_code
    prior = unplaced_prior(locator.index, query, unplaced, absent=absent)
    used = locator.index.table.codes
    titles = {
        name: [
            by_code(code).title.lower() + ("" if code in used else " (not used, the map has none)")
            for code in codes
        ]
        for name, codes in (("seen", unplaced), ("absent", absent))
        if codes
    }
    return replace(
        locator,
        log_prior=prior if locator.log_prior is None else locator.log_prior + prior,
        known={**locator.known, **titles},
    )


def _class_counts(query: Signature, unplaced: Sequence[int] = ()) -> Counter[int]:
    """Return the number of objects of each class in a query."""
    return Counter([*([] if query.codes is None else query.codes.tolist()), *unplaced])


def _yes_chances(
    index: LikelihoodIndex, code: int, count: int, *, least: float = 0.0
) -> NDArray[np.float64]:
    """Return the probability, by type sequence, that more than `count` of a class are detected.

    `least` is the minimum probability to detect an object in sight.
    """
    table, types = index.table, index.database.type_sequences
    row = int(np.flatnonzero(table.codes == code)[0])
    false = 1.0 - math.exp(-float(table.clutter[row]))
    detected = np.maximum(table.detected[table.length_rows(types.lengths), row], least)
    detected = 1.0 - (1.0 - detected) * (1.0 - false)
    return np.where(types.histogram[:, code] > count, detected, false)


def _entropy(chance: Any) -> Any:  # noqa: ANN401 - a number or an array
    """Return the entropy in bits of a yes-no answer with a probability of yes."""
    yes = np.clip(chance, 1e-12, 1.0 - 1e-12)
    return -(yes * np.log2(yes) + (1.0 - yes) * np.log2(1.0 - yes))
