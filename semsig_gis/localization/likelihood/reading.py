"""What was read, as evidence of the place: on objects, and on signs in an unknown direction.

A text s that was read on an object fits the texts of the map at a level: exactly, as a part, or a
few letters off. If the detection is an object with texts that fit at level l, the text is
``SHARES[l] / b`` times as likely as anywhere, where b is the share of the texts that fit at this
level or better, among those of the classes that the detection may be; if they do not fit, it is
``MISREAD`` times as likely, divided by their share. The factor of an object that fits is 1 or more,
and of others 1 or less. Objects without a text, and false objects, are as likely as anywhere. So a
common text says little, and a false object with a rare text is as rare as the text.

Objects that fit are parts of their class for the one question: they get free class codes in a copy
of the database and of the street objects (`DividedTaxonomy`), and the scores of a detection are
multiplied by these factors. A text that fits nothing is not used.

A text in an unknown direction, such as the name of a street, is a factor of whole cells: those in
`STREET_M` of a street of this name, and those that see an object that fits.
"""

from __future__ import annotations

import copy
import re
import weakref
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import lazy_loader
import numpy as np
from typing_extensions import TypedDict

from semsig_gis.core import (
    BEARING_UNITS,
    FULL_TURN,
    LETTERS,
    NAME,
    WILDCARD,
    ObjectClass,
    signed_degrees,
)
from semsig_gis.localization.likelihood.index import photo_power
from semsig_gis.localization.likelihood.photo import name_scores
from semsig_gis.localization.likelihood.texts import (
    EXACT,
    LETTERS_OFF,
    NONE,
    PART,
    nearest_names,
    object_texts,
    plain_text,
    text_fits,
)
from semsig_gis.localization.noise.table import DividedTaxonomy
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import shapely
    from numpy.typing import NDArray

    from semsig_gis.core import Signature, Taxonomy
    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.objects import StreetObjects
else:
    shapely = lazy_loader.load("shapely")

SHARES = {LETTERS_OFF: 0.1, PART: 0.2, EXACT: 0.5}
"""Chance that what is read on an object fits its text on the map at each level."""
MISREAD = 0.2
"""Chance that it does not fit: it was read wrongly, or the map is wrong."""
USUAL_TEXTS = 20.0
"""Texts of any class by which the share in the texts of one class is smoothed."""
UNNAMED = 0.05
"""Weight of a class without texts in the classes that a detection with a text may have."""
STREET_M = 40.0
"""Distance from a street in which its name is read."""
STREET, HOUSE_NUMBER, STREET_SIGN = "street", "house_number", "street_sign"
MOST_OBJECTS = 3000
"""Most objects that are parts of their class; common texts say little."""
LEAST_FACTOR = 2.0
"""Least factor of some text that makes objects a part of their class."""
LISTED = 3
"""Names that are listed for a text."""
KEPT = 8
"""Questions with texts for which an index keeps what it computed."""
BEARING_TOLERANCE = 2.5 * FULL_TURN / BEARING_UNITS
ROUNDING_M = 0.02
IN_WORDS = {EXACT: "exact", PART: "part", LETTERS_OFF: "letters off", NONE: "none"}


class TextRecord(TypedDict):
    """A text that was read, and the names of the map that it fits best."""

    text: str
    fit: str
    kind: str
    names: list[str]
    count: int


class Fits(NamedTuple):
    """How well a text fits rows of the map, the best level, and some names that fit so."""

    levels: NDArray[np.uint8]
    best: int
    names: list[str]


