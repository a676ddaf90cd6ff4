"""Numbers in the notations of people and spreadsheets."""

from __future__ import annotations

import re

THOUSANDS_MARKS = r"\s'" + "\N{RIGHT SINGLE QUOTATION MARK}"
# Thousands are separated by blanks, apostrophes, points or commas.
GROUPED = {
    mark: re.compile(rf"[+-]?\d{{1,3}}(?:[{mark}]\d{{3}})+(?=$|[^\d{mark}])")
    for mark in (THOUSANDS_MARKS, ".", ",")
}
# Spreadsheets keep numbers as text with ="45.7" and '45.7.
KEPT_AS_TEXT = re.compile(r"^(?:=\"|')(.*?)\"?$")
# In a file with commas between columns, "1,234" may be a decimal or a thousand.
THOUSANDS_OR_NOT = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


def decimal(text: str, *, english: bool = False) -> float:
    """Parse a number with a decimal point or comma, with or without separators of thousands.

    A single comma is a decimal comma. With `english`, ``1,234`` is ambiguous. ValueError for an
    ambiguous text or one that is not a number.
    """
    plain = KEPT_AS_TEXT.sub(r"\1", text.strip()).replace("\N{MINUS SIGN}", "-")
    if GROUPED[THOUSANDS_MARKS].match(plain):
        plain = re.sub(f"[{THOUSANDS_MARKS}]", "", plain)
    commas, points = plain.count(","), plain.count(".")
    # The comma separates thousands if there are several, or if a point follows.
    comma_groups = commas > 1 or (commas == 1 and plain.rfind(",") < plain.rfind("."))
    mark = "," if comma_groups else "."
    if ((commas and points) or max(commas, points) > 1) and GROUPED[mark].match(plain):
        plain = plain.replace(mark, "")
    if english and THOUSANDS_OR_NOT.fullmatch(plain):
        raise ValueError(f"{text!r} is a decimal or a thousand")
    return float(plain.replace(",", "."))
