"""Views: the objects that a detector or a person saw from one place, and the directions observed.

A view is a signature with optional rough distances, scores of several classes, and the sectors that
were looked at, as in a photograph.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NotRequired

import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import (
    FULL_TURN,
    MAX_CODE,
    MAX_RANGE_M,
    UNKNOWN_NAME,
    WILDCARD,
    InputError,
    Signature,
    SignatureRecord,
    require_number,
    wrap_degrees,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from semsig_gis.core import Taxonomy

LEAST_TURN = 0.001
LEAST_RANGE_M = 0.01
LEAST_RANGE_ERROR = 0.001
MOST_RANGE_ERROR = 3.0
ROUNDING = 1e-6  # tolerance of sums of scores
EDGE = 0.05  # degrees; tolerance for bearings and sectors that were rounded before
CLASSES = MAX_CODE + 1
COLUMNS = ("ranges", "range_errors", "bearing_errors", "scores", "photo")

Sector = tuple[float, float]
"""From one bearing clockwise to another, in degrees; the second may be 360 or more."""


class PhotoRecord(TypedDict):
    """What a photo covers, as plain values in degrees."""

    sectors: NotRequired[list[list[float]]]
    heading_error: NotRequired[float | Literal["unknown"]]


class ViewRecord(SignatureRecord, PhotoRecord):
    """A view as plain values; the keys of its only photo are on the same level."""

    ranges: NotRequired[list[float | None]]
    range_errors: NotRequired[list[float | None]]
    bearing_errors: NotRequired[list[float | None]]
    scores: NotRequired[list[dict[str, float]]]
    texts: NotRequired[list[str]]
    signs: NotRequired[list[str]]
    photos: NotRequired[list[PhotoRecord]]
    photo: NotRequired[list[int]]


def check_north(north_sigma: float) -> None:
    """Raise InputError if a standard deviation of north, in degrees, is out of range.

    Valid are 0, 0.001 to 360, and infinity, for an unknown north.
    """
    if north_sigma not in {0, math.inf}:
        require_number(
            "deviation of north",
            north_sigma,
            least=LEAST_TURN,
            most=FULL_TURN,
            unit="degrees, 0 or infinity",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Photo:
    """The directions of a photograph or a panorama.

    Parameters
    ----------
    sectors : tuple of (float, float), default ()
        Sectors from one bearing clockwise to another, in degrees from -360 to 720. Sectors that
        overlap are merged; none means the full turn.
    north_sigma : float, optional
        Standard deviation of its north in degrees, 0 or 0.001 to 360, infinite if unknown. All its
        bearings and sectors have this error together. None if the query sets it.

    Raises
    ------
    InputError
        If a number is out of its range.

    Examples
    --------
    >>> Photo(sectors=((350, 20), (10, 40))).sectors
    ((350.0, 400.0),)
    >>> Photo.looking(heading=90, fov=70).sees([60, 200]).tolist()
    [True, False]
    """

    sectors: tuple[Sector, ...] = ()
    north_sigma: float | None = None

    def __post_init__(self) -> None:  # noqa: D105
        spans = []
        for start, end in self.sectors:
            for value in (start, end):
                require_number(
                    "a sector", value, least=-FULL_TURN, most=2 * FULL_TURN, unit="degrees"
                )
            width = end - start
            if width < 0 or width > FULL_TURN:
                width %= FULL_TURN
            if width == 0:
                raise InputError(
                    f"a sector from {start:g} to {end:g} sees nothing; give two different bearings."
                )
            low = float(wrap_degrees(start))
            spans.append((low, low + width))
        # Merge each sector with the last one if they overlap.
        merged: list[Sector] = []
        for low, high in sorted(spans):
            if merged and low <= merged[-1][1]:
                merged[-1] = merged[-1][0], max(high, merged[-1][1])
            else:
                merged.append((low, high))
        # The last sector may extend over north into the first ones.
        while len(merged) > 1 and merged[-1][1] - FULL_TURN >= merged[0][0]:
            _, high = merged.pop(0)
            merged[-1] = merged[-1][0], max(merged[-1][1], high + FULL_TURN)
        whole = sum(high - low for low, high in merged) >= FULL_TURN
        object.__setattr__(self, "sectors", () if whole else tuple(merged))
        if self.north_sigma is not None:
            check_north(self.north_sigma)

    @classmethod
    def looking(cls, *, heading: float, fov: float, north_sigma: float | None = None) -> Photo:
        """Return the photo of a camera with its heading and its field of view in degrees."""
        require_number("heading", heading, least=-FULL_TURN, most=FULL_TURN, unit="degrees")
        if not 0 < fov <= FULL_TURN:
            raise InputError(
                f"a field of view of {fov} degrees was given; give degrees above 0, at most 360."
            )
        start = float(wrap_degrees(heading - fov / 2.0))
        sector = start, start + fov
        return cls(sectors=() if fov == FULL_TURN else (sector,), north_sigma=north_sigma)

    @property
    def width(self) -> float:
        """Total width of the sectors in degrees."""
        return sum(end - start for start, end in self.sectors) if self.sectors else FULL_TURN

    def sees(self, bearings: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the bearings inside the sectors."""
        angles = np.asarray(bearings, dtype=np.float64)
        inside = np.full(angles.shape, not self.sectors)
        for start, end in self.sectors:
            inside |= wrap_degrees(angles - start) <= end - start
        return inside

    def turned(self, degrees: float) -> Photo:
        """Return the photo with `degrees` added to its bearings."""
        start = [(float(wrap_degrees(low + degrees)), high - low) for low, high in self.sectors]
        return replace(self, sectors=tuple((low, low + width) for low, width in start))

    def to_dict(self) -> PhotoRecord:
        """Return plain values for JSON: ``sectors`` and ``heading_error``, where there are any."""
        values: PhotoRecord = {}
        if self.sectors:
            values["sectors"] = [[low, high % FULL_TURN] for low, high in self.sectors]
        if self.north_sigma is not None:
            unknown = math.isinf(self.north_sigma)
            values["heading_error"] = "unknown" if unknown else self.north_sigma
        return values


