"""Tables as rows of text, for a terminal or for Markdown."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass

__all__ = ["Table", "escaped", "one_line", "percent"]

# They join letters and emoji; every other character of their kind only hides or turns text.
JOINERS = "\u200c\u200d"


@dataclass(frozen=True, slots=True)
class Table:
    """A table to print.

    Parameters
    ----------
    title : str
        What it shows.
    columns : tuple of str
        Headings; the first column is text, the others are numbers with their units.
    rows : tuple of tuple of str
        Cells as text, one for each column; empty where there is nothing to say.
    note : str, default ""
        What a reader must know to read it rightly.

    Examples
    --------
    >>> Table("Sizes", ("What", "m"), (("step", "10"),)).note
    ''
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def _repr_markdown_(self) -> str:
        """Show the table in a notebook."""
        return self.markdown()

    def markdown(self) -> str:
        """Return the table as a Markdown section.

        Returns
        -------
        str
            A heading of the third level, the table and the note, ending in a newline.

        Examples
        --------
        >>> print(Table("Sizes", ("What", "m"), (("step", "10"),)).markdown(), end="")
        ### Sizes
        <BLANKLINE>
        | What | m |
        | --- | ---: |
        | step | 10 |
        """
        rules = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [self.columns, tuple(rules), *self.rows]
        table = "\n".join(f"| {' | '.join(escaped(cell) for cell in line)} |" for line in lines)
        note = f"\n{escaped(self.note)}\n" if self.note else ""
        return f"### {escaped(self.title)}\n\n{table}\n{note}"


def percent(share: float) -> str:
    """Return a share from 0 to 1 as percent with one decimal: ``41.8 %``."""
    return f"{100 * share:.1f} %"


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
