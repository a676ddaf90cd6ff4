"""Keywords of several languages for classes, roles and fields."""

from __future__ import annotations

import functools
import re
import tomllib
import unicodedata
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from semsig_gis.core import WILDCARD, UnknownNameError, nearest_name
from semsig_gis.sources.catalog import data_folder, load_catalog
from semsig_gis.sources.filters import Condition

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator, Mapping

    from semsig_gis.core import Taxonomy

# Word boundaries in camel case, such as ArbresAlign and WCPublic, but not AEDs.
CAMEL_CASE = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])(?!.s\b)")
# Keywords up to this length must be a whole word, because too many words start with them.
WHOLE_WORD_LETTERS = 3
ARTICLES = frozenset(
    {"a", "al", "alla", "and", "au", "aux", "d", "da", "das", "de", "degli", "dei", "del", "dell",
     "della", "delle", "dello", "dem", "den", "der", "des", "di", "die", "do", "dos", "du", "e",
     "el", "en", "et", "for", "fur", "het", "i", "il", "in", "l", "la", "las", "le", "les", "lo",
     "los", "mit", "o", "of", "on", "per", "pour", "the", "to", "und", "van", "von"}
)  # fmt: skip


# Words between a thing and what belongs to it.
PREPOSITIONS = frozenset(
    {"about", "d", "da", "das", "de", "degli", "dei", "del", "dell", "della", "delle", "der", "des",
     "di", "do", "dos", "du", "for", "fur", "of", "on", "para", "per", "pour", "sur", "van", "von"}
)  # fmt: skip
CONJUNCTIONS = frozenset({"and", "e", "et", "und", "y"})
# Endings of the plural and of other forms of a keyword; Italian and some other keywords are stems.
ENDINGS = frozenset(
    {"", "a", "al", "as", "e", "ed", "ee", "ees", "elle", "en", "er", "ern", "es", "i", "ia", "ici",
     "is", "ken", "le", "li", "n", "na", "ne", "nen", "no", "ns", "o", "os", "re", "ri", "s", "se",
     "x"}
)  # fmt: skip

Codes = tuple[int, ...]
Term = tuple[str, Codes, str]
"""A word for a thing, with its language before and the class codes that it may be of."""


@dataclass(frozen=True, slots=True)
class Match:
    """A class or role with a keyword in a text, and the matching words of the text.

    `letters` is the length of the keyword; a longer keyword is a better match. `doubt` is a word
    that may say that the text is about something else, as "complaints" in "tree complaints"; empty
    if there is none.
    """

    name: str
    words: str
    letters: int
    doubt: str = ""


def words_of(text: str) -> tuple[str, ...]:
    """Return the words of a name in lower case, without accents and articles.

    Words also end where a capital follows (``WCPublic``) and between letters and digits.
    """
    return tuple(word for word in _all_words(text) if word not in ARTICLES)


def _all_words(text: str) -> list[str]:
    """Return the words of `words_of` with articles and prepositions."""
    letters = unicodedata.normalize("NFKD", text)
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    parts = re.findall(r"[^\W\d_]+|\d+", CAMEL_CASE.sub(" ", plain))
    return [part.casefold() for part in parts]


