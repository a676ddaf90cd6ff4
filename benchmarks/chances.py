"""Measure whether the chances that are stated come true: ``python -m benchmarks.chances``.

Queries are seen from anywhere in real cities, spoiled, and answered by likelihood as
`semsig localize` does it: generic noise, refined. First with the map of the day, then with one that
is older than the queries: by the real changes of Monaco, and by three made-up years of other
cities. Results go to ``benchmarks/chances.json``, row by row; rows that are there already stay, so
that a run goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from benchmarks._cities import MADE_UP, MONTPELLIER, made_up, real
from benchmarks._later_city import later_city
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
    """The street objects of a city, and what is built of them."""

    objects: StreetObjects

    @functools.cached_property
    def database(self) -> SignatureDatabase:
        return build_database(self.objects)

    @functools.cached_property
    def store(self) -> ObjectStore:
        return ObjectStore.of(self.objects)


def main() -> None:
    """Read the options, measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.chances", description=__doc__)
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("chances.json"))
    parser.add_argument(
        "--geodata",
        type=Path,
        default=os.environ.get("SEMSIG_GEODATA"),
        metavar="FOLDER",
        help="folder of open data (default: what SEMSIG_GEODATA names)",
    )
    parser.add_argument("--city", choices=CITIES, action="append", help="default: all of them")
    options = parser.parse_args()
    names = options.city or CITIES
    if options.geodata is None:
        names = [name for name in names if name == MADE_UP]
        print("Real cities are left out: SEMSIG_GEODATA does not name the folder of open data.")
    rows = json.loads(options.out.read_text("utf-8")) if options.out.exists() else []
    for name in names:
        for case, ask in _cases(name, options.geodata, small=options.size == "small"):
            if any(case.items() <= row.items() for row in rows):
                continue
            row = {**case, **ask()}
            print(
                f"{row['city']}, {row['map']}, {row['told']} (n={row['queries']}): within 50 m "
                f"{row['p50']:.3f}; {row['answered']} from 0.9 on, {row['right']} right",
                flush=True,
            )
            rows = sorted([*rows, row], key=lambda one: CITIES.index(one["city"]))
            options.out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


def _cases(
    name: str, geodata: Path | None, *, small: bool
) -> Iterator[tuple[dict[str, Any], Callable[[], dict[str, Any]]]]:
    """Yield what to ask of a city, one case for each map and noise model, and what asks it."""
    if name == MADE_UP:
        objects = made_up(CitySpec(size=200.0 if small else 1000.0))
        read: Callable[[str], StreetObjects] = {name: objects}.__getitem__
    else:
        read = functools.partial(real, Path(str(geodata)))
    city = _City(read(name))
    if name != MADE_UP:
        case = {"city": name, "map": TODAY, "told": "", "levels": [*LEVELS]}
        count = 5 if small else 300
        yield case, functools.partial(_asked, city, city, LEVELS, count)
    if name == "Monaco":
        now, years, drifts = _City(read("Monaco a year later")), MONACO_YEARS, [named_drift()]
    else:
        now, years = _City(later_city(city.objects, YEARS, seed=1)), float(YEARS)
        changes = compare_objects(city.objects, later_city(city.objects, 1, seed=2))
        drifts = [Drift(years=1.0, classes=changes.classes), named_drift()]
    for drift in (None, *drifts):
        told, noise = "", GENERIC
        if drift is not None:
            told = f"--map-age {years:g}" + " --drift-report" * (drift is not named_drift())
            noise = aged_noise(noise, years, database=city.database, drift=drift)
        map_ = f"{years:g} years old"
        case = {"city": name, "map": map_, "told": told, "levels": [*OLD_LEVELS]}
        count = 5 if small else 200
        yield case, functools.partial(_asked, city, now, OLD_LEVELS, count, noise)


def _asked(
    city: _City, now: _City, levels: Sequence[str], count: int, noise: Noise = GENERIC
) -> dict[str, Any]:
    """Ask for what is seen now with the map of a city, and return what came of it."""
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
        "p50": _short(table["p50"].mean()),
        "stated": _short(table["chance"].fillna(0.0).mean()),
        "answered": len(sure),
        "right": int(sure.sum()),
        "low": _short(low),
        "high": _short(high),
        "nearly": len(nearly),
        "nearly_right": int(nearly.sum()),
        "bins": [
            {key: _short(value) for key, value in one.items()}
            for one in plain_records(calibration_bins(table))
        ],
    }


def _short(value: float | None) -> float | None:
    """Return a number to four digits."""
    return value if value is None or isinstance(value, int) else float(f"{value:.4g}")


if __name__ == "__main__":
    main()
