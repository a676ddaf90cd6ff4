"""The fields of a table that hold the positions, chosen by their values and their names."""

from __future__ import annotations

import functools
import itertools
import math
import re
import statistics
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from semsig_gis.core import CatalogError, SourceError, nearest_town
from semsig_gis.sources.numbers import decimal
from semsig_gis.sources.position_names import (
    LAT_LON,
    LON_LAT,
    crs_in_name,
    hints,
    o_is_east_in,
    order_by_name,
    role_of,
    tokens_of,
)
from semsig_gis.sources.position_values import (
    LATITUDE,
    LONGITUDE,
    MANY_DECIMALS,
    Located,
    axis_of,
    coordinate,
    is_angle,
    is_negative,
    locate,
    position_words,
    shown,
)
from semsig_gis.sources.rows import (
    LATITUDE_LIMIT,
    LONGITUDE_LIMIT,
    BadFeatureError,
    parse_crs,
    require_field,
    usable_crs,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from semsig_gis.core import Town
    from semsig_gis.sources.layer_spec import AxisOrder, LayerSpec
    from semsig_gis.sources.position_names import Role
    from semsig_gis.sources.rows import Position

    Row = Mapping[str, Any]
    XY = tuple[float, float]

SAMPLE_ROWS = 1_000
# Number of values that show whether a field may hold positions, and of places that are looked up.
FIRST_VALUES, PLACES = 20, 15
# Positions of objects are this near to a town, and other orders of the axes mostly are not.
NEAR_TOWN_KM = 50.0
# Objects of a city are in it, and others seldom are that far from one.
IN_TOWN_KM, FAR_FROM_TOWN_KM = 10.0, 15.0
FEW_DECIMALS = re.compile(r"\d[.,]\d")
LONG_NUMBERS = re.compile(r"\d{5}")
# What the name of a field of hemispheres has after that of the coordinates.
LETTER_WORDS = {"dir", "direction", "hemi", "hemisphere", "ref", "ns", "n_s", "ew", "e_w"}
# In a plane, coordinates of a national grid are thousands of metres.
MIN_PLANE = 1_000.0
# Positions of two fields that differ by more belong to different things: degrees, metres.
APART_DEGREES, APART_METRES = 2e-4, 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionFields:
    """The fields of positions: `x` (easting or longitude) and `y`, or `field` for both.

    `order` is that of a pair in `field` which does not show its own; with `turned`, geometries in
    it have latitude first. `english` is whether a comma
    may separate thousands, `o_is_east` whether the letter O means east (German). `letters` are
    the fields with the hemispheres of `x` and `y` without sign. `crs` is the one that the
    coordinates suggest. What a person has to check is in `questions`; without `sure`, the
    names of the fields do not say that they are positions.
    """

    x: str | None = None
    y: str | None = None
    field: str | None = None
    order: AxisOrder | None = None
    turned: bool = False
    english: bool = False
    o_is_east: bool = False
    letters: tuple[str | None, str | None] = (None, None)
    crs: str | None = None
    sure: bool = True
    questions: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fields: x and y, or the one for both."""
        return tuple(filter(None, (self.x, self.y, self.field)))

    @property
    def exchanged(self) -> PositionFields:
        """The same fields with x as y."""
        if self.field is None:
            return replace(self, x=self.y, y=self.x, letters=self.letters[::-1])
        order = LON_LAT if self.order == LAT_LON else LAT_LON
        return replace(self, order=order, turned=order == LAT_LON)

    def locate(self, values: Row) -> Located | None:
        """Return the position of a row, or None if it is blank; BadFeatureError if it has none."""
        if self.field is not None:
            try:
                place = locate(values.get(self.field), self.order, o_is_east=self.o_is_east)
            except BadFeatureError as error:
                raise BadFeatureError(f"{self.field} {error}") from error
            if place is None or place.pair or not self.turned:
                return place
            if isinstance(place.position, tuple):
                return place._replace(position=place.position[::-1])
            return place._replace(position=shapely.transform(place.position, np.fliplr))
        both = [(str(name), values.get(str(name))) for name in (self.x, self.y)]
        if all(_is_blank(value) for _, value in both):
            return None
        numbers = []
        for name, value in both:
            try:
                number = coordinate(value, english=self.english, o_is_east=self.o_is_east)
            except (TypeError, ValueError):
                number = math.nan
            if not math.isfinite(number):
                text = "" if value is None else value.strip() if isinstance(value, str) else value
                raise BadFeatureError(f"{name} {shown(text)} is not a number")
            numbers.append(number)
        return Located((self._signed(numbers[0], values, 0), self._signed(numbers[1], values, 1)))

    def _signed(self, number: float, values: Row, axis: int) -> float:
        """Return a coordinate with the sign of its hemisphere, which may be in another field."""
        letter = self.letters[axis]
        negative = letter and is_negative(values.get(letter), o_is_east=self.o_is_east)
        return -abs(number) if negative else number


def _is_blank(value: object) -> bool:
    return value is None or (isinstance(value, str) and not value.strip())


class PlaceReader:
    """Reads the positions of rows, and the CRS that these state; `what` names the file."""

    def __init__(self, fields: PositionFields, what: str) -> None:
        self.fields = fields
        self._what = what
        self._srid = 0

    def read(self, values: Row) -> Position:
        """Return the position of a row, or None if it is blank; BadFeatureError if it has none."""
        located = self.fields.locate(values)
        if located is None:
            return None
        self._srid = self._srid or located.srid
        if located.srid not in {0, self._srid}:
            raise BadFeatureError(
                f"{self.fields.field} has SRID={located.srid}, and rows before it have {self._srid}"
            )
        return located.position

    @property
    def crs(self) -> CRS | None:
        """The CRS that the positions state, or None; SourceError if it is unknown."""
        if not self._srid:
            return None
        try:
            return usable_crs(CRS.from_epsg(self._srid).to_wkt())
        except CRSError as error:
            raise SourceError(
                f"{self._what} states SRID={self._srid}, which is unknown; correct it."
            ) from error


def stated_fields(spec: LayerSpec, fields: Sequence[str], *, where: str) -> PositionFields | None:
    """Return the fields of positions that a catalogue names; CatalogError if they are absent."""
    if spec.geometry_field is not None:
        require_field(spec.geometry_field, fields, where=where, key="geometry_field")
        order = spec.axis_order or order_by_name(spec.geometry_field)
        east = o_is_east_in(fields)
        turned = spec.axis_order == LAT_LON
        name = spec.geometry_field
        return PositionFields(field=name, order=order, turned=turned, o_is_east=east)
    if not (spec.x_field or spec.y_field):
        return None
    if not (spec.x_field and spec.y_field):
        raise CatalogError(
            f"{where} has only one of x_field and y_field in the catalogue; state both."
        )
    require_field(spec.x_field, fields, where=where, key="x_field")
    require_field(spec.y_field, fields, where=where, key="y_field")
    stated = PositionFields(x=spec.x_field, y=spec.y_field, o_is_east=o_is_east_in(fields))
    return _with_letters(stated, fields)


def _with_letters(choice: PositionFields, fields: Sequence[str]) -> PositionFields:
    """Return fields of coordinates with those of their hemispheres, such as lon and lon_dir."""
    x, y = (
        next((field for field in fields if _is_letter_of(str(name), field)), None)
        for name in (choice.x, choice.y)
    )
    return replace(choice, letters=(x, y))


def _is_letter_of(name: str, field: str) -> bool:
    """Whether a field is named as the hemisphere of another, as GPSLatitudeRef is."""
    own, other = name.casefold(), field.casefold()
    return other.startswith(own) and other[len(own) :].strip("_- .") in LETTER_WORDS


def no_positions(fields: Sequence[str]) -> str:
    """Return what is wrong with a table without positions, and what to write in its catalogue."""
    names = [*fields, "lon", "lat"] if len(fields) < 2 else fields  # noqa: PLR2004 - a pair
    return (
        f"has no field that looks like a position, only {', '.join(fields) or 'none'}; if some "
        f'are, name them in the catalogue, as x_field = "{names[-2]}" and y_field = "{names[-1]}", '
        f'or as geometry_field = "{names[-1]}" if it holds the whole position, such as well-known '
        "text"
    )


def uncertain_positions(choice: PositionFields) -> str:
    """Return what to write in a catalogue for fields that only by their values are positions."""
    return (
        f"names no fields of positions, and {choice.x} and {choice.y} may be; write x_field = "
        f'"{choice.x}" and y_field = "{choice.y}" in the catalogue if they are'
    )


# Candidates.


@dataclass(frozen=True, slots=True)
class _Column:
    """A field with its numbers by row; `marked` is the share of angles, `fine` of many decimals."""

    name: str
    numbers: tuple[float | None, ...]
    marked: float
    fine: float
    axis: str

    @property
    def distinct(self) -> int:
        return len({number for number in self.numbers if number is not None})


@dataclass(frozen=True, slots=True)
class _Candidate:
    """Fields that may be the positions, their places by row, and their rank."""

    fields: PositionFields
    places: tuple[XY | None, ...]
    rank: tuple[float, ...]
    degrees: bool
    about: tuple[str, ...] = ()
    fixed: bool = False  # the order of the axes is certain
    precise: bool = False  # as degrees of places are, and small numbers of a plane are not
    unclear: bool = False  # neither values nor names say the order of the axes


def find_positions(
    fields: Sequence[str], rows: Sequence[Row], *, subject: str = "", english: bool = False
) -> PositionFields | None:
    """Find the fields of positions in a table by a sample of its rows; None if there are none.

    `subject` are the names of the file and layer, `english` is whether the file has commas between
    its columns.
    """
    rows = rows[:SAMPLE_ROWS]
    about = {token for token in tokens_of(subject) if len(token) >= 3}  # noqa: PLR2004 - a word
    east = o_is_east_in(fields)
    candidates = [*_whole_fields(fields, rows, about, o_is_east=east)]
    candidates += _pairs(fields, rows, about, english=english, o_is_east=east)
    candidates.sort(key=lambda item: item.rank, reverse=True)
    if not candidates:
        return None
    best, *others = candidates
    choice = _oriented(best)
    if choice.field is None:
        choice = _with_letters(choice, fields)
    return replace(choice, questions=(*choice.questions, *_other_places(best, others)))


def _whole_fields(
    fields: Sequence[str], rows: Sequence[Row], about: set[str], *, o_is_east: bool
) -> Iterator[_Candidate]:
    """Yield fields with whole positions."""
    for number, name in enumerate(fields):
        values = [row.get(name) for row in rows]
        filled = [value for value in values if not _is_blank(value) and value not in ([], {})]
        if all(isinstance(value, int | float) for value in filled):
            continue
        order = order_by_name(name)
        read = functools.partial(_located, order=order, o_is_east=o_is_east)
        first = filled[:FIRST_VALUES]
        if 2 * sum(read(value) is not None for value in first) < len(first):
            continue
        if not _is_position(name, filled):
            continue
        parsed_values = [None if _is_blank(value) else read(value) for value in values]
        hits = [item for item in parsed_values if item is not None]
        if 2 * len(hits) < len(filled):
            continue
        free = [item for item in hits if item.pair and item.order is None]
        fixed = 2 * sum(item.order is not None for item in hits) > len(hits)
        geometries = 2 * sum(not item.pair for item in hits) >= len(hits)
        places = tuple(item and _xy(item) for item in parsed_values)
        degrees = _in_degrees(places)
        order = None if fixed or geometries else order
        bare = not (fixed or geometries)
        unclear = bare and (order is None or name.casefold() == "coordinates")
        if bare and order is None:
            plane = not degrees and not _in_degrees(tuple(p and p[::-1] for p in places))
            order = LON_LAT if plane or any(item.bracketed for item in free) else LAT_LON
        tokens = {*tokens_of(name)}
        rank = (
            1.0,
            not tokens & hints("observer"),
            2.5 if any(item.pair for item in hits) else 2.75,
            bool(tokens & about),
            len(hits) / len(rows),
            _distinct(places),
            -number,
        )
        own = PositionFields(field=name, order=order, o_is_east=o_is_east)
        about_words = tuple(sorted(tokens - hints("frames") - hints("whole")))
        fine = sum(len(MANY_DECIMALS.findall(str(value))) > 1 for value in filled)
        precise = 2 * fine >= len(filled)
        yield _Candidate(own, places, rank, degrees, about_words, fixed, precise, unclear)


def _located(value: object, *, order: AxisOrder | None, o_is_east: bool) -> Located | None:
    try:
        return locate(value, order, o_is_east=o_is_east)
    except BadFeatureError:
        return None


def _is_position(name: str, values: Sequence[object]) -> bool:
    """Whether values that can be read as pairs are positions, not sizes, ranges or dates."""
    has_name = bool({*tokens_of(name)} & hints("whole")) or role_of(name) is not None
    has_name = has_name or order_by_name(name) is not None
    precise = FEW_DECIMALS if has_name else MANY_DECIMALS
    sure = 0
    for value in values:
        located = _located(value, order=None, o_is_east=False)
        if located is None:
            continue
        text = value if isinstance(value, str) else repr(value)
        decimals = len(precise.findall(text)) >= 2 or len(LONG_NUMBERS.findall(text)) >= 2  # noqa: PLR2004 - both
        written = located.order is not None and " x " not in text
        sure += not located.pair or written or (decimals and not _is_number(text))
    return 2 * sure >= len(values) > 0


def _is_number(text: str) -> bool:
    try:
        decimal(text)
    except ValueError:
        return False
    return True


def _xy(item: Located) -> XY | None:
    if isinstance(item.position, tuple):
        return item.position
    x, y = shapely.get_coordinates(shapely.centroid(item.position)).reshape(-1, 2)[:1].T
    return (float(x[0]), float(y[0])) if len(x) else None


def _columns(
    fields: Sequence[str], rows: Sequence[Row], *, english: bool, o_is_east: bool
) -> Iterator[_Column]:
    """Yield the fields of numbers."""
    for name in fields:
        values = [row.get(name) for row in rows]
        filled = [value for value in values if not _is_blank(value)]

        def number(value: object) -> float | None:
            try:
                read = coordinate(value, english=english, o_is_east=o_is_east)
            except (TypeError, ValueError):
                return None
            return read if math.isfinite(read) else None

        first = filled[:FIRST_VALUES]
        if not filled or 2 * sum(number(value) is not None for value in first) < len(first):
            continue
        numbers = tuple(map(number, values))
        if 2 * sum(item is not None for item in numbers) < len(filled):
            continue
        axes = {axis for value in first if (axis := axis_of(value))}
        yield _Column(
            name,
            numbers,
            marked=sum(map(is_angle, first)) / len(first),
            fine=sum(bool(MANY_DECIMALS.search(str(value))) for value in filled) / len(filled),
            axis=axes.pop() if len(axes) == 1 else "",
        )


def _pairs(
    fields: Sequence[str],
    rows: Sequence[Row],
    about: set[str],
    *,
    english: bool,
    o_is_east: bool,
) -> Iterator[_Candidate]:
    """Yield pairs of fields with coordinates: those with names that say so, or else by values."""
    columns = {
        item.name: item for item in _columns(fields, rows, english=english, o_is_east=o_is_east)
    }
    own = PositionFields(english=english, o_is_east=o_is_east)
    roles = {name: role for name in fields if (role := role_of(name)) is not None}
    has_name = False
    for (x, x_role), (y, y_role) in itertools.product(roles.items(), repeat=2):
        if (x_role.axis, y_role.axis) != ("x", "y") or x == y:
            continue
        strength = min(x_role.strength, y_role.strength)
        both = columns.get(x), columns.get(y)
        places = _places(*both)
        degrees = _in_degrees(places) or _in_degrees(tuple(p and p[::-1] for p in places))
        similar = _same_words(x_role.rest, y_role.rest)
        words = {*x_role.rest, *y_role.rest}
        if strength == 1:
            short = all(word in hints("frames") or word.isdecimal() for word in words)
            if not short or not _look_like_coordinates(both, places):
                continue
        blank = all(_is_blank(row.get(name)) for name in (x, y) for row in rows)
        readable = 1.0 if any(places) else 0.5 if blank else 0.0
        if not readable and strength == 1:
            continue
        has_name = has_name or readable == 1.0
        rank = (
            readable,
            not words & hints("observer"),
            3.0 if degrees and similar and readable == 1.0 else 1.0 + similar + strength / 4,
            bool(words & about),
            sum(place is not None for place in places) / max(len(rows), 1),
            _distinct(places),
            -fields.index(x),
        )
        letters = tuple(item.axis if item else "" for item in both)
        pair = replace(own, x=x, y=y)
        if letters == (LATITUDE, LONGITUDE):
            pair, places = pair.exchanged, tuple(place and place[::-1] for place in places)
        about_words = tuple(sorted(w for w in words - hints("frames") if not w.isdecimal()))
        yield _Candidate(
            pair,
            places,
            rank,
            degrees,
            about_words,
            fixed=all(letters),
            precise=all(item and max(item.fine, item.marked) >= 0.5 for item in both),  # noqa: PLR2004 - half
        )
    if not has_name:
        yield from _guesses(columns, roles, own)


def _guesses(
    columns: Mapping[str, _Column], roles: Mapping[str, Role], own: PositionFields
) -> Iterator[_Candidate]:
    """Yield the one pair of fields without names of coordinates that lies near a town."""
    likely = [item for item in columns.values() if _precise(item)]
    fits = []
    for x, y in itertools.permutations(likely, 2):
        axes = [role.axis if (role := roles.get(item.name)) else "" for item in (x, y)]
        if axes[0] == "y" or axes[1] == "x" or x.axis == LATITUDE or y.axis == LONGITUDE:
            continue
        places = _places(x, y)
        fit = replace(own, x=x.name, y=y.name, sure=False)
        distances = [town.distance_km for town in _towns(places) if _in_degrees(places)]
        if (distances and statistics.median(distances) <= NEAR_TOWN_KM) or _grid_of(places):
            fits.append(_Candidate(fit, places, (0.25,), _in_degrees(places), (), fixed=True))
    if len(fits) == 1:
        yield fits[0]


def _precise(column: _Column) -> bool:
    metres = [number for number in column.numbers if number is not None]
    long = min(map(abs, metres), default=0) >= MIN_PLANE
    return column.distinct > 1 and (column.fine >= 0.5 or column.marked >= 0.5 or long)  # noqa: PLR2004 - half


def _look_like_coordinates(both: tuple[_Column | None, ...], places: tuple[XY | None, ...]) -> bool:
    """Whether two columns with doubtful names hold coordinates by their values."""
    if not any(places) or any(item is None for item in both):
        return False
    some = [place for place in places if place is not None]
    if _in_degrees(places) or _in_degrees(tuple(p and p[::-1] for p in places)):
        return all(item and (item.fine >= 0.5 or item.marked >= 0.5) for item in both)  # noqa: PLR2004 - half
    return all(min(abs(x), abs(y)) >= MIN_PLANE for x, y in some)


def _same_words(first: tuple[str, ...], second: tuple[str, ...]) -> bool:
    return sorted(first) == sorted(second)


def _places(x: _Column | None, y: _Column | None) -> tuple[XY | None, ...]:
    if x is None or y is None:
        return ()
    pairs = zip(x.numbers, y.numbers, strict=True)
    return tuple(None if a is None or b is None else (a, b) for a, b in pairs)


def _in_degrees(places: Sequence[XY | None]) -> bool:
    """Whether most places are in the range of longitude and latitude."""
    some = [place for place in places if place is not None]
    fits = sum(abs(x) <= LONGITUDE_LIMIT and abs(y) <= LATITUDE_LIMIT for x, y in some)
    return 2 * fits > len(some)


def _distinct(places: Sequence[XY | None]) -> int:
    return len({place for place in places if place is not None})


# Orientation.


def _spread(places: Sequence[XY | None]) -> list[XY]:
    """Return some of the places, from all parts of the table."""
    some = [place for place in places if place is not None and place != (0.0, 0.0)]
    return some[:: max(1, len(some) // PLACES)]


def _towns(places: Sequence[XY | None]) -> list[Town]:
    inside = [place for place in places if place is not None and _in_degrees([place])]
    return [nearest_town(*place) for place in _spread(inside)]


def _oriented(best: _Candidate) -> PositionFields:
    """Return the fields of a candidate with x and y as the values say, and what to check."""
    choice, places = best.fields, best.places
    turned = tuple(place and place[::-1] for place in places)
    if not any(places) or _grid_of(places):
        return _with_grid(choice, places)
    if _grid_of(turned) and not best.fixed:
        return _with_grid(choice.exchanged, turned)
    fits = (_in_degrees(places), _in_degrees(turned))
    if fits == (False, True) and not best.fixed:
        if best.unclear:
            return choice.exchanged
        if best.precise:
            first, second = (choice.field, "the other") if choice.field else (choice.y, choice.x)
            text = f"{first} is out of the range of latitudes, so that {second} is taken for it"
            return replace(choice.exchanged, questions=(text,))
    if not (all(fits) and best.precise):
        return _with_grid(choice, places)
    return _by_towns(best, turned)


def _by_towns(best: _Candidate, turned: Sequence[XY | None]) -> PositionFields:
    """Return the fields of a candidate in degrees, in the axis order with places near towns."""
    choice = best.fields
    towns = _towns(best.places), _towns(turned)
    if not all(towns):
        return choice
    here, there = (statistics.median(town.distance_km for town in some) for some in towns)
    as_said, exchanged = (min(some, key=lambda town: town.distance_km) for some in towns)
    surely = here > NEAR_TOWN_KM >= there
    maybe = here > FAR_FROM_TOWN_KM and there <= IN_TOWN_KM
    if not best.fixed and (surely or (maybe and best.unclear)):
        question = (
            f"longitude and latitude look exchanged: as they are written, {as_said}; as read "
            f"here, {exchanged}"
        )
        return replace(choice.exchanged, questions=(question,))
    if surely or maybe or best.unclear:
        question = f"as read here, {as_said}; with longitude and latitude exchanged, {exchanged}"
        return replace(choice, questions=(question,))
    return choice


def _grid_of(places: Sequence[XY | None]) -> str | None:
    """Return the CRS of the only known grid in which most places are, or None."""
    some = [place for place in places if place is not None]
    fits = [
        crs
        for crs, (west, south, east, north) in position_words()["grids"].items()
        if 2 * sum(west <= x <= east and south <= y <= north for x, y in some) > len(some)
    ]
    return fits[0] if len(fits) == 1 else None


def _with_grid(choice: PositionFields, places: Sequence[XY | None]) -> PositionFields:
    """Return the fields with the CRS that coordinates in a plane, or their names, suggest."""
    if _in_degrees(places) or not any(places):
        return choice
    crs = _grid_of(places)
    if crs is None:
        codes = (crs_in_name(name) for name in choice.names)
        crs = next(filter(None, codes), None)
        if crs is not None and not fits_area(places, crs):
            return choice
    return replace(choice, crs=crs)


def fits_area(places: Sequence[XY | None], crs: str) -> bool:
    """Whether most places are in the area in which a CRS is used."""
    system = parse_crs(crs)
    area = system.area_of_use
    some = _spread(places)
    if area is None or not some:
        return False
    lon, lat = _to_degrees(crs).transform(*np.array(some).T)
    inside = (area.west <= lon) & (lon <= area.east) & (area.south <= lat) & (lat <= area.north)
    return bool(2 * np.count_nonzero(inside) > len(some))


@functools.lru_cache(maxsize=8)
def _to_degrees(crs: str) -> Transformer:
    return Transformer.from_crs(parse_crs(crs), 4326, always_xy=True)


def for_crs(choice: PositionFields, rows: Sequence[Row], crs: str) -> PositionFields:
    """Return the fields with x and y exchanged if only so they are in the area of a CRS.

    In several countries, x is the coordinate to the north.
    """
    if choice.x is None or not parse_crs(crs).is_projected:
        return choice
    places = []
    for row in rows[:SAMPLE_ROWS]:
        try:
            located = choice.locate(row)
        except BadFeatureError:
            continue
        places.append(located and _xy(located))
    turned = [place and place[::-1] for place in places]
    if fits_area(places, crs) or not fits_area(turned, crs):
        return choice
    question = f"only with {choice.y} as the coordinate to the east is it in the area of {crs}"
    return replace(choice.exchanged, questions=(*choice.questions, question))


def _other_places(best: _Candidate, others: Sequence[_Candidate]) -> Iterator[str]:
    """Yield a question if other fields hold other places."""
    for other in others:
        if not any(other.places) or other.rank[0] < 1.0 or not other.fields.sure:
            continue
        if {*best.fields.names} & {*other.fields.names}:
            continue
        if best.degrees == other.degrees:
            limit = APART_DEGREES if best.degrees else APART_METRES
            both = [
                min(math.dist(a, b), math.dist(a, b[::-1]))
                for a, b in zip(best.places, other.places, strict=True)
                if a is not None and b is not None
            ]
            differ = bool(both) and 4 * sum(gap > limit for gap in both) > len(both)
        else:
            differ = other.about != best.about and bool(other.about)
        if differ:
            names = " and ".join(best.fields.names)
            yield f"{names}, or {' and '.join(other.fields.names)}, which are other places?"
            return
