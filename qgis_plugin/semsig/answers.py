"""Sentences and lines for answers of the command, without QGIS."""

from __future__ import annotations

import re
from html import escape
from itertools import groupby
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["doubt", "likely", "links_line", "log_text", "percent", "words"]

BORDER = re.compile("[┏┡└]")
BARS = re.compile("[┃│]")
LEAST_CHANCE = 0.01  # as in the layers of an answer
# As in `semsig_gis.localization`.
LEAST_ELSEWHERE, LEAST_FIT = 0.1, 0.01


def log_text(printed: str) -> str:
    """Return the output of the command without the frames of its tables.

    The log of QGIS has a proportional font and removes blanks, which breaks frames.

    Parameters
    ----------
    printed : str
        Its standard output.

    Returns
    -------
    str
        The same text, with ``|`` between the cells of a table.

    Examples
    --------
    >>> table = ["Rows", "┏━━━━┳━━━┓", "┃ a  ┃ b ┃", "┡━━━━╇━━━┩", "│ 10 │   │", "└────┴───┘"]
    >>> print(log_text(chr(10).join([*table, "done"])))
    Rows
    a | b
    10 |
    done
    """
    lines = [line for line in printed.splitlines() if not BORDER.match(line)]
    return "\n".join(
        " | ".join(cell.strip() for cell in BARS.split(line)[1:-1]).rstrip()
        if BARS.match(line)
        else line.rstrip()
        for line in lines
    )


def percent(chance: float, tr: Callable[[str], str] = str) -> str:
    """Return a chance in whole percent.

    Parameters
    ----------
    chance : float
        From 0 to 1.
    tr : callable, optional
        Returns the translation of a text.

    Returns
    -------
    str
        Never 0 or 100 %.

    Examples
    --------
    >>> percent(0.418), percent(0.9981), percent(0.0002)
    ('42 %', 'over 99 %', 'under 1 %')
    """
    if chance > 0.995:  # noqa: PLR2004 - as `semsig_gis.core.percent`
        return tr("over 99 %")
    return tr("under 1 %") if chance < 0.01 else f"{100 * chance:.0f} %"  # noqa: PLR2004


def words(types: str, titles: dict[str, str]) -> str:
    """Return what is seen in words, in its order, with equal neighbours counted.

    Parameters
    ----------
    types : str
        Symbols of classes.
    titles : dict of str to str
        The title of each symbol.

    Returns
    -------
    str
        The titles in lower case.

    Examples
    --------
    >>> words("MDD", {"M": "Bus stop", "D": "Street light"})
    'bus stop, 2 × street light'
    """
    parts = []
    for symbol, group in groupby(types):
        title, count = titles.get(symbol, symbol).lower(), len([*group])
        parts.append(title if count == 1 else f"{count} × {title}")
    return ", ".join(parts)


def likely(candidates: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the candidates with a chance of at least 1 %, and the best in any case.

    Examples
    --------
    >>> likely([{"chance": 0.005}, {"chance": 0.001}])
    [{'chance': 0.005}]
    """
    return candidates[:1] + [row for row in candidates[1:] if row["chance"] >= LEAST_CHANCE]


def links_line(links: dict[str, str]) -> str:
    """Return links as a line of HTML.

    Examples
    --------
    >>> links_line({"Map": "https://a.org/?x=1&y=2"})
    '<a href="https://a.org/?x=1&amp;y=2">Map</a>'
    """
    return " · ".join(
        f'<a href="{escape(link)}">{escape(title)}</a>' for title, link in links.items()
    )


def doubt(answer: dict[str, Any], tr: Callable[[str], str] = str) -> str:
    """Return a sentence on whether a view is from elsewhere and how well it fits.

    Parameters
    ----------
    answer : dict
        An answer of the workbench: ``elsewhere`` is the chance that the view is not from the area,
        ``fit`` the share of simulated views from the place that fit it worse, or None.
    tr : callable, optional
        Returns the translation of a text.

    Returns
    -------
    str
        Empty if both are unremarkable.

    Examples
    --------
    >>> doubt({"elsewhere": 0.02, "fit": 0.004})
    'The view fits the best place badly: worse than 996 of 1,000 simulated views from there.'
    """
    fit, elsewhere = answer["fit"], answer["elsewhere"]
    fits_badly, is_near = fit is not None and fit < LEAST_FIT, elsewhere < LEAST_ELSEWHERE
    if is_near and not fits_badly:
        return ""
    if is_near:
        text = tr(
            "The view fits the best place badly: worse than {worse} of 1,000 simulated views from "
            "there."
        )
    elif fits_badly:
        text = tr(
            "The view may not be from this area: chance {chance}; it fits the best place worse "
            "than {worse} of 1,000 simulated views from there."
        )
    else:
        text = tr("The view may not be from this area: chance {chance}.")
    worse = f"{1000.0 * (1.0 - (fit or 0.0)):,.0f}"
    return text.format(chance=percent(elsewhere, tr), worse=worse)
