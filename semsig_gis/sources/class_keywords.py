"""Words of several languages that tell which class a layer, a field or a value is about."""

from __future__ import annotations

import functools
import re
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core import WILDCARD, UnknownNameError, nearest_name
from semsig_gis.sources.catalog import data_folder, load_catalog

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from semsig_gis.core import Taxonomy

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
    content = _content()
    if kind == "fields":
        groups = content["fields"].items()
        return Keywords.of((name, word) for name, words in groups for word in words)
    fields = kind == "class_fields"
    return Keywords.of(
        (name, word)
        for name, lists in content["classes" if fields else kind].items()
        for key, words in lists.items()
        if (key == "fields") == fields and key != SAID
        for word in words
    )


def class_code(word: str, taxonomy: Taxonomy) -> int:
    """Return the code of the class that a person or a detector calls so.

    Parameters
    ----------
    word : str
        A symbol, a name or a title of the taxonomy, another word for it, in the singular or the
        plural, or a tag of OpenStreetMap such as ``highway=street_lamp``; ``?`` or ``unknown``
        where the class is not known.
    taxonomy : Taxonomy
        The classes.

    Returns
    -------
    int
        The code; `WILDCARD` where the class is not known.

    Raises
    ------
    UnknownNameError
        If the word stands for no class of the taxonomy; with the nearest one that does.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> [class_code(word, paper_taxonomy()) for word in ("D", "street lamps", "amenity=bench")]
    [3, 3, 10]
    """
    text = word.strip()
    if len(text) == 1:
        return int(taxonomy.encode(text)[0])
    known = _class_words(taxonomy)
    if "=" in text:
        key, _, value = (part.strip() for part in text.partition("="))
        names = _tagged_classes()
        tagged = names.get(f"{key}={value}") or names.get(f"{key}=*")
        found = next((item.code for item in taxonomy.classes if item.name == tagged), None)
    else:
        together = "".join(words_of(text))
        ends = [together.removesuffix(end) for end in ("", "s", "es")]
        found = next((known[one][0] for one in ends if one in known), None)
    if found is None:
        near = nearest_name(text, (said for _, said in known.values()))
        legend = ", ".join(f"{item.symbol} {item.title.lower()}" for item in taxonomy.classes)
        raise UnknownNameError(
            f"class {word!r} is unknown{near}; give a word for one of these: {legend}."
        )
    return found


SAID = "said"
"""Key of the words that people say, by which no layer is told."""


@functools.cache
def _content() -> dict[str, Any]:
    return tomllib.loads((data_folder() / "keywords.toml").read_text(encoding="utf-8"))


@functools.lru_cache(maxsize=8)
def _class_words(taxonomy: Taxonomy) -> Mapping[str, tuple[int, str]]:
    """Return the words for classes, written as one: the code of the class, and the words."""
    lists = _content()["classes"]
    others = [
        (key, item.code, word)
        for item in taxonomy.classes
        for key, words in lists.get(item.name, {}).items()
        if key != "fields"
        for word in words
    ]
    others.sort(key=lambda one: one[0] not in {"en", SAID})  # English before all other languages
    spoken = [
        *((item.code, item.name.replace("_", " ")) for item in taxonomy.classes),
        *((item.code, item.title) for item in taxonomy.classes),
        (WILDCARD, "unknown"),
        *((code, word) for _, code, word in others),
    ]
    known: dict[str, tuple[int, str]] = {}
    for code, word in spoken:
        if together := "".join(words_of(word)):
            known.setdefault(together, (code, word))
    return known


@functools.cache
def _tagged_classes() -> Mapping[str, str]:
    """Return the names of classes by the tags of OpenStreetMap that stand for one class alone."""
    classes: dict[str, set[str]] = {}
    for layer in load_catalog("openstreetmap").layers:
        for tags in layer.tags if layer.role == "objects" else ():
            for key, values in tags:
                for value in values:
                    classes.setdefault(f"{key}={value}", set()).add(layer.class_name)
    return {tag: name for tag, (name, *others) in classes.items() if not others}
