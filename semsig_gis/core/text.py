"""Text from data, made safe for terminals, labels, Markdown and HTML. Imports no other module."""

from __future__ import annotations

import array
import re
import sys
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# Unicode categories: control, format, surrogate, line separator and paragraph separator.
HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
# Format characters that join letters and emoji; all others only hide or reorder text.
JOINERS = "\u200c\u200d"
# Chances that are written as whole percents.
LEAST_CHANCE, MOST_CHANCE = 0.01, 0.995
# Lengths in a message, which must not repeat the content of a file.
LONGEST_QUOTE, LONGEST_MESSAGE = 200, 3000
# A quoted value ends with a quote at the end of a word, and begins with one where a word begins.
_END = r"(?P=mark)(?=[\s,.;:)\]}]|$)"
QUOTED = re.compile(
    rf"(?<![^\s(\[{{=:,])(?P<mark>['\"])(?P<value>(?:(?!{_END}).)+){_END}", re.DOTALL
)
UTF16 = f"utf-16-{sys.byteorder[0]}e"


def visible(text: str) -> str:
    r"""Return text with characters that move the cursor or reorder text escaped: ``\u001b``.

    Control characters (also line ends), direction marks and surrogates are escaped as in JSON.
    """
    return text if text.isprintable() else "".join(map(_escape_hidden, text))


def visible_lines(texts: Iterable[str]) -> list[str]:
    """Return texts with the same characters escaped as by `visible`, except for line ends."""
    return ["\n".join(map(visible, text.split("\n"))) for text in texts]


def _escape_hidden(character: str) -> str:
    if unicodedata.category(character) not in HIDDEN or character in JOINERS:
        return character
    units = array.array("H", character.encode(UTF16, "surrogatepass"))
    return "".join(f"\\u{unit:04x}" for unit in units)


def shortened(message: str) -> str:
    """Return a message with shortened quotations, and in all of at most 3,000 characters.

    It keeps its end, which says what to do.

    >>> len(shortened(f"field 'x' is {'7' * 10_000!r}; correct it."))
    231
    """
    if len(message) <= LONGEST_QUOTE:
        return message
    text = QUOTED.sub(_short_quote, _without_middle(message, 2 * LONGEST_MESSAGE))
    return _without_middle(text, LONGEST_MESSAGE)


def _without_middle(text: str, longest: int) -> str:
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]} ... {text[-half:]}"


def _short_quote(match: re.Match[str]) -> str:
    mark, value = match["mark"], match["value"]
    return match[0] if len(value) <= LONGEST_QUOTE else f"{mark}{value[:LONGEST_QUOTE]}...{mark}"


def one_line(text: str) -> str:
    """Return text from data on one line, without control characters and direction marks.

    Surrogates, which no file can hold, become U+FFFD.
    """
    plain = " ".join(text.split())
    if plain.isprintable():
        return plain
    # A removed character may leave two spaces next to each other.
    return " ".join("".join(map(_remove_hidden, plain)).split())


def one_lines(texts: Iterable[str]) -> list[str]:
    """Return texts from data, each on one line (see `one_line`)."""
    return list(map(one_line, texts))


def _remove_hidden(character: str) -> str:
    category = unicodedata.category(character)
    if category == "Cs" or ord(character) & 0xFFFE == 0xFFFE:  # noqa: PLR2004 - a noncharacter
        return "\ufffd"
    return "" if category in {"Cc", "Cf"} and character not in JOINERS else character


def escaped(text: str) -> str:
    """Return text on one line that cannot break a Markdown table or become HTML."""
    plain = " ".join(text.split())
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")


def percent(share: float, digits: int | None = None) -> str:
    """Return a share from 0 to 1 as percent: a chance in whole percent, others with `digits`.

    A chance is an estimate, so it is never said to be 0 or 100 %.

    >>> percent(0.418), percent(0.9981), percent(0.0002)
    ('42 %', 'over 99 %', 'under 1 %')
    >>> percent(0.418, 1), percent(1.0, 0)
    ('41.8 %', '100 %')
    """
    if digits is not None:
        return f"{100 * share:.{digits}f} %"
    if share > MOST_CHANCE:
        return "over 99 %"
    return "under 1 %" if share < LEAST_CHANCE else f"{100 * share:.0f} %"
