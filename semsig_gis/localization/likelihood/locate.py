"""Locate a query: chances of all cells, a place with its region, or "cannot tell".

The likelihood method in one call: score every cell by the index, re-rank the best cells by
one-to-one associations, turn the scores into chances, decide whether to answer, and, if the street
objects are available, search the place between the viewpoints and explain it.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

import numpy as np

from semsig_gis.core import (
    DatabaseError,
    InputError,
    cell_ids,
    export_with,
    map_with,
    percent,
)
from semsig_gis.database import City
from semsig_gis.localization.answers import (
    LEAST_ELSEWHERE,
    REGION_SHARE,
    Answer,
    Ranking,
    answer_licenses,
    candidate_columns,
    check_top,
    doubt_parts,
    doubt_sentence,
    query_notes,
)
from semsig_gis.localization.likelihood.answer_rule import DEFAULT_RULE
from semsig_gis.localization.likelihood.association import rerank
from semsig_gis.localization.likelihood.elsewhere import (
    area_chances,
    evidence_ratio,
    goodness_of_fit,
)
from semsig_gis.localization.likelihood.estimate import cell_estimate, refined_estimate
from semsig_gis.localization.likelihood.explain import (
    IN_WORDS,
    explain,
    explain_cell,
)
from semsig_gis.localization.likelihood.index import (
    FIRST_TURNED_DETECTIONS,
    CellScores,
    is_plain,
    own_sigma,
    photo_power,
)
from semsig_gis.localization.likelihood.posterior import (
    DIVIDED_PARTS,
    holding,
    prior_ratio,
    refine,
)
from semsig_gis.localization.likelihood.reading import KEPT, has_texts, read_view
from semsig_gis.localization.likelihood.route import route_posteriors
from semsig_gis.localization.noise.model import cell_noise, place_noise
from semsig_gis.observation import GRID_NORTH, View

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    import pandas as pd
    from numpy.typing import NDArray

    from semsig_gis.core import MapFrame, Signature
    from semsig_gis.database import ObjectStore, SignatureDatabase
    from semsig_gis.localization.distance.memo import DistanceMemo
    from semsig_gis.localization.likelihood.answer_rule import AnswerRule, Decision
    from semsig_gis.localization.likelihood.estimate import PlaceEstimate
    from semsig_gis.localization.likelihood.explain import Explanation
    from semsig_gis.localization.likelihood.incremental import IncrementalIndex
    from semsig_gis.localization.likelihood.index import LikelihoodIndex
    from semsig_gis.localization.likelihood.location_record import LocationRecord
    from semsig_gis.localization.likelihood.posterior import Places, Posterior, Refinement
    from semsig_gis.localization.likelihood.reading import Reading, TextRecord
    from semsig_gis.observation import Leg, North

DISAGREEMENT = 0.01
"""Ratio of a prior (see `posterior.prior_ratio`) at or below which an answer warns of it."""
LARGE_POWER = 4  # of ten; larger numbers are written as powers
MOST_PLACES = 100
"""Most places of a region that are counted."""
ROUNDING = 1e-9
TINY = np.finfo(np.float64).tiny
UNREFINED = 1e-6  # share of the chance of the likeliest cells that are not divided
LEAST_REFINED = 0.02
"""Least chance of a version of a query for a search between the viewpoints."""


class _Version(NamedTuple):
    """A version of a query, its scores, and the chances of the cells if it is right."""

    query: Signature
    scores: CellScores
    posterior: Posterior


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Location(Answer):
    """The answer of the likelihood method to a query.

    Parameters
    ----------
    query, cells, crs, taxonomy, licenses
        The query, the number of cells that were searched, and the CRS, classes and licences of
        their database.
    noise : str
        Name of the noise model.
    columns : mapping of str to ndarray
        The columns of `candidates`, distinct places (see `Posterior.places`), likeliest first, each
        by its likeliest cell: ``rank`` (from 1), ``cell`` (row in the database), ``cell_id``, ``x``
        and ``y`` (viewpoint, CRS of the database), ``types`` (symbols), ``length`` (objects),
        ``loglik`` (natural logarithm of the likelihood), ``chance`` of the place, ``cell_chance``
        of the cell and, if north was not known exactly, ``heading`` (degrees to add to the bearings
        of the query).
    answer : Decision
        The centre of the first place, its chance, and whether it is enough.
    estimate : PlaceEstimate
        The place around that cell and the heading, each with its uncertainty, if it is there.
    rule : AnswerRule
        The rule of the decision.
    region : ndarray of int64
        Row numbers of the fewest cells that contain 90 % of the chance, likeliest first.
    posterior : Posterior
        The chance of every cell, if the view is from the area of the database.
    loglik : ndarray of float, shape (n,)
        Natural logarithm of the likelihood of every cell.
    explanations : tuple of Explanation
        Explanations of the first candidates, in their order.
    known : mapping of str
        The prior of the place, in plain values.
    prior_ratio : float or None
        Ratio of the likelihoods of the query with the prior and with a uniform one; None without
        a prior.
    elsewhere : float
        Chance that the view is not from the area of the database; the chances of places and of the
        answer add up to the rest.
    fit : float or None
        Share of simulated views from the best place that fit it worse than the query; None if not
        computed. Below 0.01, the query fits badly.
    headings : tuple of ndarray or None
        By photo, the degrees to add to its bearings in each cell; None where they are known.
    versions : tuple of float
        Chance of each version of the query (see `locate_versions`); `query` is the likeliest.
    unplaced, absent : tuple of int
        Class codes of objects that were seen without a direction, or looked for and not seen.
    texts : tuple of dict
        For each text that was read, the names of the map that it fits best (see `to_dict`).

    Examples
    --------
    >>> from semsig_gis import build_index, locate, named_noise
    >>> index = build_index(demo_database, named_noise("generic"))
    >>> location = locate(index, demo_database.signature(0), top=3)
    >>> len(location.candidates)
    3
    """

    noise: str
    answer: Decision
    estimate: PlaceEstimate
    rule: AnswerRule
    region: NDArray[np.int64]
    posterior: Posterior
    loglik: NDArray[np.floating]
    explanations: tuple[Explanation, ...] = ()
    known: Mapping[str, Any] = field(default_factory=dict)
    prior_ratio: float | None = None
    elsewhere: float = 0.0
    fit: float | None = None
    headings: tuple[NDArray[np.float32] | None, ...] = (None,)
    versions: tuple[float, ...] = (1.0,)
    unplaced: tuple[int, ...] = ()
    absent: tuple[int, ...] = ()
    texts: tuple[TextRecord, ...] = ()

    def _facts(self) -> dict[str, object]:
        sure = self.answer.given
        region = {"region": f"{len(self.region):,} of {self.cells:,} cells"}
        lat, lon = self.latlon
        place = {
            "place" if sure else "best place": f"{lat:.5f}, {lon:.5f}",
            **({"which is": self.place} if self.place else {}),
            "give or take" if sure else "if there, give or take": f"{self.estimate.sigma:.1f} m",
            f"within {self.rule.radius:g} m": percent(self.chance),
        }
        return {
            "answer": "yes" if sure else "cannot tell",
            **({"doubt": self.doubt} if self.doubt else {}),
            **(place | region if sure else region | place),
            "candidates": len(self.columns["cell"]),
            "noise": self.noise,
        }

    def doubted(self, elsewhere: float, fit: float | None = None) -> Location:
        """Return the answer with these fields, and with the chances of places and the decision.

        The answer itself must be one of a view from the area for sure.
        """
        here = 1.0 - elsewhere
        mass = self.answer.mass * here
        answer = replace(self.answer, mass=mass, given=self.rule.answers(mass))
        chances = {name: self.columns[name] * here for name in ("chance", "cell_chance")}
        columns = {**self.columns, **chances}
        return replace(self, answer=answer, columns=columns, elsewhere=elsewhere, fit=fit)

    @property
    def doubt(self) -> str:
        """A sentence on `elsewhere` and `fit`; empty if both are unremarkable."""
        return doubt_sentence(self.elsewhere, self.fit)

    @cached_property
    def region_places(self) -> int | None:
        """Number of distinct places with 90 % of the chance; None if there are over 100."""
        chances = self.posterior.places(MOST_PLACES, radius=self.rule.radius).chances
        count = int(np.searchsorted(np.cumsum(chances), REGION_SHARE - ROUNDING)) + 1
        return count if count <= len(chances) else None

    @property
    def region_text(self) -> str:
        """The size of the region: ``90 % region: 7 cells, 700 m², in 1 place``."""
        if_here = ", if it is from this area" if self.elsewhere >= LEAST_ELSEWHERE else ""
        cells, km2, places = len(self.region), self.region_km2, self.region_places
        size = f"{km2:.3g} km²" if km2 >= 0.1 else f"{km2 * 1e6:,.0f} m²"  # noqa: PLR2004 - 10 ha
        where = "many places" if places is None else f"{places} place{'' if places == 1 else 's'}"
        number = f"{cells:,} cell{'' if cells == 1 else 's'}"
        return f"{percent(REGION_SHARE)} region{if_here}: {number}, {size}, in {where}"

    @property
    def region_km2(self) -> float:
        """Area of the cells of the region in square kilometres."""
        return len(self.region) * self.posterior.database.grid.step**2 / 1e6

    @property
    def cell_id(self) -> int:
        """Id of the grid cell in which the estimated place is; a database may lack it."""
        estimate = np.array([[self.estimate.x, self.estimate.y]])
        return int(cell_ids(*self.posterior.database.grid.cells_at(estimate))[0])

    @property
    def xy(self) -> tuple[float, float]:
        """The estimated place in metres."""
        return self.estimate.x, self.estimate.y

    @property
    def chance(self) -> float:
        """The chance of being within the radius of `rule`, 50 m, of the best place."""
        return self.answer.mass

    def explain(self) -> pd.DataFrame:
        """Return what was seen next to what stands there, for the likeliest place.

        The columns are ``you said``, ``is there``, the ``verdict`` in words and its ``chance``.
        Objects said without a direction are among them, and those said to be absent are the last
        rows. InputError if the answer has no explanations: they need bearings.
        """
        import pandas as pd  # noqa: PLC0415 - it takes 0.25 s

        if not self.explanations:
            raise InputError(
                "the answer has no explanation; give the bearings of what was seen, and ask with "
                "explained=1."
            )

        def described(
            name: str | None, bearing: float | None, metres: float | None, text: str | None = None
        ) -> str:
            if name is None:
                return ""
            title = self.taxonomy.title_of(name).lower() + (f" {text!r}" if text else "")
            at = "" if bearing is None else f" at {bearing:.0f}°"
            return f"{title}{at}" + ("" if metres is None else f", {metres:.0f} m")

        undirected, rest = self.without_direction(self.explanations[0])
        rows = []
        for number, row in enumerate(self.explanations[0].to_dict(self.north)["rows"]):
            read = row.get("query_text")
            there_read = row.get("object_text") if read else None
            view_part = described(
                row["query_class"], row["query_bearing"], row["query_range"], read
            )
            verdict = row["verdict"]
            if number in undirected:
                view_part, verdict = described(row["object_class"], None, None), "matched"
            there = described(
                row["object_class"], row["object_bearing"], row["distance"], there_read
            )
            rows.append((view_part, there, IN_WORDS[verdict], round(row["chance"], 2)))
        rows += [
            (view_part, there, IN_WORDS["matched" if there else "false"], math.nan)
            for view_part, there in rest
        ]
        return pd.DataFrame(rows, columns=["you said", "is there", "verdict", "chance"])

    def without_direction(self, explanation: Explanation) -> tuple[set[int], list[tuple[str, str]]]:
        """Return what was said without a direction, or to be absent, and what is there.

        The first are the numbers of rows of objects that were not said otherwise: of each class the
        nearest, as many as were said. The others are pairs of words: what was said, and what is
        there, which may be empty.
        """
        words, left = self.taxonomy.words, Counter(self.unplaced)
        missed = {
            number: self.taxonomy.by_name(row["object_class"]).code
            for number, row in enumerate(explanation.rows)
            if row["verdict"] == "missed"
        }
        numbers = set()
        for number in sorted(missed, key=lambda number: explanation.rows[number]["distance"]):
            if left[missed[number]]:
                left[missed[number]] -= 1
                numbers.add(number)
        more = Counter(code for number, code in missed.items() if number not in numbers)
        rest = [(words([code] * count), "") for code, count in left.items() if count]
        rest += [
            (f"no {words([code])}", words([code] * more[code]) if more[code] else "")
            for code in self.absent
        ]
        return numbers, rest

    @property
    def chances(self) -> NDArray[np.float64]:
        """The chance of every cell."""
        return self.posterior.chances

    def region_cells(self, database: SignatureDatabase, share: float) -> NDArray[np.int64]:
        """Return the rows of the fewest cells that hold a share of the chance, likeliest first."""
        cells = self.posterior.credible_cells(share)
        if not np.array_equal(self.posterior.database.cell_ids, database.cell_ids):
            raise InputError(
                "the answer was found in another database; give the database that was searched."
            )
        return cells

    def explore(self) -> MapFrame:
        """Show the answer on a map in a notebook (see `location_map`)."""
        return map_with("location_map", self, ground=self._ground)

    @property
    def _ground(self) -> dict[str, Any]:
        return {} if self.city is None else self.city.ground_around(self.posterior.database.xy)

    def export(self, path: str | Path) -> None:
        """Write the regions to search, the candidates and the place (see `export_answer`)."""
        ground = {name: table for name, table in self._ground.items() if name != "box"}
        export_with("export_answer", self, self.posterior.database, path, **ground)

    def to_dict(self) -> LocationRecord:
        """Return everything except the chances of all cells as plain values for JSON.

        ``place`` has the keys of `PlaceEstimate.to_dict` and ``name`` (in words), ``links`` (see
        `place_links`), ``cell_id``, ``lon``, ``lat``, ``chance`` and ``within_m``. ``threshold``
        is None if no chance is enough. The ``places`` of the ``region`` are None if there are over
        100. ``doubt`` may be empty; ``doubt_parts`` are the numbers in it (see `DoubtRecord`).
        ``candidates`` have the keys of `columns`, ``lon``, ``lat`` (degrees, WGS 84) and, for the
        first of them, ``explanation``, with bearings from ``north`` like those of the query.
        ``texts``, if something was read, has for each ``text`` the best ``fit`` ("exact", "part",
        "letters off" or "none"), its ``kind`` ("object" or "street"), some of the ``names`` that
        fit so and the ``count`` of all that do.
        ``prior`` has the keys of `known` and, with a prior, ``ratio``; it is None without any.
        """
        lat, lon = self.latlon
        candidates = self.candidate_rows()
        for candidate, why in zip(candidates, self.explanations, strict=False):
            candidate["explanation"] = why.to_dict(self.north)
        threshold, ratio = self.rule.threshold, self.prior_ratio
        prior: Any = dict(self.known) if ratio is None else {**self.known, "ratio": ratio}
        values: LocationRecord = {
            "query": self.query.to_dict(self.taxonomy),
            "north": self.north.to_dict(),
            "noise": self.noise,
            "cells": self.cells,
            "answered": self.answer.given,
            "place": {
                "name": self.place,
                "cell_id": self.cell_id,
                **self.estimate.to_dict(),
                "lon": lon,
                "lat": lat,
                "chance": self.answer.mass,
                "within_m": self.rule.radius,
                "links": self.links,
            },
            "threshold": threshold if math.isfinite(threshold) else None,
            "elsewhere": self.elsewhere,
            "fit": self.fit,
            "doubt": self.doubt,
            "doubt_parts": doubt_parts(self.elsewhere, self.fit),
            "region": {
                "share": REGION_SHARE,
                "cells": len(self.region),
                "km2": self.region_km2,
                "places": self.region_places,
                "text": self.region_text,
            },
            "entropy_bits": self.posterior.entropy,
            "prior": prior or None,
            "notes": list(self.notes),
            "crs": self.crs.to_string(),
            "licenses": list(self.licenses),
            "candidates": candidates,
        }
        if self.texts:
            values["texts"] = list(self.texts)
        return values


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LikelihoodLocator:
    """An index with the settings of its answers; `locate` describes the fields.

    If `refined` is None, a place is refined if there are a store and bearings. A `quick` answer
    scores cells only at their centres, re-ranks fewer of them, and has no heading of the place. An
    `incremental` index, which wraps `index`, is for a view that grows from query to query.
    `undirected` is what the `unplaced` and `absent` objects of the first view say, by cell.
    """

    index: LikelihoodIndex
    north_sigma: float = 0.0
    log_prior: NDArray[np.float64] | None = None
    rule: AnswerRule = DEFAULT_RULE
    top: int = 10
    store: ObjectStore | None = None
    refined: bool | None = False
    explained: int = 0
    known: Mapping[str, Any] = field(default_factory=dict)
    north: North = GRID_NORTH
    quick: bool = False
    incremental: IncrementalIndex | None = None
    surely_here: bool = False
    city: City | ObjectStore | None = None
    unplaced: tuple[int, ...] = ()
    absent: tuple[int, ...] = ()
    undirected: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:  # noqa: D105
        check_top(self.top)
        if self.refined and self.store is None:
            raise InputError(
                "searching between the viewpoints needs the object store of the database; give it."
            )

    @property
    def log_weights(self) -> NDArray[np.float64] | None:
        """Logarithms by cell, of the prior and of what was seen without a direction."""
        if self.log_prior is None or self.undirected is None:
            return self.undirected if self.log_prior is None else self.log_prior
        return self.log_prior + self.undirected

    def locate(self, query: Signature, *, top: int | None = None) -> Location:
        """Locate a query."""
        (location,) = self.locate_versions([[query]], top=top)
        return location

    def locate_route(
        self, queries: Sequence[Signature], legs: Sequence[Leg]
    ) -> tuple[Location, ...]:
        """Locate the views of a route; any of them may have no objects."""
        return self.locate_versions([queries], legs)

    def locate_versions(
        self,
        versions: Sequence[Sequence[Signature]],
        legs: Sequence[Leg] = (),
        *,
        log_weights: Sequence[Sequence[float]] | None = None,
        scores: Sequence[Sequence[CellScores]] | None = None,
        scanned: Sequence[CellScores] | None = None,
        top: int | None = None,
    ) -> tuple[Location, ...]:
        """Locate a view, or the views of a route, from versions: exactly one is right.

        Before they are compared, all versions have the same chance. `log_weights` are added to the
        log-likelihood of each view, for densities that are not per degree. The `scores` of the
        views, and the results `scanned` of `scan` for the first, are computed if not given.
        """
        database, log_prior = self.index.database, self.log_weights
        scored = [self._route_scores(queries) for queries in versions] if scores is None else scores
        chances = [
            route_posteriors(database, [view.loglik for view in views], legs, log_prior=log_prior)
            for views in scored
        ]
        evidence = np.array([views[0].log_evidence for views in chances])
        for number, weights in enumerate(log_weights or ()):
            for query, weight in zip(versions[number], weights, strict=True):
                evidence[number] += weight * photo_power(
                    len(View.of(query).photos), self.index.noise
                )
        shares = np.exp(evidence - np.logaddexp.reduce(evidence))
        best, ratio = int(shares.argmax()), None
        if self.log_prior is not None:
            first = self.scores(
                versions[best][0], scanned=scanned[best] if scanned else None
            ).loglik
            if legs:
                logliks = [first, *(view.loglik for view in scored[best][1:])]
                start = route_posteriors(database, logliks, legs)[0].chances
                first = np.log(np.maximum(start, TINY))
            # Objects without a direction belong to the view, not to the prior.
            view = first if self.undirected is None else first + self.undirected
            ratio = prior_ratio(view, self.log_prior)
        elsewhere = 0.0
        if not self.surely_here:
            ratios = [
                self.evidence_ratio(queries, views[0])
                for queries, views in zip(versions, chances, strict=True)
            ]
            here, away = np.logaddexp.reduce(evidence), np.logaddexp.reduce(evidence - ratios)
            elsewhere = float(area_chances([float(here - away)])[-1])
        return tuple(
            self._location(
                [_Version(*parts) for parts in zip(*view, strict=True)],
                shares=shares,
                top=top or self.top,
                store=self._store_for(versions[best]),
                ratio=ratio,
                elsewhere=elsewhere,
            )
            for view in zip(
                zip(*versions, strict=True),
                zip(*scored, strict=True),
                zip(*chances, strict=True),
                strict=True,
            )
        )

    def _route_scores(self, queries: Sequence[Signature]) -> list[CellScores]:
        """Return the scores of the views of a route; the prior is that of the first."""
        first = [self.scores(query, self.log_weights) for query in queries[:1]]
        return first + [self.scores(query) for query in queries[1:]]

    def rankings(
        self,
        queries: Sequence[Signature],
        *,
        memo: DistanceMemo | None = None,  # noqa: ARG002 - there are no distances
    ) -> Iterator[Ranking]:
        """Rank all cells for each query; see `Locator`."""
        for query in queries[:1]:
            self.locate(query, top=1)  # kernels are loaded once
        for query in queries:
            start = time.perf_counter()
            location = self.locate(query, top=1)
            seconds = time.perf_counter() - start
            answer, estimate = location.answer, location.estimate
            scores = -location.loglik.astype(np.float32)
            best = [answer.cell]
            if not self.refined:  # all cells that are as good an answer
                equal = np.flatnonzero(location.chances == location.chances[answer.cell])
                masses = location.posterior.mass_within(self.rule.radius, equal)
                masses = np.round(masses, 9)
                best = equal[masses == masses[equal == answer.cell]]
            scores[best] = scores.min() - 1.0
            yield Ranking(
                scores=scores,
                best_score=-float(location.loglik[answer.cell]),
                place=(estimate.x, estimate.y) if self.refined else None,
                heading=estimate.heading,
                chance=answer.mass,
                chances=location.chances,
                region=location.region,
                seconds=seconds,
            )

    def _usable_objects(self, query: Signature) -> Signature:
        """Return a query with bearings from grid north, without classes that no cell sees."""
        reading = self._reading(query)
        return reading.view if reading.plain is None else reading.plain

    def _reading(self, query: Signature) -> Reading:
        """Return what is read in a query; the index keeps the last ones."""
        view = self.north.to_grid(query)
        if not has_texts(view):
            return read_view(view, self.index, None)
        store = _text_store(self.store, self.city)
        memo: dict[Any, Reading] = self.index.memo
        key = query, store, self.north
        reading = memo.get(key)
        if reading is None:
            memo[key] = reading = read_view(view, self.index, store)
            for old in list(memo)[:-KEPT]:
                memo.pop(old, None)
        return reading

    def scan(self, query: Signature) -> CellScores:
        """Return the scores of all cells by the sum over detections one by one.

        What was read in an unknown direction is not among them.
        """
        reading = self._reading(query)
        index = reading.index
        # A growing photo is scored again only in part, if this gives the first scores.
        if (
            self.incremental is not None
            and index is self.index
            and all(
                len(photo) <= FIRST_TURNED_DETECTIONS
                and own_sigma(photo, self.north_sigma) > 0.0
                and not is_plain(photo)
                for photo in View.of(reading.view).split()
            )
        ):
            return self.incremental.scores(reading.view, north_sigma=self.north_sigma)
        return index.first_scores(reading.view, north_sigma=self.north_sigma)

    def scores(
        self,
        query: Signature,
        log_prior: NDArray[np.float64] | None = None,
        *,
        scanned: CellScores | None = None,
    ) -> CellScores:
        """Return the scores of all cells; those of the best are by one-to-one associations.

        A view of nothing but signs says only what they say: who reads a sign looks for no objects.
        """
        reading = self._reading(query)
        if reading.extra is not None and not len(reading.view):
            headings = (None,) * len(View.of(reading.view).photos)
            return CellScores(loglik=reading.extra, headings=headings)
        if reading.extra is not None:
            log_prior = reading.extra if log_prior is None else log_prior + reading.extra
        scores = rerank(
            reading.index,
            reading.view,
            scanned or self.scan(query),
            north_sigma=self.north_sigma,
            log_prior=log_prior,
            off_centre=not self.quick,
        )
        if reading.extra is None:
            return scores
        return replace(scores, loglik=scores.loglik + reading.extra)

    def _store_for(self, queries: Sequence[Signature]) -> ObjectStore | None:
        """Return the street objects if places are to be refined, else None."""
        blind = any(query.bearings is None and len(query) for query in queries)
        return self.store if self.refined or (self.refined is None and not blind) else None

    def evidence_ratio(self, queries: Sequence[Signature], posterior: Posterior) -> float:
        """Return how much likelier some views are in this area than elsewhere, as a logarithm."""
        usable = list(map(self._usable_objects, queries))
        return evidence_ratio(self.index, usable, posterior.log_evidence)

    def _location(
        self,
        versions: Sequence[_Version],
        *,
        shares: NDArray[np.float64],
        top: int,
        store: ObjectStore | None,
        ratio: float | None,
        elsewhere: float,
    ) -> Location:
        """Return the answer from the chances of the cells, refined if a store is given.

        It is explained by the likeliest version; `shares` are the chances of all.
        """
        parts, chances = None, np.zeros(len(self.index.database))
        # The likeliest comes last, so that its scores and parts are used below.
        for number in np.argsort(shares, kind="stable").tolist():
            query, scores, posterior = versions[number]
            usable = self._usable_objects(query)
            if store is not None and len(usable) and shares[number] >= LEAST_REFINED:
                parts = self.parts(query, scores, posterior, store)
                scores, posterior = _with_parts(parts, scores, posterior)
            if len(versions) > 1:
                chances += shares[number] * posterior.chances
        if len(versions) > 1:
            posterior = replace(posterior, chances=chances / chances.sum())
        places = posterior.places(top, radius=self.rule.radius)
        answer = self.rule.decide(posterior, places=places)
        radius, sigma = self.rule.radius, self.north_sigma
        database, noise = self.index.database, self.index.noise
        city = self.store if self.city is None else self.city
        estimate = None
        if parts is not None:
            xy = answer.x, answer.y
            estimate = refined_estimate(parts, xy, radius=radius, turned=scores.heading is not None)
        if estimate is None:
            estimate = cell_estimate(
                usable,
                noise,
                posterior,
                answer.cell,
                radius=radius,
                north_sigma=sigma,
                turned=not self.quick,
            )
        columns, reading = _columns(scores, posterior, places), self._reading(query)
        first = columns["cell"].tolist()[: self.explained if len(usable) else 0]
        (best,) = posterior.likeliest(1).tolist()
        fit = goodness_of_fit(self.index, usable, best, scores.headings_at(best))
        location = Location(
            query=query,
            noise=noise.name,
            columns=columns,
            cells=len(scores.loglik),
            crs=database.crs,
            taxonomy=database.taxonomy,
            licenses=answer_licenses(database, city),
            notes=(
                *query_notes(
                    query,
                    database.present_codes,
                    database.taxonomy,
                    texts=[record["text"] for record in reading.records if record["names"]],
                ),
                *reading.notes,
                *_prior_notes(ratio),
                *self.north.notes,
                *self.notes,
            ),
            answer=answer,
            estimate=estimate,
            rule=self.rule,
            region=posterior.credible_cells(REGION_SHARE),
            posterior=posterior,
            loglik=scores.loglik,
            explanations=tuple(self._explanation(query, cell, scores, parts) for cell in first),
            known=self.known,
            prior_ratio=ratio,
            north=self.north,
            city=city,
            headings=scores.headings,
            versions=tuple(shares.tolist()),
            unplaced=self.unplaced,
            absent=self.absent,
            texts=reading.records,
        )
        return location.doubted(elsewhere, fit)

    def parts(
        self, query: Signature, scores: CellScores, posterior: Posterior, store: ObjectStore
    ) -> Refinement:
        """Return the chances of the parts of the likeliest cells."""
        database, chances = posterior.database, posterior.chances
        cells = posterior.likeliest(DIVIDED_PARTS[0])
        cells = cells[holding(chances[cells], UNREFINED)]
        reading, extra = self._reading(query), np.zeros(len(cells))
        if reading.extra is not None:
            extra = reading.extra[cells]
        parts = refine(
            reading.view,
            database.xy_of(cells),
            place_noise(self.index.noise, database.grid.step),
            store=store if reading.store is None else reading.store,
            step=database.grid.step,
            radius=database.spec.radius,
            north_sigma=self.north_sigma,
            headings=[None if turns is None else turns[cells] for turns in scores.headings],
            # The chances of the cells without the likelihood of the objects of this query.
            log_prior=np.log(chances[cells]) - scores.loglik[cells] + extra,
            occlusion=database.occlusion,
        )
        rows = cells[parts.cells]
        loglik = parts.loglik if reading.extra is None else parts.loglik + reading.extra[rows]
        return replace(parts, cells=rows, loglik=loglik)

    def _explanation(
        self, query: Signature, cell: int, scores: CellScores, parts: Refinement | None
    ) -> Explanation:
        """Explain a query at a cell: at its likeliest part, or at its centre."""
        reading, store = self._reading(query), self.store
        database, noise = self.index.database, self.index.noise
        divided = reading.plain is not None
        view = reading.view if divided else self.north.to_grid(query)
        headings = scores.headings_at(cell)
        if store is None:
            database = reading.index.database
            explanation = explain_cell(
                view, cell, noise, database=database, heading=headings, plain=reading.plain
            )
            return explanation.numbered(reading.rows) if divided else explanation
        x, y = database.xy_of(cell).tolist()
        if parts is not None and len(inside := np.flatnonzero(parts.cells == cell)):
            best = inside[parts.loglik[inside].argmax()]
            x, y = parts.places[best].tolist()
            headings[0] = float(parts.headings[best])
            noise = cell_noise(place_noise(noise, database.grid.step), float(parts.sizes[best]))
        store = reading.store or store
        explanation = explain(
            view,
            (x, y),
            noise,
            objects=store.objects,
            index=store.index,
            radius=database.spec.radius,
            heading=headings,
            plain=reading.plain,
            footprints=store.buildings_around(
                np.array([[x, y]]), distance=database.near_reach, occlusion=database.occlusion
            ),
        )
        return explanation.numbered(reading.rows) if divided else explanation


class LikelihoodOptions(TypedDict, total=False):
    """The settings of answers that only the likelihood method has; `locate` describes them."""

    north_sigma: float
    log_prior: NDArray[np.float64] | None
    rule: AnswerRule
    store: ObjectStore | None
    refined: bool | None
    explained: int
    known: Mapping[str, Any]
    surely_here: bool
    city: City | ObjectStore | None
    notes: tuple[str, ...]


class LocateOptions(LikelihoodOptions, total=False):
    """The settings of answers; `locate` describes them."""

    top: int
    north: North


def locate(index: LikelihoodIndex, query: Signature, **options: Unpack[LocateOptions]) -> Location:
    """Locate a query: find the place that it was seen from, by likelihood.

    Parameters
    ----------
    index : LikelihoodIndex
        The cells and the noise model: for queries from anywhere, not only from the centres of
        cells, it is ``cell_noise(noise, step)``.
    query : Signature
        The observed objects, perhaps none; types or bearings may be unknown. Objects of a class
        that no cell sees are not used, and the answer has a note on them.
    **options : LocateOptions
        ``north_sigma`` is the standard deviation in degrees of the north of the query, 0 by
        default and infinite if it is not known; ``log_prior``, shape (n,), is a prior of the place
        (see `likelihood.priors`). The ``rule`` is when to answer, from a chance of 0.9 by default,
        and ``top`` (10) the most places to list. The ``store`` has the street objects of the
        cells: with ``refined``, the place is searched between the viewpoints as well, and the
        chance of a cell is the sum over its parts. ``explained`` (0) is the number of candidates
        to explain; without a store, street objects have no identifiers. ``known`` describes the
        prior in the answer, in plain values. The ``north`` is the direction from which bearings
        count, grid north by default. ``surely_here`` is whether views are surely from the area of
        the database; otherwise they are from elsewhere with a chance of 0.5 before their objects
        are compared (see `likelihood.elsewhere`). The ``city``, by default the store, names
        places and is drawn. The ``notes`` are added to those of the answer.

    Returns
    -------
    Location
        The answer.

    Raises
    ------
    InputError
        If a number is out of its range, or bearings, a store or another index are required.

    Examples
    --------
    >>> from semsig_gis import ObjectStore, build_index, named_noise
    >>> index = build_index(demo_database, cell_noise(named_noise("generic"), 10.0))
    >>> longest = int(demo_database.lengths.argmax())
    >>> query = demo_database.signature(longest)
    >>> location = locate(index, query, top=3)
    >>> int(location.candidates["cell"][0]) == longest, len(location.candidates)
    (True, 3)
    >>> store = ObjectStore.of(demo_objects)
    >>> location = locate(index, query, store=store, refined=True, explained=1)
    >>> x, y = demo_database.xy[longest]
    >>> bool(np.hypot(location.estimate.x - x, location.estimate.y - y) < 2.0)
    True
    >>> location.explanations[0].counts["matched"] == len(query)
    True
    """
    return LikelihoodLocator(index=index, **options).locate(query)


def locate_versions(
    index: LikelihoodIndex,
    versions: Sequence[Signature],
    *,
    log_weights: Sequence[float] | None = None,
    **options: Unpack[LocateOptions],
) -> Location:
    """Locate a query from several versions: exactly one is right.

    A photo of unknown field of view, for example, has a version for each field of view that it may
    have. The chances of places are the sums over the versions.

    Parameters
    ----------
    index : LikelihoodIndex
        As of `locate`.
    versions : sequence of Signature
        The versions, with the same chance before they are compared.
    log_weights : sequence of float, optional
        Logarithm of a factor of the likelihood of each, 0 by default: bearings of versions may be
        stretched, and their densities are per degree.
    **options : LocateOptions
        As of `locate`.

    Returns
    -------
    Location
        The answer, with the chance of each version in its `versions`.

    Examples
    --------
    >>> from semsig_gis import build_index, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> longest = int(demo_database.lengths.argmax())
    >>> seen = demo_database.signature(longest)
    >>> versions = [demo_database.signature(0), seen]
    >>> location = locate_versions(index, versions)
    >>> len(location.versions), round(sum(location.versions), 9)
    (2, 1.0)
    """
    locator = LikelihoodLocator(index=index, **options)
    views = [[version] for version in versions]
    weights = None if log_weights is None else [[weight] for weight in log_weights]
    (location,) = locator.locate_versions(views, log_weights=weights)
    return location


def locate_in_areas(
    locators: Sequence[LikelihoodLocator],
    queries: Sequence[Signature],
    *,
    surely_here: bool = False,
) -> tuple[tuple[Location, ...], float]:
    """Locate a query in several areas: return the answer of each, and the chance of elsewhere.

    `queries` is the query for each locator, in the classes of its database. The chances of places
    in all areas and of elsewhere add up to 1; `surely_here` is whether the query is surely from one
    of the areas, whatever the locators have.
    """
    views = list(zip(locators, queries, strict=True))
    locations = [replace(locator, surely_here=True).locate(query) for locator, query in views]
    chances = area_chances(
        [
            locator.evidence_ratio([query], location.posterior)
            for (locator, query), location in zip(views, locations, strict=True)
        ]
    )
    if surely_here:
        chances = np.append(chances[:-1] / chances[:-1].sum(), 0.0)
    *areas, elsewhere = chances.tolist()
    answers = zip(locations, areas, strict=True)
    return tuple(place.doubted(1.0 - area, place.fit) for place, area in answers), elsewhere


def locate_route(
    index: LikelihoodIndex,
    queries: Sequence[Signature],
    legs: Sequence[Leg],
    **options: Unpack[LocateOptions],
) -> tuple[Location, ...]:
    """Locate the views of a route, each by all of them.

    Parameters
    ----------
    index : LikelihoodIndex
        As of `locate`.
    queries : sequence of Signature
        The views. A view may be without objects, which is information as well.
    legs : sequence of Leg
        The legs between them, one fewer than views; otherwise InputError.
    **options : LocateOptions
        As of `locate`, for each view; ``log_prior`` is that of the first view.

    Returns
    -------
    tuple of Location
        One for each view, in their order.

    Examples
    --------
    >>> from semsig_gis import Leg, build_index, named_noise
    >>> index = build_index(demo_database, named_noise("light"))
    >>> way = demo_database.xy[200] - demo_database.xy[0]
    >>> views = [demo_database.signature(0), demo_database.signature(200)]
    >>> first, last = locate_route(index, views, [Leg(dx=way[0], dy=way[1])])
    >>> int(first.candidates["cell"][0]), int(last.candidates["cell"][0])
    (0, 200)
    """
    return LikelihoodLocator(index=index, **options).locate_route(queries, legs)


def _prior_notes(ratio: float | None) -> tuple[str, ...]:
    """Return a note if the view contradicts the prior."""
    if ratio is None or ratio > DISAGREEMENT:
        return ()
    power = -math.log10(ratio)
    odds = f"{1.0 / ratio:,.0f}" if power < LARGE_POWER else f"10^{power:.0f}"
    note = (
        f"the prior and the view disagree: the view is {odds} times likelier from anywhere in the "
        "city than from where the prior says."
    )
    return (note,)


def _columns(scores: CellScores, posterior: Posterior, places: Places) -> dict[str, NDArray[Any]]:
    """Return distinct places with their likeliest cells, by column."""
    listed = places.cells
    columns = {
        "rank": np.arange(1, len(listed) + 1),
        **candidate_columns(posterior.database, listed),
        "loglik": scores.loglik[listed].astype(np.float64),
        "chance": places.chances,
        "cell_chance": posterior.chances[listed],
    }
    if scores.heading is not None:
        columns["heading"] = scores.heading[listed].astype(np.float64)
    return columns


def _with_parts(
    parts: Refinement, scores: CellScores, before: Posterior
) -> tuple[CellScores, Posterior]:
    """Return the scores and chances of the cells, replaced by those of the parts."""
    step = before.database.grid.step
    order = np.argsort(parts.cells, kind="stable")
    owners = parts.cells[order]
    firsts = np.flatnonzero(np.diff(owners, prepend=-1))
    cells = owners[firsts]
    chances = before.chances.copy()
    chances[cells] = np.add.reduceat(parts.chances[order], firsts) * before.chances[cells].sum()
    logs = parts.loglik[order] + 2.0 * np.log(parts.sizes[order] / step)
    loglik = scores.loglik.astype(np.float64)
    loglik[cells] = np.logaddexp.reduceat(logs, firsts)
    heading = scores.heading
    if heading is not None:
        heading = heading.copy()
        order = np.argsort(parts.chances, kind="stable")  # the likeliest part comes last
        heading[parts.cells[order]] = parts.headings[order]
    parted = CellScores(loglik=loglik, headings=(heading, *scores.headings[1:]))
    return parted, replace(before, chances=chances)


def _text_store(store: ObjectStore | None, city: City | ObjectStore | None) -> ObjectStore | None:
    """Return the street objects that texts are compared with, None if there are none."""
    if store is not None:
        return store
    try:
        return city.store if isinstance(city, City) else city
    except DatabaseError:
        return None
