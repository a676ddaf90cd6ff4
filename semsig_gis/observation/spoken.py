"""Sentences of a person: what was seen where, and what is not there.

A sentence is split into items (things, directions, numbers, ...), each the longest phrase that the
vocabulary has. The items between commas, and words such as "and", are a part, with one thing.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from semsig_gis.core import FULL_TURN, WILDCARD, InputError, UnknownNameError
from semsig_gis.observation.vocabulary import LONGEST, Vocabulary
from semsig_gis.sources import class_code

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.storage import Row

Codes = tuple[int, ...]

# Standard deviations in degrees of directions in words, which are uniform to either side.
SIDE_ERROR = 26.0
"""Left, right, ahead and behind: up to 45 degrees."""
POINT_ERROR = 13.0
"""The eight points of the compass, and between two sides: up to 22.5 degrees."""
FINE_POINT_ERROR = 6.5
"""The eight points between them: up to 11.25 degrees."""
HOUR_ERROR = 8.7
"""An hour on a clock: up to 15 degrees."""

RIGHT, HOURS = 90.0, 12
MOST_COUNT, MOST_ADJECTIVES = 20, 2
UNITS = frozenset({"metres", "degrees", "hours"})
# Attributes of `_Part` by kind of item: directions, and what a phrase says of the part.
DIRECTIONS = {"compass": "points", "turn": "turns", "hours": "hours", "degrees": "degrees"}
FLAGS = {"none": "absent", "or": "either", "facing": "facing", "within": "within"}
SEPARATORS = frozenset({"end", "also"})
ADJECTIVES_FIRST = frozenset({"en", "de"})
"""Languages in which a word after a thing makes another thing of it, such as "tree stump"."""

_TOKEN = re.compile(
    r"(?P<tag>[\w:]+ ?= ?[\w:*]+)"
    r"|(?P<number>\(\d+\)|(?<!\w)[-+]?\d+(?:\.\d+|,\d+(?=\s*(?:°|m\b|(?:met|mèt|deg|grad|grau))))?|\d+(?:\.\d+)?)"
    r"|(?P<word>[^\W\d_]+(?:_[^\W\d_]+)*|[°@?])"
    r"|(?P<end>[,;!.\n])"
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
    the sentence gives it; `notes` are on words that were not used. `unplaced` and `absent` are the
    class codes of objects that were seen in an unknown direction, if others have one, and of those
    that are not in sight.
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
        If a part names no class.
    InputError
        If something else in a part is not understood.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> sentence = read_sentence("2 green benches on the left, a lamp, no tree", paper_taxonomy())
    >>> [(item["class"], item["offset"]) for item in sentence.row["detections"]]
    [('L', -90.0), ('L', -90.0)]
    >>> sentence.unplaced, sentence.absent, sentence.notes
    ((3,), (1,), ("'green' was not used.",))
    """
    tokens = [*_TOKEN.finditer(text.replace("º", "°"))]
    vocabulary = Vocabulary.of([match["word"] for match in tokens if match["word"]], taxonomy)
    parts = [*_parts(_items(tokens, vocabulary, taxonomy), vocabulary)]
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
    return _sentence(things, look, taxonomy)


def _things(parts: Iterable[_Part], vocabulary: Vocabulary) -> list[_Part]:
    """Return the parts with a thing; the others give them their direction or distance."""
    things: list[_Part] = []
    waiting: _Part | None = None  # a direction before its thing
    for part in parts:
        last = things[-1] if things else None
        if part.codes or part.others or part.absent:
            part.check(vocabulary, last)
            if waiting is not None:
                part.take(waiting)
                part.led, waiting = True, None
            things.append(part)
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
    elsewhere = [thing for thing in things if thing.elsewhere]
    things = [thing for thing in things if not thing.elsewhere]
    if elsewhere and not things:
        words = ", ".join(thing.elsewhere for thing in elsewhere)
        raise InputError(f"the map has no {words}; say what else is there.")
    notes = [
        f"{thing.text!r} was not used, because the map has no {thing.elsewhere}."
        for thing in elsewhere
    ]
    pairs = [(thing, thing.place()) for thing in things if not thing.absent]
    rows: list[Row] = [
        {"class": taxonomy.decode(thing.codes), **place, "range": thing.range}
        for thing, place in pairs
        if place
        for _ in range(thing.count)
    ]
    if look and any("bearing" in row for row in rows):
        # Of directions from north, only those from the direction of sight have its error.
        look = dict(look)
        error = look.pop("heading_error", 0.0)
        for row in rows:
            if "offset" in row and error:
                row["bearing_error"] = math.hypot(row.get("bearing_error", 0.0), error)
    others = [thing for thing, place in pairs if not place]
    unplaced = [code for thing in others for code in thing.codes * thing.count]
    if not rows:
        rows, unplaced = [{"class": taxonomy.decode([code])} for code in unplaced], []
    notes += [f"{word!r} was not used." for thing in things for word in thing.others]
    if WILDCARD in unplaced:
        notes.append("something in an unknown direction was not used.")
    notes += [
        f"the distance in {thing.text!r} was not used, because it has no direction."
        for thing in others
        if thing.range is not None
    ]
    return Sentence(
        row={"detections": rows, **look},
        notes=tuple(notes),
        unplaced=tuple(code for code in unplaced if code != WILDCARD),
        absent=tuple(code for thing in things if thing.absent for code in thing.codes),
    )


