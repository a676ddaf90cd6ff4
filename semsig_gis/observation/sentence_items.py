"""The items of a sentence: things, directions, numbers and other phrases.

Each is the longest phrase that the vocabulary has.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core import WILDCARD, InputError
from semsig_gis.observation.vocabulary import HOUSE_NUMBER, LONGEST
from semsig_gis.sources import class_codes

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.observation.vocabulary import Vocabulary

METRES = {"metres": 1.0, "kilometres": 1000.0}
"""Metres of each unit of distance."""
UNITS = frozenset({*METRES, "degrees", "hours"})
SEPARATORS = frozenset({"end", "also"})

# The beginnings of units; a number with a comma that has none may be two numbers.
_UNITS = r"\s*(?:°|k?m\b|kil|quil|chil|met|mèt|deg|grad|grau)"
_AND = r"(?:and|und|et|y|e|ed)\b"
TOKEN = re.compile(
    # A quotation; ' and \u2019 are apostrophes as well.
    r"(?P<text>\"[^\"\n]+\"|[\u201c\u201e][^\u201c-\u201e\n]+[\u201c\u201d]"
    r"|\u00ab[^\u00ab\u00bb\n]+\u00bb|\u00bb[^\u00ab\u00bb\n]+\u00ab"
    r"|(?<!\w)['\u2018\u201a](?=[^\s'\u2019])[^\n]*?(?<=\S)['\u2018\u2019](?!\w))"
    # A quotation mark that is not closed, and the word after it.
    r"|(?P<open>(?:[\"\u201c\u201e\u00ab]|(?<!\w)['\u2018\u201a])[^\s'\u2019,;!.]+)"
    r"|(?P<tag>[\w:]+ ?= ?(?!\d)[\w:*]+)"
    rf"|(?P<number>\(\d+\)|(?<!\w)[-+]?\d+(?:\.\d+|(?:,\d+)+(?=\s*(?:[,;.)]|$|{_AND})|{_UNITS}))?"
    r"|\d+(?:\.\d+)?)"
    r"|(?P<word>[^\W\d_]+(?:_[^\W\d_]+)*|[°@?])"
    r"|(?P<end>[,;!.\n])"
)
# What is written on a house: 12, 12a, 12 bis, 12-14.
_HOUSE = re.compile(
    r"\s*(?P<text>\d{1,5}(?:[a-z](?!\w)|\s?(?:bis|ter|quater)\b)?(?:[-/]\d{1,5}[a-z]?)?)"
    rf"(?![\w.,]*\w|{_UNITS})",
    re.IGNORECASE,
)
_UNCLEAR = re.compile(r"[()]|,\d{3}$")
_UNIT = re.compile(_UNITS)


@dataclass(frozen=True, eq=False, slots=True)
class Item:
    """A phrase of a sentence, with a kind of the vocabulary or one of these.

    A "thing" with its class codes, a "symbol" of a class, a "sign" with the name of its class, the
    "text" on a thing, a "number", an "other" word, or the "end" of a part.
    """

    kind: str
    value: Any
    text: str


def items_of(
    tokens: Sequence[re.Match[str]], vocabulary: Vocabulary, taxonomy: Taxonomy
) -> Iterator[Item]:
    """Yield the longest phrases and things, from left to right."""
    symbols = {item.symbol: (item.code,) for item in taxonomy.classes} | {"?": (WILDCARD,)}
    place, first, numbered = 0, True, False  # whether a symbol or a unit may come next
    while place < len(tokens):
        token, text, size = tokens[place], tokens[place].group(), 1
        if token["end"]:
            item = Item("end", None, text)
        elif token["text"]:
            item = Item("text", text[1:-1].strip(), text)
        elif token["number"]:
            item = Item("number", _number(token), text)
        elif token["tag"]:
            item = Item("thing", class_codes(text, taxonomy), text)
        else:
            following = tokens[place : place + LONGEST]
            words = [*itertools.takewhile(bool, (other["word"] for other in following))]
            size, item = longest_phrase(words, vocabulary, numbered=numbered)
            plain = item.kind in {"thing", "other", "compass"} or text.isupper()
            if first and size == 1 and plain and text in symbols:
                item = Item("symbol", symbols[text], text)
        yield item
        place += size + _is_possessive(tokens[place + size : place + size + 1])
        if item.value == HOUSE_NUMBER and (
            house := _HOUSE.match(token.string, tokens[place - 1].end())
        ):
            yield Item("text", house["text"], house["text"])
            while place < len(tokens) and tokens[place].start() < house.end():
                place += 1
        numbered = item.kind == "number"
        first = item.kind in SEPARATORS or (first and item.kind in {"skip", "number", "none"})


def _number(token: re.Match[str]) -> float:
    """Return the value of a number; InputError if it may have another."""
    text = token.group()
    if _UNCLEAR.search(text):
        raise InputError(f"the number {text} is not clear; write 1000 or 1.5, for example.")
    if "," in text and (text.count(",") > 1 or not _UNIT.match(token.string, token.end())):
        raise InputError(
            f"the number {text} is not clear; write 1.5, or '{text.replace(',', ' and ')}' for "
            "several."
        )
    return float(text.replace(",", "."))


def _is_possessive(following: Sequence[re.Match[str]]) -> bool:
    """Return whether the s of a possessive follows, such as that of "baker's", or of "it's"."""
    return any(
        token.group() == "s" and token.string[token.start() - 1] in "'\u2019" for token in following
    )


def longest_phrase(
    words: Sequence[str], vocabulary: Vocabulary, *, numbered: bool = False
) -> tuple[int, Item]:
    """Return the longest phrase or thing at the beginning of some words, and its length.

    After a number, a unit goes before a thing, as "Uhr" (clock) does in "3 Uhr".
    """
    for size in range(len(words), 0, -1):
        text = " ".join(words[:size])
        meaning = vocabulary.meaning(words[:size])
        if meaning and numbered and meaning[0] in UNITS:
            return size, Item(*meaning, text)
        if (name := vocabulary.text_class(words[:size])) is not None:
            return size, Item("sign", name, text)
        if (codes := vocabulary.codes_of(words[:size], own=meaning is not None)) is not None:
            return size, Item("thing", codes, text)
        if meaning:
            return size, Item(*meaning, text)
    return 1, Item("other", None, words[0])
