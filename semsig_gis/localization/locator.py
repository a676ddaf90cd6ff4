"""Methods of either kind: named by text, with what they need to answer, and their answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias, overload

import numpy as np

from semsig_gis.core import DEFAULT_METHOD, LIKELIHOOD
from semsig_gis.database import City, PartitionedDatabase, join_databases
from semsig_gis.localization.distance.method import Method
from semsig_gis.localization.distance.search import DistanceLocator
from semsig_gis.localization.likelihood.index import build_index
from semsig_gis.localization.likelihood.locate import LikelihoodLocator
from semsig_gis.localization.likelihood.method import LikelihoodMethod
from semsig_gis.localization.likelihood.priors import weight_prior
from semsig_gis.localization.noise.model import NOISES, cell_noise
from semsig_gis.observation import GRID_NORTH

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from semsig_gis.core import Signature
    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.localization.answers import Answer, Locator, Requirement
    from semsig_gis.localization.distance.search import Localization
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.locate import Location
    from semsig_gis.localization.noise.model import Noise
    from semsig_gis.observation import North

AnyMethod: TypeAlias = Method | LikelihoodMethod


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
        return LikelihoodMethod.parse(text, noises=noises)
    return Method.parse(text)


def make_locator(
    database: SignatureDatabase,
    method: AnyMethod,
    *,
    store: Callable[[], ObjectStore] | None = None,
) -> Locator[Answer]:
    """Return a method with all that it needs; `store` is called if places are to be refined."""
    if isinstance(method, Method):
        return DistanceLocator(database=database, method=method)
    return LikelihoodLocator(
        index=_index(database, method),
        north_sigma=method.north_sigma,
        store=store() if method.refined and store else None,
        refined=method.refined,
    )


@overload
def localize(
    database: SignatureDatabase | PartitionedDatabase | City,
    query: Signature,
    *,
    method: LikelihoodMethod | Literal["likelihood"] = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Location: ...
@overload
def localize(
    database: SignatureDatabase | PartitionedDatabase | City,
    query: Signature,
    *,
    method: Method,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Localization: ...
@overload
def localize(
    database: SignatureDatabase | PartitionedDatabase | City,
    query: Signature,
    *,
    method: str,
    requirement: Requirement | None = None,
    top: int = 10,
    north: North = GRID_NORTH,
) -> Location | Localization: ...
def localize(
    database: SignatureDatabase | PartitionedDatabase | City,
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
    if isinstance(used, Method):
        cells = database.dataset if isinstance(database, City) else database
        return DistanceLocator(
            database=cells, method=used, requirement=requirement, top=top, north=north
        ).locate(query)
    store = None
    if isinstance(database, City):
        store = database.store if database.has_store and not used.on_grid else None
        database = database.database
    elif isinstance(database, PartitionedDatabase):
        database = join_databases(list(database.parts()))
    prior = None
    if requirement is not None:
        met = requirement.met(database.type_sequences)
        prior = weight_prior(database, met.astype(np.float64))
    return LikelihoodLocator(
        index=_index(database, used),
        north_sigma=used.north_sigma,
        log_prior=prior,
        top=top,
        store=store,
        refined=used.refined or (None if store else False),
        north=north,
    ).locate(query)


def _index(database: SignatureDatabase, method: LikelihoodMethod) -> LikelihoodIndex:
    noise = method.noise if method.on_grid else cell_noise(method.noise, database.grid.step)
    return build_index(database, noise)