def _elsewhere(part: _Part, vocabulary: Vocabulary) -> str:
    """Return the words of a part for a class that only other cities have.

    UnknownNameError if there are none.
    """
    if not part.others:
        raise _absent_unnamed(part.text)
    if words := vocabulary.elsewhere(part.others):
        return words
    word = " ".join(part.others)
    raise UnknownNameError(
        f"class {word!r} is unknown{vocabulary.nearest(word)}; `semsig info` lists the classes of "
        "a city, and `semsig sources` those of a catalogue."
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Item:
    """A phrase of a sentence, with a kind of the vocabulary or one of these.

    A "thing", a "symbol" of a class, a "number", an "other" word, or the "end" of a part.
    """

    kind: str
    value: Any
    text: str


def _items(
    tokens: Sequence[re.Match[str]], vocabulary: Vocabulary, taxonomy: Taxonomy
) -> Iterator[_Item]:
    """Yield the longest phrases and things, from left to right."""
    symbols = {item.symbol: item.code for item in taxonomy.classes} | {"?": WILDCARD}
    place, first, numbered = 0, True, False  # whether a symbol or a unit may come next
    while place < len(tokens):
        token, text, size = tokens[place], tokens[place].group(), 1
        if token["end"]:
            item = _Item("end", None, text)
        elif token["number"]:
            if _UNCLEAR.search(text):
                raise InputError(f"the number {text} is not clear; write 1000 or 1.5, for example.")
            item = _Item("number", float(text.replace(",", ".")), text)
        elif token["tag"]:
            item = _Item("thing", class_code(text, taxonomy), text)
        else:
            following = tokens[place : place + LONGEST]
            words = [*itertools.takewhile(bool, (other["word"] for other in following))]
            size, item = _phrase(words, vocabulary, numbered=numbered)
            if first and size == 1 and text in symbols:
                item = _Item("symbol", symbols[text], text)
        yield item
        numbered = item.kind == "number"
        first = item.kind in SEPARATORS or (first and item.kind in {"skip", "number", "none"})
        place += size


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
        if (code := vocabulary.class_of(words[:size])) is not None:
            return size, _Item("thing", code, text)
        if meaning:
            return size, _Item(*meaning, text)
    return 1, _Item("other", None, words[0])


def _parts(items: Iterable[_Item], vocabulary: Vocabulary) -> Iterator[_Part]:
    """Yield the parts of a sentence."""
    joined, group = False, list[_Item]()
    for item in (*items, _Item("end", None, "")):
        if item.kind not in SEPARATORS:
            group.append(item)
            continue
        if group:
            yield _part(group, vocabulary, joined=joined)
        joined, group = item.kind == "also", []


def _part(items: list[_Item], vocabulary: Vocabulary, *, joined: bool) -> _Part:
    """Collect the items of a part."""
    part = _Part(text=" ".join(item.text for item in items), joined=joined)
    has_thing = any(item.kind == "thing" for item in items)
    before = ""
    while items:
        item, *items = items
        if item.kind == "symbol":  # a letter before a thing is a word: "a bench"
            _, item = (
                _phrase([item.text], vocabulary) if has_thing else (1, replace(item, kind="thing"))
            )
        elif item.kind == "number":
            unit = items[0].kind if items else ""
            if unit in UNITS:
                del items[0]
            else:
                unit = part.unit(item, before, items)
            item = replace(item, kind=unit if unit != "count" or item.value else "none")
        elif item.kind in UNITS:
            item = replace(item, kind="other")
        part.add(item)
        before = item.kind
    if before == "at" and part.codes:
        raise InputError(f"{part.text!r} ends before it says where; {_DIRECTIONS}.")
    return part


@dataclass(eq=False, slots=True, kw_only=True)
class _Part:
    """A part of a sentence about one thing.

    `words` are those for things and those without a meaning, each with the number of its run, which
    ends at a direction. `either` is whether it has a word such as "or". `points`, `turns`, `hours`
    and `degrees` are directions; `heading` is the direction of sight, and `heading_error` its
    standard deviation. `joined` is whether the part follows a word such as "and", `led` whether its
    direction comes before its thing, and `split` whether there are directions before and after it,
    as in "left turn sign ahead". `elsewhere` are words for a thing that only other cities have.
    """

    text: str
    joined: bool
    codes: list[int] = field(default_factory=list)
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
    elsewhere: str = ""

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
        """Return the unit of a number without one: hours, degrees or a count of things."""
        after = next((item.kind for item in following if item.kind not in {"skip", "at"}), "")
        if before == "clock":
            return "hours"
        if before == "at" or after == "turn":
            return "degrees"
        whole = number.value in range(MOST_COUNT + 1)
        if whole and not self.codes and after in {"thing", "symbol", "other"}:
            return "count"
        if before == "turn":
            return "degrees"
        raise InputError(
            f"the number {number.text} in {self.text!r} is not clear; write 'at 40' or '40 left' "
            f"for degrees, '40 m' for metres, or '4 benches', up to {MOST_COUNT}."
        )

    def add(self, item: _Item) -> None:
        """Add a phrase, a thing, or a number with its unit as its kind."""
        kind, value = item.kind, item.value
        if kind in {"thing", "other"}:
            self.words.append((self.run, item))
            self.led = self.directed
            self.codes += [value] if kind == "thing" else []
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
        elif kind == "count":
            self.count = int(value)
        elif kind == "metres":
            if self.range is not None and self.range.endswith(" m"):
                raise InputError(f"{self.text!r} has two distances; give one.")
            self.range = f"within {value:g} m" if self.within else f"{value:g} m"
        elif kind == "range":
            self.range = self.range or value

    def check(self, vocabulary: Vocabulary, last: _Part | None) -> None:
        """Raise InputError for words that are not understood, or for several things."""
        if not self.codes:
            self.elsewhere = _elsewhere(self, vocabulary)
            return
        runs = {run for run, item in self.words if item.kind != "other"}
        strange = [item.text for run, item in self.words if run not in runs]
        if vocabulary.language in ADJECTIVES_FIRST:
            strange += [
                word.text
                for (run, item), (next_run, word) in itertools.pairwise(self.words)
                if run == next_run and item.kind != "other" and word.kind == "other"
            ]
        if strange or len(self.others) > MOST_ADJECTIVES:
            strange = strange or self.others
            raise InputError(
                f"{' '.join(strange)!r} in {self.text!r} is not understood; {_DIRECTIONS}."
            )
        if len(self.codes) > 1 and not self.absent:
            raise InputError(
                f"{self.text!r} names several things; put a comma between them, and give each its "
                "own direction."
            )
        if self.absent and WILDCARD in self.codes:
            raise _absent_unnamed(self.text)
        if self.absent and self.others:
            raise InputError(
                f"{' '.join(self.others)!r} in {self.text!r} is not understood; say 'no' only "
                "where nothing of that class is in sight."
            )
        if self.absent and self.says_where:
            raise InputError(
                f"{self.text!r} says where something is not; say only what is nowhere in sight."
            )
        if self.joined and last is not None and last.absent and not (self.absent or self.directed):
            raise InputError(
                f"{self.text!r} follows {last.text!r}; say 'no' before each thing that is not in "
                "sight, or put a comma before one that is."
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
            raise self.unclear()
        return place

    def unclear(self) -> InputError:
        """Return the error for directions that do not fit together."""
        return InputError(f"the direction in {self.text!r} is not clear; {_DIRECTIONS}.")
