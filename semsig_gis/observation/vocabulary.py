"""The words of people for things and directions, by language, from ``data_sources``."""

from __future__ import annotations

import functools
import itertools
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core import nearest_name
from semsig_gis.sources import class_words, data_folder, other_class_words, words_for, words_of

if TYPE_CHECKING:
    from collections.abc import Container, Mapping, Sequence

    from semsig_gis.core import Taxonomy
    from semsig_gis.sources import Term

# Kinds of phrases, without and with a value; see `phrases.toml`.
LISTS = (
    "skip",
    "or",
    "at",
    "none",
    "also",
    "facing",
    "degrees",
    "metres",
    "hours",
    "clock",
    "within",
    "with",
    "next",
    "between",
    "amid",
    "opposite",
)
TABLES = ("number", "turn", "compass", "range")
SHORT_WORD = 2
"""Words up to this number of letters have no endings."""
LETTERS = 3
"""Letters of the longest point of the compass, such as NNE."""
LONGEST = 6
"""Words in the longest phrase."""
STREET_SIGN, HOUSE_NUMBER = "street_sign", "house_number"
"""Names of the classes of objects that are known by what is written on them."""

Words = tuple[str, ...]
Codes = tuple[int, ...]
Meaning = tuple[str, Any]
"""The kind of a phrase, and its value."""


def plain_word(word: str) -> str:
    """Return a word in lower case and without accents.

    >>> plain_word("Árbol"), plain_word("Straße")
    ('arbol', 'strasse')
    """
    letters = unicodedata.normalize("NFKD", word.casefold())
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def is_point(word: str) -> bool:
    """Return whether a word may be the letters of a point of the compass, such as NE or S."""
    return word.isupper() and len(word) <= LETTERS


@dataclass(frozen=True, eq=False, slots=True)
class Vocabulary:
    """The words of a language, then those of the other languages that have one meaning.

    `classes` are class codes by the words of a thing, joined and in any form, and `others` such
    words for things that the taxonomy has no class for; `phrases` are meanings by words, `letters`
    bearings by capitals, and `names` words for things of the language. `texts` are the words for a
    street sign and a house number, each with the name of the class.
    """

    language: str
    classes: Mapping[str, Codes]
    phrases: Mapping[Words, Meaning]
    letters: Mapping[str, float]
    names: tuple[str, ...]
    others: Container[str]
    texts: Mapping[str, str]

    @classmethod
    def of(cls, words: Sequence[str], taxonomy: Taxonomy) -> Vocabulary:
        """Return the vocabulary of the language that knows most of the words, English first."""

        def count(language: str) -> int:
            letters, own = _phrases()[language]["letters"], _own_words(taxonomy, language)
            return sum(
                word in letters if is_point(word) else plain_word(word) in own for word in words
            )

        return _vocabulary(taxonomy, max(_phrases(), key=count))

    def codes_of(self, words: Sequence[str]) -> Codes | None:
        """Return the class codes for the words of a thing, None if they are for no class."""
        return self.classes.get(_joined(words))

    def text_class(self, words: Sequence[str]) -> str | None:
        """Return the name of the class if words are for a street sign or a house number."""
        return self.texts.get(_joined(words))

    def elsewhere(self, words: Sequence[str]) -> str:
        """Return the last of some words that are for a thing without a class here, or nothing."""
        for start in range(len(words)):
            if _joined(words[start:]) in self.others:
                return " ".join(words[start:])
        return ""

    def meaning(self, words: Sequence[str]) -> Meaning | None:
        """Return the kind and the value of a phrase, None if it has no meaning."""
        (word, *more) = words
        letters = is_point(word) or (self.language == "en" and len(word) > 1)
        if not more and letters and (bearing := self.letters.get(word.upper())) is not None:
            return "compass", bearing
        return self.phrases.get(tuple(map(plain_word, words)))

    def nearest(self, text: str) -> str:
        """Return ``"; the nearest is 'x'"`` for the nearest word of the language, or nothing."""
        return nearest_name(text, self.names)


def _joined(words: Sequence[str]) -> str:
    """Return the words of a thing joined; empty if they cannot be of one."""
    names = [words_of(word) for word in words]
    # A thing does not begin or end with an article or a letter, such as S for south.
    if not names[0] or not names[-1] or min(len(words[0]), len(words[-1])) == 1:
        return ""
    return "".join(itertools.chain(*names))


@functools.cache
def _phrases() -> dict[str, dict[str, Any]]:
    """Return the tables of ``phrases.toml`` by language."""
    return tomllib.loads((data_folder() / "phrases.toml").read_text(encoding="utf-8"))


@functools.cache
def _meanings(language: str) -> dict[Words, Meaning]:
    """Return the meaning of each phrase of a language."""
    table = _phrases()[language]
    pairs: list[tuple[str, Meaning]] = [
        (phrase, (kind, None)) for kind in LISTS for phrase in table[kind]
    ]
    pairs += [(phrase, (kind, value)) for kind in TABLES for phrase, value in table[kind].items()]
    return {tuple(phrase.split()): meaning for phrase, meaning in pairs}


@functools.cache
def _shared() -> dict[Words, Meaning]:
    """Return the phrases that have the same meaning in all languages that have them.

    Letters are left out: "n" may be for north.
    """
    meanings: dict[Words, set[Meaning]] = {}
    for language in _phrases():
        for words, meaning in _meanings(language).items():
            if words != (words[0][0],):
                meanings.setdefault(words, set()).add(meaning)
    return {words: next(iter(values)) for words, values in meanings.items() if len(values) == 1}


def _forms(phrase: str, endings: Sequence[str]) -> set[str]:
    """Return a word for a thing with each of its words in each form, joined."""
    forms = [
        [word, *(word + ending for ending in endings if len(word) > SHORT_WORD)]
        for word in words_of(phrase)
    ]
    return {"".join(words) for words in itertools.product(*forms)} - {""}


def _by_form(terms: Sequence[Term], language: str) -> dict[str, Codes]:
    """Return the class codes by the words of a thing in any form."""
    classes: dict[str, Codes] = {}
    # All words as they are go before their forms, the own language before others.
    for exact in (True, False):
        for name in dict.fromkeys(["", language, *_phrases(), *(name for name, _, _ in terms)]):
            endings = () if exact else _phrases().get(name or "en", {}).get("endings", ())
            for _, codes, phrase in (item for item in terms if item[0] == name):
                for form in _forms(phrase, endings):
                    classes.setdefault(form, codes)
    return classes


@functools.lru_cache(maxsize=64)
def _vocabulary(taxonomy: Taxonomy, language: str) -> Vocabulary:
    terms, others = class_words(taxonomy), other_class_words(taxonomy)
    names = tuple(word for name, _, word in terms if name in {"", language})
    return Vocabulary(
        language=language,
        classes=_by_form(terms, language),
        phrases={**_shared(), **_meanings(language)},
        letters=_phrases()[language]["letters"],
        names=names,
        others=frozenset(_by_form(others, language)),
        texts={
            form: name
            for name in (STREET_SIGN, HOUSE_NUMBER)
            for phrase in words_for(name)
            for form in _forms(phrase, ())
        },
    )


@functools.lru_cache(maxsize=64)
def _own_words(taxonomy: Taxonomy, language: str) -> frozenset[str]:
    """Return the single words of a language."""
    endings = ["", *_phrases()[language]["endings"]]
    terms = (*class_words(taxonomy), *other_class_words(taxonomy))
    things = {
        word + ending
        for name, _, phrase in terms
        if name == language
        for word in map(plain_word, phrase.split())
        for ending in endings
    }
    return frozenset(things.union(*_meanings(language)))