@dataclass(frozen=True, slots=True)
class Keywords:
    """Names of classes, roles or kinds of field, each with the words of a keyword.

    `whole` is whether the words of a text have to be those of the keyword, except their endings.
    Keywords `before_heads` may stand before the word that says what a thing is ("tree pit").
    """

    phrases: tuple[tuple[str, tuple[str, ...]], ...]
    whole: bool = False
    before_heads: frozenset[tuple[str, ...]] = frozenset()

    @classmethod
    def of(
        cls,
        pairs: Iterable[tuple[str, str]],
        *,
        whole: bool = False,
        before_heads: Iterable[str] = (),
    ) -> Keywords:
        """Return the keywords of pairs of a name and a phrase, without duplicates."""
        phrases = tuple(dict.fromkeys((name, words_of(phrase)) for name, phrase in pairs))
        return cls(phrases, whole, frozenset(map(words_of, before_heads)))

    def find(self, text: str) -> tuple[Match, ...]:
        """Find the keywords in a text, those without doubt first, then the longest.

        Each name is found once. A keyword inside a longer keyword does not count.
        """
        words = words_of(text)
        none = (("", phrase) for phrase in _neighbours().none)
        spans = [
            _Span(start, at[0], name, phrase, at[1])
            for name, phrase in (*self.phrases, *none)
            for start in range(len(words))
            if words[start].startswith(phrase[0])  # most fail here
            and (at := _end(words, start, phrase))
            and not (self.whole and at[1])
        ]
        # Python's sort keeps the order of the file among keywords of the same length.
        spans.sort(key=lambda span: (-span.letters, span.start))
        matches = {word for span in spans for word in words[span.start : span.end]}
        best: dict[str, Match] = {}
        for span in spans:
            if span.name and not any(
                other.start <= span.start and span.end <= other.end and other.letters > span.letters
                for other in spans
            ):
                doubt = self._doubt(span, words, text, matches)
                match = Match(
                    span.name, " ".join(words[span.start : span.end]), span.letters, doubt
                )
                if span.name not in best or (best[span.name].doubt and not doubt):
                    best[span.name] = match
        return tuple(sorted(best.values(), key=lambda match: match.doubt != ""))

    def _doubt(
        self, span: _Span, words: tuple[str, ...], text: str, matches: Container[str]
    ) -> str:
        """Return the word that may say what a text is about in place of a keyword, or nothing."""
        near = _neighbours()
        last = words[span.end - 1]
        if span.rest and not {span.rest, span.rest[1:]} & near.same:
            return last  # a compound, perhaps with a letter between its parts
        others = (*words[: span.start], *words[span.end :])
        if doubt := next((word for word in others if word in near.other), ""):
            return doubt
        following = "".join(words[span.end : span.end + 1])
        singular = last.endswith(span.phrase[-1]) and not last.endswith("s")
        if singular and span.phrase in self.before_heads and _says_more(following):
            return following
        # "hydrants and valves"; words of other keywords are found as such
        every = _all_words(text)
        for first, link, second in zip(every, every[1:], every[2:], strict=False):
            if link in CONJUNCTIONS and {first, second} & {words[span.start], last}:
                (other,) = {first, second} - {words[span.start], last} or {""}
                if _says_more(other) and other not in matches:
                    return other
        for head, link, word in zip(every, every[1:], every[2:], strict=False):
            # "cabinets of signals"
            if (head, word) == (*words[span.start - 1 : span.start], words[span.start]):
                return head if link in PREPOSITIONS and _says_more(head) else ""
        return ""


class _Span(NamedTuple):
    """A keyword at words ``start:end``; `rest` is the end of its last word, if not an ending."""

    start: int
    end: int
    name: str
    phrase: tuple[str, ...]
    rest: str

    @property
    def letters(self) -> int:
        return sum(map(len, self.phrase))


def _says_more(word: str) -> bool:
    """Whether a word next to a keyword may change its meaning; numbers and "locations" do not."""
    return word != "" and not word.isdecimal() and word not in _neighbours().same


def _end(words: tuple[str, ...], start: int, phrase: tuple[str, ...]) -> tuple[int, str] | None:
    """Return the index after `phrase` and the rest of its last word if it is at `start`."""
    joined = "".join(phrase)
    if len(phrase) > 1 and words[start].startswith(joined):  # written as one word
        return start + 1, _rest(words[start], joined)
    end = start + len(phrase)
    if end > len(words):
        return None
    for word, keyword in zip(words[start:end], phrase, strict=True):
        is_short = len(keyword) <= WHOLE_WORD_LETTERS
        if not (
            word in {keyword, f"{keyword}s", f"{keyword}es"}
            if is_short
            else word.startswith(keyword)
        ):
            return None
    return end, _rest(words[end - 1], phrase[-1])


def _rest(word: str, keyword: str) -> str:
    """Return what follows a keyword in a word, if it is not an ending."""
    rest = word.removeprefix(keyword)
    return "" if rest in ENDINGS else rest


@dataclass(frozen=True, slots=True)
class _Neighbours:
    """Words next to keywords: that change nothing, that change all, and phrases of no class."""

    same: frozenset[str]
    other: frozenset[str]
    none: tuple[tuple[str, ...], ...]


@functools.cache
def _neighbours() -> _Neighbours:
    table = _content()["neighbours"]

    def forms(lists: Mapping[str, list[str]]) -> frozenset[str]:
        words = [word for language in lists.values() for word in language]
        return frozenset(f"{word}{ending}" for word in words for ending in ENDINGS)

    none = (words_of(phrase) for language in table["none"].values() for phrase in language)
    return _Neighbours(forms(table["same"]), forms(table["other"]), tuple(none))