@dataclass(frozen=True, eq=False, kw_only=True)
class Names:
    """Texts of the map: as they are written, in plain words, and the rows that have them.

    Entry i says that row ``rows[i]``, of `size`, has the text ``texts[i]``.
    """

    shown: tuple[str, ...]
    plain: tuple[str, ...]
    rows: NDArray[np.int64]
    texts: NDArray[np.int64]
    size: int

    @classmethod
    def of(cls, columns: Iterable[Sequence[str]], size: int) -> Names:
        """Return the texts of columns of `size` rows each; empty ones are none."""
        numbers: dict[str, int] = {}
        shown: list[str] = []
        rows, texts = [], []
        for column in columns:
            distinct, places = np.unique(np.asarray(column, dtype=object), return_inverse=True)
            number = np.full(len(distinct), -1)
            for place, text in enumerate(distinct.tolist()):
                if plain := plain_text(text):
                    number[place] = numbers.setdefault(plain, len(numbers))
                    if number[place] == len(shown):
                        shown.append(text)
            own = number[places.reshape(-1)]
            rows.append(np.flatnonzero(own >= 0))
            texts.append(own[own >= 0])
        nothing = np.empty(0, np.int64)
        return cls(
            shown=tuple(shown),
            plain=tuple(numbers),
            rows=np.concatenate([nothing, *rows]),
            texts=np.concatenate([nothing, *texts]),
            size=size,
        )

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """Whether each row has a text."""
        mask = np.zeros(self.size, np.bool_)
        mask[self.rows] = True
        return mask

    def fits(self, text: str) -> Fits:
        """Return how well a text fits each row."""
        own = text_fits(plain_text(text), self.plain)
        levels = np.zeros(self.size, np.uint8)
        np.maximum.at(levels, self.rows, own[self.texts])
        best = int(own.max(initial=NONE))
        names = np.flatnonzero(own == best)[: LISTED if best else 0].tolist()
        return Fits(levels, best, [self.shown[name] for name in names])

    def nearest(self, text: str) -> list[str]:
        """Return the names that are most like a text."""
        return [self.shown[row] for row in nearest_names(plain_text(text), self.plain)]


@dataclass(frozen=True, eq=False, kw_only=True)
class MapTexts:
    """The texts of street objects, and the names of streets with their lines and places."""

    objects: Names
    streets: Names
    shapes: NDArray[np.object_]

    @classmethod
    def of(cls, store: ObjectStore) -> MapTexts:
        """Return the texts of an object store."""
        columns, size = object_texts(store.objects), len(store.objects)
        streets = columns.pop(STREET, None)
        if streets is not None and HOUSE_NUMBER in columns:
            pairs = list(zip(columns[HOUSE_NUMBER], streets, strict=True))
            for name, form in (("address", "{1} {0}"), ("number first", "{0} {1}")):
                columns[name] = [form.format(*pair) if all(pair) else "" for pair in pairs]
        shapes, names = [np.empty(0, object)], []
        if store.streets is not None and NAME in store.streets:
            shapes.append(store.streets.geometry.to_numpy())
            names += store.streets[NAME].tolist()
        if streets is not None:
            shapes.append(np.asarray(shapely.points(store.objects.xy)))
            names += streets
        return cls(
            objects=Names.of(columns.values(), size),
            streets=Names.of([names] if names else [], len(names)),
            shapes=np.concatenate(shapes),
        )


_texts_of: weakref.WeakKeyDictionary[ObjectStore, MapTexts] = weakref.WeakKeyDictionary()


def map_texts(store: ObjectStore) -> MapTexts:
    """Return the texts of an object store, which are kept as long as the store."""
    if store not in _texts_of:
        _texts_of[store] = MapTexts.of(store)
    return _texts_of[store]


