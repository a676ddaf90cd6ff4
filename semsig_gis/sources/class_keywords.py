"""Keywords of several languages for classes, roles and fields."""

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
    from collections.abc import Container, Iterable, Iterator, Mapping

    from semsig_gis.core import Taxonomy

# Word boundaries in camel case, such as ArbresAlign and WCPublic.
CAMEL_CASE = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
# Keywords up to this length must be a whole word, because too many words start with them.
WHOLE_WORD_LETTERS = 3
ARTICLES = frozenset(
    {"a", "al", "alla", "and", "au", "aux", "d", "da", "das", "de", "dei", "del", "della", "dem",
     "den", "der", "des", "di", "die", "do", "dos", "du", "e", "el", "en", "et", "for", "fur",
     "het", "i", "il", "in", "l", "la", "las", "le", "les", "lo", "los", "mit", "o", "of", "on",
     "per", "pour", "the", "to", "und", "van", "von"}
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Match:
    """A class or role with a keyword in a text, and the matching words of the text.

    `letters` is the length of the keyword; a longer keyword is a better match.
    """

    name: str
    words: str
    letters: int


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a name in lower case, without accents and articles.

    Words also end where a capital follows (``WCPublic``) and between letters and digits.
    """
    letters = unicodedata.normalize("NFKD", text)
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    parts = re.findall(r"[^\W\d_]+|\d+", CAMEL_CASE.sub(" ", plain))
    return tuple(word for part in parts if (word := part.casefold()) not in ARTICLES)


@dataclass(frozen=True, slots=True)
class Keywords:
    """Names of classes, roles or kinds of field, each with the words of a keyword."""

    phrases: tuple[tuple[str, tuple[str, ...]], ...]

    @classmethod
    def of(cls, pairs: Iterable[tuple[str, str]]) -> Keywords:
        """Return the keywords of pairs of a name and a phrase, without duplicates."""
        return cls(tuple(dict.fromkeys((name, words_of(phrase)) for name, phrase in pairs)))

    def find(self, text: str) -> tuple[Match, ...]:
        """Find the keywords in a text, the longest first and each name once.

        A keyword inside a longer keyword does not count.
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
    """Return the index after `phrase` if it matches the words at `start`; None if not."""
    if len(phrase) > 1 and words[start].startswith("".join(phrase)):
        return start + 1  # written as one word
    end = start + len(phrase)
    if end > len(words):
        return None
    for word, keyword in zip(words[start:end], phrase, strict=True):
        is_short = len(keyword) <= WHOLE_WORD_LETTERS
        if not (word in {keyword, f"{keyword}s"} if is_short else word.startswith(keyword)):
            return None
    return end


@functools.cache
def keywords(kind: str) -> Keywords:
    """Return the shipped keywords of a kind.

    Kinds are ``"classes"`` (words for classes), ``"class_fields"`` (names of fields that imply the
    class of a layer), ``"roles"`` (layers without objects) and ``"fields"`` (uses of fields).
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
        if (key == "fields") == fields and key != SPOKEN
        for word in words
    )


def class_code(word: str, taxonomy: Taxonomy) -> int:
    """Return the code of the class for a word of a person or a detector.

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
        If no class of the taxonomy has the word; the message gives the nearest word.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> [class_code(word, paper_taxonomy()) for word in ("D", "street lamps", "amenity=bench")]
    [3, 3, 10]
    """
    text = word.strip()
    if len(text) == 1:
        return int(taxonomy.encode(text)[0])
    words = _class_words(taxonomy)
    code: int | None
    if "=" in text:
        key, _, value = (part.strip() for part in text.partition("="))
        names = _tagged_classes()
        name = names.get(f"{key}={value}") or names.get(f"{key}=*")
        code = next((item.code for item in taxonomy.classes if item.name == name), None)
    else:
        joined = "".join(words_of(text))
        # The word itself, then its singular.
        forms = [joined.removesuffix(suffix) for suffix in ("", "s", "es")]
        code = next((words[form][0] for form in forms if form in words), None)
    if code is None:
        near = nearest_name(text, (name for _, name in words.values()))
        raise UnknownNameError(
            f"class {word!r} is unknown{near}; `semsig info` lists the classes of a city, and "
            "`semsig sources` those of a catalogue."
        )
    return code


SPOKEN = "said"
"""Key of words for classes in observations; layers are not recognised by them."""


@functools.cache
def _content() -> dict[str, Any]:
    return tomllib.loads((data_folder() / "keywords.toml").read_text(encoding="utf-8"))


def class_words(
    taxonomy: Taxonomy, *, languages: Container[str] | None = None
) -> tuple[tuple[str, int, str], ...]:
    """Return the words for the classes, each with its language and class code.

    The language of names and titles is empty, because they may be in any. Words that only people
    say may be limited to the languages `languages`.
    """
    words = [("", WILDCARD, "unknown"), ("en", WILDCARD, "something")]
    for item in taxonomy.classes:
        words += [("", item.code, item.title), *_keywords(item.name, item.code, languages)]
    return tuple(words)


def other_class_words(taxonomy: Taxonomy) -> tuple[tuple[str, int, str], ...]:
    """Return the words of `class_words` for classes that a taxonomy has not, as of `WILDCARD`."""
    own = {item.name for item in taxonomy.classes}
    names = [name for name in _content()["classes"] if name not in own]
    return tuple(item for name in names for item in _keywords(name, WILDCARD, None))


def _keywords(
    name: str, code: int, languages: Container[str] | None
) -> Iterator[tuple[str, int, str]]:
    """Yield the name of a class and its keywords, each with its language and a class code."""
    yield "", code, name.replace("_", " ")
    by_key = dict(_content()["classes"].get(name, {}))
    more = by_key.pop(SPOKEN, {}).items()
    lists = [pair for pair in by_key.items() if pair[0] != "fields"]
    lists += [pair for pair in more if languages is None or pair[0] in languages]
    for key, phrases in lists:
        yield from ((key, code, word) for word in phrases)


@functools.lru_cache(maxsize=8)
def _class_words(taxonomy: Taxonomy) -> Mapping[str, tuple[int, str]]:
    """Return class code and original word by normalized word (lower case, no blanks)."""
    code_of: dict[str, tuple[int, str]] = {}
    classes = class_words(taxonomy, languages={"en"})
    # Names and titles have priority, then English.
    for _, code, word in sorted(classes, key=lambda item: (item[0] != "", item[0] != "en")):
        if joined := "".join(words_of(word)):
            code_of.setdefault(joined, (code, word))
    return code_of


@functools.cache
def _tagged_classes() -> Mapping[str, str]:
    """Return the class name of each OpenStreetMap tag that belongs to exactly one class."""
    classes: dict[str, set[str]] = {}
    for layer in load_catalog("openstreetmap").layers:
        for tags in layer.tags if layer.role == "objects" else ():
            for key, values in tags:
                for value in values:
                    classes.setdefault(f"{key}={value}", set()).add(layer.class_name)
    return {tag: name for tag, (name, *others) in classes.items() if not others}
