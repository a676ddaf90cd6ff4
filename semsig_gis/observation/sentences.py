"""Parse observations (rows of values or sentences) into views.

Distances in words become rough ranges with an error that includes a person's guess.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core import (
    MAX_RANGE_M,
    WILDCARD,
    InputError,
    Signature,
    SignatureSpec,
    nearest_name,
    wrap_degrees,
    wrapped_bearings,
)
from semsig_gis.observation.sentence_items import METRES
from semsig_gis.observation.spoken import read_sentence
from semsig_gis.observation.view import CLASSES, ROUNDING, Photo, View
from semsig_gis.observation.vocabulary import Vocabulary
from semsig_gis.sources import class_codes
from semsig_gis.storage import row_value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from semsig_gis.core import Taxonomy
    from semsig_gis.observation.vocabulary import Codes
    from semsig_gis.storage import Row

SEEN = ("types", "bearings", "detections", "see", "photos", "signs")
"""Keys of a row that describe what was seen; at least one is required."""
COLUMNS = (
    *("types", "bearings", "bearing_errors", "ranges", "range_errors", "scores", "texts"),
    "photo",
)
LOOK = ("heading", "fov", "sectors", "heading_error")
"""Keys of a row that describe the direction of a photo."""

RADIUS_M: float = SignatureSpec().radius
LEAST_LETTERS = 4
"""Length of the shortest text that is a word if it is written like one."""
GUESS_ERROR = 0.25
"""Relative error of distances that a person estimates."""
THIRDS = {"near": (0, 1), "middle": (1, 2), "far": (2, 3)}
"""Rings around the viewpoint, in thirds of the visibility range of a class."""
HEADING_ERRORS = {"known": 0.0, "unknown": math.inf}
NO_SIGHT = (
    "where you look is not known, so that left and right say only how things lie to each other; "
    "say it as well, such as 'facing north'."
)
UNKNOWN = (None, "", "?", "nan")

_NUMBER = r"[-+]?\d+(?:\.\d*)?"
_METRES = re.compile(
    rf"(?P<within>within\s+)?(?:about\s+|~\s*)?(?P<metres>{_NUMBER})\s*"
    r"(?:(?P<kilo>k|kilo)?(?:m|met(?:re|er)s?))?"
    r"(?:\s+away)?",
    re.IGNORECASE,
)
_SECTOR = rf"({_NUMBER})\s*°?\s*-\s*({_NUMBER})\s*°?"
_SECTORS = re.compile(rf"{_SECTOR}(?:[\s,;]+{_SECTOR})*")


def parse_view(row: Row, *, taxonomy: Taxonomy, radius: float = RADIUS_M) -> View:
    """Return the view that a row of a file, or of a person's description, contains.

    Parameters
    ----------
    row : dict
        The observed objects, in one of these forms: ``types`` (symbols) and ``bearings`` (degrees),
        one of which may be missing, with ``ranges``, ``range_errors`` and ``scores``;
        ``detections``, a list of mappings with ``class``, ``bearing`` or ``offset``,
        ``bearing_error``, ``range``, ``range_error`` and ``text``, what is written on it; ``see``,
        a sentence (see `read_sentence`); or ``photos``, a list of rows. In addition, the direction
        of the photo: ``heading`` and ``fov``, or ``sectors``, and ``heading_error``. Other keys are
        ignored.
    taxonomy : Taxonomy
        The classes.
    radius : float, default 30
        Visibility range in metres of classes without their own; "far" depends on it.

    Returns
    -------
    View
        The objects, clockwise from north; none if the row contains none.

    Raises
    ------
    InputError
        If a value cannot be read, or values contradict each other.
    UnknownNameError
        If a class is not in the taxonomy.

    Notes
    -----
    A class is a symbol, a name or another word (see `sources.class_codes`), a family, which is any
    of its classes, or a mapping of these to probabilities from a detector; the rest, up to one, is
    for any class. A range is a number of metres, ``within 12 m``, or ``near``, ``middle`` or
    ``far``: thirds of the visibility range of the class. For these words, the distance is uniform
    over the disc or the ring: the view has the mean and the standard deviation of its logarithm,
    with 25 % added for a guess. An ``offset`` is in degrees to the right of the heading; without a
    heading, the heading is 0 and the north of the photo unknown.

    Examples
    --------
    >>> from semsig_gis import paper_taxonomy
    >>> row = {"see": "lamp at 80 within 12 m, bench at 40", "heading": 60, "fov": 70}
    >>> view = parse_view(row, taxonomy=paper_taxonomy())
    >>> view.codes.tolist(), view.bearings.tolist(), view.ranges.round(1).tolist()
    ([10, 3], [40.0, 80.0], [nan, 7.3])
    """
    view, unplaced, absent = parse_seen(row, taxonomy=taxonomy, radius=radius)
    if unplaced:
        raise InputError(
            f"{row['see']!r} has things with and without a direction, which is not accepted here; "
            "give each thing a direction, or none of them."
        )
    if absent:
        raise InputError(
            f"{row['see']!r} says what is not in sight, which is not accepted here; leave it out."
        )
    return view


def parse_seen(row: Row, *, taxonomy: Taxonomy, radius: float) -> tuple[View, Codes, Codes]:
    """Return the view of a row as `parse_view` does, and what else its sentence says.

    These are the class codes of objects that were seen in an unknown direction, if others have a
    direction, and of objects that are not in sight.
    """
    values = {name: value for name in row if (value := row_value(row, name)) is not None}
    lists = [name for name in ("detections", "see") if name in values]
    columns = [name for name in COLUMNS if name in values]
    photos = ["photos"] if "photos" in values else []
    if len(lists) > 1 or (lists and columns + photos):
        raise InputError(
            f"{' and '.join(lists + photos + columns)} were given; describe what was seen "
            "in one of these ways."
        )
    if photos and not columns:  # one row for each photo
        shared = {name: values[name] for name in LOOK if name in values}
        rows = mappings(values["photos"], "photos")
        for photo in rows:
            require_seen(photo)
        signs = list(_texts(values, "signs"))  # those of all photos, kept with the first
        rows = [
            {**photo, "signs": [*signs, *_texts(photo, "signs")]} if not row and signs else photo
            for row, photo in enumerate(rows)
        ]
        views = [parse_view(shared | photo, taxonomy=taxonomy, radius=radius) for photo in rows]
        if not views or (len(views) > 1 and any(view.bearings is None for view in views)):
            raise InputError(
                "there are no photos, or objects in them have no bearing; give at least one photo, "
                "and a bearing for each object."
            )
        return (views[0] if len(views) == 1 else View.joined(views).turned(0.0)), (), ()
    if "see" not in values:
        if lists:
            values |= _columns(mappings(values["detections"], "detections"), values, taxonomy)
        return _columns_view(values, taxonomy, radius), (), ()
    sentence = read_sentence(str(values["see"]), taxonomy)
    if "heading" in values and "heading" in sentence.row:
        raise InputError(
            f"the direction of sight was given in {values['see']!r} and as a heading of "
            f"{values['heading']}; give it once."
        )
    signs = [*_texts(values, "signs"), *_texts(sentence.row, "signs")]
    values = {**values, **sentence.row, "signs": signs}
    items = values["detections"]
    keys = {name for item in items for name in ("bearing", "offset") if name in item}
    if len(keys) < 2 or "heading" in values:  # noqa: PLR2004
        values |= _columns(items, values, taxonomy)
        view = replace(_columns_view(values, taxonomy, radius), notes=sentence.notes)
        return view, sentence.unplaced, sentence.absent
    if "sectors" in values:
        raise InputError(
            f"{values['see']!r} mixes directions from north (at 40, NE) with those from the "
            "direction of sight (left, 3 o'clock); say where you look as well, such as "
            "'facing north'."
        )
    # The directions from that of sight turn together, as those of a photo of unknown north.
    parts = [[item for item in items if name in item] for name in ("bearing", "offset")]
    views = [
        _columns_view(shared | _columns(part, {}, taxonomy), taxonomy, radius)
        for part, shared in zip(parts, ({"signs": signs}, {}), strict=True)
    ]
    view = replace(View.joined(views).turned(0.0), notes=(*sentence.notes, NO_SIGHT))
    return view, sentence.unplaced, sentence.absent


def text_row(text: str, taxonomy: Taxonomy) -> Row:
    """Return a person's text as a row: ``types`` if it consists of symbols, otherwise ``see``.

    One word consists of symbols if it has only capitals, or if all its letters are symbols, it is
    no word for a thing in any language, and not written like a word: four or more lower-case
    letters, the first perhaps a capital. Then ``DDBQ`` is an error because of its ``Q``.
    """
    word = text.strip()
    symbols = {"?", *(item.symbol for item in taxonomy.classes)}
    is_like_word = len(word) >= LEAST_LETTERS and word.isalpha() and word[1:].islower()
    is_symbols = symbols.issuperset(word) and not is_like_word
    if word and (is_symbols or (word.isalpha() and word.isupper())):
        codes = len(word) > 1 and Vocabulary.of([word], taxonomy).codes_of([word])
        return {"see": text} if codes else {"types": word}
    return {"see": text}


def require_seen(row: Row) -> None:
    """Raise InputError if a row has none of the keys `SEEN`, whose values may be empty."""
    # Otherwise a row of another kind would count as a view without objects.
    if all(row.get(name) is None for name in SEEN):
        hints = (
            f"the key {key!r} is unknown{near}; "
            for key in row
            if key not in (*LOOK, *SEEN) and (near := nearest_name(str(key), SEEN))
        )
        raise InputError(
            f"{next(hints, '')}it needs types, bearings or both, or detections, see or photos, "
            "which may be empty where nothing was seen"
        )


def _columns_view(values: Row, taxonomy: Taxonomy, radius: float) -> View:
    """Return the view in columns such as those of `View.to_dict`."""
    symbols, angles = values.get("types"), values.get("bearings")
    if isinstance(angles, str):
        angles = re.findall(r"[^\s,;]+", angles)
    elif isinstance(angles, (int, float)):
        angles = [angles]
    codes = None if symbols is None else taxonomy.encode(str(symbols).strip())
    scores = None
    if chances := mappings(values.get("scores", []), "scores"):
        scores = np.stack([_scores(item, taxonomy) for item in chances])
        if codes is None:
            # The likeliest class, before "any class"; none of several with equal scores.
            most = scores[:, 1:].max(axis=1, keepdims=True)
            best = (most[:, 0] >= scores[:, WILDCARD]) & ((scores[:, 1:] == most).sum(axis=1) == 1)
            codes = np.where(best, 1 + scores[:, 1:].argmax(axis=1), WILDCARD).astype(np.uint8)
    bearings = wrapped_bearings(angles) if angles else None
    if bearings is None and (codes is None or not len(codes)):
        codes, bearings = np.empty(0, np.uint8), np.empty(0)
    plain = Signature(codes, bearings)
    # Photos inherit the direction of the row.
    look = {name: values[name] for name in LOOK if name in values}
    rows = mappings(values.get("photos", []), "photos")
    photos = [_photo(look | row) for row in rows] or [_photo(look)]
    owners = [_number("photo", number) for number in _values(values.get("photo", []))]
    if any(number not in range(len(photos)) for number in owners):
        raise InputError(
            f"photo was given as {values['photo']!r}; give numbers from 0 to {len(photos) - 1}."
        )
    if len(photos) > 1 and "photo" not in values:
        raise InputError(
            "several photos were given, but not which one each object is in; give photo as well."
        )
    classes = np.full(len(plain), WILDCARD) if codes is None else codes
    furthest = taxonomy.ranges(radius)
    limits = np.stack([furthest[classes]] * 2, axis=1)
    if scores is not None and len(scores) == len(plain):  # of all classes that it may be of
        several = classes == WILDCARD
        possible = np.where(scores[several] > 0, furthest, np.nan)
        limits[several] = np.stack([np.nanmin(possible, 1), np.nanmax(possible, 1)], axis=1)
    ranges, errors = _ranges(values, limits)
    return View.of(
        plain,
        ranges=ranges,
        range_errors=errors,
        bearing_errors=_errors(values, "bearing_errors", len(plain)),
        scores=scores,
        photo=np.array(owners, np.int64) if "photo" in values else None,
        texts=_texts(values, "texts") if "texts" in values else None,
        signs=_texts(values, "signs"),
        photos=tuple(photos),
    ).turned(0.0)


def _columns(items: Sequence[Row], values: Row, taxonomy: Taxonomy) -> Row:
    """Return detections as columns, with a heading if offsets need one and `values` has none."""
    columns: Row = {
        f"{name}s": [item.get(name) for item in items]
        for name in ("bearing_error", "range", "range_error")
    }
    if any(item.get("text") is not None for item in items):
        columns["texts"] = [item.get("text") for item in items]
    classes = [_class(item, taxonomy) for item in items]
    if any(isinstance(value, dict) for value in classes):
        columns["scores"] = [
            value if isinstance(value, dict) else {value: 1.0} for value in classes
        ]
    else:
        columns["types"] = "".join(map(str, classes))
    keys = {name for item in items for name in ("bearing", "offset") if item.get(name) is not None}
    if not keys and items:
        return columns
    if any((item.get("bearing") is None) == (item.get("offset") is None) for item in items):
        raise InputError(
            "a detection has neither a bearing nor an offset, or both; give it one of them."
        )
    heading = values.get("heading")
    if "offset" in keys and heading is None:
        if "bearing" in keys or values.get("heading_error", "unknown") != "unknown":
            raise InputError(
                "offsets were given with bearings or an error of the heading, but without the "
                "heading that they are measured from; give it as well."
            )
        heading = 0.0
        columns |= {"heading": heading, "heading_error": "unknown"}
    columns["bearings"] = [
        _number("bearing", item["bearing"])
        if item.get("offset") is None
        else float(wrap_degrees(_number("heading", heading) + _number("offset", item["offset"])))
        for item in items
    ]
    return columns


def _class(item: Row, taxonomy: Taxonomy) -> str | Row:
    """Return the symbol of a detection's class, or scores by symbol."""
    value = item.get("class")
    if value is None and item.get("text") is not None:
        value = "unknown"  # something that is known by what is written on it
    if not isinstance(value, (dict, str)):
        raise InputError(
            f"the class of a detection is {value!r}; give a symbol, a word or scores by word."
        )
    if isinstance(value, dict):
        return value
    codes = class_codes(value, taxonomy)  # one, or those of a family
    symbols = [taxonomy.decode([code]) for code in codes]
    return symbols[0] if len(codes) == 1 else dict.fromkeys(symbols, 1.0 / len(codes))


