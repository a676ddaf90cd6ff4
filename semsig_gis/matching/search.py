"""Rank the cells of a signature database for a query.

Scores are distances: lower is better. Cells that tie are told as such, never ranked by accident.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from semsig_gis.core.errors import EmptyResultError, InputError
from semsig_gis.core.taxonomy import WILDCARD
from semsig_gis.database.file import PartitionedDatabase
from semsig_gis.database.requirement import PatternIndex
from semsig_gis.matching.method import DEFAULT_METHOD
from semsig_gis.matching.result import Localization, Shortlist
from semsig_gis.matching.scores import _score_parts

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Hashable

    from numpy.typing import NDArray

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.database.requirement import Requirement
    from semsig_gis.matching.method import Method

    _SecondStage = Callable[[NDArray[np.int64]], NDArray[np.float32]]
    _Known = Callable[[Hashable, Callable[[], NDArray[Any]]], NDArray[Any]]


def localize(
    database: SignatureDatabase | PartitionedDatabase,
    query: Signature,
    *,
    method: Method = DEFAULT_METHOD,
    requirement: Requirement | None = None,
    top: int = 100,
) -> Localization:
    """Find the cells whose signature is most like a query.

    Parameters
    ----------
    database : SignatureDatabase or PartitionedDatabase
        The cells. Of a database in parts, one part at a time is in memory; the answer is that of
        the parts together.
    query : Signature
        What a person or a detector saw; types or bearings may be unknown.
    method : Method
        How the cells are ranked. A fusion uses the part that the query has.
    requirement : Requirement, optional
        What a cell must see to be a candidate; nothing by default.
    top : int
        How many cells to list, at least 1.

    Returns
    -------
    Localization
        The best cells, with ties told.

    Raises
    ------
    InputError
        If the query is empty, has no part that the method compares, or has a class that no cell
        of the database sees, or `top` is below 1.
    EmptyResultError
        If no cell meets the requirement.

    Examples
    --------
    >>> from semsig_gis.sources.catalog import paper_taxonomy
    >>> from semsig_gis.database.build import build_database
    >>> from semsig_gis.objects.clean import build_objects
    >>> from semsig_gis.sources.synthetic.city import CitySpec, synthetic_city
    >>> layers = synthetic_city(CitySpec(size=300.0))
    >>> objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    >>> database = build_database(objects)
    >>> found = localize(database, database.signature(10), top=3)
    >>> found.used, found.candidates["distance"][0]
    ('types+angles', np.float64(0.0))
    """
    if top < 1:
        msg = f"{top} candidates were asked for; give a whole number from 1."
        raise InputError(msg)
    if len(query) == 0:
        msg = "the query has no objects; give at least one type or bearing."
        raise InputError(msg)
    shortlist = Shortlist(top)
    met = np.empty(0, np.bool_)
    for part, scores in _score_parts(database, query, method):
        shortlist.present.update(part.present_codes.tolist())
        if requirement is None:
            shortlist.add(part, scores)
        elif (met := PatternIndex.build(part.type_sequences).meeting(requirement)).any():
            shortlist.add(part.select(met), scores[met])
    _require_present(query, shortlist.present, part.taxonomy)
    if shortlist.cells == 0:
        msg = f"none of the {len(database):,} cells meets the requirement; ask for less."
        raise EmptyResultError(msg)
    candidates, tied_beyond = shortlist.ranked()
    if isinstance(database, PartitionedDatabase):
        candidates["cell"] = database.row_numbers(candidates["cell_id"].to_numpy())
    elif requirement is not None:
        candidates["cell"] = np.flatnonzero(met)[candidates["cell"]]
    return Localization(
        query=query,
        method=method,
        used=method.used(query),
        candidates=candidates,
        cells=shortlist.cells,
        tied_beyond=tied_beyond,
        crs=part.crs,
        taxonomy=part.taxonomy,
        licenses=part.licenses,
    )


def _require_present(query: Signature, present: Collection[int], taxonomy: Taxonomy) -> None:
    """Refuse a class that no cell sees: it could only make every score worse."""
    if query.codes is None:
        return
    absent = sorted(set(query.codes.tolist()) - {WILDCARD, *present})
    if absent:
        missing = taxonomy.by_code(absent[0])
        seen = [taxonomy.by_code(code) for code in sorted(present)]
        legend = ", ".join(f"{item.symbol} {item.title.lower()}" for item in seen)
        msg = (
            f"the query has symbol {missing.symbol!r} ({missing.title.lower()}), which no cell of "
            f"the database sees; leave it out, the symbols seen are {legend}."
        )
        raise InputError(msg)