@functools.cache
def keywords(kind: str) -> Keywords:
    """Return the shipped keywords of a kind.

    Kinds are ``"classes"`` (words for classes), ``"class_names"`` (their names and what people say
    in English), ``"class_fields"`` (names of fields that imply the class of a layer), ``"roles"``
    (layers without objects) and ``"fields"`` (uses of fields).
    """
    content = _content()
    if kind == "fields":
        groups = content["fields"].items()
        return Keywords.of((name, word) for name, words in groups for word in words)
    if kind == "class_names":
        pairs = [
            (name, word)
            for name, lists in content["classes"].items()
            for word in (name.replace("_", " "), *lists.get(SPOKEN, {}).get("en", ()))
        ]
        return Keywords.of(pairs, whole=True, before_heads=[word for _, word in pairs])
    fields = kind == "class_fields"
    lists = [
        (name, key, word)
        for name, lists in content["classes" if fields else kind].items()
        for key, words in lists.items()
        if (key == "fields") == fields and key != SPOKEN
        for word in words
    ]
    # In English, the last word says what a thing is; in German and Dutch, it ends a compound.
    elsewhere = {word for _, key, word in lists if key in {"fr", "es", "it", "pt"}}
    return Keywords.of(
        ((name, word) for name, _, word in lists),
        before_heads=(word for _, key, word in lists if key == "en" and word not in elsewhere),
    )


def class_codes(word: str, taxonomy: Taxonomy) -> tuple[int, ...]:
    """Return the codes of the classes for a word of a person or a detector, ascending.

    Parameters
    ----------
    word : str
        A symbol, a name or a title of the taxonomy, or a family of it, another word for these, in
        the singular or the plural, or a tag of OpenStreetMap such as ``highway=street_lamp``; ``?``
        or ``unknown`` where the class is not known.
    taxonomy : Taxonomy
        The classes.

    Returns
    -------
    tuple of int
        One code, or those of all classes of a family; `WILDCARD` where the class is not known.

    Raises
    ------
    UnknownNameError
        If no class of the taxonomy has the word; the message gives the nearest word.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> [class_codes(word, paper_taxonomy()) for word in ("D", "street lamps", "amenity=bench")]
    [(3,), (3,), (10,)]
    """
    text = word.strip()
    if len(text) == 1:
        return (int(taxonomy.encode(text)[0]),)
    words = _class_words(taxonomy)
    codes: Codes | None
    if "=" in text:
        key, _, value = (part.strip() for part in text.partition("="))
        tags = _tagged_classes()
        names = tags.get(f"{key}={value}") or tags.get(f"{key}=*") or frozenset()
        codes = _codes_of(names, taxonomy)
    else:
        joined = "".join(words_of(text))
        # The word itself, then its singular.
        forms = [joined.removesuffix(suffix) for suffix in ("", "s", "es")]
        codes = next((words[form][0] for form in forms if form in words), None)
    if not codes:
        near = nearest_name(text, (name for _, name in words.values()))
        raise UnknownNameError(
            f"class {word!r} is unknown{near}; `semsig info` lists the classes of a city, and "
            "`semsig sources` those of a catalogue."
        )
    return codes


def tagged_class(key: str, value: str) -> str:
    """Return the only class with a tag of OpenStreetMap; empty for none or several."""
    names = _tagged_classes().get(f"{key}={value}", frozenset())
    return next(iter(names)) if len(names) == 1 else ""


SPOKEN = "said"
"""Key of words for classes in observations; layers are not recognised by them."""
MEMBERS = "classes"
"""Key of the classes that a word stands for, if they are not those of the family of its name."""


@functools.cache
def _content() -> dict[str, Any]:
    return tomllib.loads((data_folder() / "keywords.toml").read_text(encoding="utf-8"))


def class_words(taxonomy: Taxonomy, *, languages: Container[str] | None = None) -> tuple[Term, ...]:
    """Return the words for the classes, each with its language and class codes.

    The language of names and titles is empty, because they may be in any. Words that only people
    say may be limited to the languages `languages`.
    """
    words: list[Term] = [("", (WILDCARD,), "unknown"), ("en", (WILDCARD,), "something")]
    words += [("", (item.code,), item.title) for item in taxonomy.classes]
    tables = [
        (item.name, (item.code,), _content()["classes"].get(item.name, {}))
        for item in taxonomy.classes
    ]
    return (*words, *_terms(tables, languages))


