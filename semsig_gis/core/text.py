"""Text from anywhere, as a terminal may show it."""

from __future__ import annotations

import array
import sys
import unicodedata

# Categories of Unicode: control, format, half a character, and ends of lines and paragraphs.
HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
# They join letters and emoji.
JOINERS = "\u200c\u200d"
UTF16 = f"utf-16-{sys.byteorder[0]}e"


def visible(text: str) -> str:
    r"""Return text in which what would move the cursor or turn other text is seen: ``\u001b``.

    Control characters, ends of lines among them, marks of direction and halves of characters are
    written as in JSON.
    """
    return text if text.isprintable() else "".join(map(_shown, text))


def _shown(character: str) -> str:
    if unicodedata.category(character) not in HIDDEN or character in JOINERS:
        return character
    units = array.array("H", character.encode(UTF16, "surrogatepass"))
    return "".join(f"\\u{unit:04x}" for unit in units)


def percent(share: float, digits: int = 1) -> str:
    """Return a share from 0 to 1 as percent: ``41.8 %``.

    >>> percent(0.418), percent(1.0, 0)
    ('41.8 %', '100 %')
    """
    return f"{100 * share:.{digits}f} %"
