"""Numbers as people and spreadsheets write them."""

from __future__ import annotations

import re

APART = r"\s'" + "\N{RIGHT SINGLE QUOTATION MARK}"
# Thousands are set apart by blanks of any kind, by apostrophes, or by the other of point and comma.
GROUPED = {
    mark: re.compile(rf"[+-]?\d{{1,3}}(?:[{mark}]\d{{3}})+(?=$|[^\d{mark}])")
    for mark in (APART, ".", ",")
}
# In a file whose columns are set apart by commas, this could be either.
THOUSANDS_OR_NOT = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")


def decimal(text: str, *, english: bool = False) -> float:
    """Return a number with a decimal point or comma, and thousands set apart or not.

    A single comma is a decimal comma, but in `english` text, where ``1,234`` may be anything.
    ValueError where it is that or no number.
    """
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    if GROUPED[APART].match(plain):
        plain = re.sub(f"[{APART}]", "", plain)
    commas, points = plain.count(","), plain.count(".")
    several = commas > 1 or (commas == 1 and plain.rfind(",") < plain.rfind("."))
    mark = "," if several else "."
    if ((commas and points) or max(commas, points) > 1) and GROUPED[mark].match(plain):
        plain = plain.replace(mark, "")
    if english and THOUSANDS_OR_NOT.fullmatch(plain):
        raise ValueError(f"{text!r} is a decimal or a thousand")
    return float(plain.replace(",", "."))
