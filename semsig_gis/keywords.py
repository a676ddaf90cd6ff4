"""Words of several languages that tell which class a layer or a value is about."""

from __future__ import annotations

import functools
import re
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.catalog import data_folder

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Found", "Keywords", "keywords", "words_of"]

# Boundaries in ArbresAlign and in WCPublic.
HUMPS = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
ARTICLES = frozenset(
    {"a", "al", "alla", "and", "au", "aux", "d", "da", "das", "de", "dei", "del", "della", "dem",
     "den", "der", "des", "di", "die", "do", "dos", "du", "e", "el", "en", "et", "for", "fur",
     "het", "i", "il", "in", "l", "la", "las", "le", "les", "lo", "los", "mit", "o", "of", "on",
     "per", "pour", "the", "to", "und", "van", "von"}
)  # fmt: skip
# Shorter words are the beginnings of too many others.
WHOLE_WORD_LETTERS = 3


@dataclass(frozen=True, slots=True)
class Found:
    """A keyword that was found.

    Parameters
    ----------
    name : str
        Class or role that it stands for.
    words : str
        The words of the text in which it was found.
    letters : int
        Letters of the keyword: the more, the surer.

    Examples
    --------
    >>> Found("bench", "bancs", 4).name
    'bench'
    """

    name: str
    words: str
    letters: int


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a name without capitals, accents and articles.

    Parameters
    ----------
    text : str
        Name of a file, layer or field, or a value.

    Returns
    -------
    tuple of str
        The words.

    Examples
    --------
    >>> words_of("Les_ArbresAlignés (2011)")
    ('arbres', 'alignes', '2011')
    >>> words_of("Arrêts de bus"), words_of("WCPublic")
    (('arrets', 'bus'), ('wc', 'public'))
    """
    letters = unicodedata.normalize("NFKD", text)
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    parts = re.findall(r"[^\W\d_]+|\d+", HUMPS.sub(" ", plain))
    folded = (part.casefold() for part in parts)
    return tuple(word for word in folded if word not in ARTICLES)


@dataclass(frozen=True, slots=True)
class Keywords:
    """Keywords of classes, roles or kinds of field.

    Parameters
    ----------
    phrases : tuple of (str, tuple of str)
        Name, and the words that stand for it one after the other.

    Examples
    --------
    >>> Keywords.of([("bus_stop", "bus stop"), ("bus_stop", "Haltestelle")]).find("BusStops_2024")
    (Found(name='bus_stop', words='bus stops', letters=7),)
    """

    phrases: tuple[tuple[str, tuple[str, ...]], ...]

    @classmethod
    def of(cls, pairs: Iterable[tuple[str, str]]) -> Keywords:
        """Return keywords from pairs of a name and a phrase.

        Parameters
        ----------
        pairs : iterable of (str, str)
            Name and phrase.

        Returns
        -------
        Keywords
            The keywords, each once.
        """
        return cls(tuple(dict.fromkeys((name, words_of(phrase)) for name, phrase in pairs)))

    def find(self, text: str) -> tuple[Found, ...]:
        """Find the keywords in a text.

        Parameters
        ----------
        text : str
            Name of a file, layer or field, or a value.

        Returns
        -------
        tuple of Found
            What was found, the longest keyword first and each name once; words that are part of
            those of a longer keyword do not count.
        """
        words = words_of(text)
        found: list[tuple[int, int, Found]] = []
        for name, phrase in self.phrases:
            for start in range(len(words)):
                end = _end(words, start, phrase)
                if end is not None:
                    what = Found(name, " ".join(words[start:end]), sum(map(len, phrase)))
                    found.append((start, end, what))
        # Python's sort keeps the order of the file among keywords of the same length.
        found.sort(key=lambda item: (-item[2].letters, item[0]))
        best: dict[str, Found] = {}
        for start, end, what in found:
            if not any(
                first <= start and end <= last and other.letters > what.letters
                for first, last, other in found
            ):
                best.setdefault(what.name, what)
        return tuple(best.values())


def _end(words: tuple[str, ...], start: int, phrase: tuple[str, ...]) -> int | None:
    """Return where a phrase ends that begins at a word, or None if it is not there."""
    if len(phrase) > 1 and words[start].startswith("".join(phrase)):
        return start + 1  # written as one word
    end = start + len(phrase)
    pairs = zip(words[start:end], phrase, strict=False)
    return end if end <= len(words) and all(_begins(*pair) for pair in pairs) else None


def _begins(word: str, keyword: str) -> bool:
    if len(keyword) <= WHOLE_WORD_LETTERS:
        return word in {keyword, f"{keyword}s"}
    return word.startswith(keyword)


@functools.cache
def keywords(kind: str) -> Keywords:
    """Return the shipped keywords of a kind.

    Parameters
    ----------
    kind : {"classes", "class_fields", "roles", "fields"}
        What they tell: the class of a layer or value by what it is called, the class of a layer
        by a field of it, the role of a layer that holds no objects, or what a field is for.

    Returns
    -------
    Keywords
        The keywords.

    Examples
    --------
    >>> [found.name for found in keywords("classes").find("Straßenbäume")]
    ['alignment_tree']
    """
    text = (data_folder() / "keywords.toml").read_text(encoding="utf-8")
    content = tomllib.loads(text)
    if kind == "fields":
        groups = content["fields"].items()
        return Keywords.of((name, word) for name, words in groups for word in words)
    table = content["classes" if kind == "class_fields" else kind]
    return Keywords.of(
        (name, word)
        for name, lists in table.items()
        for key, words in lists.items()
        if (key == "fields") == (kind == "class_fields")
        for word in words
    )