def _scores(chances: Row, taxonomy: Taxonomy) -> NDArray[np.float64]:
    """Return the probability of each class code; the rest, up to one, is for any class."""
    scores = np.zeros(CLASSES)
    for word, chance in chances.items():
        codes = [*class_codes(word, taxonomy)]  # equal scores of those of a family
        scores[codes] += _number(f"the score of {word!r}", chance) / len(codes)
    rest = 1.0 - scores.sum()
    if not ((scores >= 0).all() and rest >= -ROUNDING):  # false for NaN too
        raise InputError(
            f"scores {chances!r} are not chances; give numbers from 0 that add up to at most 1."
        )
    scores[WILDCARD] += rest if rest > ROUNDING else 0.0
    return scores


def _ranges(
    values: Row, limits: NDArray[np.float64]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return ranges and errors, None if all are unknown.

    `limits` are the shortest and the longest visibility range of each object.
    """
    words = _column(values, "ranges", len(limits))
    pairs = [_range(word, *pair) for word, pair in zip(words, limits.tolist(), strict=True)]
    ranges, guessed = np.array(pairs).reshape(-1, 2).T
    own = _errors(values, "range_errors", len(limits))
    errors = guessed if own is None else np.where(np.isnan(own), guessed, own)
    return (
        None if np.isnan(ranges).all() else ranges,
        None if np.isnan(errors).all() else errors,
    )


def _texts(values: Row, name: str) -> tuple[str, ...]:
    """Return what was read, as a list of text, or as text.

    Text in the cell of a table may be such a list as JSON, or have semicolons between its parts. A
    number is text as well, and None is nothing.
    """
    items = values.get(name, [])
    if isinstance(items, str):
        with contextlib.suppress(ValueError):
            items = json.loads(items) if items.startswith("[") else items
    if isinstance(items, str):
        items = [part.strip() for part in items.split(";")]
    if not isinstance(items, list) or any(isinstance(item, (list, dict)) for item in items):
        raise InputError(f"{name} were given as {items!r:.60}; give a list of text.")
    return tuple("" if item is None else str(item) for item in items)


def _errors(values: Row, name: str, size: int) -> NDArray[np.float64] | None:
    """Return a column of errors, NaN where unknown; None if all are unknown."""
    what = f"a {name.replace('_', ' ').removesuffix('s')}"
    errors = np.array(
        [
            math.nan if value in UNKNOWN else _number(what, value)
            for value in _column(values, name, size)
        ]
    )
    return None if np.isnan(errors).all() else errors


def _column(values: Row, name: str, size: int) -> list[Any]:
    """Return the value of each object; a single number is for all of them."""
    column = values.get(name)
    column = _values(column) if isinstance(column, (str, list)) else [column] * size
    if len(column) != size:
        what = name.replace("_", " ")
        raise InputError(f"{len(column)} {what} were given for {size} objects; give one for each.")
    return column


def _range(value: object, shortest: float, longest: float) -> tuple[float, float]:
    """Return a range and its error, NaN if they are unknown.

    A word such as "far" is for the rings of the shortest and of the longest visibility range.
    """
    if value in UNKNOWN:
        return math.nan, math.nan
    if isinstance(value, (int, float)):
        return float(value), math.nan
    text = _spaced(str(value)).lower()
    if third := THIRDS.get(text):
        ends = [
            _ring_range(*(reach * edge / 3.0 for edge in third))
            for reach in dict.fromkeys((shortest, longest))
        ]
        if len(ends) == 1:
            return ends[0]
        (low, low_error), (high, high_error) = ends
        error = math.hypot(low_error, high_error) / math.sqrt(2.0)
        return math.sqrt(low * high), math.hypot(error, math.log(high / low) / 2.0)
    match = _METRES.fullmatch(text)
    metres = float(match["metres"]) if match else 0.0
    if match and match["kilo"]:
        metres *= METRES["kilometres"]
    if match is None or not 0 < metres <= MAX_RANGE_M:
        raise InputError(
            f"range {value!r} cannot be read; give metres, 'within 12 m', 'near', 'middle' or "
            "'far', or '?' if it is not known."
        )
    return _ring_range(0.0, metres) if match["within"] else (metres, math.nan)


def _ring_range(inner: float, outer: float) -> tuple[float, float]:
    """Return the range and its error for a place that is uniform in a ring, and guessed."""

    def moments(radius: float) -> NDArray[np.float64]:
        """Integrate the logarithm of the distance, and its square, over a disc."""
        log = math.log(radius) if radius else 0.0
        return radius**2 * np.array([log - 0.5, log**2 - log + 0.5])

    mean, square = ((moments(outer) - moments(inner)) / (outer**2 - inner**2)).tolist()
    return math.exp(mean), math.hypot(math.sqrt(square - mean**2), GUESS_ERROR)


def _photo(look: Row) -> Photo:
    """Return the sectors of a photo and its error of north."""
    heading, fov, error = (look.get(name) for name in ("heading", "fov", "heading_error"))
    sigma = None if error is None else HEADING_ERRORS.get(str(error))
    if error is not None and sigma is None:
        sigma = _number("heading_error", error)
    if fov is not None:
        if "sectors" in look:
            raise InputError("a field of view was given with sectors; give one of the two.")
        if heading is None:
            raise InputError(
                "a field of view was given without the heading of the camera (--look); give the "
                "heading as well, or give sectors instead."
            )
        heading, fov = _number("heading", heading), _number("fov", fov)
        return Photo.looking(heading=heading, fov=fov, north_sigma=sigma)
    # Sectors are text such as 20-90,180-250, or pairs.
    sectors = pairs = look.get("sectors", [])
    if isinstance(sectors, str) and _SECTORS.fullmatch(text := _spaced(sectors)):
        pairs = [list(pair) for pair in re.findall(_SECTOR, text)]
    if not isinstance(pairs, list) or not all(
        isinstance(pair, list) and len(pair) == 2  # noqa: PLR2004
        for pair in pairs
    ):
        raise InputError(
            f"sectors were given as {sectors!r}; give bearings clockwise from one to the other, "
            "such as 20-90,180-250 or [[20, 90], [180, 250]]."
        )
    numbers = tuple((_number("a sector", start), _number("a sector", end)) for start, end in pairs)
    return Photo(sectors=numbers, north_sigma=sigma)


def _spaced(text: str) -> str:
    """Return text with single blanks, to avoid catastrophic backtracking of the expressions."""
    return " ".join(text.split())


def _values(value: Any) -> list[Any]:  # noqa: ANN401 - any value of JSON
    """Return the values of a list, or of text with commas, semicolons or blanks between them."""
    if isinstance(value, str):
        text = _spaced(value)
        return re.split(" ?[,;] ?" if re.search("[,;]", text) else " ", text)
    return value if isinstance(value, list) else [value]


def mappings(values: object, name: str, *, most: int | None = None) -> list[Row]:
    """Return a list of mappings of names to values; InputError for other or too many values."""
    if (
        not isinstance(values, list)
        or not all(isinstance(item, dict) for item in values)
        or (most is not None and len(values) > most)
    ):
        limit = "" if most is None else f" at most {most}"
        raise InputError(
            f"{name} were given as {values!r:.60}; give a list of{limit} mappings of names to "
            "values."
        )
    return values


def _number(what: str, value: Any) -> float:  # noqa: ANN401 - any value of JSON
    try:
        return float(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} was given as {value!r}; give a number.") from error
