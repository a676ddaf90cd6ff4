"""Make the locator of a method, and locate a view with it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Any,
    Literal,
    Protocol,
    TypeAlias,
    TypeVar,
    Unpack,
    cast,
    overload,
)

import numpy as np

from semsig_gis.core import DEFAULT_METHOD, LIKELIHOOD, InputError, Signature, each_in_order
from semsig_gis.database import (
    City,
    PartitionedDatabase,
    open_city,
    whole_database,
)
from semsig_gis.localization.answers import Answer
from semsig_gis.localization.noise.model import cell_noise
from semsig_gis.localization.noise.presets import NOISES
from semsig_gis.observation import GRID_NORTH, Description, View, read_description

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization.answers import Ranking
    from semsig_gis.localization.distance.memo import DistanceMemo
    from semsig_gis.localization.distance.method import Method
    from semsig_gis.localization.distance.search import DistanceLocator, Localization
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import (
        LikelihoodLocator,
        LikelihoodOptions,
        LocateOptions,
        Location,
    )
    from semsig_gis.localization.likelihood.method import LikelihoodMethod
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.requirement import Requirement
    from semsig_gis.observation import AnyView, North

    Cells: TypeAlias = SignatureDatabase | PartitionedDatabase | City
    Where: TypeAlias = str | Path | Cells

AnyMethod: TypeAlias = "Method | LikelihoodMethod"

KEPT_INDEXES = 4
"""Number of indexes that a database keeps: one for each noise that is usual for some views."""

# Imports of one kind of method are in functions: they take 0.1 s for each kind, and a process
# answers by one of them.

_Answer_co = TypeVar("_Answer_co", bound=Answer, covariant=True)


class Locator(Protocol[_Answer_co]):
    """A method with the cells that it searches, ready to answer queries."""

    def locate(self, query: Signature, *, top: int | None = None) -> _Answer_co:
        """Return the answer to a query; `top` replaces the number of candidates of the locator.

        Objects of a class that no cell sees are not used; a note in the answer says so.
        Raises InputError if the query lacks a part that the method needs.
        """

    def rankings(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[Ranking]:
        """Yield the ranking of all cells for each query; each query has at least one object.

        `memo` shares the distances of these queries between methods; the time to compute them
        counts for each method.
        """


def parse_method(text: str, *, noises: Mapping[str, Noise] = NOISES) -> AnyMethod:
    """Read a method of either kind from text.

    Parameters
    ----------
    text : str
        Text for `Method.parse` or `LikelihoodMethod.parse`.
    noises : mapping of str to Noise, optional
        The noise models by name.

    Returns
    -------
    Method or LikelihoodMethod
        The method.

    Raises
    ------
    SemsigError
        If the text cannot be read.

    Examples
    --------
    >>> str(parse_method("edit+edit:5%")), str(parse_method("likelihood"))
    ('edit+edit:5%', 'likelihood:generic')
    """
    if text.strip().partition(":")[0] == LIKELIHOOD:
        from semsig_gis.localization.likelihood.method import LikelihoodMethod  # noqa: PLC0415 - above

        return LikelihoodMethod.parse(text, noises=noises)
    from semsig_gis.localization.distance.method import Method  # noqa: PLC0415 - above

    return Method.parse(text)


@overload
def make_locator(
    database: Cells,
    method: LikelihoodMethod,
    *,
    requirement: Requirement | None = None,
    index: LikelihoodIndex | None = None,
    **options: Unpack[LocateOptions],
) -> LikelihoodLocator: ...
@overload
def make_locator(
    database: Cells,
    method: AnyMethod,
    *,
    requirement: Requirement | None = None,
    index: LikelihoodIndex | None = None,
    **options: Unpack[LocateOptions],
) -> DistanceLocator | LikelihoodLocator: ...
def make_locator(
    database: Cells,
    method: AnyMethod,
    *,
    requirement: Requirement | None = None,
    index: LikelihoodIndex | None = None,
    **options: Unpack[LocateOptions],
) -> DistanceLocator | LikelihoodLocator:
    """Return the locator of a method.

    `requirement` limits the candidate cells. `index` is the result of `method_index`, if it exists
    already. `options` are those of `locate`. A distance uses only ``top``, ``north`` and ``city``,
    which is by default the one that is searched. For the likelihood method, the default
    ``store`` is that of the city, and ``refined`` depends by default on the method and the store.
    """
    if isinstance(database, City):
        options.setdefault("city", database)
    if method.noise is None:
        from semsig_gis.localization.distance.search import DistanceLocator  # noqa: PLC0415 - above

        cells = database.dataset if isinstance(database, City) else database
        return DistanceLocator(
            database=cells,
            method=method,
            requirement=requirement,
            top=options.get("top", DistanceLocator.top),
            north=options.get("north", GRID_NORTH),
            city=options.get("city"),
        )
    from semsig_gis.localization.likelihood.locate import LikelihoodLocator  # noqa: PLC0415 - above

    if isinstance(database, City):
        if "store" not in options and database.has_store and not method.on_grid:
            options["store"] = database.store
        database = database.database
    elif isinstance(database, PartitionedDatabase):
        database = database.whole()
    if requirement is not None:
        # The module imports GeoPandas, which takes 0.3 s.
        from semsig_gis.localization.likelihood.priors import weight_prior  # noqa: PLC0415

        mask = requirement.met(database.type_sequences)
        prior = weight_prior(database, mask.astype(np.float64))
        other = options.get("log_prior")
        options["log_prior"] = prior if other is None else other + prior
    if "refined" not in options:
        # None: refined if the query has bearings.
        between = options.get("store") is not None and not method.on_grid
        options["refined"] = method.refined or (None if between else False)
    options.setdefault("north_sigma", method.north_sigma)
    options.setdefault("surely_here", method.surely_here)
    return LikelihoodLocator(index=index or method_index(database, method), **options)


def usual_noise(view: Signature, *, in_words: bool = False) -> str:
    """Return the name of the noise model for a view if none is given.

    It is ``by-hand`` for a view in words, since people leave out much, ``photo`` for a view of
    photographs or sectors, ``panorama`` for a full turn with scores of a detector, and otherwise
    ``generic``.
    """
    if in_words:
        return "by-hand"
    if not isinstance(view, View):
        return "generic"
    if any(photo.sectors for photo in view.photos):
        return "photo"
    return "generic" if view.scores is None else "panorama"


@dataclass(frozen=True, eq=False, kw_only=True)
class UsualLocator:
    """The locator of views with the usual noise of each (see `usual_noise`).

    `make` returns the locator for the name of a noise model.
    """

    make: Callable[[str], LikelihoodLocator]
    _locators: dict[str, LikelihoodLocator] = field(default_factory=dict, init=False)

    def of(self, view: Signature, *, in_words: bool = False) -> LikelihoodLocator:
        """Return the locator for a view."""
        name = usual_noise(view, in_words=in_words)
        if name not in self._locators:
            self._locators[name] = self.make(name)
        return self._locators[name]

    def locate(self, query: Signature, *, top: int | None = None) -> Location:
        """Return the answer to a query; see `Locator`."""
        return self.of(query).locate(query, top=top)

    def rankings(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[Ranking]:
        """Rank all cells for each query; see `Locator`."""
        for query in queries:
            yield from self.of(query).rankings([query], memo=memo)


def method_index(database: SignatureDatabase, method: LikelihoodMethod) -> LikelihoodIndex:
    """Return the index of a database for a method: from cell centres or from anywhere in a cell.

    The database keeps the last of them.
    """
    from semsig_gis.localization.likelihood.index import build_index  # noqa: PLC0415 - above

    noise = method.noise if method.on_grid else cell_noise(method.noise, database.grid.step)
    # The noise of an index may differ from the one that was asked for, so both are kept.
    indexes: list[tuple[Noise, LikelihoodIndex]] = database.memo
    for indexed_noise, index in indexes:
        if indexed_noise == noise:
            return index
    index = build_index(database, noise)
    indexes[:] = [*indexes[1 - KEPT_INDEXES :], (noise, index)]
    return index


@overload
def localize(
    database: Where,
    query: AnyView,
    *,
    method: LikelihoodMethod | Literal["likelihood"] = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
    **options: Unpack[LikelihoodOptions],
) -> Location: ...
@overload
def localize(
    database: Where,
    query: AnyView,
    *,
    method: Method,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Localization: ...
@overload
def localize(
    database: Where,
    query: AnyView,
    *,
    method: str,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
    **options: Unpack[LikelihoodOptions],
) -> Location | Localization: ...
def localize(
    database: Where,
    query: AnyView,
    *,
    method: str | AnyMethod = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
    **options: Unpack[LikelihoodOptions],
) -> Location | Localization:
    """Return the places from which something may have been seen, as `semsig localize` does.

    Parameters
    ----------
    database : str, Path, City, SignatureDatabase or PartitionedDatabase
        The cells: the file or folder of a database, or one that is open, which is faster from the
        second question on. A distance reads a partitioned database one part at a time. The
        likelihood method also searches between the centres of cells if there are street objects.
    query : str, iterable, dict or Signature
        What a person or a detector saw: a sentence, a list of pairs of class and bearing, a row as
        `parse_view` takes it, or a view. Objects of a class that no cell sees are not used, with a
        note in the answer.
    method : str, Method or LikelihoodMethod, default "likelihood"
        How the cells are ranked, or its text (see `parse_method`), such as ``"edit+edit:5%"``. A
        fusion uses one part if the view has only this one. The noise of ``"likelihood"`` depends
        on what was seen: ``"by-hand"`` for words, that of photographs for a view of sectors, that
        of panoramas for a full turn with scores of a detector, and otherwise ``"generic"``.
    requirement : Requirement, optional
        The objects that a candidate cell must see; none by default.
    top : int, default 10
        Number of cells to list, at least 1.
    north : North, optional
        The north from which the bearings are measured; grid north by default.
    **options : LikelihoodOptions
        Further settings of the likelihood method, as in `locate`; ``explained`` is 1 by default.

    Returns
    -------
    Location or Localization
        The answer by likelihood, with probabilities, or by distance, with ties.

    Raises
    ------
    InputError
        If what was seen cannot be read or has no part that the method compares, the method needs
        street objects but the city has none, no cell meets the requirement, `top` is below 1, or a
        distance is given an option of the likelihood method.
    UnknownNameError
        If a class or the text of the method has an unknown name.
    DatabaseError
        If there is no database at the path.
    EmptyResultError
        If no cell meets the requirement and the method is a distance.

    Examples
    --------
    >>> answer = localize(demo_database, "bench at 40, lamp at 120, tree at 200")
    >>> [round(degrees, 2) for degrees in answer.latlon], 0 < answer.chance < 1
    ([48.75, 3.0], True)
    >>> longest = int(demo_database.lengths.argmax())
    >>> answer = localize(demo_database, demo_database.signature(longest))
    >>> answer.answer.given, answer.answer.cell == longest
    (True, True)
    >>> pairs = [("bench", 40), ("lamp", 120)]
    >>> answer = localize(demo_database, pairs, method="edit+edit:5%", top=3)
    >>> answer.used
    'types+angles'
    """
    settings: dict[str, Any] = {"requirement": requirement, "top": top, "north": north, **options}
    (answer,) = localize_many(database, [query], method=method, **settings)
    return cast("Location | Localization", answer)


def localize_many(
    database: Where,
    queries: Iterable[AnyView],
    *,
    method: str | AnyMethod = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
    **options: Unpack[LikelihoodOptions],
) -> Iterator[Any]:
    """Return the answers to many questions, one by one and in order, computed in parallel.

    Parameters
    ----------
    database : path, SignatureDatabase, PartitionedDatabase or City
        As in `localize`.
    queries : iterable
        What was seen, each as in `localize`. One that cannot be read raises its error in its turn.
    method, requirement, top, north, **options : optional
        As in `localize`.

    Returns
    -------
    iterator of Location or Localization
        The answers. One by likelihood holds the chances of all cells: keep only what is needed of
        each.

    Examples
    --------
    >>> views = ["bench at 40, lamp at 120", [("tree", 10), ("lamp", 200)]]
    >>> [len(answer.query) for answer in localize_many(demo_database, views)]
    [2, 2]
    """
    cells = open_city(database) if isinstance(database, str | Path) else database
    if not isinstance(cells, City | PartitionedDatabase):
        cells = whole_database(cells)
    dataset = cells.dataset if isinstance(cells, City) else cells
    usual = method == LIKELIHOOD
    ranking = parse_method(method) if isinstance(method, str) else method
    if options and ranking.noise is None:
        raise InputError(
            f"{' and '.join(options)} {'works' if len(options) == 1 else 'work'} only with the "
            f"likelihood method, not with {str(ranking)!r}; leave out one or the other."
        )

    @cache
    def locator_for(noise: str) -> Any:  # noqa: ANN401 - a locator of either kind
        own = parse_method(f"{LIKELIHOOD}:{noise}") if noise else ranking
        settings: LocateOptions = {"top": top, "north": north, **options}
        return make_locator(cells, own, requirement=requirement, **settings)

    @cache  # of a database in parts, the first part is read for them
    def words() -> dict[str, Any]:
        return {"taxonomy": dataset.taxonomy, "radius": dataset.spec.radius}

    def answer(item: AnyView) -> Location | Localization:
        if isinstance(item, Signature):
            description = Description(view=item)
        else:
            description = read_description(item, **words())
        noise = usual_noise(description.view, in_words=description.in_words)
        locator = locator_for(noise if usual else "")
        unplaced, absent = description.unplaced, description.absent
        if unplaced or absent:
            from semsig_gis.localization.suggest import with_unplaced  # noqa: PLC0415 - geopandas

            locator = with_unplaced(locator, description.view, unplaced, absent=absent)
        has_bearings = description.view.bearings is not None  # which explanations need
        if ranking.noise is not None and "explained" not in options and has_bearings:
            locator = replace(locator, explained=1)
        return cast("Location | Localization", locator.locate(description.view))

    return each_in_order(answer, queries)
