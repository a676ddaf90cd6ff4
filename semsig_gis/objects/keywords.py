"""Words of several languages that tell which class a layer, a field or a value is about."""

from __future__ import annotations

import functools
import re
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING

from semsig_gis.sources.catalog import data_folder

if TYPE_CHECKING:
    from collections.abc import Iterable

# Boundaries in ArbresAlign and in WCPublic.
HUMPS = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
# Shorter words are the beginnings of too many others.
WHOLE_WORD_LETTERS = 3
ARTICLES = frozenset(
    {"a", "al", "alla", "and", "au", "aux", "d", "da", "das", "de", "dei", "del", "della", "dem",
     "den", "der", "des", "di", "die", "do", "dos", "du", "e", "el", "en", "et", "for", "fur",
     "het", "i", "il", "in", "l", "la", "las", "le", "les", "lo", "los", "mit", "o", "of", "on",
     "per", "pour", "the", "to", "und", "van", "von"}
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Match:
    """A class or role whose keyword stands in a text, and the words there.

    `letters` is the length of the keyword: the longer, the surer.
    """

    name: str
    words: str
    letters: int


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a name without capitals, accents and articles.

    Words also end where a capital follows (``WCPublic``) and between letters and digits.
    """
    letters = unicodedata.normalize("NFKD", text)
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    parts = re.findall(r"[^\W\d_]+|\d+", HUMPS.sub(" ", plain))
    return tuple(word for part in parts if (word := part.casefold()) not in ARTICLES)


@dataclass(frozen=True, slots=True)
class Keywords:
    """Names of classes, roles or kinds of field, each with words that stand for it in a row."""

    phrases: tuple[tuple[str, tuple[str, ...]], ...]

    @classmethod
    def of(cls, pairs: Iterable[tuple[str, str]]) -> Keywords:
        """Return the keywords of pairs of a name and a phrase, each once."""
        return cls(tuple(dict.fromkeys((name, words_of(phrase)) for name, phrase in pairs)))

    def find(self, text: str) -> tuple[Match, ...]:
        """Find the keywords in a text, the longest first and each name once.

        Words that are part of those of a longer keyword do not count.
        """
        words = words_of(text)
        spans = [
            (start, end, Match(name, " ".join(words[start:end]), sum(map(len, phrase))))
            for name, phrase in self.phrases
            for start in range(len(words))
            if (end := _end(words, start, phrase)) is not None
        ]
        # Python's sort keeps the order of the file among keywords of the same length.
        spans.sort(key=lambda span: (-span[2].letters, span[0]))
        best: dict[str, Match] = {}
        for start, end, match in spans:
            if not any(
                first <= start and end <= last and other.letters > match.letters
                for first, last, other in spans
            ):
                best.setdefault(match.name, match)
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

    They are ``"classes"`` (what a class is called), ``"class_fields"`` (fields that tell the class
    of a layer), ``"roles"`` (layers without objects) and ``"fields"`` (what a field is for).
    """
    content = tomllib.loads((data_folder() / "keywords.toml").read_text(encoding="utf-8"))
    if kind == "fields":
        groups = content["fields"].items()
        return Keywords.of((name, word) for name, words in groups for word in words)
    return Keywords.of(
        (name, word)
        for name, lists in content["classes" if kind == "class_fields" else kind].items()
        for key, words in lists.items()
        if (key == "fields") == (kind == "class_fields")
        for word in words
    )
