"""Make the locator of a method, and locate a view with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias, TypeVar, Unpack, overload

import numpy as np

from semsig_gis.core.defaults import DEFAULT_METHOD, LIKELIHOOD
from semsig_gis.database.city import City
from semsig_gis.database.database import join_databases
from semsig_gis.database.file import PartitionedDatabase
from semsig_gis.localization.answers import Answer
from semsig_gis.localization.noise.model import NOISES, cell_noise
from semsig_gis.observation.north import GRID_NORTH

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from semsig_gis.core.signature import Signature
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.localization.answers import Ranking
    from semsig_gis.localization.distance.memo import DistanceMemo
    from semsig_gis.localization.distance.method import Method
    from semsig_gis.localization.distance.search import DistanceLocator, Localization
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import (
        LikelihoodLocator,
        LocateOptions,
        Location,
    )
    from semsig_gis.localization.likelihood.method import LikelihoodMethod
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.localization.requirement import Requirement
    from semsig_gis.observation.north import North

    AnyMethod: TypeAlias = Method | LikelihoodMethod
    Cells: TypeAlias = SignatureDatabase | PartitionedDatabase | City

# Imports of one kind of method are in functions: they take 0.1 s for each kind, and a process
# answers by one of them.

_Answer_co = TypeVar("_Answer_co", bound=Answer, covariant=True)


class Locator(Protocol[_Answer_co]):
    """A method with the cells that it searches and all else that it needs."""

    def locate(self, query: Signature, *, top: int | None = None) -> _Answer_co:
        """Answer a query, with its own number of candidates or another one.

        Objects of a class that no cell sees count as false detections, and the answer says so.
        Raises InputError if the query lacks a part that the method needs.
        """

    def rankings(
        self, queries: Sequence[Signature], *, memo: DistanceMemo | None = None
    ) -> Iterator[Ranking]:
        """Rank all cells for each query, in order; each query has at least one object.

        `memo` keeps distances of these queries that other methods have needed; the time it took to
        measure them counts for each method.
        """


def parse_method(text: str, *, noises: Mapping[str, Noise] = NOISES) -> AnyMethod:
    """Read a method of either kind from text.

    Parameters
    ----------
    text : str
        What `Method.parse` or `LikelihoodMethod.parse` reads.
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
    method: Method,
    *,
    requirement: Requirement | None = None,
    index: LikelihoodIndex | None = None,
    **options: Unpack[LocateOptions],
) -> DistanceLocator: ...
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

    `requirement` limits the cells that are candidates. `index` is the one of `method_index`, if it
    exists already. `options` are those of `locate`: a distance uses ``top`` and ``north``, and by
    likelihood the ``store`` is that of the city, and ``refined`` follows the method and the store,
    where they are not given.
    """
    if method.noise is None:
        from semsig_gis.localization.distance.search import DistanceLocator  # noqa: PLC0415 - above

        cells = database.dataset if isinstance(database, City) else database
        return DistanceLocator(
            database=cells,
            method=method,
            requirement=requirement,
            top=options.get("top", DistanceLocator.top),
            north=options.get("north", GRID_NORTH),
        )
    from semsig_gis.localization.likelihood.locate import LikelihoodLocator  # noqa: PLC0415 - above

    if isinstance(database, City):
        if "store" not in options and database.has_store and not method.on_grid:
            options["store"] = database.store
        database = database.database
    elif isinstance(database, PartitionedDatabase):
        database = join_databases(list(database.parts()))
    if requirement is not None:
        # GeoPandas, which the module of priors imports, takes a second.
        from semsig_gis.localization.likelihood.priors import weight_prior  # noqa: PLC0415

        met = requirement.met(database.type_sequences)
        prior = weight_prior(database, met.astype(np.float64))
        other = options.get("log_prior")
        options["log_prior"] = prior if other is None else other + prior
    if "refined" not in options:
        # None: where the query has bearings.
        between = options.get("store") is not None and not method.on_grid
        options["refined"] = method.refined or (None if between else False)
    options.setdefault("north_sigma", method.north_sigma)
    return LikelihoodLocator(index=index or method_index(database, method), **options)


def method_index(database: SignatureDatabase, method: LikelihoodMethod) -> LikelihoodIndex:
    """Return the index of a database for queries from where the method expects them."""
    from semsig_gis.localization.likelihood.index import build_index  # noqa: PLC0415 - above

    noise = method.noise if method.on_grid else cell_noise(method.noise, database.grid.step)
    return build_index(database, noise)


@overload
def localize(
    database: Cells,
    query: Signature,
    *,
    method: LikelihoodMethod | Literal["likelihood"] = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Location: ...
@overload
def localize(
    database: Cells,
    query: Signature,
    *,
    method: Method,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Localization: ...
@overload
def localize(
    database: Cells,
    query: Signature,
    *,
    method: str,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Location | Localization: ...
def localize(
    database: Cells,
    query: Signature,
    *,
    method: str | AnyMethod = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Location | Localization:
    """Find where a query was seen from, as `semsig localize` does.

    Parameters
    ----------
    database : SignatureDatabase, PartitionedDatabase or City
        The cells. By a distance, only one part of a database in parts is in memory at a time. By
        likelihood, a city with a store of street objects is also searched between the centres of
        its cells.
    query : Signature
        What a person or a detector saw, perhaps nothing; types or bearings may be unknown. Objects
        of a class that no cell sees are false detections, and the answer says so.
    method : str, Method or LikelihoodMethod, default "likelihood"
        How the cells are ranked, or its text (see `parse_method`), such as ``"edit+edit:5%"``. A
        fusion uses the part that the query has.
    requirement : Requirement, optional
        What a cell must see to be a candidate; nothing by default.
    top : int, default 10
        How many cells to list, at least 1.
    north : North, optional
        What the bearings of the query count from; grid north by default.

    Returns
    -------
    Location or Localization
        The answer of the likelihood, with chances (see `locate` for what else it may know), or
        that of a distance, with its ties.

    Raises
    ------
    InputError
        If the query has no part that the method compares, the method needs street objects that are
        not there, no cell meets the requirement, or `top` is below 1.
    UnknownNameError
        If the text of the method has a name that is not known.
    EmptyResultError
        The same, if no cell meets the requirement of a query by distance.

    Examples
    --------
    >>> longest = int(demo_database.lengths.argmax())
    >>> query = demo_database.signature(longest)
    >>> answer = localize(demo_database, query)
    >>> answer.answer.given, answer.answer.cell == longest
    (True, True)
    >>> answer = localize(demo_database, query, method="edit+edit:5%", top=3)
    >>> answer.used, answer.candidates["distance"][0]
    ('types+angles', np.float64(0.0))
    """
    used = parse_method(method) if isinstance(method, str) else method
    locator = make_locator(database, used, requirement=requirement, top=top, north=north)
    return locator.locate(query)
