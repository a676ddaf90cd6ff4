"""Convert output of the command to lines of the log and rows of layers, without QGIS."""

from __future__ import annotations

import json
import math
import re
from typing import Any

from .command import SETTINGS, CommandError

__all__ = [
    "CANDIDATE_FIELDS",
    "PLACE_FIELDS",
    "answer_lines",
    "candidate_rows",
    "log_text",
    "parse_answer",
    "percent",
    "place_row",
    "ring",
]

# Names and types that the provider of memory layers accepts in every version of QGIS.
CANDIDATE_FIELDS = {
    "rank": "integer",
    "rank_high": "integer",
    "cell_id": "int8",
    "types": "string",
    "length": "integer",
    "chance": "double",
    "distance": "double",
}
PLACE_FIELDS = {
    "answered": "string",
    "chance": "double",
    "within_m": "double",
    "sigma_m": "double",
    "longer_m": "double",
    "shorter_m": "double",
    "bearing": "double",
    "heading": "double",
    "elsewhere": "double",
    "fit": "double",
}
CORNERS = 72
BORDER = re.compile("[┏┡└]")
BARS = re.compile("[┃│]")


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


def parse_answer(printed: str) -> dict[str, Any]:
    """Return the answer in the output of the command.

    Parameters
    ----------
    printed : str
        Its standard output.

    Returns
    -------
    dict
        The answer.

    Raises
    ------
    CommandError
        If it is not an answer.
    """
    try:
        answer: dict[str, Any] = json.loads(printed)
        answer["crs"], answer["candidates"]
    except (KeyError, TypeError, ValueError) as error:
        message = (
            "The semsig command gave an answer that this plugin does not understand; install a "
            "semsig_gis and a plugin of the same version, or choose another command in "
            f"{SETTINGS}."
        )
        raise CommandError(message) from error
    return answer


def answer_lines(answer: dict[str, Any]) -> list[str]:
    """Return the lines of the log for an answer.

    Parameters
    ----------
    answer : dict
        See `parse_answer`.

    Returns
    -------
    list of str
        The region if there is no answer, doubts, and the chance of the place, or the ties of the
        candidates; notes on the query; the size of the regions to search.

    Examples
    --------
    >>> best = {"rank_low": 1, "rank_high": 4}
    >>> answer_lines({"candidates": [best], "tied_beyond": 3})
    ['The best 4 cells share the ranks 1 to 4.', '3 further cells tie with the last candidate.']
    """
    place, searched = answer.get("place"), answer.get("searched")
    if place is None:
        lines = _tie_lines(answer)
    else:
        sure = answer["answered"]
        lines = [] if sure else [f"Cannot tell. {answer['region']['text']}."]
        lines += [answer["doubt"]] if answer["doubt"] else []
        within, chance = f"{place['within_m']:g} m", percent(place["chance"])
        verdict = "The place is" if sure else "The best place is"
        lines.append(f"{verdict} within {within} of the ellipse's middle: chance {chance}.")
    lines += [f"Note: {note}" for note in answer.get("notes", [])]
    if searched is not None:
        regions = searched["regions"]
        share = percent(searched["chance"]) if "chance" in searched else ""
        chance = f", with {share} of the chance" if share else ""
        lines.append(
            f"To search: {regions:,} region{'' if regions == 1 else 's'}, "
            f"{searched['km2']:.4g} km2, {searched['percent']:.3g} % of the city{chance}."
        )
    return lines


def percent(chance: float) -> str:
    """Return a chance in whole percent, as the command writes it.

    Parameters
    ----------
    chance : float
        From 0 to 1.

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
        return "over 99 %"
    return "under 1 %" if chance < 0.01 else f"{100 * chance:.0f} %"  # noqa: PLR2004


def _tie_lines(answer: dict[str, Any]) -> list[str]:
    tied, beyond = answer["candidates"][0]["rank_high"], answer["tied_beyond"]
    lines = [
        "The best cell ties with no other."
        if tied == 1
        else f"The best {tied:,} cells share the ranks 1 to {tied:,}."
    ]
    if beyond:
        further = "1 further cell ties" if beyond == 1 else f"{beyond:,} further cells tie"
        lines.append(f"{further} with the last candidate.")
    return lines


def candidate_rows(answer: dict[str, Any]) -> list[tuple[float, float, list[Any]]]:
    """Return x, y and the values of `CANDIDATE_FIELDS` of each candidate.

    Parameters
    ----------
    answer : dict
        See `parse_answer`.

    Returns
    -------
    list of tuple
        Best first.
    """
    return [
        (
            candidate["x"],
            candidate["y"],
            [
                candidate.get("rank", candidate.get("rank_low")),
                candidate.get("rank", candidate.get("rank_high")),
                candidate["cell_id"],
                candidate["types"],
                candidate["length"],
                candidate.get("chance"),
                candidate.get("distance"),
            ],
        )
        for candidate in answer["candidates"]
    ]


def place_row(answer: dict[str, Any]) -> tuple[list[tuple[float, float]], list[Any]] | None:
    """Return the outline of the place and the values of `PLACE_FIELDS`.

    Parameters
    ----------
    answer : dict
        See `parse_answer`.

    Returns
    -------
    tuple or None
        The ellipse that contains the place with a chance of 90 %, if the answer is right; None
        if the method only ranks cells.
    """
    place = answer.get("place")
    if place is None:
        return None
    ellipse = place["ellipse_90"]
    outline = ring(
        (place["x"], place["y"]), ellipse["longer"], ellipse["shorter"], ellipse["bearing"]
    )
    values = [
        "yes" if answer["answered"] else "cannot tell",
        place["chance"],
        place["within_m"],
        place["sigma"],
        ellipse["longer"],
        ellipse["shorter"],
        ellipse["bearing"],
        place["heading"],
        answer["elsewhere"],
        answer["fit"],
    ]
    return outline, values


def ring(
    centre: tuple[float, float], longer: float, shorter: float, bearing: float
) -> list[tuple[float, float]]:
    """Return the corners of an ellipse as a closed ring.

    Parameters
    ----------
    centre : tuple of float
        The centre.
    longer, shorter : float
        Half axes.
    bearing : float
        Direction of the longer axis, in degrees clockwise from north.

    Returns
    -------
    list of tuple
        The corners, the first again at the end.

    Examples
    --------
    >>> [round(part) for part in ring((5.0, 5.0), 2.0, 1.0, 0.0)[0]]
    [5, 7]
    """
    turn = math.radians(bearing)
    along, across = (math.sin(turn), math.cos(turn)), (math.cos(turn), -math.sin(turn))
    corners = []
    for corner in range(CORNERS):
        angle = math.tau * corner / CORNERS
        # The corner in the axes of the ellipse, then turned by its bearing.
        u, v = longer * math.cos(angle), shorter * math.sin(angle)
        corners.append(
            (
                centre[0] + u * along[0] + v * across[0],
                centre[1] + u * along[1] + v * across[1],
            )
        )
    return [*corners, corners[0]]
