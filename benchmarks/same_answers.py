"""Save answers of the likelihood method to seeded views, and compare them with those of other code.

``python -m benchmarks.same_answers OUT.json`` locates the same views in a made-up city like Paris,
and in Montpellier and Helsinki of the folder that SEMSIG_GEODATA names, each with and without the
search between the viewpoints. ``--compare OLD.json NEW.json`` prints how many of the answers have
the same place (within 1 m) and the same chance (within 0.01).
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks._cities import PARIS_LIKE, made_up, made_up_streets, real
from benchmarks._measuring import add_geodata, available_cities, read_rows, write_rows
from benchmarks.views import NOISE
from semsig_gis.database import ObjectStore, build_database
from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain
from semsig_gis.localization import (
    build_index,
    cell_noise,
    locate,
    named_noise,
    usual_noise,
)
from semsig_gis.sources import PARIS_LIKE as LIKE_PARIS
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from semsig_gis.evaluation import SeenFrom

__all__ = ["answers"]

_CITIES = (PARIS_LIKE, "Montpellier", "Helsinki")
# By kind of views: where they are seen from, their distortions, and the deviation of north.
_KINDS: dict[str, tuple[SeenFrom, str, float]] = {
    "grid": ("cells", "view:360", 0.0),
    "anywhere": ("anywhere", "view:360", 0.0),
    "photo of 70 degrees": ("anywhere", "view:70", 0.0),
    "ranges": ("anywhere", "ranges:25, view:360", 0.0),
    "north unknown": ("anywhere", "view:360, compass:360", math.inf),
}
_NEAR_M, _NEAR_CHANCE = 1.0, 0.01
_RIGHT_M = 50.0
_LEAST_CHANCE = 0.1  # of a place that is likely
_LEAST_STATED = 1e-6  # chance of what happened
_LIKELY = f"chance of {_LEAST_CHANCE:g} or more"


def main() -> None:
    """Save answers, or compare two files of them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.same_answers", description=__doc__)
    parser.add_argument("out", type=Path, nargs="?", metavar="OUT.json")
    parser.add_argument("--views", type=int, default=20, help="of each kind and city")
    parser.add_argument("--city", choices=_CITIES, action="append", help="default: all of them")
    parser.add_argument("--size", choices=("full", "small"), default="full")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD.json", "NEW.json"))
    add_geodata(parser)
    options = parser.parse_args()
    if options.compare:
        _compare(*options.compare)
        return
    if options.out is None:
        parser.error("give OUT.json, or --compare")
    cities = available_cities(options.city or _CITIES, options.geodata, made_up=PARIS_LIKE)
    small = options.size == "small"
    rows = [
        row for city in cities for row in answers(city, options.geodata, options.views, small=small)
    ]
    write_rows(options.out, rows)


def answers(
    city: str, geodata: str | os.PathLike[str] | None, views: int, *, small: bool = False
) -> Iterator[dict[str, Any]]:
    """Yield the answers to some views of each kind in a city."""
    if city == PARIS_LIKE:
        spec = CitySpec(size=300.0) if small else LIKE_PARIS
        objects = made_up(spec)
        database = made_up_streets(spec, objects)
    else:
        objects = real(Path(geodata or "."), city)
        database = build_database(objects)
    store = ObjectStore.of(objects)
    for kind, (seen_from, chain, north_sigma) in _KINDS.items():
        start = time.perf_counter()
        distortions = parse_chain(f"detector:{NOISE.name}, {chain}", noises={NOISE.name: NOISE})
        spec_of_views = QuerySpec(number=4 * views, seen_from=seen_from, distortions=distortions)
        queries = [
            (query.asked.signature, query.xy)
            for query in draw_queries(database, spec_of_views, store=store)
            if len(query.asked.signature)
        ]
        for number, (query, xy) in enumerate(queries[:views]):
            noise = named_noise(usual_noise(query))
            if seen_from != "cells":
                noise = cell_noise(noise, database.grid.step)
            index = build_index(database, noise)
            # Between the viewpoints are no views from the grid.
            for refined in (False, True)[: 1 + (seen_from != "cells")]:
                location = locate(
                    index, query, store=store, refined=refined, north_sigma=north_sigma
                )
                yield {
                    "city": city,
                    "kind": kind,
                    "number": number,
                    "refined": refined,
                    "objects": len(query),
                    "xy": [round(metres, 3) for metres in location.xy],
                    "right": math.dist(location.xy, xy) <= _RIGHT_M,
                    "chance": round(location.chance, 5),
                    "elsewhere": round(location.elsewhere, 5),
                    "heading": location.estimate.heading,
                    "region": len(location.region),
                }
        print(f"{city}, {kind}: {time.perf_counter() - start:.0f} s", flush=True)


def _compare(old: Path, new: Path) -> None:
    """Print the share of equal answers by kind of view, and those that differ."""

    def by_view(path: Path) -> dict[tuple[Any, ...], dict[str, Any]]:
        keys = ("city", "kind", "number", "refined")
        return {tuple(row[key] for key in keys): row for row in read_rows(path)}

    before, after = by_view(old), by_view(new)
    counts: Counter[tuple[str, str]] = Counter()
    for view in before.keys() & after.keys():
        was, now = before[view], after[view]
        facts = {
            "place": math.dist(was["xy"], now["xy"]) <= _NEAR_M,
            "chance": abs(was["chance"] - now["chance"]) <= _NEAR_CHANCE,
            "elsewhere": abs(was["elsewhere"] - now["elsewhere"]) <= _NEAR_CHANCE,
        }
        groups = (view[1], "all", *([_LIKELY] if was["chance"] >= _LEAST_CHANCE else []))
        for group in groups:
            counts.update((group, fact) for fact, holds in facts.items() if holds)
            counts[group, "views"] += 1
        if not (facts["place"] and facts["chance"]):
            print(
                f"{view}: {was['objects']} objects, {math.dist(was['xy'], now['xy']):.1f} m, "
                f"chance {was['chance']:.3f} {now['chance']:.3f}"
            )
    for name, rows in (("old", before), ("new", after)):
        right, here = ([row[what] for row in rows.values()] for what in ("right", "chance"))
        stated = [
            row["chance"] * (1.0 if row["right"] else -1.0) + (not row["right"])
            for row in rows.values()
        ]
        score = sum(math.log(max(chance, _LEAST_STATED)) for chance in stated) / len(rows)
        print(
            f"{name}: {sum(right)} of {len(rows)} within {_RIGHT_M:g} m, {sum(here):.1f} expected, "
            f"mean logarithm of the stated chance of right or wrong {score:.4f}"
        )
    for group in (*_KINDS, _LIKELY, "all"):
        if views := counts[group, "views"]:
            shares = (
                f"{what} {counts[group, what] / views:.1%}"
                for what in ("place", "chance", "elsewhere")
            )
            print(f"{group}: of {views} answers, the same {', '.join(shares)}")


if __name__ == "__main__":
    main()
