"""The plain values of answers that commands return, with the keys that they add."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict

from semsig_gis.core import SignatureRecord
from semsig_gis.localization import (
    LocalizationRecord,
    LocationRecord,
    PlaceRecord,
    PriorRecord,
    QuestionRecord,
    RegionRecord,
    RegionsRecord,
)
from semsig_gis.observation import ViewRecord


class RouteRecord(LocationRecord):
    """The answer to a view of a route, with its name or number."""

    id: str | int


class AddedRecord(TypedDict):
    """The keys of one of many queries, and of regions that were written."""

    id: NotRequired[str | int]
    line: NotRequired[int]
    searched: NotRequired[RegionsRecord]


class LikelyAnswerRecord(AddedRecord, LocationRecord):
    """An answer by likelihood; of several cities, the likeliest and the chance of each."""

    city: NotRequired[str]
    cities: NotRequired[dict[str, float]]


class RankedAnswerRecord(AddedRecord, LocalizationRecord):
    """An answer by distance."""


class UnansweredRecord(TypedDict):
    """One of many queries that cannot be answered."""

    id: str | int
    line: int
    error: str


LocalizeRecord = LikelyAnswerRecord | RankedAnswerRecord | UnansweredRecord
"""The answer to a query."""


class SuggestRecord(TypedDict):
    """The present answer, and what to look for next, most useful first."""

    query: ViewRecord | SignatureRecord
    prior: PriorRecord | None
    answered: bool
    elsewhere: float
    fit: float | None
    doubt: str
    place: PlaceRecord
    region: RegionRecord
    notes: list[str]
    questions: list[QuestionRecord]
