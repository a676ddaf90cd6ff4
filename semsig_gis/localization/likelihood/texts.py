"""Whether a text that was read fits a name of the map: the same, a part, or a few letters off."""

from __future__ import annotations

import functools
import re
import tomllib
import unicodedata
from typing import TYPE_CHECKING

import numpy as np

from semsig_gis.core import TEXTS
from semsig_gis.sources import data_folder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from semsig_gis.objects import StreetObjects

NONE, LETTERS_OFF, PART, EXACT = range(4)
"""How well a text fits a name."""

# Letters that have no accent to remove.
PLAIN_LETTERS = str.maketrans(
    {"ø": "o", "ł": "l", "đ": "d", "æ": "ae", "œ": "oe", "ħ": "h", "þ": "th", "ð": "d"}
    | dict.fromkeys("\u2018\u2019`", "'")
    | {"\u0131": "i"}
)
LEAST_LETTERS = 4
"""Letters from which on a text may have errors, and a name may be a part of a longer text."""
LEAST_LIKENESS = 78.0
"""Percent of the letters of text and name that agree, at least, if letters are off."""
LEAST_PART_LETTERS, LEAST_PART_LIKENESS = 6, 82.0
"""The same of a text that is a part of a name."""
NEAREST = 3
"""Names that a note gives for a text that fits none."""


def plain_text(text: str) -> str:
    """Return the words of a text without case, accents, punctuation and long forms.

    >>> plain_text("Rue de l'Église-St.-Paul"), plain_text("R. de l'Eglise Saint Paul")
    ('r de l eglise st paul', 'r de l eglise st paul')
    >>> plain_text("Große Hauptstraße"), plain_text("C/ Mayor"), plain_text("Paul's")
    ('grosse hauptstr', 'c mayor', 'pauls')
    """
    letters = unicodedata.normalize("NFKD", text).casefold().translate(PLAIN_LETTERS)
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    plain = re.sub(r"'(?=s\b)|(?<=\w)\.(?=\w+\.?(?:\s|$))", "", plain)
    short = " ".join(map(_short_word, re.findall(r"[^\W_]+", plain)))
    return re.sub(r"\b(\d+) ([a-z])(?= |$)", r"\1\2", short)  # house numbers such as 12 a


def _short_word(word: str) -> str:
    words, ends = _street_words()
    if word in words:
        return words[word]
    for end, short in ends.items():
        if word.endswith(end):
            return word.removesuffix(end) + short
    return word


@functools.cache
def _street_words() -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return the short form of words, and of endings of words."""
    text = (data_folder() / "street_words.toml").read_text(encoding="utf-8")
    content = tomllib.loads(text)
    words, ends = (
        {long: short for short, forms in content[name].items() for long in forms}
        for name in ("words", "ends")
    )
    return words, ends


def text_fits(text: str, names: Sequence[str]) -> NDArray[np.uint8]:
    """Return how well a text fits each of some names: `NONE`, `LETTERS_OFF`, `PART` or `EXACT`.

    All of them are the results of `plain_text`. A text is a part of a name if each of its words
    begins another word of the name, or the other way round. Digits must agree.
    """
    fits = np.zeros(len(names), np.uint8)
    if not text or not len(names):
        return fits
    from rapidfuzz import fuzz  # noqa: PLC0415 - only questions with texts
    from rapidfuzz.process import cdist  # noqa: PLC0415 - as above

    digits = re.findall(r"\d+", text)
    if len(text) >= LEAST_LETTERS:
        like = cdist([text], names, scorer=fuzz.ratio, score_cutoff=LEAST_LIKENESS)[0] > 0
        if len(text) >= LEAST_PART_LETTERS:
            parts = cdist(
                [text], names, scorer=fuzz.partial_ratio, score_cutoff=LEAST_PART_LIKENESS
            )
            like |= (parts[0] > 0) & (np.array([len(name) for name in names]) >= len(text))
        for row in np.flatnonzero(like).tolist():
            if re.findall(r"\d+", names[row]) == digits:
                fits[row] = LETTERS_OFF
    words = text.split()
    for row, name in enumerate(names):
        if name == text:
            fits[row] = EXACT
        elif _is_part(words, own := name.split()) or (
            len(name) >= LEAST_LETTERS and name[0].isalpha() and set(own) < set(words)
        ):
            fits[row] = PART
    return fits


def _is_part(words: Sequence[str], own: Sequence[str]) -> bool:
    """Whether each word begins a word of a name, no two of them the same one."""
    if len(words) > len(own):
        return False
    others = list(own)
    for word in words:
        match = next((other for other in others if _begins(word, other)), None)
        if match is None:
            return False
        others.remove(match)
    return True


def _begins(word: str, other: str) -> bool:
    """Whether a word begins another one; a number must end where that of the other ends."""
    if not other.startswith(word):
        return False
    return word == other or not (word[-1].isdigit() and other[len(word)].isdigit())


def nearest_names(text: str, names: Sequence[str]) -> tuple[int, ...]:
    """Return the rows of the names that are most like a text, the nearest first."""
    from rapidfuzz import fuzz  # noqa: PLC0415 - only questions with texts
    from rapidfuzz.process import extract  # noqa: PLC0415 - as above

    rows = extract(text, names, scorer=fuzz.ratio, processor=None, limit=NEAREST, score_cutoff=50)
    return tuple(row for _, _, row in rows)


def object_texts(objects: StreetObjects) -> dict[str, list[str]]:
    """Return the columns of what is written on objects, and the names of their streets."""
    table = objects.texts
    if table is None:
        return {}
    names = [name for name in TEXTS if name in table.column_names]
    return {name: [text or "" for text in table[name].to_pylist()] for name in names}


def best_text(objects: StreetObjects, row: int, text: str) -> str | None:
    """Return what is written on an object: what is most like a text, otherwise the first."""
    table = objects.texts
    if table is None:
        return None
    written = [table[name][row].as_py() for name in TEXTS if name in table.column_names]
    texts = list(filter(None, written))
    if not texts:
        return None
    best = nearest_names(plain_text(text), list(map(plain_text, texts))) if text else ()
    nearest: str = texts[best[0] if best else 0]
    return nearest
