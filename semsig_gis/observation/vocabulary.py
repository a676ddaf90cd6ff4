"""The words of people for things and directions, by language, from ``data_sources``."""

from __future__ import annotations

import functools
import itertools
import re
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from semsig_gis.core import nearest_name
from semsig_gis.sources import (
    class_words,
    data_folder,
    family_words,
    other_class_words,
    words_for,
    words_of,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    "kilometres",
    "hours",
    "clock",
    "within",
    "with",
    "next",
    "between",
    "amid",
    "opposite",
    "sides",
)
TABLES = ("number", "turn", "compass", "range")
SHORT_WORD = 2
"""Words up to this number of letters have no endings."""
LETTERS = 3
"""Letters of the longest point of the compass, such as NNE."""
LONGEST = 6
"""Words in the longest phrase."""
OWN = 2
"""Number of the first names that are of the language: those of classes, and its words."""
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


Endings = tuple[tuple[str, str], ...]
"""Letters at the end of a word, and those that replace them in another form of it."""


@dataclass(frozen=True, eq=False, slots=True)
class Names:
    """The words for things in a language: `codes` by the words, joined.

    `beginnings` are those of the words, and `endings` those of their forms. `edged` are the codes
    by the words of phrases that begin or end with a letter or an article, such as "T junction".
    """

    codes: Mapping[str, Codes]
    edged: Mapping[Words, Codes]
    beginnings: frozenset[str]
    endings: Endings

    @classmethod
    def of(cls, terms: Sequence[Term], language: str) -> Self:
        """Return the words of a language; the first meaning of each counts."""
        codes: dict[str, Codes] = {}
        edged: dict[Words, Codes] = {}
        for name, codes_of_word, phrase in terms:
            if name == language and (joined := "".join(words_of(phrase))):
                codes.setdefault(joined, codes_of_word)
                words = tuple(re.findall(r"[^\W\d_]+", plain_word(phrase)))
                if len(words) > 1 and _has_edge(words):
                    edged.setdefault(words, codes_of_word)
        beginnings = frozenset(word[: end + 1] for word in codes for end in range(len(word)))
        return cls(codes, edged, beginnings, _endings(language))

    def find(self, words: Sequence[str]) -> Codes | None:
        """Return the codes for words of a thing, each in any form; None if it has no such words."""
        joined = {""}
        for word in words:
            bases = _bases(word, self.endings)
            joined = {
                whole
                for start in joined
                for base in bases
                if (whole := start + base) in self.beginnings
            }
        return next((self.codes[whole] for whole in sorted(joined) if whole in self.codes), None)

    def find_edged(self, words: Words) -> Codes | None:
        """Return the codes for a phrase with a letter or an article at its beginning or end."""
        *first, last = words
        forms = ((*first, base) for base in sorted(_bases(last, self.endings)))
        return next((self.edged[form] for form in forms if form in self.edged), None)


@dataclass(frozen=True, eq=False, slots=True)
class Vocabulary:
    """The words of a language, then those of the other languages that have one meaning.

    `families` and `classes` have the words for things, of this language and then of the others, and
    `others` those for things that the taxonomy has no class for; `phrases` are meanings by words,
    `letters` bearings by capitals, and `names` words for things of the language. `texts` are the
    words for a street sign and a house number, each with the name of the class.
    """

    language: str
    families: tuple[Names, ...]
    classes: tuple[Names, ...]
    others: tuple[Names, ...]
    phrases: Mapping[Words, Meaning]
    letters: Mapping[str, float]
    names: tuple[str, ...]
    texts: Mapping[str, str]

    @classmethod
    def of(cls, words: Sequence[str], taxonomy: Taxonomy) -> Vocabulary:
        """Return the vocabulary of the language that knows most of the words, English first."""

        def count(language: str) -> int:
            letters, own = _phrases()[language]["letters"], _own_words(taxonomy, language)
            endings = _endings(language)
            return sum(
                word in letters
                if is_point(word)
                else not own.isdisjoint(_bases(plain_word(word), endings))
                for word in words
            )

        return _vocabulary(taxonomy, max(_phrases(), key=count))

    def codes_of(self, words: Sequence[str], *, own: bool = False) -> Codes | None:
        """Return the class codes for the words of a thing, None if they are for no class.

        `own` is whether the words must be of this language.
        """
        kinds = self.families, self.classes
        # The names of classes are English, and in English they go before words for several classes.
        codes = _find(words, self.classes[:1]) if self.language == "en" else None
        # Words of the language go before those of others: "Post" is no pole in German.
        codes = codes or _find(words, self.families[:OWN]) or _exact(words, self.classes[:OWN])
        for tables in kinds:
            codes = codes or _find(words, tables[:OWN] if own else tables)
        return codes

    def text_class(self, words: Sequence[str]) -> str | None:
        """Return the name of the class if words are for a street sign or a house number."""
        return self.texts.get("".join(_parts(words)))

    def elsewhere(self, words: Sequence[str]) -> str:
        """Return the last of some words that are for a thing without a class here, or nothing."""
        for start in range(len(words)):
            if _find(words[start:], self.others):
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


