"""Sentences of a person: what was seen where, and what is not there.

A sentence is split into items (things, directions, numbers, ...), each the longest phrase that the
vocabulary has. The items between commas, and words such as "and" and "next to", are a part, with
one thing. A part that is not understood is left out, with a note.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from semsig_gis.core import FULL_TURN, WILDCARD, InputError
from semsig_gis.observation.sentence_items import TOKEN, items_of
from semsig_gis.observation.sentence_parts import (
    BEFORE,
    LAST_TWO,
    NEXT_TWO,
    parts_of,
    signed_turn,
    without_thing,
)
from semsig_gis.observation.vocabulary import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.observation.sentence_parts import Part
    from semsig_gis.observation.vocabulary import Codes
    from semsig_gis.storage import Row

# Standard deviations in degrees.
NEXT_ERROR = 15.0
"""Next to another thing: some metres at a usual distance."""
ANY_ERROR = FULL_TURN / 2.0
"""An unknown direction."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sentence:
    """What a sentence says.

    `row` has the objects as ``detections`` of `parse_view`, and the ``heading`` with its error if
    the sentence gives it, and what was read in an unknown direction as ``signs``; `notes` are on
    words that were not used. `unplaced` and `absent` are the class codes of objects that were seen
    in an unknown direction, if others have one, and of those that are not in sight.
    """

    row: Row
    notes: tuple[str, ...] = ()
    unplaced: Codes = ()
    absent: Codes = ()


def read_sentence(text: str, taxonomy: Taxonomy) -> Sentence:
    """Return what a person's sentence says.

    Parameters
    ----------
    text : str
        What was seen, in English, German, French, Spanish, Italian or Portuguese.
    taxonomy : Taxonomy
        The classes.

    Returns
    -------
    Sentence
        The objects; without any direction, all are in its row.

    Raises
    ------
    UnknownNameError
        If no part names a class.
    InputError
        If a number or a direction is not clear.

    Notes
    -----
    A word for a family, such as "shop", and "church or mosque" have equal scores for all classes
    that they may mean. What stands between quotation marks was read on the thing before it, or on
    something of any class. A thing "next to" another, or "with" it is in the same
    direction, with an error of `NEXT_ERROR`; a thing "between" two others is anywhere between their
    directions. Other words do not say where a thing is: after "and then", and "opposite the
    church", its direction is unknown. "Trees at 40, 80 and 120" are three things, "lamps on both
    sides" two, and "2 trees at 40" two in one direction. A "hotel entrance" is an entrance, with a
    note. Words that are not understood are left out, with a note;
    those that make something else of a thing, as in "tree stump", with their part of the sentence.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> sentence = read_sentence("2 green benches on the left, a lamp, no tree", paper_taxonomy())
    >>> [(item["class"], item["offset"]) for item in sentence.row["detections"]]
    [('L', -90.0), ('L', -90.0)]
    >>> sentence.unplaced, sentence.absent, sentence.notes
    ((3,), (1,), ("'green' was not used.",))
    """
    matches = [*TOKEN.finditer(text.replace("º", "°"))]
    tokens = [match for match in matches if not match["open"]]
    vocabulary = Vocabulary.of([match["word"] for match in tokens if match["word"]], taxonomy)
    parts = [*parts_of(items_of(tokens, vocabulary, taxonomy), vocabulary, taxonomy)]
    look: Row = {}
    for part in parts:
        if part.heading is not None and look:
            raise InputError(f"{part.text!r} is a second direction of sight; give it once.")
        if part.heading is not None:
            look = {"heading": part.heading}
            if part.heading_error:
                look["heading_error"] = part.heading_error
    things = _things(parts, vocabulary)
    if text.strip() and not things:
        raise without_thing(text)
    sentence = _sentence(things, look, taxonomy)
    unclosed = (
        f"the quotation mark before {match['open'][1:]!r} is not closed, so what was read was not "
        "used."
        for match in matches
        if match["open"]
    )
    return replace(sentence, notes=(*unclosed, *sentence.notes))