FULL_VIEW: Photo = Photo()
"""The full turn."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class View(Signature):
    """The objects that were seen from one place: a signature with optional details.

    Distances use its `codes` and `bearings`; the likelihood method uses everything.

    Parameters
    ----------
    codes, bearings : ndarray, shape (n,), or None
        As in `Signature`; `ranges` and sectors require the bearings.
    ranges : ndarray of float64, shape (n,), or None
        Rough distance of each object in metres, from 0.01 to 6,000; NaN if unknown.
    range_errors : ndarray of float64, shape (n,), or None
        Relative error of each distance, the standard deviation of its logarithm, from 0.001 to
        3; NaN for that of the noise model.
    bearing_errors : ndarray of float64, shape (n,), or None
        Error of each bearing in degrees in addition to that of the noise model, a standard
        deviation from 0.001 to 180; NaN for none. Distances ignore it.
    scores : ndarray of float64, shape (n, 256), or None
        The probability of each class code for each object, by the detector; each row sums to one.
        Code 0 is for any class.
    photo : ndarray of int64, shape (n,), or None
        Number of the photo of each object; 0 by default.
    texts : tuple of str, or None
        What was read on each object, such as the name of a shop or a house number; empty for none.
        Distances ignore it.
    signs : tuple of str, default ()
        What was read in an unknown direction, such as the name of a street. Distances ignore it.
    photos : tuple of Photo, default one full turn
        The photos, each with its own error of north.
    notes : tuple of str, optional
        Remarks on how the view was read, for the notes of its answers.

    Raises
    ------
    InputError
        If the arrays differ in length, or a number is out of its range.

    Examples
    --------
    >>> lamps = Signature(np.array([3, 3], np.uint8), np.array([80.0, 110.0]))
    >>> view = View.of(lamps, photos=(Photo.looking(heading=90, fov=70),))
    >>> len(view), view.photos[0].width
    (2, 70.0)
    """

    ranges: NDArray[np.float64] | None = None
    range_errors: NDArray[np.float64] | None = None
    bearing_errors: NDArray[np.float64] | None = None
    scores: NDArray[np.float64] | None = None
    photo: NDArray[np.int64] | None = None
    texts: tuple[str, ...] | None = None
    signs: tuple[str, ...] = ()
    photos: tuple[Photo, ...] = (FULL_VIEW,)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:  # noqa: D105
        super().__post_init__()
        for name in COLUMNS:
            value = getattr(self, name)
            if value is not None:
                kind = np.int64 if name == "photo" else np.float64
                object.__setattr__(self, name, np.asarray(value, dtype=kind))
        self._check()
        self._set_texts()

    def _facts(self) -> dict[str, object]:
        sectors = ", ".join(f"{photo.width:g}°" for photo in self.photos)
        names = "ranges", "scores", "texts"
        details = [name for name in names if getattr(self, name) is not None]
        return {**super()._facts(), "sectors": sectors, "details": ", ".join(details) or "none"}

    def _check(self) -> None:
        """Raise InputError if arrays do not fit each other or numbers are out of range."""
        plain = self.photos == (FULL_VIEW,) and self.ranges is None
        if self.bearings is None and not plain:
            raise InputError(
                "a view with ranges or sectors needs the bearings of its objects; give them."
            )
        for name in COLUMNS:
            value, rest = getattr(self, name), (CLASSES,) if name == "scores" else ()
            if value is not None and value.shape != (len(self), *rest):
                raise InputError(
                    f"{len(value)} {name.replace('_', ' ')} were given for {len(self)} objects; "
                    "give one for each."
                )
        limits = {
            "ranges": (LEAST_RANGE_M, MAX_RANGE_M),
            "range_errors": (LEAST_RANGE_ERROR, MOST_RANGE_ERROR),
            "bearing_errors": (LEAST_TURN, FULL_TURN / 2.0),
        }
        for name, (least, most) in limits.items():
            value = getattr(self, name)
            if value is not None and len(
                bad := value[~(np.isnan(value) | (value >= least)) | (value > most)]
            ):
                what = name.replace("_", " ").removesuffix("s")
                raise InputError(
                    f"a {what} is {bad[0]:g}; give a number from {least:g} to {most:,.0f}."
                )
        if self.scores is not None and len(self.scores):
            sums = self.scores.sum(axis=1)
            if not ((self.scores >= 0).all() and np.allclose(sums, 1.0, atol=ROUNDING)):
                raise InputError(
                    "the scores of an object are not chances; give numbers from 0 that add up to 1."
                )
        if not self.photos:
            raise InputError(
                "a view of no photo was given; give at least one, or leave photos out."
            )
        numbers = self.photo
        if (
            numbers is not None
            and len(numbers)
            and not 0 <= numbers.min() <= numbers.max() < len(self.photos)
        ):
            raise InputError(
                f"an object is from a photo that is not there; the view has {len(self.photos)}."
            )

    def _set_texts(self) -> None:
        """Set texts with single blanks; InputError if they do not fit."""
        if self.texts is not None:
            texts = _read_texts("texts", self.texts)
            if len(texts) != len(self):
                raise InputError(
                    f"{len(texts)} texts were given for {len(self)} objects; give one for each, "
                    "empty where nothing was read, and with ; between them in the cell of a table."
                )
            object.__setattr__(self, "texts", texts if any(texts) else None)
        signs = _read_texts("signs", self.signs)
        object.__setattr__(self, "signs", tuple(filter(None, signs)))

    @classmethod
    def of(cls, signature: Signature, **more: Any) -> View:  # noqa: ANN401 - any fields
        """Return a signature as a view, with fields replaced by `more`."""
        if isinstance(signature, View):
            return replace(signature, **more) if more else signature
        return cls(signature.codes, signature.bearings, **more)

    @classmethod
    def joined(cls, views: Iterable[Signature]) -> View:
        """Merge several views of one place; each photo keeps its own error of north."""
        parts = [cls.of(view) for view in views]
        first_photos = np.cumsum([0, *(len(part.photos) for part in parts)])

        def column(name: str, blank: float) -> NDArray[Any] | None:
            columns = [getattr(part, name) for part in parts]
            if all(value is None for value in columns):
                return None
            filled = [
                np.full(len(part), blank) if value is None else value
                for part, value in zip(parts, columns, strict=True)
            ]
            return np.concatenate(filled)

        read = any(part.texts is not None for part in parts)
        scored = any(part.scores is not None for part in parts)
        shares = [part.class_scores() for part in parts] if scored else []
        rows = [part.photo_rows + first for part, first in zip(parts, first_photos, strict=False)]
        return cls(
            column("codes", WILDCARD),
            column("bearings", math.nan),
            ranges=column("ranges", math.nan),
            range_errors=column("range_errors", math.nan),
            bearing_errors=column("bearing_errors", math.nan),
            scores=np.concatenate(shares) if scored else None,
            photo=np.concatenate(rows),
            texts=tuple(text for part in parts for text in part.text_rows) if read else None,
            signs=tuple(sign for part in parts for sign in part.signs),
            photos=tuple(photo for part in parts for photo in part.photos),
            notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        )

    @property
    def photo_rows(self) -> NDArray[np.int64]:
        """Number of the photo of each object, shape (n,)."""
        return np.zeros(len(self), np.int64) if self.photo is None else self.photo

    @property
    def text_rows(self) -> tuple[str, ...]:
        """What was read on each object, empty for nothing."""
        return ("",) * len(self) if self.texts is None else self.texts

    def split(self) -> tuple[View, ...]:
        """Return one view for each photo; the first one has the `signs`."""
        if len(self.photos) == 1:
            return (self,)
        rows = self.photo_rows
        return tuple(
            replace(
                self.select(rows == number),
                photo=None,
                photos=(photo,),
                signs=() if number else self.signs,
            )
            for number, photo in enumerate(self.photos)
        )

    def outside(self) -> NDArray[np.int64]:
        """Return the rows of objects outside the sectors of their photo by more than `EDGE`."""
        if self.bearings is None:
            return np.empty(0, np.int64)
        around = self.bearings + np.array([[-EDGE], [0.0], [EDGE]])
        inside = np.stack([photo.sees(around).any(axis=0) for photo in self.photos])
        return np.flatnonzero(~inside[self.photo_rows, np.arange(len(self))])

    def class_scores(self) -> NDArray[np.float64]:
        """Return the probability of each class code for each object, shape (n, 256)."""
        if self.scores is not None:
            return self.scores
        scores = np.zeros((len(self), CLASSES))
        scores[np.arange(len(self)), WILDCARD if self.codes is None else self.codes] = 1.0
        return scores

    def class_names(self, taxonomy: Taxonomy) -> list[str]:
        """Return what each object is said to be: a class, a family, or some classes.

        It is the name of the likeliest class or, of classes with equal scores, that of their
        family, if they are all of its classes, or their names with "or" between them; ``unknown``
        for an object of any class.
        """
        if self.scores is None:
            codes = [WILDCARD] * len(self) if self.codes is None else self.codes.tolist()
            return [taxonomy.by_code(code).name if code else UNKNOWN_NAME for code in codes]
        families: dict[frozenset[int], str] = {}
        for family in {item.family for item in taxonomy.classes} - {""}:
            families[frozenset(taxonomy.family_codes(family).tolist())] = family
        words = []
        for row in self.scores:
            best = np.flatnonzero(row == row.max()).tolist()
            if len(best) > 1 and WILDCARD in best:
                best.remove(WILDCARD)
            family = families.get(frozenset(best), "") if len(best) > 1 else ""
            names = (taxonomy.by_code(code).name if code else UNKNOWN_NAME for code in best)
            words.append(family or " or ".join(names))
        return words

    def among(self, codes: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of objects that may be of these classes, or any class, shape (n,)."""
        if self.scores is None:
            return super().among(codes)
        classes = np.append(np.asarray(codes, dtype=np.int64), WILDCARD)
        return np.asarray(self.scores[:, classes].sum(axis=1) > 0)

    def select(self, objects: NDArray[np.bool_ | np.int64]) -> View:
        """Return the view with a selection of its objects, by row numbers or a mask."""
        names = ("codes", "bearings", *COLUMNS)
        values = {name: getattr(self, name) for name in names}
        rows = {name: None if value is None else value[objects] for name, value in values.items()}
        codes, bearings = rows.pop("codes"), rows.pop("bearings")
        texts = self.texts
        if texts is not None:
            texts = tuple(texts[row] for row in np.arange(len(self))[objects].tolist())
        return View(
            codes,
            bearings,
            **rows,
            texts=texts,
            signs=self.signs,
            photos=self.photos,
            notes=self.notes,
        )

    def turned(self, degrees: float) -> View:
        """Return the view with `degrees` added to its bearings, sorted clockwise."""
        if self.bearings is None:
            return self
        bearings = wrap_degrees(self.bearings + degrees)
        photos = tuple(photo.turned(degrees) for photo in self.photos)
        turned = replace(self, bearings=bearings, photos=photos)
        return turned.select(np.argsort(bearings, kind="stable"))

    def to_dict(self, taxonomy: Taxonomy) -> ViewRecord:
        """Return the values of `Signature.to_dict` and the details, for JSON and `parse_view`.

        ``ranges`` and the errors have None for unknown values; ``scores`` are by name of the
        class; ``texts`` and ``signs`` are there if something was read. The values of
        `Photo.to_dict` are on the same level for one photo; for several
        photos, they are in ``photos``, and ``photo`` has the number of the photo of each object.
        """
        plain = super().to_dict(taxonomy)
        values = ViewRecord(
            types=plain["types"], bearings=plain["bearings"], length=plain["length"]
        )
        if self.ranges is not None:
            values["ranges"] = _none_for_nan(self.ranges)
        if self.range_errors is not None:
            values["range_errors"] = _none_for_nan(self.range_errors)
        if self.bearing_errors is not None:
            values["bearing_errors"] = _none_for_nan(self.bearing_errors)
        if self.scores is not None:
            names = {item.code: item.name for item in taxonomy.classes} | {WILDCARD: UNKNOWN_NAME}
            values["scores"] = [
                {names[code]: float(row[code]) for code in np.flatnonzero(row).tolist()}
                for row in self.scores
            ]
        if self.texts is not None:
            values["texts"] = list(self.texts)
        if self.signs:
            values["signs"] = list(self.signs)
        if len(self.photos) == 1:
            return {**values, **self.photos[0].to_dict()}
        values["photos"] = [photo.to_dict() for photo in self.photos]
        values["photo"] = self.photo_rows.tolist()
        return values


def _none_for_nan(column: NDArray[np.float64]) -> list[float | None]:
    return [None if math.isnan(value) else value for value in column.tolist()]


def _read_texts(what: str, texts: Sequence[str]) -> tuple[str, ...]:
    """Return texts with single blanks; InputError unless they are a sequence of text."""
    if isinstance(texts, str) or not all(isinstance(text, str) for text in texts):
        raise InputError(f"{what} were given as {texts!r:.60}; give a list of text.")
    return tuple(" ".join(text.split()) for text in texts)
