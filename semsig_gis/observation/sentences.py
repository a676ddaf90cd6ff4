"""What people and detectors tell of a place, in rows and in words, as views.

Distances that are told in words become rough ranges, with what a person's guess is off by.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    MAX_RANGE_M,
    WILDCARD,
    InputError,
    Signature,
    SignatureSpec,
    UnknownNameError,
    wrap_degrees,
    wrapped_bearings,
)
from semsig_gis.observation.view import CLASSES, ROUNDING, Photo, View
from semsig_gis.storage import row_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.storage import Row

SEEN = ("types", "bearings", "detections", "see", "photos")
"""Keys of a row that say what was seen, of which one at least is needed."""
COLUMNS = ("types", "bearings", "ranges", "range_errors", "scores", "photo")
LOOK = ("heading", "fov", "sectors", "heading_error")
"""Keys of a row that say where a photo looks."""

RADIUS_M: float = SignatureSpec().radius
GUESS_ERROR = 0.25
"""Relative error of the distances by which a person tells near from far."""
THIRDS = {"near": (0, 1), "middle": (1, 2), "far": (2, 3)}
"""Rings around the viewpoint, in thirds of the range that a class is seen from."""
NORTHS = {"known": 0.0, "unknown": math.inf}
PAIR = 2
UNKNOWN = (None, "", "?", "nan")

_NUMBER = r"[-+]?\d+(?:\.\d*)?"
_PLACED = re.compile(
    rf"""(?P<name>.*?\S)\s+(?:
        (?:at\s+)?(?P<offset>{_NUMBER})\s*(?:°|deg(?:rees)?)?\s*(?P<side>left|right)
        | (?P<ahead>ahead)
        | (?:at\s+|@\s*)(?P<bearing>{_NUMBER})\s*(?:°|deg(?:rees)?\b)?
    )(?:\s+(?P<range>.*\S))?""",
    re.VERBOSE | re.IGNORECASE,
)
_ABSENT = re.compile(r"no\s+(?:other\s+)?(\S.*)", re.IGNORECASE)
_METRES = re.compile(
    rf"(?P<within>within\s+)?(?:about\s+|~\s*)?(?P<metres>{_NUMBER})\s*(?:m|met(?:re|er)s?)?"
    r"(?:\s+away)?",
    re.IGNORECASE,
)
_SECTOR = rf"({_NUMBER})\s*°?\s*-\s*({_NUMBER})\s*°?"
_SECTORS = re.compile(rf"{_SECTOR}(?:[\s,;]+{_SECTOR})*")


def parse_view(row: Row, *, taxonomy: Taxonomy, radius: float = RADIUS_M) -> View:
    """Make a view from a row of a file, or from what a person says.

    Parameters
    ----------
    row : dict
        What was seen, in one of these forms: ``types`` (symbols) and ``bearings`` (degrees), either
        of which may be missing, with ``ranges``, ``range_errors`` and ``scores``; ``detections``, a
        list of mappings with ``class``, ``bearing`` or ``offset``, ``range`` and ``range_error``;
        ``see``, a sentence; or ``photos``, a list of such rows. Beside it, where it looked:
        ``heading`` and ``fov``, or ``sectors``, and ``heading_error``. Other keys are left alone.
    taxonomy : Taxonomy
        The classes.
    radius : float, default 30
        Visibility range in metres of classes without one of their own: what "far" is measured by.

    Returns
    -------
    View
        The view, clockwise from north; of nothing where nothing was seen.

    Raises
    ------
    InputError
        If a part cannot be read, or the parts do not fit each other.
    UnknownNameError
        If a class is none of the taxonomy.

    Notes
    -----
    A class is a symbol, a name or another word (see `objects.keywords.class_code`), or a mapping of
    these to the chances that a detector gives them; what is left to one is for any class. A range
    is a number of metres, ``within 12 m``, or ``near``, ``middle`` or ``far``: thirds of the range
    from which the class is seen. These stand for the mean and the deviation of the logarithm of a
    distance that is spread evenly over the disc or the ring, off by another 25 % for a guess. An
    ``offset`` counts in degrees to the right of the heading; where that is not given, it is 0, and
    the north of the photo unknown.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> row = {"see": "lamp at 80 within 12 m, bench at 40", "heading": 60, "fov": 70}
    >>> view = parse_view(row, taxonomy=paper_taxonomy())
    >>> view.codes.tolist(), view.bearings.tolist(), view.ranges.round(1).tolist()
    ([10, 3], [40.0, 80.0], [nan, 7.3])
    """
    told = {name: value for name in row if (value := row_value(row, name)) is not None}
    lists = [name for name in ("detections", "see") if name in told]
    columns = [name for name in COLUMNS if name in told]
    photos = ["photos"] if "photos" in told else []
    if len(lists) > 1 or (lists and columns + photos):
        raise InputError(
            f"{' and '.join(lists + photos + columns)} were given; describe what was seen "
            "in one of these ways."
        )
    if photos and not columns:
        return _joined_view(told, taxonomy, radius)
    if lists:
        items = _said(str(told["see"])) if "see" in told else _mappings(told, "detections")
        told |= _columns(items, told, taxonomy)
    return _column_view(told, taxonomy, radius)


def said_row(text: str, taxonomy: Taxonomy) -> Row:
    """Return what somebody says was seen as keys of a row: symbols are types, all else a sentence.

    One word is symbols if each of its letters is one and it is no word for a class, or if it has
    capitals alone, so that ``DDBQ`` is refused for its ``Q``.
    """
    from semsig_gis.sources import class_code  # noqa: PLC0415 - it loads slowly

    word = text.strip()
    symbols = {"?", *(item.symbol for item in taxonomy.classes)}
    if word and (symbols.issuperset(word) or (word.isalpha() and word.isupper())):
        try:
            class_code(word, taxonomy)
        except UnknownNameError:
            return {"types": word}
    return {"see": text}


def require_seen(row: Row) -> None:
    """Refuse a row that does not say what was seen, not even that it was nothing."""
    # Without their names, an empty row would be one that saw nothing, whatever it was meant for.
    if all(row.get(name) is None for name in SEEN):
        raise InputError(
            "it needs types, bearings or both, or detections, see or photos, which may be empty "
            "where nothing was seen"
        )


def _joined_view(told: Row, taxonomy: Taxonomy, radius: float) -> View:
    """Return the view of several photos, each a row of its own."""
    shared = {name: told[name] for name in LOOK if name in told}
    photos = _mappings(told, "photos")
    for photo in photos:
        require_seen(photo)
    views = [parse_view(shared | photo, taxonomy=taxonomy, radius=radius) for photo in photos]
    if len(views) == 1:
        return views[0]
    if not views or any(view.bearings is None for view in views):
        raise InputError(
            "there are no photos, or objects in them have no bearing; give at least one photo, "
            "and a bearing for each object."
        )
    return View.joined(views).turned(0.0)


def _column_view(told: Row, taxonomy: Taxonomy, radius: float) -> View:
    """Return the view of columns, such as those of `View.to_dict`."""
    symbols, angles = told.get("types"), told.get("bearings")
    if isinstance(angles, str):
        angles = re.findall(r"[^\s,;]+", angles)
    elif isinstance(angles, (int, float)):
        angles = [angles]
    codes = None if symbols is None else taxonomy.encode(str(symbols).strip())
    scores = None
    if chances := _mappings(told, "scores"):
        scores = np.stack([_scores(one, taxonomy) for one in chances])
        codes = _likeliest(scores) if codes is None else codes
    bearings = wrapped_bearings(angles) if angles else None
    if bearings is None and (codes is None or not len(codes)):
        codes, bearings = np.empty(0, np.uint8), np.empty(0)
    plain = Signature(codes, bearings)
    look = {name: told[name] for name in LOOK if name in told}
    photos = [_photo(look | one) for one in _mappings(told, "photos")] or [_photo(look)]
    owners = [_number("photo", one) for one in _values(told.get("photo", []))]
    if any(one not in range(len(photos)) for one in owners):
        raise InputError(
            f"photo was given as {told['photo']!r}; give numbers from 0 to {len(photos) - 1}."
        )
    if len(photos) > 1 and "photo" not in told:
        raise InputError(
            "several photos were given, but not which one each object is in; give photo as well."
        )
    known = np.full(len(plain), WILDCARD) if codes is None else codes
    ranges, errors = _ranges(told, taxonomy.ranges(radius)[known])
    return View.of(
        plain,
        ranges=ranges,
        range_errors=errors,
        scores=scores,
        photo=np.array(owners, np.int64) if "photo" in told else None,
        photos=tuple(photos),
    ).turned(0.0)


def _columns(items: Sequence[Row], told: Row, taxonomy: Taxonomy) -> Row:
    """Return detections as columns, with the look of the photo where its heading is not told."""
    columns: Row = {
        f"{name}s": [one.get(name) for one in items] for name in ("range", "range_error")
    }
    classes = [_class(one.get("class"), taxonomy) for one in items]
    if any(isinstance(one, dict) for one in classes):
        columns["scores"] = [one if isinstance(one, dict) else {one: 1.0} for one in classes]
    else:
        columns["types"] = "".join(map(str, classes))
    ways = {name for one in items for name in ("bearing", "offset") if one.get(name) is not None}
    if not ways and items:
        return columns
    if any((one.get("bearing") is None) == (one.get("offset") is None) for one in items):
        raise InputError(
            "a detection has neither a bearing nor an offset, or both; give it one of them."
        )
    heading = told.get("heading")
    if "offset" in ways and heading is None:
        if "bearing" in ways or told.get("heading_error", "unknown") != "unknown":
            raise InputError(
                "offsets were given with bearings or an error of the heading, but without the "
                "heading that they are measured from; give it as well."
            )
        heading = 0.0
        columns |= {"heading": heading, "heading_error": "unknown"}
    columns["bearings"] = [
        _number("bearing", one["bearing"])
        if one.get("offset") is None
        else float(wrap_degrees(_number("heading", heading) + _number("offset", one["offset"])))
        for one in items
    ]
    return columns


def unplaced_parts(text: str) -> tuple[str, list[str], list[str]]:
    """Return a sentence of objects with directions, what else was seen, and what was not.

    Where no object has a direction, all stay in the sentence.

    >>> unplaced_parts("bench at 40, bus stop, lamp at 80, no hydrant")
    ('bench at 40, lamp at 80', ['bus stop'], ['hydrant'])
    >>> unplaced_parts("bench, lamp")
    ('bench, lamp', [], [])
    """
    parts = _parts(text)
    absent = [match[1] for part in parts if (match := _ABSENT.fullmatch(part))]
    seen = [part for part in parts if not _ABSENT.fullmatch(part)]
    placed = [part for part in seen if _PLACED.fullmatch(part)]
    if not placed:
        return ", ".join(seen), [], absent
    return ", ".join(placed), [part for part in seen if part not in placed], absent


def unplaced_codes(text: str, taxonomy: Taxonomy) -> tuple[str, tuple[int, ...], tuple[int, ...]]:
    """Return what `unplaced_parts` does, with class codes in the place of words."""
    sentence, *others = unplaced_parts(text)
    if not any(others):
        return sentence, (), ()
    from semsig_gis.sources import class_code  # noqa: PLC0415 - it loads slowly

    seen, absent = (tuple(class_code(word, taxonomy) for word in words) for words in others)
    return sentence, seen, absent


def _parts(text: str) -> list[str]:
    return [part for part in map(_spaced, re.split(r"[,;\n]", text)) if part]


def _said(text: str) -> list[Row]:
    """Return the detections that a sentence tells of."""
    found = []
    for part in _parts(text):
        match = _PLACED.fullmatch(part)
        if match is None:
            found.append({"class": part})
            continue
        said: Row = {key: match[key] for key in ("bearing", "offset", "range")}
        if match["ahead"]:
            said["offset"] = 0.0
        elif match["side"] and match["side"].lower() == "left":
            said["offset"] = -float(match["offset"])
        found.append({"class": match["name"]} | said)
    return found


def _class(told: object, taxonomy: Taxonomy) -> str | Row:
    """Return the symbol of a class, or the scores of several as they were given."""
    if isinstance(told, dict):
        return told
    if not isinstance(told, str):
        raise InputError(
            f"the class of a detection is {told!r}; give a symbol, a word or scores by word."
        )
    from semsig_gis.sources import class_code  # noqa: PLC0415 - it loads slowly

    return taxonomy.decode([class_code(told, taxonomy)])


def _scores(told: Row, taxonomy: Taxonomy) -> NDArray[np.float64]:
    """Return the chance of each class code; what is left to one is for any class."""
    from semsig_gis.sources import class_code  # noqa: PLC0415 - it loads slowly

    scores = np.zeros(CLASSES)
    for word, chance in told.items():
        scores[class_code(word, taxonomy)] += _number(f"the score of {word!r}", chance)
    rest = 1.0 - scores.sum()
    if not ((scores >= 0).all() and rest >= -ROUNDING):  # false for NaN too
        raise InputError(
            f"scores {told!r} are not chances; give numbers from 0 that add up to at most 1."
        )
    scores[WILDCARD] += rest if rest > ROUNDING else 0.0
    return scores


def _likeliest(scores: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the likeliest class of each object; a named one before any class."""
    return np.where(
        scores[:, 1:].max(axis=1) >= scores[:, WILDCARD], 1 + scores[:, 1:].argmax(axis=1), WILDCARD
    ).astype(np.uint8)


