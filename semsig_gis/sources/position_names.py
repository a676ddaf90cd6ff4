"""What the name of a field says of positions in it."""

from __future__ import annotations

import functools
import itertools
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.sources.class_keywords import CAMEL_CASE
from semsig_gis.sources.position_values import plain_letters, position_words

if TYPE_CHECKING:
    from collections.abc import Iterable

    from semsig_gis.sources.layer_spec import AxisOrder

WHOLE_WORD_LETTERS = 5
FIRST_IDEOGRAPH = 0x1100
LON_LAT: AxisOrder = "lon_lat"
LAT_LON: AxisOrder = "lat_lon"


@functools.cache
def tokens_of(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name, in lower case and without accents."""
    parts = re.findall(r"[^\W\d_]+|\d+", CAMEL_CASE.sub(" ", name))
    plain = (re.findall(r"[^\W\d_]+|\d+", plain_letters(part)) for part in parts)
    return tuple(itertools.chain.from_iterable(plain))


@functools.cache
def _phrases(axis: str, strength: str) -> tuple[tuple[str, ...], ...]:
    words = sorted(position_words()[axis][strength], key=len, reverse=True)
    return tuple(tokens_of(word) for word in words)


@dataclass(frozen=True, slots=True)
class Role:
    """The axis that a name says, how surely (2 or 1), and its other words."""

    axis: str
    strength: int
    rest: tuple[str, ...]


@functools.cache
def role_of(name: str) -> Role | None:
    """Return the axis that a name says by its longest word for one, or None."""
    tokens = tokens_of(name)
    hits: list[tuple[int, int, Role]] = []
    for axis, (kind, strength) in itertools.product("xy", (("words", 2), ("doubtful", 1))):
        for phrase in _phrases(axis, kind):
            rest = _without(tokens, phrase)
            if rest is not None:
                hits.append((strength, sum(map(len, phrase)), Role(axis, strength, rest)))
    return max(hits, key=lambda hit: hit[:2], default=(0, 0, None))[2]


def _without(tokens: tuple[str, ...], phrase: tuple[str, ...]) -> tuple[str, ...] | None:
    """Return the words of a name without a phrase; None if it is not in it."""
    size = len(phrase)
    if size == 1 and ord(phrase[0][0]) >= FIRST_IDEOGRAPH:
        joined = " ".join(tokens)
        return tokens_of(joined.replace(phrase[0], " ")) if phrase[0] in joined else None
    for start in range(len(tokens) - size + 1):
        *others, last = tokens[start : start + size]
        longer = len(phrase[-1]) >= WHOLE_WORD_LETTERS and last.startswith(phrase[-1])
        if tuple(others) == phrase[:-1] and (last == phrase[-1] or longer):
            return tokens[:start] + tokens[start + size :]
    glued = {"x": "frames", "y": "frames"} | dict.fromkeys(("lat", "lon", "lng", "long"), "glued")
    if size == 1 and (kind := glued.get(phrase[0])):
        words = [
            word for word in position_words()["hints"][kind] if len(word) > 1 or kind == "glued"
        ]
        for start, token in enumerate(tokens):
            for word in words:
                if token in {word + phrase[0], phrase[0] + word}:
                    return (*tokens[:start], word, *tokens[start + 1 :])
    return None


@functools.cache
def hints(kind: str) -> frozenset[str]:
    """Return the words of a kind of hints on positions."""
    hints = position_words()["hints"][kind]
    return frozenset(itertools.chain.from_iterable(map(tokens_of, hints)))


def o_is_east_in(fields: Iterable[str]) -> bool:
    """Whether the fields are in German, in which O stands for Ost, which is east."""
    german = {
        token for word in position_words()["hemispheres"]["german"] for token in tokens_of(word)
    }
    return any(german & {*tokens_of(field)} for field in fields)


def order_by_name(field: str) -> AxisOrder | None:
    """Return the order of a pair that the name of its field says, or None."""
    name = "".join(tokens_of(field))
    lat, lon = name.find("lat"), max(name.find("lon"), name.find("lng"))
    if lat >= 0 and lon >= 0:
        return LAT_LON if lat < lon else LON_LAT
    if name in {"coordinates", "xy"} or name.endswith("xy"):
        return LON_LAT
    return LAT_LON if name.endswith("yx") else None


def crs_in_name(name: str) -> str | None:
    """Return the CRS in the name of a field, such as X_L93 or easting_25832, or None."""
    tokens = tokens_of(name)
    for size in (3, 2, 1):
        for start in range(len(tokens) - size + 1):
            word = "".join(tokens[start : start + size])
            for key in (word, word.lstrip("xy")):
                if key in position_words()["grid_names"]:
                    return str(position_words()["grid_names"][key])
    for token in tokens:
        if re.fullmatch(r"[1-9]\d{3,4}", token):
            try:
                if CRS.from_epsg(int(token)).is_projected:
                    return f"EPSG:{token}"
            except CRSError:
                continue
    return None