@dataclass(frozen=True, eq=False, kw_only=True)
class DividedIndex:
    """An index and a store with classes divided by the fit of some texts.

    By text, `often`, shape (t, 256, levels), is how often it fits the texts of each class, by its
    code. `levels` of the parts, shape (t, parts), say how well it fits, and `shares`, shape
    (t, 256, levels), what share of the rest of each class has texts that fit at each level.
    `weights` are those of the classes of a detection with a text.
    """

    plain: LikelihoodIndex
    index: LikelihoodIndex
    store: ObjectStore
    taxonomy: DividedTaxonomy
    texts: tuple[str, ...]
    often: NDArray[np.float64]
    levels: NDArray[np.uint8]
    shares: NDArray[np.float64]
    weights: NDArray[np.float64]

    @classmethod
    def of(
        cls, index: LikelihoodIndex, store: ObjectStore, levels: dict[str, NDArray[np.uint8]]
    ) -> DividedIndex:
        """Divide the classes by the `levels` of objects, by text."""
        objects, names = store.objects, map_texts(store).objects
        database, codes = index.database, objects.codes
        fits = np.stack([*levels.values()])
        often = _often(fits, codes, names.present)
        rarest = often[:, index.table.codes].min(axis=1)
        most = np.stack(
            [_factors(own)[own_fits] for own, own_fits in zip(rarest, fits, strict=True)]
        )
        parts, part_of = _parts(fits, most, codes, index.table.codes)
        free = _free_codes(database.taxonomy, database.present_codes, codes)
        parts = parts[: len(free) - 1]
        own = np.flatnonzero(np.isin(part_of, parts))
        number = np.searchsorted(np.sort(parts), part_of[own])
        first = own[np.unique(number, return_index=True)[1]]
        part_codes = free[1 : len(first) + 1]
        taxonomy = _divided(
            database.taxonomy, dict(zip(part_codes, codes[first].tolist(), strict=True)), free[0]
        )
        new = codes.copy()
        new[own] = np.array(part_codes, np.uint8)[number]
        left = np.ones(len(codes), np.bool_)
        left[own] = False
        counts = np.bincount(codes, minlength=256)
        others = np.maximum(np.bincount(codes[left], minlength=256), 1)
        left &= names.present
        shares = np.zeros(often.shape)
        for row, own_fits in enumerate(fits):
            np.add.at(shares[row], (codes[left], own_fits[left]), 1.0)
        return cls(
            plain=index,
            index=_recoded_index(index, objects, own, new, taxonomy),
            store=_recoded_store(store, new, taxonomy),
            taxonomy=taxonomy,
            texts=tuple(levels),
            often=often,
            levels=fits[:, first],
            shares=shares / others[:, None],
            weights=np.maximum(
                np.bincount(codes[names.present], minlength=256) / np.maximum(counts, 1), UNNAMED
            ),
        )

    def view(self, view: View) -> tuple[View, float]:
        """Return a view with the scores of parts of classes, and the log of what they lack.

        The scores of a detection are divided by their sum, because those of a view are chances.
        """
        table = self.plain.table
        plain = name_scores(view, table)
        wrong = table.misnamed.mean(axis=0)
        parents = [int(table.row_of[code]) for code in self.taxonomy.parents.values()]
        scores = np.zeros((len(view), 256))
        for number, text in enumerate(view.text_rows):
            own = plain[:, number]
            rest, factors = np.ones(len(own)), np.ones(len(parents))
            if text in self.texts:
                row = self.texts.index(text)
                if np.count_nonzero(own) > 1:
                    own = own * self.weights[table.codes]
                chances = own * table.clutter / (table.clutter @ own)
                by_level = _factors(chances @ self.often[row, table.codes])
                factors = by_level[self.levels[row]]
                # Objects of the rest without a text are as likely as anywhere.
                rest = 1.0 + self.shares[row, table.codes] @ (by_level - 1.0)
                rest = np.minimum(rest, 1.0)
            left = own * rest
            # An object of a part that is misnamed as well has the factor of its part.
            more = factors * (table.others @ own)[parents] - (table.others @ left)[parents]
            more *= (wrong / (1.0 - wrong))[parents]
            scores[number, table.codes] = left
            scores[number, [*self.taxonomy.parents]] = np.maximum(
                factors * own[parents] + more, 0.0
            )
            false = 2.0 * (table.clutter @ own) - table.clutter @ left
            scores[number, self.taxonomy.rest] = false / table.clutter.sum()
        sums = scores.sum(axis=1)
        divided = replace(view, scores=scores / sums[:, None])
        power = photo_power(len(view.photos), self.plain.noise)
        return divided, float(np.log(sums).sum() * power)