def _things(parts: Sequence[Part], vocabulary: Vocabulary) -> list[Part]:
    """Return the parts with a thing; the others give them their direction or distance."""
    things: list[Part] = []
    waiting: Part | None = None  # a direction before its thing
    at = 0
    while at < len(parts):
        part, at = parts[at], at + 1
        last = things[-1] if things else None
        if part.things or part.read or part.others or part.absent:
            part.check(vocabulary, last)
            if waiting is not None:
                part.take(waiting)
                part.led, waiting = True, None
            more = part.directions_after(parts[at:])
            things += [part, *(map(part.at, more) if part.fault is None else ())]
            at += 0 if part.sides else len(more)
        elif part.fault is not None:
            raise part.fault
        elif not part.says_where:
            continue
        elif last is not None and last.can_take(part):
            last.take(part)
        elif part.joined and last is not None and not (last.absent or last.led):
            raise without_thing(part.text)
        elif waiting is not None:
            waiting.take(part)
        else:
            waiting = part
    if waiting is not None:
        raise without_thing(waiting.text)
    return things


def _sentence(things: Sequence[Part], look: Row, taxonomy: Taxonomy) -> Sentence:
    """Return what the things of a sentence say; `look` has the direction of sight."""
    faults = [thing.fault for thing in things if thing.fault is not None]
    if faults and len(faults) == len(things):
        raise faults[0]
    notes = [
        f"{thing.text!r} was not used, because {thing.lost}." for thing in things if thing.lost
    ]
    pairs = [*zip(things, _places(things), strict=True)]
    pairs = [(thing, place) for thing, place in pairs if thing.fault is None]
    sights = [(thing, place) for thing, place in pairs if not thing.absent]
    notes += [note for thing, place in pairs for note in thing.notes(place)]
    somewhere = next((place for _, place in sights if place), None)
    rows: list[Row] = []
    signs: list[str] = []
    unplaced: list[int] = []
    for thing, place in sights:
        if thing.names_street or (thing.read and somewhere and not place):
            signs += [thing.read] * thing.count
        elif place or not somewhere:
            rows += [thing.row(taxonomy) | place for _ in range(thing.count)]
        elif len(thing.codes) == 1:
            unplaced += thing.codes * thing.count
        else:
            anywhere = {**somewhere, "bearing_error": ANY_ERROR}
            rows += [thing.row(taxonomy) | anywhere for _ in range(thing.count)]
    if WILDCARD in unplaced:
        notes.append("something in an unknown direction was not used.")
    if look and any("bearing" in row for row in rows):
        # Of directions from north, only those from the direction of sight have its error.
        look = dict(look)
        error = look.pop("heading_error", 0.0)
        for row in rows:
            if "offset" in row and error:
                row["bearing_error"] = math.hypot(row.get("bearing_error", 0.0), error)
    return Sentence(
        row={"detections": rows, **({"signs": signs} if signs else {}), **look},
        notes=tuple(dict.fromkeys(notes)),
        unplaced=tuple(code for code in unplaced if code != WILDCARD),
        absent=tuple(code for thing, _ in pairs if thing.absent for code in thing.codes),
    )


def _places(things: Sequence[Part]) -> list[Row]:
    """Return the directions of things as values of detections, also by those of others."""
    places = [thing.place() for thing in things]
    followers = [row for row, thing in enumerate(things) if row and thing.near == BEFORE]
    for row in (
        *followers,
        *reversed(followers),
    ):  # to the things on either side, from each to the next
        before, place = places[row - 1 : row + 1]
        places[row] = place or _next_to(before)
        places[row - 1] = before or _next_to(place)
    for row, thing in enumerate(things):
        ends = [row + step for step in thing.near if 0 <= row + step < len(things)]
        if thing.near in {NEXT_TWO, LAST_TWO} and ends and not places[row]:
            nearest = min(ends, key=lambda end: abs(end - row))
            if things[nearest].count > 1:  # "between two trees"
                places[row] = _next_to(places[nearest])
            elif len(ends) > 1:
                places[row] = _between(*(places[end] for end in ends))
    return places


def _next_to(place: Row) -> Row:
    """Return the direction of what is next to a thing in some direction."""
    error = math.hypot(place.get("bearing_error", 0.0), NEXT_ERROR)
    return {**place, "bearing_error": error} if place else {}


def _between(first: Row, second: Row) -> Row:
    """Return the direction of what is between two directions; empty where these do not say it."""
    for name in ("bearing", "offset"):
        if name in first and name in second:
            width = signed_turn(first[name], second[name])
            ends = [place.get("bearing_error", 0.0) for place in (first, second)]
            error = math.hypot(width / math.sqrt(12), *ends)
            if error and abs(width) < FULL_TURN / 2:
                middle = (first[name] + width / 2) % FULL_TURN
                turned = name == "offset" and middle > FULL_TURN / 2
                return {name: middle - turned * FULL_TURN, "bearing_error": error}
    return {}