def family_words(
    taxonomy: Taxonomy, *, languages: Container[str] | None = None
) -> tuple[Term, ...]:
    """Return the words of `class_words` for families, and others for several classes."""
    tables = _content()["families"]
    own = families(taxonomy).items()
    return tuple(
        _terms(((family, codes, tables.get(family, {})) for family, codes in own), languages)
    )


def families(taxonomy: Taxonomy) -> dict[str, Codes]:
    """Return the class codes of each family, and of each other name for several classes."""
    own = (item.family for item in taxonomy.classes if item.family)
    names = dict.fromkeys((*_content()["families"], *own))
    return {name: codes for name in names if (codes := _family_codes(name, taxonomy))}


def other_class_words(taxonomy: Taxonomy) -> tuple[Term, ...]:
    """Return the words of `class_words` for what a taxonomy has not, as of `WILDCARD`."""
    own = {item.name for item in taxonomy.classes}
    tables = {name: table for name, table in _content()["classes"].items() if name not in own}
    used = families(taxonomy)
    tables |= {name: table for name, table in _content()["families"].items() if name not in used}
    return tuple(_terms((name, (WILDCARD,), table) for name, table in tables.items()))


def words_for(name: str) -> tuple[str, ...]:
    """Return all words for a class or a family, in all languages."""
    table = {**_content()["classes"], **_content()["families"]}.get(name, {})
    return tuple(word for _, _, word in _terms([(name, (), table)]))


def _family_codes(family: str, taxonomy: Taxonomy) -> Codes:
    """Return the class codes of a family, or of a word for several classes."""
    own = [item.name for item in taxonomy.classes if item.family == family]
    return _codes_of(_content()["families"].get(family, {}).get(MEMBERS, own), taxonomy)


def _codes_of(names: Container[str], taxonomy: Taxonomy) -> Codes:
    """Return the codes of the classes of a taxonomy that have one of some names, ascending."""
    return tuple(sorted(item.code for item in taxonomy.classes if item.name in names))


def _terms(
    tables: Iterable[tuple[str, Codes, Mapping[str, Any]]],
    languages: Container[str] | None = None,
) -> Iterator[Term]:
    """Yield names and their words, each with its language and class codes.

    Words that people say go before those of layers, which may be for several kinds of things.
    """
    tables = [*tables]
    for name, codes, table in tables:
        yield "", codes, name.replace("_", " ")
        for language, phrases in table.get(SPOKEN, {}).items():
            if languages is None or language in languages:
                yield from ((language, codes, word) for word in phrases)
    for _, codes, table in tables:
        for language, phrases in table.items():
            if language not in {SPOKEN, MEMBERS, "fields"}:
                yield from ((language, codes, word) for word in phrases)


@functools.lru_cache(maxsize=8)
def _class_words(taxonomy: Taxonomy) -> Mapping[str, tuple[Codes, str]]:
    """Return class codes and original word by normalized word (lower case, no blanks)."""
    codes_of: dict[str, tuple[Codes, str]] = {}
    for terms in (class_words, family_words):
        words = terms(taxonomy, languages={"en"})
        # Names and titles have priority, then English.
        for _, codes, word in sorted(words, key=lambda item: (item[0] != "", item[0] != "en")):
            if joined := "".join(words_of(word)):
                codes_of.setdefault(joined, (codes, word))
    return codes_of


@functools.cache
def _tagged_classes() -> Mapping[str, frozenset[str]]:
    """Return the class names of each OpenStreetMap tag."""
    classes: dict[str, set[str]] = {}
    for layer in load_catalog("openstreetmap").layers:
        keys = {key for tags in layer.tags for key, _ in tags}
        more = [values for key, values in layer.where if key not in keys]
        if not all(Condition.parse(values).accepts(None) for values in more):
            continue  # high-rise buildings, which are more than their tags
        by = layer.class_by
        if by is not None:
            for value, name in by.classes:
                classes.setdefault(f"{by.field}={value}", set()).add(name)
        for tags in layer.tags if layer.role == "objects" else ():
            for key, values in tags:
                # The values of the field that decides have their class already.
                decides = by is not None and by.field == key
                names = (layer.class_name,) if decides else layer.classes
                for value in values:
                    classes.setdefault(f"{key}={value}", set()).update(names)
    return {tag: frozenset(names - {""}) for tag, names in classes.items()}