def _often(
    fits: NDArray[np.uint8], codes: NDArray[np.uint8], has_text: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the share of the texts of each class that a text fits, by text, code and level.

    It fits them at the level or better; the share of level `NONE` is that of texts that do not fit.
    """
    sizes = np.bincount(codes[has_text], minlength=256)
    often = np.zeros((len(fits), 256, EXACT + 1))
    for text, own in enumerate(fits):
        for level in SHARES:
            counts = np.bincount(codes[own >= level], minlength=256)
            usual = (counts.sum() + 0.5) / (has_text.sum() + 1.0)
            often[text, :, level] = (counts + USUAL_TEXTS * usual) / (sizes + USUAL_TEXTS)
    often[:, :, NONE] = 1.0 - often[:, :, LETTERS_OFF]
    return often


def _factors(often: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how much likelier a text is than anywhere on an object, by how well it fits.

    `often` is that of `_often` for the classes that the object may be.
    """
    factors = np.empty(EXACT + 1)
    for level, share in SHARES.items():
        factors[level] = max(share / often[level], 1.0)
    factors[NONE] = min(MISREAD / max(often[NONE], MISREAD), 1.0)
    return factors


def _parts(
    fits: NDArray[np.uint8],
    factor: NDArray[np.float64],
    codes: NDArray[np.uint8],
    visible: NDArray[np.uint8],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the parts that say the most first, and the part of each object, -1 for none.

    Objects of a part have the same class, one of those that are `visible`, and the same fits.
    """
    part_of = np.full(len(codes), -1)
    some = np.flatnonzero(fits.any(axis=0) & np.isin(codes, visible))
    keys = np.vstack([codes[some], fits[:, some]])
    distinct, numbers, sizes = np.unique(keys, axis=1, return_inverse=True, return_counts=True)
    part_of[some] = numbers.reshape(-1)
    best = np.zeros(distinct.shape[1])
    np.maximum.at(best, part_of[some], factor[:, some].max(axis=0))
    order = np.argsort(-best, kind="stable")
    order = order[(best[order] >= LEAST_FACTOR) & (np.cumsum(sizes[order]) <= MOST_OBJECTS)]
    return order, part_of


def _free_codes(
    taxonomy: Taxonomy, present: NDArray[np.uint8], codes: NDArray[np.uint8]
) -> list[int]:
    """Return class codes for parts: those of no class, then those of classes without objects."""
    used = {item.code for item in taxonomy.classes}
    occurring = {*present.tolist(), *np.unique(codes).tolist()}
    codes_of_none = [code for code in range(1, 256) if code not in used]
    return codes_of_none + sorted(used - occurring)


def _divided(taxonomy: Taxonomy, parents: dict[int, int], rest: int) -> DividedTaxonomy:
    """Return the classes with the parts of some of them, and the code of false objects."""
    new = {rest, *parents}
    classes = [item for item in taxonomy.classes if item.code not in new]
    used = {item.symbol for item in classes}
    letters = re.findall(f"[{LETTERS}]", "".join(map(chr, range(0xC0, 0x450))))
    free = iter([letter for letter in letters if letter not in used])
    items = {item.code: item for item in taxonomy.classes}
    parts = [
        replace(items[parent], code=code, symbol=next(free), name=f"part_{code}")
        for code, parent in parents.items()
    ]
    false = ObjectClass(rest, next(free), f"part_{rest}", "False object")
    return DividedTaxonomy((*classes, *parts, false), whole=taxonomy, parents=parents, rest=rest)


KEPT_FACTS = ("xy", "cell_ids", "lengths", "scale", "reach", "near_reach")
"""What a copy of a database has in common with it."""


def _recoded_index(
    index: LikelihoodIndex,
    objects: StreetObjects,
    rows: NDArray[np.int64],
    codes: NDArray[np.uint8],
    taxonomy: DividedTaxonomy,
) -> LikelihoodIndex:
    """Return an index in which some objects, by row, have other codes."""
    database = index.database
    entries, owners = object_entries(database, objects, rows)
    new = database.codes.copy()
    new[entries] = codes[owners]
    copied = replace(database, codes=new, taxonomy=taxonomy)
    vars(copied).update({name: getattr(database, name) for name in KEPT_FACTS})
    result = replace(index, database=copied)
    kinds = index.objects.kinds.copy()
    kinds[entries] = result.table.row_of[new[entries]]
    vars(result)["objects"] = index.objects._replace(kinds=kinds)
    return result


def _recoded_store(
    store: ObjectStore, codes: NDArray[np.uint8], taxonomy: DividedTaxonomy
) -> ObjectStore:
    """Return a store with other codes of the objects."""
    objects = copy.copy(store.objects)
    vars(objects).update(codes=codes, taxonomy=taxonomy)
    result = copy.copy(store)
    vars(result).update(objects=objects, index=store.index)
    return result


def object_entries(
    database: SignatureDatabase, objects: StreetObjects, rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the entries of a database that are some objects, by row, and the row of each.

    An entry is an object if class, bearing and distance agree to the units of the database.
    """
    ranges = database.taxonomy.ranges(database.spec.radius)
    entries, owners = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for code in np.unique(objects.codes[rows]).tolist():
        places = np.flatnonzero(database.codes == code)
        cells = np.searchsorted(database.offsets, places, side="right") - 1
        distances = database.scale.metres[database.distance_units[places]]
        x, y = database.xy[cells].T
        for row in rows[objects.codes[rows] == code].tolist():
            east, north = objects.xy[row]
            near = np.flatnonzero(np.abs(x - east) <= ranges[code] + ROUNDING_M)
            near = near[np.abs(y[near] - north) <= ranges[code] + ROUNDING_M]
            dx, dy = east - x[near], north - y[near]
            away = np.hypot(dx, dy)
            rounding = database.scale.rounding(away) + ROUNDING_M
            same = np.flatnonzero(np.abs(distances[near] - away) <= rounding)
            bearings = database.bearing_units[places[near[same]]] * (FULL_TURN / BEARING_UNITS)
            turned = signed_degrees(bearings - np.degrees(np.arctan2(dx[same], dy[same])))
            rows_here = places[near[same[np.abs(turned) <= BEARING_TOLERANCE]]]
            entries.append(rows_here)
            owners.append(np.full(len(rows_here), row))
    return np.concatenate(entries), np.concatenate(owners)


@dataclass(frozen=True, eq=False, kw_only=True)
class Reading:
    """A view with what was read, for the index and the store in which it is evidence.

    `view` has the objects that are used, which are `rows` of the query. If texts are in its scores,
    `plain` is the view with those of classes. `extra` is added to the log-likelihood of each cell,
    shape (n,). `records` say what each text fits.
    """

    view: Signature
    rows: NDArray[np.int64]
    index: LikelihoodIndex
    store: ObjectStore | None = None
    plain: View | None = None
    extra: NDArray[np.float64] | None = None
    records: tuple[TextRecord, ...] = ()
    notes: tuple[str, ...] = ()


def has_texts(query: Signature) -> bool:
    """Whether something was read."""
    return isinstance(query, View) and (query.texts is not None or bool(query.signs))


def read_view(query: Signature, index: LikelihoodIndex, store: ObjectStore | None) -> Reading:
    """Return a view, with bearings from grid north, and what its texts say in an index.

    Without a store, texts are not used. Objects of a class that no cell sees are not used either,
    unless a text on them fits an object of the map: then their class is unknown.
    """
    if isinstance(query, View) and store is not None and has_texts(query):
        return _Reader(query, index, store).reading
    view, rows = usable_objects(query, index.database.present_codes)
    notes = (NO_STORE,) if has_texts(query) else ()
    return Reading(view=view, rows=rows, index=index, notes=notes)


def usable_objects(
    query: Signature, present: NDArray[np.uint8]
) -> tuple[Signature, NDArray[np.int64]]:
    """Return a query without classes that are not present, and the rows of the others.

    Objects that may be of several classes, without bearings, are in any direction.
    """
    usable = query.among(present)
    view = query if usable.all() else query.select(usable)
    if isinstance(view, View) and view.scores is not None:
        view = _in_any_direction(view)
    return view, np.flatnonzero(usable)


def _in_any_direction(view: View) -> View:
    """Return a view with bearings that say nothing, if it has none."""
    if view.bearings is not None:
        return view
    errors = np.full(len(view), FULL_TURN / 2.0)
    return replace(view, bearings=np.zeros(len(view)), bearing_errors=errors)


NO_STORE = (
    "what was read was not used, because the street objects of the database are missing; build "
    "the database again to have them."
)


class _Reader:
    """What each text of a view fits, and what follows from it."""

    def __init__(self, query: View, index: LikelihoodIndex, store: ObjectStore) -> None:
        self.query, self.index, self.store = query, index, store
        self.names = map_texts(store)
        texts = dict.fromkeys(filter(None, (*query.text_rows, *query.signs)))
        self.objects = {text: self.names.objects.fits(text) for text in texts}
        self.streets = {text: self.names.streets.fits(text) for text in texts}
        self.signs: list[str] = []

    @property
    def reading(self) -> Reading:
        """The view, and what its texts say."""
        query = self.query
        used = [self._is_on_object(row, text) for row, text in enumerate(query.text_rows)]
        others = [text for text, on in zip(query.text_rows, used, strict=True) if text and not on]
        # A street has the same sign at each corner, so that a second reading says nothing new.
        signs = dict.fromkeys((*others, *query.signs))
        self.signs = [text for text in signs if self._fits_any(text)]
        usable = query.among(self.index.database.present_codes)
        rows = np.flatnonzero(usable | np.array(used, np.bool_))
        texts = tuple(text if on else "" for text, on in zip(query.text_rows, used, strict=True))
        view = _of_unknown_class(query, np.flatnonzero(~usable)).select(rows)
        view = replace(view, texts=tuple(texts[row] for row in rows.tolist()), signs=())
        reading = Reading(
            view=view,
            rows=rows,
            index=self.index,
            extra=np.sum(list(map(self._sign, self.signs)), axis=0) if self.signs else None,
            records=tuple(map(self._record, self.objects)),
            notes=tuple(self._unknown(text) for text in self.objects if not self._fits_any(text)),
        )
        if view.texts is None:
            return replace(reading, view=usable_objects(view, self.index.table.codes)[0])
        divided = self._divided(tuple(sorted({*filter(None, view.texts)})))
        plain = _in_any_direction(view)
        scored, lacking = divided.view(plain)
        extra = np.zeros(len(self.index.database)) if reading.extra is None else reading.extra
        return replace(
            reading,
            view=scored,
            index=divided.index,
            store=divided.store,
            plain=plain,
            extra=extra + lacking,
        )

    def _is_on_object(self, row: int, text: str) -> bool:
        """Whether a text is that of an object, rather than the name of a street."""
        if not text:
            return False
        street, other = self.streets[text].best, self.objects[text].best
        likeliest = int(self.query.class_scores()[row].argmax())
        names = {item.code: item.name for item in self.index.database.taxonomy.classes}
        sign = names.get(likeliest) == STREET_SIGN
        return other > NONE and not (street > NONE if sign else street > other)

    def _fits_any(self, text: str) -> bool:
        return max(self.objects[text].best, self.streets[text].best) > NONE

    def _sign(self, text: str) -> NDArray[np.float64]:
        """Return what a text in an unknown direction adds to the log-likelihood of each cell."""
        database, size = self.index.database, len(self.index.database)
        levels = np.zeros(size, np.uint8)
        fits = self.streets[text].levels
        for level in np.unique(fits[fits > NONE]).tolist():
            tree = shapely.STRtree(self.names.shapes[fits == level])
            points = shapely.points(database.xy)
            near = np.unique(tree.query(points, predicate="dwithin", distance=STREET_M)[0])
            levels[near] = level
        rows = np.flatnonzero(self.objects[text].levels)
        if len(rows) <= MOST_OBJECTS:
            entries, owners = object_entries(database, self.store.objects, rows)
            cells = np.searchsorted(database.offsets, entries, side="right") - 1
            np.maximum.at(levels, cells, self.objects[text].levels[owners])
        counts = np.bincount(levels, minlength=EXACT + 1)
        factors = np.array([0.0, *(SHARES[level] for level in range(1, EXACT + 1))])
        # Whoever reads the name of one street hardly misread that of another, so that a name
        # that fits is compared with all that fit as well or better.
        factors *= (size + 1.0) / (np.cumsum(counts[::-1])[::-1] + 1.0)
        factors[NONE] = min(MISREAD / max(counts[NONE] / size, MISREAD), 1.0)
        return np.asarray(np.log(factors)[levels])

    def _divided(self, texts: tuple[str, ...]) -> DividedIndex:
        """Return the index for some texts; the index keeps the last ones."""
        memo, key = self.index.memo, (self.store, texts)
        if key not in memo:
            levels = {text: self.objects[text].levels for text in texts}
            memo[key] = DividedIndex.of(self.index, self.store, levels)
        divided: DividedIndex = memo[key]
        return divided

    def _record(self, text: str) -> TextRecord:
        """Return what a text fits best."""
        street, other = self.streets[text], self.objects[text]
        on_street = street.best > other.best or (text in self.signs and street.best == other.best)
        kind, fits = ("street", street) if on_street else ("object", other)
        return {
            "text": text,
            "fit": IN_WORDS[fits.best],
            "kind": kind if fits.best else "",
            "names": fits.names,
            "count": int(np.count_nonzero(fits.levels == fits.best)) if fits.best else 0,
        }

    def _unknown(self, text: str) -> str:
        """Return a note on a text that fits nothing."""
        near = [*self.names.objects.nearest(text), *self.names.streets.nearest(text)][:LISTED]
        nearest = f"; the nearest are {', '.join(map(repr, near))}" if near else ""
        return f"nothing on the map is named {text!r}, so this text was not used{nearest}."


def _of_unknown_class(view: View, rows: NDArray[np.int64]) -> View:
    """Return a view in which the class of some objects is not known."""
    if not len(rows):
        return view
    codes, scores = view.codes, view.scores
    if codes is not None:
        codes = codes.copy()
        codes[rows] = WILDCARD
    if scores is not None:
        scores = scores.copy()
        scores[rows] = np.eye(scores.shape[1])[WILDCARD]
    return replace(view, codes=codes, scores=scores)