def _has_edge(words: Sequence[str]) -> bool:
    """Return whether words begin or end with an article or a letter, such as S for south."""
    return any(len(word) == 1 or not words_of(word) for word in (words[0], words[-1]))


def _parts(words: Sequence[str]) -> list[str]:
    """Return the words of a thing as they are compared; none if they cannot be of one."""
    # Few things begin or end with an article or a letter.
    return [] if _has_edge(words) else [*itertools.chain(*map(words_of, words))]


def _exact(words: Sequence[str], names: Sequence[Names]) -> Codes | None:
    """Return the class codes for the words of a thing as they are, None if no names have them."""
    joined = "".join(_parts(words))
    return next(filter(None, (table.codes.get(joined) for table in names)), None)


def _find(words: Sequence[str], names: Sequence[Names]) -> Codes | None:
    """Return the class codes for the words of a thing, None if no names have them."""
    parts = _parts(words)
    if not parts:
        plain = tuple(map(plain_word, words))
        return next(filter(None, (table.find_edged(plain) for table in names[:OWN])), None)
    # All words as they are go before their forms, which count only in the own language: "turn" is
    # a form of a German word for a door.
    forms = (table.find(parts) for table in names[:OWN])
    return _exact(words, names) or next(filter(None, forms), None)


@functools.lru_cache(maxsize=4096)
def _bases(word: str, endings: Endings) -> frozenset[str]:
    """Return the words that a word may be a form of, and the word itself."""
    return frozenset(
        {word}.union(
            base
            for last, ending in endings
            if word.endswith(ending) and len(base := word.removesuffix(ending) + last) > SHORT_WORD
        )
    )


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


@functools.cache
def _endings(language: str) -> Endings:
    """Return the endings of words for things in a language; English for names."""
    table = _phrases().get(language or "en", {})
    endings = (("", ending) for ending in table.get("endings", ()))
    return (*endings, *table.get("changed", {}).items())


@functools.lru_cache(maxsize=64)
def _names(taxonomy: Taxonomy) -> dict[str, tuple[Names, Names, Names]]:
    """Return the words for families, for classes and for other things, by language."""
    parts = family_words(taxonomy), class_words(taxonomy), other_class_words(taxonomy)
    languages = dict.fromkeys(["", *_phrases(), *(name for part in parts for name, _, _ in part)])
    return {
        name: (Names.of(parts[0], name), Names.of(parts[1], name), Names.of(parts[2], name))
        for name in languages
    }


@functools.lru_cache(maxsize=64)
def _vocabulary(taxonomy: Taxonomy, language: str) -> Vocabulary:
    names = _names(taxonomy)
    # Names and titles are English before they are of another language: "Bank" is German for bench.
    first = ["", "en"] if language == "en" else [language, ""]
    order = [names[name] for name in dict.fromkeys([*first, *names])]
    families, classes, others = zip(*order, strict=True)
    return Vocabulary(
        language=language,
        families=families,
        classes=classes,
        others=others,
        phrases={**_shared(), **_meanings(language)},
        letters=_phrases()[language]["letters"],
        names=tuple(
            word
            for name, _, word in (*class_words(taxonomy), *family_words(taxonomy))
            if name in {"", language}
        ),
        texts={
            "".join(words_of(phrase)): name
            for name in (STREET_SIGN, HOUSE_NUMBER)
            for phrase in words_for(name)
        },
    )


@functools.lru_cache(maxsize=64)
def _own_words(taxonomy: Taxonomy, language: str) -> frozenset[str]:
    """Return the single words of a language, without other forms of those for things."""
    terms = (*class_words(taxonomy), *family_words(taxonomy), *other_class_words(taxonomy))
    things = {
        word
        for name, _, phrase in terms
        if name == language
        for word in map(plain_word, phrase.split())
    }
    return frozenset(things.union(*_meanings(language)))
