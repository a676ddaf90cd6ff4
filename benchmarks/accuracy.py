"""Measure how well the methods localize: ``python -m benchmarks.accuracy``.

Cities: a made-up one with as many cells and objects as the paper's Paris, and Montpellier from its
open data. All methods get the same distorted queries. Results are written to
``benchmarks/accuracy.json``, which keeps the rows of cities that are not measured. Times are
processor times, so that other programs do not count.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from benchmarks._accuracy_methods import (
    Settings,
    ask_likelihood,
    ask_paper,
    ask_refined,
    ask_routes,
)
from benchmarks._accuracy_queries import City, off_grid, on_grid, turned, walks
from benchmarks._accuracy_rows import Bar, Row
from benchmarks._cities import MONTPELLIER, made_up, made_up_streets, real
from benchmarks._cities import PARIS_LIKE as PARIS
from benchmarks._measuring import add_geodata, option_parser, read_rows, write_rows
from semsig_gis.core import ObjectIndex
from semsig_gis.database import build_database
from semsig_gis.localization import Method, build_index, calibrate, cell_noise, named_noise
from semsig_gis.sources import PARIS_LIKE, CitySpec

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from benchmarks._accuracy_methods import Outcome
    from benchmarks._accuracy_queries import Query
    from semsig_gis.localization import LikelihoodIndex

__all__ = ["main"]

LEVELS = ("light", "medium", "strong")
BARS = {"light": (0.66, 0.95), "medium": (0.50, 0.82), "strong": (0.43, 0.70)}
PANORAMAS = (1, 2, 3, 5)
ROUTE_BARS = {3: 0.87, 5: 0.97}
LEG_SIGMA = 2.0
NORTH_SIGMA = 10.0
PAPER = Method.parse("edit+edit:5%")  # the best that the paper reports
REGION_BAR = (0.85, 0.95)

INDEX = "likelihood, noise generic"
RERANKED = "likelihood, noise generic, re-ranked"
ON_GRID = "north known; on the grid"
OFF_GRID = "north known; off the grid"


@dataclass(frozen=True, slots=True)
class _Size:
    """The made-up city, and the number of queries of each row."""

    city: CitySpec
    queries: int


_SIZES = {
    "full": _Size(PARIS_LIKE, 2000),
    "small": _Size(CitySpec(size=300.0), 8),
}


def main() -> None:
    """Measure, and print and write each row."""
    parser = option_parser("accuracy", __doc__)
    add_geodata(parser)
    parser.add_argument("--city", choices=(PARIS, MONTPELLIER), help="default: both")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    size = _SIZES[options.size]
    cities = [options.city] if options.city else [PARIS, MONTPELLIER]
    others = [row for row in read_rows(options.out) if row["city"] not in cities]
    rows: list[Row] = []
    for city in _cities(cities, size, options.geodata):
        print(f"{city.name}: {len(city.database):,} cells", flush=True)
        for row in _rows(city, size, options.threads):
            print(row, flush=True)
            rows.append(row)
            values = [measured.to_dict() for measured in rows] + others
            write_rows(options.out, sorted(values, key=lambda value: value["city"] != PARIS))
    bars = [bar for row in rows for bar in row.bars]
    print(f"{sum(bar.met for bar in bars)} of {len(bars)} bars met")
    for row in rows:
        for bar in row.bars:
            if not bar.met:
                print(f"  {row.city.name}: {bar}")


def _cities(names: Sequence[str], size: _Size, geodata: Path | None) -> Iterator[City]:
    if PARIS in names:
        objects = made_up(size.city)
        database = made_up_streets(size.city, objects)
        yield City(name=PARIS, database=database, objects=objects, tree=ObjectIndex(objects.xy))
    if MONTPELLIER not in names:
        return
    if geodata is None:
        print("Montpellier is left out: SEMSIG_GEODATA does not name the folder of open data.")
        return
    objects = real(geodata, MONTPELLIER)
    yield City(
        name=MONTPELLIER,
        database=build_database(objects),
        objects=objects,
        tree=ObjectIndex(objects.xy),
    )


def _rows(city: City, size: _Size, threads: int) -> Iterator[Row]:
    queries = {level: on_grid(city, level, size.queries) for level in LEVELS}
    generic = build_index(city.database, named_noise("generic"))
    reranked: dict[str, Row] = {}
    for level in LEVELS:
        best = 0.0
        for row in _paper_rows(city, level, queries[level]):
            best = max(best, row.share())
            yield row
        for method, settings in ((INDEX, Settings(reranked=False)), (RERANKED, Settings())):
            outcomes = ask_likelihood(city, queries[level], generic, settings, threads=threads)
            row = Row(
                city=city, distortion=level, method=method, setting=ON_GRID, outcomes=outcomes
            )
            if settings.reranked:
                reranked[level] = row
                row.bars.extend(_main_bars(row, best))
            yield row
    yield from _abstention_rows(reranked)
    yield from _off_grid_rows(city, generic, size.queries, threads)
    yield from _north_rows(queries["medium"], reranked["medium"], generic, threads)
    yield from _route_rows(city, generic, size.queries, threads)
    del generic  # an index takes a quarter of a gigabyte
    yield from _noise_rows(city, queries["medium"], threads)


def _paper_rows(city: City, level: str, queries: Sequence[Query]) -> Iterator[Row]:
    for unsorted, order in ((True, "order kept"), (False, "sorted after the noise")):
        yield Row(
            city=city,
            distortion=level,
            method=f"{PAPER}, {order}",
            setting=ON_GRID,
            outcomes=ask_paper(city, queries, PAPER, unsorted=unsorted),
        )


def _main_bars(row: Row, best: float) -> Iterator[Bar]:
    if row.city.name == PARIS:
        everywhere, many = BARS[row.distortion]
        yield Bar(what=f"P50 at {row.distortion}", value=row.share(), low=everywhere)
        yield Bar(
            what=f"P50 at {row.distortion}, ten objects or more", value=row.share_of_many, low=many
        )
    if row.distortion == "medium":
        ratio = row.share() / best if best else math.inf
        yield Bar(what="P50 at medium, to the paper's method", value=ratio, low=1.3)


def _abstention_rows(reranked: dict[str, Row]) -> Iterator[Row]:
    """Calibrate the rule on half of the medium queries; apply it to the other halves."""
    half = len(reranked["medium"].outcomes) // 2
    first = reranked["medium"].outcomes[:half]
    rule = calibrate([outcome.mass or 0.0 for outcome in first], [*map(_right, first)])
    for level, row in reranked.items():
        rest = row.outcomes[half:]
        right = [_right(outcome) for outcome in rest if rule.answers(outcome.mass or 0.0)]
        coverage = len(right) / len(rest)
        precision = sum(right) / len(right) if right else None
        answers = dataclasses.replace(
            row,
            setting=f"{ON_GRID}; answers only where sure, by other queries at medium",
            outcomes=rest,
            coverage=coverage,
            precision=precision,
            bars=[],
        )
        if level == "medium" and row.city.name == PARIS:
            answers.bars.append(
                Bar(what="answers that are right", value=precision or 0.0, low=0.98)
            )
            answers.bars.append(Bar(what="queries answered", value=coverage, low=0.4))
        yield answers


def _north_rows(
    queries: Sequence[Query], reference: Row, generic: LikelihoodIndex, threads: int
) -> Iterator[Row]:
    rng = np.random.default_rng(1)
    slips = rng.normal(0.0, NORTH_SIGMA, len(queries)).tolist()
    anyhow = rng.uniform(0.0, 360.0, len(queries)).tolist()
    for setting, turns, sigma in (
        (f"north off by N(0, {NORTH_SIGMA:g} deg), modelled", slips, NORTH_SIGMA),
        (f"north off by N(0, {NORTH_SIGMA:g} deg), ignored", slips, 0.0),
        ("north unknown", anyhow, math.inf),
    ):
        outcomes = ask_likelihood(
            reference.city,
            turned(queries, turns),
            generic,
            Settings(north_sigma=sigma),
            threads=threads,
        )
        row = dataclasses.replace(
            reference, setting=f"{setting}; on the grid", outcomes=outcomes, bars=[]
        )
        if sigma == math.inf and reference.city.name == PARIS:
            ratio = row.share() / reference.share() if reference.share() else math.inf
            row.bars.append(Bar(what="P50, to that with north known", value=ratio, low=0.8))
        yield row


def _route_rows(city: City, generic: LikelihoodIndex, count: int, threads: int) -> Iterator[Row]:
    cases = [(panoramas, 0.0) for panoramas in PANORAMAS]
    cases += [(panoramas, LEG_SIGMA) for panoramas in PANORAMAS if panoramas > 1]
    routes = walks(city, "medium", count, max(PANORAMAS), leg_sigmas=(0.0, LEG_SIGMA))
    results = ask_routes(city, routes, generic, cases, threads=threads)
    for (panoramas, sigma), outcomes in zip(cases, results, strict=True):
        legs = f"legs known to {sigma:g} m" if sigma else "legs known"
        setting = f"{panoramas} panoramas 20 m apart, {legs}" if panoramas > 1 else "1 panorama"
        row = Row(
            city=city,
            distortion="medium",
            method=RERANKED,
            setting=f"{ON_GRID}; route of {setting}",
            outcomes=outcomes,
        )
        if city.name == PARIS and not sigma and panoramas in ROUTE_BARS:
            bar = ROUTE_BARS[panoramas]
            row.bars.append(Bar(what=f"P50, {panoramas} panoramas", value=row.share(), low=bar))
        yield row


def _off_grid_rows(city: City, generic: LikelihoodIndex, count: int, threads: int) -> Iterator[Row]:
    queries = off_grid(city, "medium", count)
    yield from (
        dataclasses.replace(row, setting=OFF_GRID) for row in _paper_rows(city, "medium", queries)
    )
    noise = named_noise("generic")
    settings = Settings(radius=25.0)
    wide = build_index(city.database, cell_noise(noise, city.database.grid.step))
    shares = []
    for method, outcomes in (
        (RERANKED, ask_likelihood(city, queries, generic, settings, threads=threads)),
        (
            f"{RERANKED}, place in the cell unknown",
            ask_likelihood(city, queries, wide, settings, threads=threads),
        ),
        (f"{RERANKED}, refined", ask_refined(city, queries, wide, noise, threads=threads)),
    ):
        row = Row(
            city=city, distortion="medium", method=method, setting=OFF_GRID, outcomes=outcomes
        )
        shares.append(row.share(25.0))
        if method.endswith("refined"):
            ratio = shares[-1] / shares[0] if shares[0] else math.inf
            row.bars.append(Bar(what="P25 off the grid, to on-grid", value=ratio, low=2.0))
        yield row


def _noise_rows(city: City, queries: Sequence[Query], threads: int) -> Iterator[Row]:
    """Localize with the right noise model, and with wrong ones."""
    for noise in ("medium", "light", "strong"):
        index = build_index(city.database, named_noise(noise))
        outcomes = ask_likelihood(city, queries, index, Settings(), threads=threads)
        row = Row(
            city=city,
            distortion="medium",
            method=f"likelihood, noise {noise}, re-ranked",
            setting=ON_GRID,
            outcomes=outcomes,
        )
        if noise == "medium":
            low, high = REGION_BAR
            share = row.in_exact_region or 0.0
            row.bars.append(
                Bar(what="regions of just 90 % that hold", value=share, low=low, high=high)
            )
        yield row


def _right(outcome: Outcome) -> bool:
    return outcome.within[-1] == 1.0


if __name__ == "__main__":
    main()
