"""Suggest objects to look for next: the questions with the largest expected information gain."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import BEARING_UNITS, FULL_TURN, InputError
from semsig_gis.localization.distance.search import DistanceLocator
from semsig_gis.localization.likelihood.priors import weight_prior
from semsig_gis.localization.noise.table import query_bearings
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Signature
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import LikelihoodLocator, Location
    from semsig_gis.localization.noise.table import NoiseTable
    from semsig_gis.observation import Photo


_Locator = TypeVar("_Locator", "LikelihoodLocator", DistanceLocator)

LOOKED_FOR = 0.95
"""Minimum probability that a person who looks for an object detects it."""
EDGE = 5.0
"""Degrees at each edge of a photo in which objects do not count: its heading is only estimated."""
HEAD_END, PLURAL = re.compile(" of | between | or |,"), re.compile("[^su]s$")
"""What follows the noun of a title, and the end of a noun in the plural."""
MOST_CELLS = 20_000
"""Most cells, the likeliest ones, in which the sectors of a view are compared."""

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
    in_view : bool
        Whether the question is only about the sectors that the query looked at.
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
    in_view: bool
    chance: float
    gain: float

    @property
    def text(self) -> str:
        """The question in words."""
        title = self.item.title.lower()
        where = f"{'in view, ' if self.in_view else ''}within {self.metres:g} m"
        if PLURAL.search(HEAD_END.split(title)[0]):
            return f"Do you see {'more ' if self.more else ''}{title} {where}?"
        article = "another" if self.more else "an" if title[0] in "aeiou" else "a"
        return f"Is there {article} {title} {where}?"

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
    answer, minus its mean entropy if the cell is known. Missed and false detections reduce it. Of a
    query with sectors, only objects in them count, at the likeliest heading in each cell.

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
    view = location.grid_query
    if in_view := _has_sectors(view):
        cells = location.posterior.likeliest(MOST_CELLS)
        sights = _Sights.in_sectors(index, View.of(view), location.headings, cells)
        weights = location.chances[cells] / location.chances[cells].sum()
    else:
        # Cells with one type sequence give the same answer.
        types = database.type_sequences
        sights = _Sights.all_round(index, view)
        weights = np.bincount(types.inverse, location.chances, minlength=len(types))
    sights.counts.update(code for code in unplaced if code in table.codes)
    questions = []
    for code in table.codes.tolist():
        if code in absent:
            continue
        yes = sights.yes_chances(code, least=LOOKED_FOR)
        chance = float(weights @ yes)
        item = database.taxonomy.by_code(code)
        questions.append(
            ClassQuestion(
                item=item,
                metres=database.spec.radius if item.range_m is None else item.range_m,
                more=bool(sights.counts[code]),
                in_view=in_view,
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
    headings: Sequence[NDArray[np.float32] | None] = (None,),
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
        Class codes that were looked for: no more objects of these classes are in sight, or of a
        query with sectors, in these sectors.
    headings : sequence of ndarray or None, optional
        By photo, the degrees to add to its bearings in each cell; None if they are known.

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
    database, inverse = index.database, index.database.type_sequences.inverse
    used = set(index.table.codes.tolist())  # classes that the map lacks are not used
    sights = _Sights.all_round(index, query)
    weights = np.ones(len(database))
    for code in filter(used.__contains__, unplaced):
        weights *= sights.yes_chances(code)[inverse]
        sights.counts[code] += 1
    if _has_sectors(query):
        inverse = np.arange(len(database))
        sights = _Sights.in_sectors(index, View.of(query), headings, inverse)
    for code in filter(used.__contains__, absent):
        weights *= 1.0 - sights.yes_chances(code, least=LOOKED_FOR)[inverse]
    return weight_prior(database, weights)


def with_unplaced(
    locator: _Locator,
    query: Signature,
    unplaced: Sequence[int] = (),
    *,
    absent: Sequence[int] = (),
) -> _Locator:
    """Return a locator with the evidence of undirected and absent objects.

    InputError if there are any, and the locator is one by distance.
    """
    if not unplaced and not absent:
        return locator
    if isinstance(locator, DistanceLocator):
        what = "objects with and without a direction" if unplaced else "absent objects"
        raise InputError(
            f"the query has {what}, which the method {str(locator.method)!r} cannot take; give "
            "directions to all objects or to none, or leave out the method."
        )
    words = locator.index.database.taxonomy.words
    grid_query = locator.north.to_grid(query)
    headings = locator.scan(query).headings if absent and _has_sectors(query) else (None,)
    prior = unplaced_prior(locator.index, grid_query, unplaced, absent=absent, headings=headings)
    used = locator.index.table.codes
    titles = {
        name: [
            words(list(group)) + ("" if code in used else " (not used, the map has none)")
            for code, group in itertools.groupby(codes)
        ]
        for name, codes in (("seen", unplaced), ("absent", absent))
        if codes
    }
    return replace(
        locator,
        undirected=prior,
        known={**locator.known, **titles},
        unplaced=tuple(unplaced),
        absent=tuple(absent),
    )


def _has_sectors(query: Signature) -> bool:
    """Whether a query looked at less than the full turn."""
    return any(photo.sectors for photo in View.of(query).photos)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Sights:
    """The objects that are looked at from some places, and those of the query.

    `histogram` has the number of objects by place and class of the noise table, `lengths` the
    number of objects all around by place, `counts` the objects of the query by class, and `share`
    is the part of the full turn that is looked at.
    """

    table: NoiseTable
    histogram: NDArray[np.integer]
    lengths: NDArray[np.int64]
    counts: Counter[int]
    share: float = 1.0

    @classmethod
    def all_round(cls, index: LikelihoodIndex, query: Signature) -> _Sights:
        """Return what is seen all around, by type sequence."""
        types, table = index.database.type_sequences, index.table
        return cls(
            table=table,
            histogram=types.histogram[:, table.codes],
            lengths=types.lengths,
            counts=Counter([] if query.codes is None else query.codes.tolist()),
        )

    @classmethod
    def in_sectors(
        cls,
        index: LikelihoodIndex,
        view: View,
        headings: Sequence[NDArray[np.float32] | None],
        cells: NDArray[np.int64],
    ) -> _Sights:
        """Return what is in the sectors of a view, by cell."""
        database, table = index.database, index.table
        starts = database.offsets[cells]
        lengths = database.offsets[cells + 1] - starts
        places = np.repeat(np.arange(len(cells)), lengths)
        rows = np.arange(len(places)) + np.repeat(starts - np.cumsum(lengths) + lengths, lengths)
        bearings = database.bearing_units[rows] * (FULL_TURN / BEARING_UNITS)
        inside, in_photo = np.zeros(len(rows), np.bool_), np.zeros(len(view), np.bool_)
        own_bearings = query_bearings(view)
        for number, photo in enumerate(view.photos):
            inner = _without_edges(photo)
            turns = headings[number] if number < len(headings) else None
            turn = 0.0 if turns is None else turns[cells][places]
            inside |= inner.sees(bearings - turn)
            in_photo |= (view.photo_rows == number) & inner.sees(own_bearings)
        kinds = table.row_of[database.codes[rows[inside]]]
        size = len(table.codes)
        counted = np.bincount(places[inside] * size + kinds, minlength=len(cells) * size)
        return cls(
            table=table,
            histogram=counted.reshape(-1, size),
            lengths=lengths,
            counts=Counter([] if view.codes is None else view.codes[in_photo].tolist()),
            share=min(sum(photo.width for photo in view.photos) / FULL_TURN, 1.0),
        )

    def yes_chances(self, code: int, *, least: float = 0.0) -> NDArray[np.float64]:
        """Return the probability, by place, that more of a class are detected than in the query.

        `least` is the minimum probability to detect an object in sight.
        """
        table, row = self.table, int(self.table.row_of[code])
        false = 1.0 - math.exp(-float(table.clutter[row]) * self.share)
        detected = np.maximum(table.detected[table.length_rows(self.lengths), row], least)
        detected = 1.0 - (1.0 - detected) * (1.0 - false)
        return np.where(self.histogram[:, row] > self.counts[code], detected, false)


def _without_edges(photo: Photo) -> Photo:
    """Return a photo with its sectors smaller by `EDGE` degrees, or a quarter, at each side."""
    sectors = []
    for low, high in photo.sectors:
        edge = min(EDGE, (high - low) / 4.0)
        sectors.append((low + edge, high - edge))
    return replace(photo, sectors=tuple(sectors))


def _entropy(chance: Any) -> Any:  # noqa: ANN401 - a number or an array
    """Return the entropy in bits of a yes-no answer with a probability of yes."""
    yes = np.clip(chance, 1e-12, 1.0 - 1e-12)
    return -(yes * np.log2(yes) + (1.0 - yes) * np.log2(1.0 - yes))
