"""The answers of the likelihood method as plain values, for JSON and its schema."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict

from semsig_gis.localization.answers import (
    AnswerRecord,
    BestPlaceRecord,
    CandidateRecord,
    DoubtRecord,  # noqa: TC001 - pydantic reads it
    PositionRecord,
)
from semsig_gis.localization.likelihood.estimate import EstimateRecord
from semsig_gis.localization.likelihood.explain import ExplanationRecord  # noqa: TC001 - pydantic reads it
from semsig_gis.localization.likelihood.reading import TextRecord  # noqa: TC001 - pydantic reads it


class PlaceRecord(EstimateRecord, BestPlaceRecord):
    """The place of an answer in words, in metres and in degrees, with links and its chance."""

    cell_id: int
    chance: float
    within_m: float


class RegionRecord(TypedDict):
    """The fewest cells that contain a share of the chance; `places` is None if there are many."""

    share: float
    cells: int
    km2: float
    places: int | None
    text: str


class KnownCells(TypedDict):
    """A file or a text, and the number of cells that it allows."""

    file: NotRequired[str]
    text: NotRequired[str]
    cells: NotRequired[int]


class PriorRecord(TypedDict):
    """What was known of the place without the query."""

    near: NotRequired[PositionRecord]
    area: NotRequired[KnownCells]
    popularity: NotRequired[KnownCells]
    require: NotRequired[KnownCells]
    seen: NotRequired[list[str]]
    absent: NotRequired[list[str]]
    ratio: NotRequired[float]


class LikelyRecord(CandidateRecord):
    """A candidate by likelihood: a place with its likeliest cell."""

    rank: int
    loglik: float
    chance: float
    cell_chance: float
    heading: NotRequired[float]
    explanation: NotRequired[ExplanationRecord]
    city: NotRequired[str]  # of several


class LocationRecord(AnswerRecord):
    """An answer by likelihood as plain values."""

    noise: str
    answered: bool
    place: PlaceRecord
    threshold: float | None
    elsewhere: float
    fit: float | None
    doubt: str
    doubt_parts: DoubtRecord
    region: RegionRecord
    entropy_bits: float
    prior: PriorRecord | None
    candidates: list[LikelyRecord]
    texts: NotRequired[list[TextRecord]]
