"""The parts of a sentence, each about one thing, and what each says of it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from semsig_gis.core import FULL_TURN, WILDCARD, InputError, UnknownNameError
from semsig_gis.observation.sentence_items import (
    METRES,
    SEPARATORS,
    UNITS,
    Item,
    longest_phrase,
)
from semsig_gis.observation.vocabulary import STREET_SIGN

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.core import SemsigError, Taxonomy
    from semsig_gis.observation.vocabulary import Codes, Vocabulary
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

RIGHT, HOURS = 90.0, 12
MOST_COUNT = 20
# Attributes of `Part` by kind of item: directions, and what a phrase says of the part.
DIRECTIONS = {"compass": "points", "turn": "turns", "hours": "hours", "degrees": "degrees"}
SINGLE = ([1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 1, 0, 1])
"""Numbers of directions of these kinds that are a single direction."""
FLAGS = {"none": "absent", "or": "either", "facing": "facing", "within": "within"}
RELATIONS = frozenset({"with", "next", "between", "amid", "opposite"})
THINGS = frozenset({"thing", "symbol", "sign", "text"})
Steps = tuple[int, ...]
"""From a thing to those that its direction follows from, in the order of the sentence."""
BEFORE: Steps = (-1,)
NEXT_TWO: Steps = (1, 2)
LAST_TWO: Steps = (-2, -1)
ADJECTIVES_FIRST = frozenset({"en", "de"})
"""Languages in which a word after a thing makes another thing of it, such as "tree stump"."""
_DIRECTIONS = (
    "give degrees (at 40, 20 left), a compass point (NE), a time on a clock (3 o'clock), left, "
    "right, ahead or behind"
)


def point_error(bearing: float) -> float:
    """Return the standard deviation of a point of the compass."""
    return FINE_POINT_ERROR if bearing % (RIGHT / 2.0) else POINT_ERROR


def signed_turn(first: float, second: float) -> float:
    """Return the turn from a direction to another, from -180 degrees."""
    return (second - first + FULL_TURN / 2) % FULL_TURN - FULL_TURN / 2


def _point_between(points: list[float]) -> list[float]:
    """Return a point such as north north-east for the two in its name, others as they are."""
    if len(points) == 2 and abs(turn := signed_turn(*points)) == RIGHT / 2:  # noqa: PLR2004
        return [(points[0] + turn / 2) % FULL_TURN]
    return points


def _absent_unnamed(text: str) -> InputError:
    return InputError(
        f"{text!r} does not say what is not in sight; name it, such as 'no bench, no tree', or "
        "leave this out."
    )


def without_thing(text: str) -> InputError:
    """Return the error for words without a thing."""
    return InputError(
        f"{text!r} does not say what is there; say what was seen where, such as 'bench at 40', and "
        "give each thing its own direction."
    )


def parts_of(items: Iterable[Item], vocabulary: Vocabulary, taxonomy: Taxonomy) -> Iterator[Part]:
    """Yield the parts of a sentence."""
    joined, group = False, list[Item]()
    for item in (*items, Item("end", None, "")):
        if item.kind not in SEPARATORS:
            group.append(item)
            continue
        for clause, near in _clauses(group):
            yield _part(clause, vocabulary, taxonomy, near=near, joined=joined)
            joined = False
        joined, group = item.kind == "also", []


def _clauses(items: Sequence[Item]) -> Iterator[tuple[list[Item], Steps]]:
    """Yield the items about each of the things that words such as "next to" relate.

    With each are the steps to the things that its direction follows from.
    """
    clause, near = list[Item](), Steps()
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
    items: list[Item], vocabulary: Vocabulary, taxonomy: Taxonomy, *, near: Steps, joined: bool
) -> Part:
    """Collect the items of a part."""
    kinds = {item.kind for item in items}
    part = Part(
        text=" ".join(item.text for item in items),
        near=near,
        joined=joined,
        sides="sides" in kinds,
        turns=[-RIGHT] if "sides" in kinds else [],
        bare=_bare_point(items, vocabulary),
    )
    has_thing = bool(kinds & {"thing", "sign"})
    codes_of: dict[str, Codes] = {item.name: (item.code,) for item in taxonomy.classes}
    before = ""
    while items:
        item, *items = items
        if item.kind == "symbol":  # a letter before a thing is a word: "a bench"
            _, item = (
                longest_phrase([item.text], vocabulary)
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
            elif has_thing or "text" in kinds or "other" not in kinds:
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


def _bare_point(items: Sequence[Item], vocabulary: Vocabulary) -> tuple[str, float] | None:
    """Return the direction that the letter of a class may be, such as S; None for other items."""
    if len(items) != 1 or items[0].kind != "symbol" or items[0].text not in vocabulary.letters:
        return None
    return "points", vocabulary.letters[items[0].text]


@dataclass(eq=False, slots=True, kw_only=True)
class Part:
    """A part of a sentence about one thing.

    `things` are the class codes of each thing. `words` are those for things and those without a
    meaning, each with the number of its run, which ends at a direction. `either` is whether it has
    a word such as "or". `points`, `turns`, `hours` and `degrees` are directions; `heading` is the
    direction of sight, and `heading_error` its standard deviation. `bare` is a number without a
    unit or a thing, `sides` whether things are on both sides. `joined` is whether the part follows
    a word such as "and", `led` whether its direction comes before its thing, and `split` whether
    there are directions before and after it, as in "left turn sign ahead". `read` is what is
    written on the thing, and `sign` the name of its class if that is what it is known by; `near`
    are the steps to the things that its direction follows from, if it has none. `skipped` are the
    last words without a meaning, `gaps` those between a thing and the next; `head` is the thing
    that a compound is, such as the entrance in "hotel entrance". A part with a `fault` is left out:
    `lost` says why.
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
    bare: tuple[str, float] | None = None
    sides: bool = False
    range: str | None = None
    words: list[tuple[int, Item]] = field(default_factory=list)
    run: int = 0
    skipped: list[str] = field(default_factory=list)
    gaps: list[str] = field(default_factory=list)
    head: str = ""
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
        if self.head:
            notes.append(f"{self.text!r} was taken as {self.head!r}.")
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

    def can_take(self, other: Part) -> bool:
        """Return whether another part without a thing says something new about this thing."""
        return not (
            self.absent
            or (self.directed and other.directed)
            or (self.range is not None and other.range is not None)
        )

    def take(self, other: Part) -> None:
        """Add the direction and the distance of another part; InputError if there are others."""
        if not self.can_take(other):
            raise without_thing(other.text)
        self.text += f", {other.text}"
        for name in DIRECTIONS.values():
            getattr(self, name).extend(getattr(other, name))
        self.range = self.range or other.range

    def directions_after(self, parts: Sequence[Part]) -> list[Part]:
        """Return those parts after it that say only where more of its things are.

        They are of one kind and end with "and", as in "trees at 40, 80 and 120", or with the last
        of the things that were counted. InputError if their number is another.
        """
        if self.sides:
            more = [Part(text="", joined=True, turns=[RIGHT], degrees=self.degrees)]
        else:
            more = [*itertools.takewhile(self._continues, parts)]
            following = next(iter(parts[len(more) :]), None)
            # The last direction may be that of the next thing.
            if following and not (following.joined or following.says_where or following.near):
                return []
            if not more or not (more[-1].joined or self.count == 1 + len(more)):
                return []
        if self.count not in {1, 1 + len(more)}:
            raise InputError(
                f"{', '.join(part.text for part in (self, *more) if part.text)!r} says "
                f"{1 + len(more)} directions of {self.count} things; give each its own direction."
            )
        self.count = 1
        return more

    def _continues(self, other: Part) -> bool:
        """Return whether another part says only a direction, of the same kind as its own."""
        if self.led or self.absent or self.near or self.either or other.near:
            return False
        has_thing = other.things and other.bare is None
        if has_thing or other.read or other.others or other.absent or other.either or other.facing:
            return False
        own, more = ([*map(len, part.directions())] for part in (self, other))
        if other.bare is not None:
            return sum(own) == len(getattr(self, other.bare[0])) == 1 and not any(more)
        if own != more or own not in SINGLE:
            return False
        # Ahead and to the left may be a single direction.
        return own != [0, 1, 0, 0] or abs(self.turns[0] - other.turns[0]) == FULL_TURN / 2.0

    def directions(self) -> list[list[float]]:
        """Return its directions by kind; degrees are the last."""
        return [getattr(self, name) for name in DIRECTIONS.values()]

    def at(self, other: Part) -> Part:
        """Return the same thing in the direction of another part."""
        part = replace(self, range=other.range)
        part.points, part.turns, part.hours, part.degrees = other.directions()
        if other.bare is not None:
            name, value = other.bare
            setattr(part, name, [value])
        return part

    def unit(self, number: Item, before: str, following: Sequence[Item]) -> str:
        """Return the unit of a number without one: hours, degrees or a count of things.

        A number that may be anything is left out, with its part.
        """
        after = next((item.kind for item in following if item.kind not in {"skip", "at"}), "")
        if before == "clock":
            return "hours"
        # Two things on the left are not 2 degrees to the left.
        digits = number.text[-1].isdigit()
        if digits and (before == "at" or after == "turn"):
            return "degrees"
        whole = number.value in range(MOST_COUNT + 1)
        if whole and not self.things and after in {"thing", "symbol", "other"}:
            return "count"
        if digits and before == "turn":
            return "degrees"
        self.bare = "degrees", number.value
        self.lost = f"the number {number.text} is not clear"
        self.fault = InputError(
            f"the number {number.text} in {self.text!r} is not clear; write 'at 40' or '40 left' "
            f"for degrees, '40 m' for metres, or '4 benches', up to {MOST_COUNT}."
        )
        return "skip"

    def add(self, item: Item) -> None:
        """Add a phrase, a thing, or a number with its unit as its kind."""
        kind, value = item.kind, item.value
        if kind in {"thing", "other"}:
            self._add_word(item)
            return
        if kind == "skip":
            self.skipped.append(item.text)
            return
        self.run += 1
        if kind in {"compass", "degrees"} and self.facing and self.heading is None:
            self.heading = value
            self.heading_error = point_error(value) if kind == "compass" else 0.0
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

    def _add_word(self, item: Item) -> None:
        run, previous = self.words[-1] if self.words else (-1, item)
        if item.kind == previous.kind == "thing" and run == self.run:
            self.gaps.append(" ".join(self.skipped))
        self.skipped = []
        self.words.append((self.run, item))
        self.led = self.directed
        self.things += [item.value] if item.kind == "thing" else []

    def _add_metres(self, metres: float) -> None:
        if self.range is not None and self.range.endswith(" m"):
            raise InputError(f"{self.text!r} has two distances; give one.")
        self.range = f"within {metres:g} m" if self.within else f"{metres:g} m"

    def check(self, vocabulary: Vocabulary, last: Part | None) -> None:
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
        if self.fault is None and ((self.absent and not self.either) or not self.codes):
            self._take_head(vocabulary)
        if self.fault is None and not self.codes:
            self.lost = "it names several things; put a comma between them"
            self.fault = InputError(
                f"{self.text!r} names several things; put a comma between them, and give each its "
                "own direction."
            )

    def _take_head(self, vocabulary: Vocabulary) -> None:
        """Take a compound of two things, such as "hotel entrance", for the thing that it is."""
        if not (len(self.things) == 2 and len(self.gaps) == 1 and (self.directed or self.absent)):  # noqa: PLR2004
            return
        last = vocabulary.language in ADJECTIVES_FIRST
        # In Romance languages, a form of "of" is between: de, du, del, della, do.
        if self.gaps[0] if last else not self.gaps[0].lower().startswith("d"):
            return
        head = -1 if last else 0
        self.head = [item.text for _, item in self.words if item.kind == "thing"][head]
        self.things = [self.things[head]]

    def _check_absent(self, last: Part | None) -> None:
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
        turns, degrees = self.turns, self.degrees
        points = _point_between(self.points)
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
                place = {"bearing": points[0], "bearing_error": point_error(points[0])}
            case 0, 0, 0, 1 if 1 <= self.hours[0] <= HOURS:
                offset = self.hours[0] % HOURS * (FULL_TURN / HOURS)
                place = {"offset": offset, "bearing_error": HOUR_ERROR}
        directions = sum(map(len, self.directions()))
        if place is None or (directions > 1 and (self.either or self.split)):
            if self.fault is not None:
                return {}
            raise self.unclear()
        return place

    def unclear(self) -> InputError:
        """Return the error for directions that do not fit together."""
        return InputError(f"the direction in {self.text!r} is not clear; {_DIRECTIONS}.")
