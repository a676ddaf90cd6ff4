"""Sentences of a person: what was seen where, and what is not there.

A sentence is split into items (things, directions, numbers, ...), each the longest phrase that the
vocabulary has. The items between commas, and words such as "and" and "next to", are a part, with
one thing. A part that is not understood is left out, with a note.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from semsig_gis.core import (
    FULL_TURN,
    WILDCARD,
    InputError,
    UnknownNameError,
    wrap_degrees,
)
from semsig_gis.observation.vocabulary import (
    HOUSE_NUMBER,
    LONGEST,
    STREET_SIGN,
    Vocabulary,
)
from semsig_gis.sources import class_codes

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.core import (
        SemsigError,
        Taxonomy,
    )
    from semsig_gis.observation.vocabulary import (
        Codes,
    )
    from semsig_gis.storage import Row

# Standard deviations in degrees of directions in words, which are uniform to either side.
SIDE_ERROR = 26.0
"""Left, right, ahead and behind: up to 45 degrees."""
POINT_ERROR = 13.0
"""The eight points of the compass, and between two sides: up to 22.5 degrees."""
FINE_POINT_ERROR = 6.5
"""The eight points between them: up to 11.25 degrees."""
HOUR_ERROR = 8.7
"""An hour on a clock: up to 15 degrees."""
NEXT_ERROR = 15.0
"""Next to another thing: some metres at a usual distance."""
ANY_ERROR = FULL_TURN / 2.0
"""An unknown direction."""

RIGHT, HOURS = 90.0, 12
MOST_COUNT = 20
METRES = {"metres": 1.0, "kilometres": 1000.0}
"""Metres of each unit of distance."""
"""Metres of each unit of distance."""
UNITS = frozenset({*METRES, "degrees", "hours"})
# Attributes of `_Part` by kind of item: directions, and what a phrase says of the part.
DIRECTIONS = {"compass": "points", "turn": "turns", "hours": "hours", "degrees": "degrees"}
FLAGS = {"none": "absent", "or": "either", "facing": "facing", "within": "within"}
SEPARATORS = frozenset({"end", "also"})
RELATIONS = frozenset({"with", "next", "between", "amid", "opposite"})
THINGS = frozenset({"thing", "symbol", "sign", "text"})
Steps = tuple[int, ...]
"""From a thing to those that its direction follows from, in the order of the sentence."""
BEFORE: Steps = (-1,)
NEXT_TWO: Steps = (1, 2)
LAST_TWO: Steps = (-2, -1)
ADJECTIVES_FIRST = frozenset({"en", "de"})
"""Languages in which a word after a thing makes another thing of it, such as "tree stump"."""

_TOKEN = re.compile(
    # A quotation; ' and \u2019 are apostrophes as well.
    r"(?P<text>\"[^\"\n]+\"|[\u201c\u201e][^\u201c-\u201e\n]+[\u201c\u201d]"
    r"|\u00ab[^\u00ab\u00bb\n]+\u00bb|\u00bb[^\u00ab\u00bb\n]+\u00ab"
    r"|(?<!\w)['\u2018\u201a](?=[^\s'\u2019])[^\n]*?(?<=\S)['\u2018\u2019](?!\w))"
    # A quotation mark that is not closed, and the word after it.
    r"|(?P<open>(?:[\"\u201c\u201e\u00ab]|(?<!\w)['\u2018\u201a])[^\s'\u2019,;!.]+)"
    r"|(?P<tag>[\w:]+ ?= ?[\w:*]+)"
    r"|(?P<number>\(\d+\)|(?<!\w)[-+]?\d+(?:\.\d+|,\d+(?=\s*(?:°|k?m\b|(?:kil|quil|chil|met|mèt|deg|grad|grau))))?|\d+(?:\.\d+)?)"
    r"|(?P<word>[^\W\d_]+(?:_[^\W\d_]+)*|[°@?])"
    r"|(?P<end>[,;!.\n])"
)
# What is written on a house: 12, 12a, 12 bis, 12-14.
_HOUSE = re.compile(
    r"\s*(?P<text>\d{1,5}(?:[a-z](?!\w)|\s?(?:bis|ter|quater)\b)?(?:[-/]\d{1,5}[a-z]?)?)"
    r"(?![\w.,]*\w|\s*(?:°|k?m\b|kil|quil|chil|met|mèt|deg|grad|grau))",
    re.IGNORECASE,
)
_UNCLEAR = re.compile(r"[()]|,\d{3}$")
_DIRECTIONS = (
    "give degrees (at 40, 20 left), a compass point (NE), a time on a clock (3 o'clock), left, "
    "right, ahead or behind"
)


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
    church", its direction is unknown. Words that are not understood are left out, with a note;
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
    matches = [*_TOKEN.finditer(text.replace("º", "°"))]
    tokens = [match for match in matches if not match["open"]]
    vocabulary = Vocabulary.of([match["word"] for match in tokens if match["word"]], taxonomy)
    parts = [*_parts(_items(tokens, vocabulary, taxonomy), vocabulary, taxonomy)]
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
        raise _without_thing(text)
    sentence = _sentence(things, look, taxonomy)
    unclosed = (
        f"the quotation mark before {match['open'][1:]!r} is not closed, so what was read was not "
        "used."
        for match in matches
        if match["open"]
    )
    return replace(sentence, notes=(*unclosed, *sentence.notes))


def _things(parts: Iterable[_Part], vocabulary: Vocabulary) -> list[_Part]:
    """Return the parts with a thing; the others give them their direction or distance."""
    things: list[_Part] = []
    waiting: _Part | None = None  # a direction before its thing
    for part in parts:
        last = things[-1] if things else None
        if part.things or part.read or part.others or part.absent:
            part.check(vocabulary, last)
            if waiting is not None:
                part.take(waiting)
                part.led, waiting = True, None
            things.append(part)
        elif part.fault is not None:
            raise part.fault
        elif not part.says_where:
            continue
        elif last is not None and last.can_take(part):
            last.take(part)
        elif part.joined and last is not None and not (last.absent or last.led):
            raise _without_thing(part.text)
        elif waiting is not None:
            waiting.take(part)
        else:
            waiting = part
    if waiting is not None:
        raise _without_thing(waiting.text)
    return things


def _point_error(bearing: float) -> float:
    """Return the standard deviation of a point of the compass."""
    return FINE_POINT_ERROR if bearing % (RIGHT / 2.0) else POINT_ERROR


def _absent_unnamed(text: str) -> InputError:
    return InputError(
        f"{text!r} does not say what is not in sight; name it, such as 'no bench, no tree', or "
        "leave this out."
    )


def _without_thing(text: str) -> InputError:
    return InputError(
        f"{text!r} does not say what is there; say what was seen where, such as 'bench at 40', and "
        "give each thing its own direction."
    )


def _sentence(things: Sequence[_Part], look: Row, taxonomy: Taxonomy) -> Sentence:
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
    notes += [note for thing, place in sights for note in thing.notes(place)]
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
        notes=tuple(notes),
        unplaced=tuple(code for code in unplaced if code != WILDCARD),
        absent=tuple(code for thing, _ in pairs if thing.absent for code in thing.codes),
    )


def _places(things: Sequence[_Part]) -> list[Row]:
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
            width = float(wrap_degrees(second[name] - first[name] + FULL_TURN / 2)) - FULL_TURN / 2
            ends = [place.get("bearing_error", 0.0) for place in (first, second)]
            error = math.hypot(width / math.sqrt(12), *ends)
            if error and abs(width) < FULL_TURN / 2:
                middle = (first[name] + width / 2) % FULL_TURN
                turned = name == "offset" and middle > FULL_TURN / 2
                return {name: middle - turned * FULL_TURN, "bearing_error": error}
    return {}


@dataclass(frozen=True, eq=False, slots=True)
class _Item:
    """A phrase of a sentence, with a kind of the vocabulary or one of these.

    A "thing" with its class codes, a "symbol" of a class, a "sign" with the name of its class, the
    "text" on a thing, a "number", an "other" word, or the "end" of a part.
    """

    kind: str
    value: Any
    text: str


def _items(
    tokens: Sequence[re.Match[str]], vocabulary: Vocabulary, taxonomy: Taxonomy
) -> Iterator[_Item]:
    """Yield the longest phrases and things, from left to right."""
    symbols = {item.symbol: (item.code,) for item in taxonomy.classes} | {"?": (WILDCARD,)}
    place, first, numbered = 0, True, False  # whether a symbol or a unit may come next
    while place < len(tokens):
        token, text, size = tokens[place], tokens[place].group(), 1
        if token["end"]:
            item = _Item("end", None, text)
        elif token["text"]:
            item = _Item("text", text[1:-1].strip(), text)
        elif token["number"]:
            if _UNCLEAR.search(text):
                raise InputError(f"the number {text} is not clear; write 1000 or 1.5, for example.")
            item = _Item("number", float(text.replace(",", ".")), text)
        elif token["tag"]:
            item = _Item("thing", class_codes(text, taxonomy), text)
        else:
            following = tokens[place : place + LONGEST]
            words = [*itertools.takewhile(bool, (other["word"] for other in following))]
            size, item = _phrase(words, vocabulary, numbered=numbered)
            plain = item.kind in {"thing", "other", "compass"} or text.isupper()
            if first and size == 1 and plain and text in symbols:
                item = _Item("symbol", symbols[text], text)
        yield item
        place += size + _is_possessive(tokens[place + size : place + size + 1])
        if item.value == HOUSE_NUMBER and (
            house := _HOUSE.match(token.string, tokens[place - 1].end())
        ):
            yield _Item("text", house["text"], house["text"])
            while place < len(tokens) and tokens[place].start() < house.end():
                place += 1
        numbered = item.kind == "number"
        first = item.kind in SEPARATORS or (first and item.kind in {"skip", "number", "none"})


def _is_possessive(following: Sequence[re.Match[str]]) -> bool:
    """Return whether the s of a possessive follows, such as that of "baker's", or of "it's"."""
    return any(
        token.group() == "s" and token.string[token.start() - 1] in "'\u2019" for token in following
    )


def _phrase(
    words: Sequence[str], vocabulary: Vocabulary, *, numbered: bool = False
) -> tuple[int, _Item]:
    """Return the longest phrase or thing at the beginning of some words, and its length.

    After a number, a unit goes before a thing, as "Uhr" (clock) does in "3 Uhr".
    """
    for size in range(len(words), 0, -1):
        text = " ".join(words[:size])
        meaning = vocabulary.meaning(words[:size])
        if meaning and numbered and meaning[0] in UNITS:
            return size, _Item(*meaning, text)
        if (name := vocabulary.text_class(words[:size])) is not None:
            return size, _Item("sign", name, text)
        if (codes := vocabulary.codes_of(words[:size], own=meaning is not None)) is not None:
            return size, _Item("thing", codes, text)
        if meaning:
            return size, _Item(*meaning, text)
    return 1, _Item("other", None, words[0])


def _parts(items: Iterable[_Item], vocabulary: Vocabulary, taxonomy: Taxonomy) -> Iterator[_Part]:
    """Yield the parts of a sentence."""
    joined, group = False, list[_Item]()
    for item in (*items, _Item("end", None, "")):
        if item.kind not in SEPARATORS:
            group.append(item)
            continue
        for clause, near in _clauses(group):
            yield _part(clause, vocabulary, taxonomy, near=near, joined=joined)
            joined = False
        joined, group = item.kind == "also", []


def _clauses(items: Sequence[_Item]) -> Iterator[tuple[list[_Item], Steps]]:
    """Yield the items about each of the things that words such as "next to" relate.

    With each are the steps to the things that its direction follows from.
    """
    clause, near = list[_Item](), Steps()
    for row, item in enumerate(items):
        kinds = {other.kind for other in clause}
        rest = {other.kind for other in items[row + 1 :]}
        before, after = bool(kinds & THINGS), bool(rest & (THINGS - {"symbol"}))
        if item.kind not in RELATIONS:
            clause.append(item)
        elif item.kind == "opposite" and not (before and (after or "other" in rest)):
            clause.append(replace(item, kind="turn", value=0))
        elif item.kind == "with":
            if before and rest & {"thing", "sign"} and "none" not in kinds | rest:
                yield clause, near
                clause, near = [], BEFORE
        elif before and after and item.kind != "amid":
            yield clause, NEXT_TWO if item.kind == "between" else near
            clause, near = [], BEFORE if item.kind == "next" else Steps()
        elif before and "other" in rest:
            yield clause, near
            clause, near = [], Steps()
        elif item.kind != "opposite":
            near = BEFORE if item.kind == "next" else LAST_TWO
    if clause:
        yield clause, near


def _part(
    items: list[_Item], vocabulary: Vocabulary, taxonomy: Taxonomy, *, near: Steps, joined: bool
) -> _Part:
    """Collect the items of a part."""
    part = _Part(text=" ".join(item.text for item in items), near=near, joined=joined)
    kinds = {item.kind for item in items}
    has_thing = bool(kinds & {"thing", "sign"})
    codes_of: dict[str, Codes] = {item.name: (item.code,) for item in taxonomy.classes}
    before = ""
    while items:
        item, *items = items
        if item.kind == "symbol":  # a letter before a thing is a word: "a bench"
            _, item = (
                _phrase([item.text], vocabulary)
                if has_thing or "other" in kinds
                else (1, replace(item, kind="thing"))
            )
        elif item.kind == "sign":
            part.sign = item.value
            codes = codes_of.get(item.value)
            if codes is None and "text" not in kinds:
                codes = vocabulary.codes_of(item.text.split())
            item = replace(item, kind="thing", value=codes or (WILDCARD,))
        elif item.kind == "number":
            unit = items[0].kind if items else ""
            if unit in UNITS:
                del items[0]
            elif has_thing or "other" not in kinds:
                unit = part.unit(item, before, items)
            else:  # of a thing that is not known
                unit = "skip"
            item = replace(item, kind=unit if unit != "count" or item.value else "none")
        elif item.kind in UNITS:
            item = replace(item, kind="other")
        part.add(item)
        before = item.kind
    if before == "at" and part.things:
        raise InputError(f"{part.text!r} ends before it says where; {_DIRECTIONS}.")
    return part


@dataclass(eq=False, slots=True, kw_only=True)
class _Part:
    """A part of a sentence about one thing.

    `things` are the class codes of each thing. `words` are those for things and those without a
    meaning, each with the number of its run, which ends at a direction. `either` is whether it has
    a word such as "or". `points`, `turns`, `hours` and `degrees` are directions; `heading` is the
    direction of sight, and `heading_error` its standard deviation. `joined` is whether the part
    follows a word such as "and", `led` whether its direction comes before its thing, and `split`
    whether there are directions before and after it, as in "left turn sign ahead". `read` is what
    is written on the thing, and `sign` the name of its class if that is what it is known by; `near`
    are the steps to the things that its direction follows from, if it has none. A part with a
    `fault` is left out: `lost` says why.
    """

    text: str
    joined: bool
    near: Steps = ()
    things: list[Codes] = field(default_factory=list)
    read: str = ""
    sign: str = ""
    count: int = 1
    absent: bool = False
    either: bool = False
    facing: bool = False
    within: bool = False
    heading: float | None = None
    heading_error: float = 0.0
    points: list[float] = field(default_factory=list)
    turns: list[float] = field(default_factory=list)
    hours: list[float] = field(default_factory=list)
    degrees: list[float] = field(default_factory=list)
    range: str | None = None
    words: list[tuple[int, _Item]] = field(default_factory=list)
    run: int = 0
    led: bool = False
    split: bool = False
    fault: SemsigError | None = None
    lost: str = ""

    @property
    def codes(self) -> Codes:
        """The classes that the thing may be of; none where its words are for several things."""
        classes = [codes for codes in self.things if codes != (WILDCARD,)] or [(WILDCARD,)]
        first, *others = map(frozenset[int], classes)
        several = self.either or self.absent
        return tuple(sorted(first.union(*others) if several else first.intersection(*others)))

    @property
    def names_street(self) -> bool:
        """Whether it is the name on a street sign, where such signs are no objects."""
        return self.sign == STREET_SIGN and self.codes == (WILDCARD,)

    def row(self, taxonomy: Taxonomy) -> Row:
        """Return the thing as a detection, without a direction."""
        symbols = [taxonomy.decode([code]) for code in self.codes]
        share = 1.0 / len(symbols)
        row: Row = {"class": symbols[0] if len(symbols) == 1 else dict.fromkeys(symbols, share)}
        if self.directed and self.range is not None:
            row["range"] = self.range
        if self.read:
            row["text"] = self.read
        return row

    def notes(self, place: Row) -> list[str]:
        """Return remarks on what was not used; `place` is its direction."""
        notes = [f"{word!r} was not used." for word in self.others]
        if self.range is not None and not place:
            notes.append(
                f"the distance in {self.text!r} was not used, because it has no direction."
            )
        return notes

    @property
    def others(self) -> list[str]:
        """Words without a meaning."""
        return [item.text for _, item in self.words if item.kind == "other"]

    @property
    def directed(self) -> bool:
        """Whether it has a direction."""
        return bool(self.points or self.turns or self.hours or self.degrees)

    @property
    def says_where(self) -> bool:
        """Whether it has a direction or a distance."""
        return self.directed or self.range is not None

    def can_take(self, other: _Part) -> bool:
        """Return whether another part without a thing says something new about this thing."""
        return not (
            self.absent
            or (self.directed and other.directed)
            or (self.range is not None and other.range is not None)
        )

    def take(self, other: _Part) -> None:
        """Add the direction and the distance of another part; InputError if there are others."""
        if not self.can_take(other):
            raise _without_thing(other.text)
        self.text += f", {other.text}"
        for name in DIRECTIONS.values():
            getattr(self, name).extend(getattr(other, name))
        self.range = self.range or other.range

    def unit(self, number: _Item, before: str, following: Sequence[_Item]) -> str:
        """Return the unit of a number without one: hours, degrees or a count of things.

        A number that may be anything is left out, with its part.
        """
        after = next((item.kind for item in following if item.kind not in {"skip", "at"}), "")
        if before == "clock":
            return "hours"
        if before == "at" or after == "turn":
            return "degrees"
        whole = number.value in range(MOST_COUNT + 1)
        if whole and not self.things and after in {"thing", "symbol", "other"}:
            return "count"
        if before == "turn":
            return "degrees"
        self.lost = f"the number {number.text} is not clear"
        self.fault = InputError(
            f"the number {number.text} in {self.text!r} is not clear; write 'at 40' or '40 left' "
            f"for degrees, '40 m' for metres, or '4 benches', up to {MOST_COUNT}."
        )
        return "skip"

    def add(self, item: _Item) -> None:
        """Add a phrase, a thing, or a number with its unit as its kind."""
        kind, value = item.kind, item.value
        if kind in {"thing", "other"}:
            self.words.append((self.run, item))
            self.led = self.directed
            self.things += [value] if kind == "thing" else []
            return
        if kind == "skip":
            return
        self.run += 1
        if kind in {"compass", "degrees"} and self.facing and self.heading is None:
            self.heading = value
            self.heading_error = _point_error(value) if kind == "compass" else 0.0
        elif kind in DIRECTIONS:
            getattr(self, DIRECTIONS[kind]).append(value)
            self.split = self.led
        elif kind in FLAGS:
            setattr(self, FLAGS[kind], True)
        elif kind == "text":
            self.read = f"{self.read} {value}".strip()
        elif kind == "count":
            self.count = int(value)
        elif kind in METRES:
            self._add_metres(value * METRES[kind])
        elif kind == "range":
            self.range = self.range or value

    def _add_metres(self, metres: float) -> None:
        if self.range is not None and self.range.endswith(" m"):
            raise InputError(f"{self.text!r} has two distances; give one.")
        self.range = f"within {metres:g} m" if self.within else f"{metres:g} m"

    def check(self, vocabulary: Vocabulary, last: _Part | None) -> None:
        """Find what is not understood; InputError for several things, or contradictions."""
        if self.fault is None:
            self._check_thing(vocabulary)
        if self.fault is None:
            self._check_absent(last)

    def _check_thing(self, vocabulary: Vocabulary) -> None:
        """Find what is not understood, and several things."""
        if not self.things and self.read:
            self.things.append((WILDCARD,))
        if self.sign and not self.read and self.codes == (WILDCARD,):
            self._leave_out(vocabulary, self.sign.replace("_", " "))
        elif self.things:
            self._check_words(vocabulary)
        elif self.others:
            self._leave_out(vocabulary)
        else:
            raise _absent_unnamed(self.text)
        if self.fault is None and not self.codes:
            self.lost = "it names several things; put a comma between them"
            self.fault = InputError(
                f"{self.text!r} names several things; put a comma between them, and give each its "
                "own direction."
            )

    def _check_absent(self, last: _Part | None) -> None:
        """Refuse a contradiction in what is not in sight."""
        if self.absent and WILDCARD in self.codes:
            raise _absent_unnamed(self.text)
        placed = self.says_where or self.near
        if (self.absent and placed) or (last and last.absent and self.near == BEFORE):
            raise InputError(
                f"{self.text!r} says where something is not; say only what is nowhere in sight."
            )
        if self.joined and last is not None and last.absent and not (self.absent or self.directed):
            raise InputError(
                f"{self.text!r} follows {last.text!r}; say 'no' before each thing that is not in "
                "sight, or put a comma before one that is."
            )

    def _check_words(self, vocabulary: Vocabulary) -> None:
        """Leave the part out if another word makes something else of its thing."""
        strange = self.others if self.absent else []
        if vocabulary.language in ADJECTIVES_FIRST:
            strange = strange or [
                word.text
                for (run, item), (next_run, word) in itertools.pairwise(self.words)
                if run == next_run and item.kind != "other" and word.kind == "other"
            ]
        if strange:
            words = " ".join(strange)
            self.lost = f"{words!r} is not understood"
            self.fault = InputError(
                f"{words!r} in {self.text!r} is not understood; name the thing in another way, or "
                "leave it out."
            )

    def _leave_out(self, vocabulary: Vocabulary, name: str = "") -> None:
        """Say why the part is left out: its words are for nothing, or for what the map lacks."""
        if words := name or vocabulary.elsewhere(self.others):
            self.lost = f"the map has no {words}"
            self.fault = InputError(f"{self.lost}; say what else is there.")
            return
        word = " ".join(self.others)
        near = vocabulary.nearest(word)
        self.lost = f"{word!r} is unknown{near}"
        self.fault = UnknownNameError(
            f"class {word!r} is unknown{near}; `semsig info` lists the classes of a city, and "
            "`semsig sources` those of a catalogue."
        )

    def place(self) -> Row:
        """Return the direction as values of a detection; empty without any."""
        points, turns, degrees = self.points, self.turns, self.degrees
        place: Row | None = None
        match len(turns), len(degrees), len(points), len(self.hours):
            case 0, 0, 0, 0:
                place = {}
            case 0, 1, 0, 0:
                place = {"bearing": degrees[0]}
            case 1, 1, 0, 0 if abs(turns[0]) == RIGHT:
                place = {"offset": degrees[0] * turns[0] / RIGHT}
            case 1, 0, 0, 0:
                place = {"offset": float(turns[0]), "bearing_error": SIDE_ERROR}
            case 2, 0, 0, 0 if sorted(abs(turn) == RIGHT for turn in turns) == [False, True]:
                along, side = sorted(turns, key=lambda turn: abs(turn) == RIGHT)
                away = (along + RIGHT) / 2.0
                place = {"offset": math.copysign(away, side), "bearing_error": POINT_ERROR}
            case 0, 0, 1, 0:
                place = {"bearing": points[0], "bearing_error": _point_error(points[0])}
            case 0, 0, 0, 1 if 1 <= self.hours[0] <= HOURS:
                offset = self.hours[0] % HOURS * (FULL_TURN / HOURS)
                place = {"offset": offset, "bearing_error": HOUR_ERROR}
        directions = len(turns) + len(degrees) + len(points) + len(self.hours)
        if place is None or (directions > 1 and (self.either or self.split)):
            if self.fault is not None:
                return {}
            raise self.unclear()
        return place

    def unclear(self) -> InputError:
        """Return the error for directions that do not fit together."""
        return InputError(f"the direction in {self.text!r} is not clear; {_DIRECTIONS}.")
