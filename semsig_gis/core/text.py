"""Text of others made fit to be shown."""

from __future__ import annotations

import unicodedata


def plain_number(number: float) -> str:
    """Write a number so that it reads back the same, without a needless decimal point."""
    return str(int(number)) if number == int(number) else repr(float(number))


# They join letters and emoji; every other character of their kind only hides or turns text.
JOINERS = "\u200c\u200d"


def escaped(text: str) -> str:
    """Return text on one line that cannot break a Markdown table or become HTML."""
    plain = " ".join(text.split())
    return plain.replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")


def one_line(text: str) -> str:
    """Return text from data on one line, without characters that hide or turn other text.

    Those are control characters and marks of direction. Halves of characters, which no file can
    hold, become U+FFFD.
    """
    plain = " ".join(text.split())
    # What is left out may have stood between two spaces.
    return plain if plain.isprintable() else " ".join("".join(map(_shown, plain)).split())


def _shown(character: str) -> str:
    kind = unicodedata.category(character)
    if kind == "Cs" or ord(character) & 0xFFFE == 0xFFFE:  # noqa: PLR2004 - Unicode's own number
        return "\ufffd"
    return "" if kind in {"Cc", "Cf"} and character not in JOINERS else character
