"""Measure whether stated chances come true: ``python -m benchmarks.chances``.

Queries from anywhere in real cities are distorted and localized by likelihood with the settings of
`semsig localize`: generic noise, refined. This is done with a current map, and with a map that is
older than the queries: by the real changes of Monaco, and by three simulated years of other cities.
Results are written to ``benchmarks/chances.json``, row by row. Rows that are there are not measured
again, so that an interrupted run continues.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from benchmarks._cities import MADE_UP, MONTPELLIER, made_up, real
from benchmarks._later_city import later_city
from benchmarks._measuring import (
    INPUTS,
    add_geodata,
    available_cities,
    option_parser,
    read_rows,
    short,
    write_rows,
)
from benchmarks.tables import TODAY
from semsig_gis.core import wilson_interval
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.evaluation import (
    QuerySpec,
    calibration_bins,
    draw_queries,
    parse_chain,
    plain_records,
    score_queries,
    scored_tables,
)
from semsig_gis.localization import (
    DEFAULT_RULE,
    Drift,
    LikelihoodLocator,
    aged_noise,
    build_index,
    cell_noise,
    named_drift,
    named_noise,
)
from semsig_gis.objects import compare_objects
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.localization import Noise
    from semsig_gis.objects import StreetObjects

__all__ = ["main"]

LEVELS = ("light", "medium", "strong")
OLD_LEVELS = ("light", "medium")  # of the old maps
YEARS = 3
MONACO_YEARS = named_drift().years
GENERIC = named_noise("generic")
CITIES = ("Helsinki", "Monaco", MONTPELLIER, MADE_UP)


@dataclass(frozen=True, eq=False)
class _City:
    """The street objects of a city, with its database and object store."""

    objects: StreetObjects

    @functools.cached_property
    def database(self) -> SignatureDatabase:
        return build_database(self.objects)

    @functools.cached_property
    def store(self) -> ObjectStore:
        return ObjectStore.of(self.objects)


def main() -> None:
    """Measure, print and write."""
    parser = option_parser("chances", __doc__)
    add_geodata(parser)
    parser.add_argument("--city", choices=CITIES, action="append", help="default: all of them")
    options = parser.parse_args()
    rows = read_rows(options.out)
    for name in available_cities(options.city or CITIES, options.geodata, made_up=MADE_UP):
        for case, measure in _cases(name, options.geodata, small=options.size == "small"):
            if any(case.items() <= row.items() for row in rows):
                continue
            row = {**case, **measure()}
            print(
                f"{row['city']}, {row['map']}, {row[INPUTS]} (n={row['queries']}): within 50 m "
                f"{row['p50']:.3f}; {row['answered']} from 0.9 on, {row['right']} right",
                flush=True,
            )
            rows = sorted([*rows, row], key=lambda item: CITIES.index(item["city"]))
            write_rows(options.out, rows)


def _cases(
    name: str, geodata: Path | None, *, small: bool
) -> Iterator[tuple[dict[str, Any], Callable[[], dict[str, Any]]]]:
    """Yield the cases of a city, one for each map and noise model, with functions to measure."""
    if name == MADE_UP:
        objects = made_up(CitySpec(size=200.0 if small else 1000.0))
        read: Callable[[str], StreetObjects] = {name: objects}.__getitem__
    else:
        read = functools.partial(real, Path(str(geodata)))
    city = _City(read(name))
    if name != MADE_UP:
        case = {"city": name, "map": TODAY, INPUTS: "", "levels": [*LEVELS]}
        count = 5 if small else 300
        yield case, functools.partial(_figures, city, city, LEVELS, count)
    if name == "Monaco":
        now, years, drifts = _City(read("Monaco a year later")), MONACO_YEARS, [named_drift()]
    else:
        now, years = _City(later_city(city.objects, YEARS, seed=1)), float(YEARS)
        changes = compare_objects(city.objects, later_city(city.objects, 1, seed=2))
        drifts = [Drift(years=1.0, classes=changes.classes), named_drift()]
    for drift in (None, *drifts):
        settings, noise = "", GENERIC
        if drift is not None:
            settings = f"--map-age {years:g}" + " --drift-report" * (drift is not named_drift())
            noise = aged_noise(noise, years, database=city.database, drift=drift)
        map_ = f"{years:g} years old"
        case = {"city": name, "map": map_, INPUTS: settings, "levels": [*OLD_LEVELS]}
        count = 5 if small else 200
        yield case, functools.partial(_figures, city, now, OLD_LEVELS, count, noise)


def _figures(
    city: _City, now: _City, levels: Sequence[str], count: int, noise: Noise = GENERIC
) -> dict[str, Any]:
    """Localize views of the city `now` with the map of a city, and return the figures."""
    database = city.database
    locator = LikelihoodLocator(
        index=build_index(database, cell_noise(noise, database.grid.step)),
        store=city.store,
        refined=True,
    )
    parts = []
    for level in levels:
        spec = QuerySpec(number=count, seen_from="anywhere", distortions=parse_chain(level))
        queries = draw_queries(database, spec, store=now.store, city=now.database)
        outcomes = score_queries(database, locator, queries)
        parts.append(scored_tables(database, queries, outcomes)[1])
    table = pd.concat(parts)
    sure = table["right"][table["chance"] >= DEFAULT_RULE.threshold]
    share = float(sure.mean()) if len(sure) else 1.0
    low, high = wilson_interval(share, max(len(sure), 1))
    nearly = table["right"][table["chance"].between(0.9, 0.99, inclusive="left")]
    return {
        "cells": len(database),
        "queries": len(table),
        "p50": short(table["p50"].mean()),
        "stated": short(table["chance"].fillna(0.0).mean()),
        "answered": len(sure),
        "right": int(sure.sum()),
        "low": short(low),
        "high": short(high),
        "nearly": len(nearly),
        "nearly_right": int(nearly.sum()),
        "bins": [
            {key: short(value) for key, value in tenth.items()}
            for tenth in plain_records(calibration_bins(table))
        ],
    }


if __name__ == "__main__":
    main()