def _ranges(
    told: Row, furthest: NDArray[np.float64]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return the ranges of objects that are seen from so far, and their errors, None if unknown."""
    unknown = [None] * len(furthest)
    columns = []
    for name in ("ranges", "range_errors"):
        values = told.get(name, unknown)
        values = _values(values) if isinstance(values, (str, list)) else [values] * len(furthest)
        if len(values) != len(furthest):
            what = name.replace("_", " ")
            raise InputError(
                f"{len(values)} {what} were given for {len(furthest)} objects; give one for each."
            )
        columns.append(values)
    pairs = [_range(word, far) for word, far in zip(columns[0], furthest.tolist(), strict=True)]
    ranges, guessed = np.array(pairs).reshape(-1, 2).T
    given = [math.nan if one in UNKNOWN else _number("a range error", one) for one in columns[1]]
    errors = np.where(np.isnan(given), guessed, given)
    return _known(ranges), _known(errors)


def _known(values: NDArray[np.float64]) -> NDArray[np.float64] | None:
    return None if np.isnan(values).all() else values


def _range(told: object, furthest: float) -> tuple[float, float]:
    """Return a range and its error, NaN where they are not known."""
    if told in UNKNOWN:
        return math.nan, math.nan
    if isinstance(told, (int, float)):
        return float(told), math.nan
    text = _spaced(str(told)).lower()
    if third := THIRDS.get(text):
        return _spread(*(furthest * edge / 3.0 for edge in third))
    match = _METRES.fullmatch(text)
    metres = float(match["metres"]) if match else 0.0
    if match is None or not 0 < metres <= MAX_RANGE_M:
        raise InputError(
            f"range {told!r} cannot be read; give metres, 'within 12 m', 'near', 'middle' or "
            "'far', or '?' if it is not known."
        )
    return _spread(0.0, metres) if match["within"] else (metres, math.nan)


def _spread(inner: float, outer: float) -> tuple[float, float]:
    """Return a range and its error for a guess: anywhere in the ring between two distances."""

    def moments(radius: float) -> NDArray[np.float64]:
        """Integrate the logarithm of the distance, and its square, over the disc."""
        log = math.log(radius) if radius else 0.0
        return radius**2 * np.array([log - 0.5, log**2 - log + 0.5])

    mean, square = ((moments(outer) - moments(inner)) / (outer**2 - inner**2)).tolist()
    return math.exp(mean), math.hypot(math.sqrt(square - mean**2), GUESS_ERROR)


def _photo(look: Row) -> Photo:
    """Return where a photo looks."""
    heading, fov, error = (look.get(name) for name in ("heading", "fov", "heading_error"))
    sigma = None if error is None else NORTHS.get(str(error))
    if error is not None and sigma is None:
        sigma = _number("heading_error", error)
    if fov is None:
        return Photo(sectors=_sectors(look.get("sectors", [])), north_sigma=sigma)
    if "sectors" in look:
        raise InputError("a field of view was given with sectors; give one of the two.")
    if heading is None:
        raise InputError(
            "a field of view was given without the heading of the camera (--look); give the "
            "heading as well, or give sectors instead."
        )
    heading, fov = _number("heading", heading), _number("fov", fov)
    return Photo.looking(heading=heading, fov=fov, north_sigma=sigma)


def _sectors(told: object) -> tuple[tuple[float, float], ...]:
    """Return sectors from text such as ``20-90,180-250``, or from pairs."""
    if isinstance(told, str):
        text = _spaced(told)
        if _SECTORS.fullmatch(text):
            pairs = re.findall(_SECTOR, text)
            return tuple((float(start), float(end)) for start, end in pairs)
    elif isinstance(told, list) and all(
        isinstance(pair, list) and len(pair) == PAIR for pair in told
    ):
        return tuple((_number("a sector", start), _number("a sector", end)) for start, end in told)
    raise InputError(
        f"sectors were given as {told!r}; give bearings clockwise from one to the other, such as "
        "20-90,180-250 or [[20, 90], [180, 250]]."
    )


def _spaced(text: str) -> str:
    """Return text with one blank where there were several, which expressions read for ever."""
    return " ".join(text.split())


def _values(told: Any) -> list[Any]:  # noqa: ANN401 - any value of JSON
    """Return the values of a list, which in text stand between commas, semicolons or blanks."""
    if isinstance(told, str):
        text = _spaced(told)
        return re.split(" ?[,;] ?" if re.search("[,;]", text) else " ", text)
    return told if isinstance(told, list) else [told]


def _mappings(told: Row, name: str) -> list[Row]:
    """Return a list of mappings of names to values."""
    values = told.get(name, [])
    if not (isinstance(values, list) and all(isinstance(one, dict) for one in values)):
        raise InputError(
            f"{name} were given as {values!r}; give a list of mappings of names to values."
        )
    return values


def _number(what: str, told: Any) -> float:  # noqa: ANN401 - any value of JSON
    try:
        return float(told)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} was given as {told!r}; give a number.") from error
