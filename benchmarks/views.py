"""Measure how well views localize, not only full turns: ``python -m benchmarks.views``.

A detector finds 80 % of the objects, misnames 10 % of these, is 4 degrees out and makes up one
object in a full turn; a camera sees 70, 120 or 360 degrees. The likelihood method knows this noise.
It takes what is seen for a full turn, or is told the sector, or rough distances, too, of the same
queries. Results go to ``benchmarks/views.json``, line by line; lines that are there already stay,
so that a run goes on where it was interrupted.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import json
import math
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from benchmarks._accuracy_queries import straight_walk
from benchmarks._accuracy_rows import Bar
from benchmarks._cities import MONTPELLIER, PARIS_LIKE, made_up, made_up_streets, real
from semsig_gis.core import wilson_interval
from semsig_gis.database import ObjectStore, build_database, open_database, save_database
from semsig_gis.evaluation import (
    CitySights,
    QuerySpec,
    Sight,
    calibration_bins,
    draw_queries,
    parse_chain,
    plain_records,
    prepare_chain,
)
from semsig_gis.localization import (
    REGION_SHARE,
    LikelihoodLocator,
    NoiseSpec,
    build_index,
    cell_noise,
)
from semsig_gis.observation import Leg
from semsig_gis.sources import PARIS_LIKE as LIKE_PARIS
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import QueryDistortion, SeenFrom
    from semsig_gis.localization import Location

__all__ = ["NOT_TOLD", "RANGES", "SECTORS", "bars", "lines", "main"]

NOISE = NoiseSpec(detection=0.8, misnamed=0.1, clutter=1.0, bearing_sigma=4.0, name="views")
CITIES = (PARIS_LIKE, MONTPELLIER, "Helsinki")
DEGREES = (70, 120, 360)
MANY_SEEN = 5
LEAST = (1, MANY_SEEN)
KNOWN, OFF, UNKNOWN = "known", "10 degrees off", "unknown"
NORTHS = {KNOWN: ("", 0.0), OFF: (", compass:10", 10.0), UNKNOWN: (", compass:360", math.inf)}
NOT_TOLD, SECTORS, RANGES = "as a full turn", "sectors", "sectors and ranges"
PHOTOS = 5
NEAR_M = 50.0
MANY, DECILE_OFF = 100, 0.05  # queries in a tenth of the chance, and how far off it may be
LEAST_LUCK, LUCK_DRAWS = 0.05, 20_000  # below which it is more than luck; how often it is tried
PARTS = 16  # of the queries of a line, that processes take
SPARE = 40  # times the queries of a line are drawn at most, to find enough with five detections


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """What is asked: photos of so many degrees, the last of them with so many detections."""

    seen_from: SeenFrom
    photos: int
    degrees: int
    least: int
    heading: str
    told: str

    @property
    def chain(self) -> tuple[QueryDistortion, ...]:
        """What happens to the queries; those of lines that differ in what is told are the same."""
        told = ":told=false" if self.told == NOT_TOLD else ""
        ranges = ", ranges:25" if self.told == RANGES else ""
        text = f"detector:{NOISE.name}{ranges}, view:{self.degrees}{told}{NORTHS[self.heading][0]}"
        return parse_chain(text, noises={NOISE.name: NOISE})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Question:
    """Views with the legs between them, and where the last one was seen."""

    views: tuple[Signature, ...]
    legs: tuple[Leg, ...] = ()
    cell: int
    xy: tuple[float, float]


def main() -> None:
    """Read the options, measure, print and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.views", description=__doc__)
    parser.add_argument("--size", choices=["full", "small"], default="full")
    parser.add_argument("--queries", type=int, metavar="N", help="of each line (default: by line)")
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("views.json"))
    parser.add_argument(
        "--geodata",
        type=Path,
        default=os.environ.get("SEMSIG_GEODATA"),
        metavar="FOLDER",
        help="folder of open data (default: what SEMSIG_GEODATA names)",
    )
    parser.add_argument("--city", choices=CITIES, action="append", help="default: all of them")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    small = options.size == "small"
    names = options.city or CITIES
    if options.geodata is None:
        names = [name for name in names if name == PARIS_LIKE]
        print("Real cities are left out: SEMSIG_GEODATA does not name the folder of open data.")
    rows = json.loads(options.out.read_text("utf-8")) if options.out.exists() else []
    for name in names:
        missing = {}
        for line in lines():
            wanted = options.queries or (10 if small else _number(name, line))
            case = {"city": name, **asdict(line), "wanted": wanted}
            if not any(case.items() <= row.items() for row in rows):
                missing[line] = wanted
        for row in _rows(name, options.geodata, missing, options.processes, small=small):
            print(_text(row), flush=True)
            rows.append(row)
            options.out.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    for name, bar in bars(rows):
        print(f"{name}: {bar}")


def lines() -> Iterator[Line]:
    """Yield all lines of a city, those with the heading known first."""
    cells: SeenFrom = "cells"
    anywhere: SeenFrom = "anywhere"
    for heading, seen_from in (*((one, cells) for one in NORTHS), (KNOWN, anywhere)):
        for degrees, least in itertools.product(DEGREES, LEAST):
            for told in (NOT_TOLD, SECTORS, RANGES):
                if not (degrees == DEGREES[-1] and told == SECTORS):  # which is the full turn
                    yield Line(
                        seen_from=seen_from,
                        photos=1,
                        degrees=degrees,
                        least=least,
                        heading=heading,
                        told=told,
                    )
    for told in (SECTORS, RANGES):
        yield Line(
            seen_from=cells,
            photos=PHOTOS,
            degrees=DEGREES[0],
            least=LEAST[0],
            heading=OFF,
            told=told,
        )


def _number(city: str, line: Line) -> int:
    """Return how many queries a line has, fewer where each takes longer or says less."""
    if line.photos > 1:
        return 100
    if line.seen_from == "anywhere":
        return 300
    return {KNOWN: 2000 if city == PARIS_LIKE else 500, OFF: 200, UNKNOWN: 100}[line.heading]


def _rows(
    name: str,
    geodata: Path | None,
    lines: Mapping[Line, int],
    processes: int,
    *,
    small: bool,
) -> Iterator[dict[str, Any]]:
    """Yield what came of lines with so many queries, one after the other."""
    if not lines:
        return
    if name == PARIS_LIKE or geodata is None:
        spec = CitySpec(size=300.0) if small else LIKE_PARIS
        objects = made_up(spec)
        database = made_up_streets(spec, objects)
    else:
        objects = real(geodata, name)
        database = build_database(objects)
    store = ObjectStore.of(objects)
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool,
    ):
        file = f"{folder}/city.parquet"
        save_database(database, file)
        for line, wanted in lines.items():
            questions = _questions(database, store, line, wanted)
            parts = [questions[start::PARTS] for start in range(min(PARTS, len(questions)))]
            answer = functools.partial(_answers, file, line.seen_from, line.heading)
            answers = pd.concat(pool.map(answer, parts))
            yield {
                "city": name,
                **asdict(line),
                "wanted": wanted,
                "cells": len(database),
                **_figures(answers),
            }


def _questions(
    database: SignatureDatabase, store: ObjectStore, line: Line, count: int
) -> list[_Question]:
    """Return so many questions, or as many as there are in a city."""
    drawn = _walks(database, line) if line.photos > 1 else _single(database, store, line, count)
    enough = (one for one in drawn if len(one.views[-1]) >= line.least)
    return list(itertools.islice(enough, count))


def _single(
    database: SignatureDatabase, store: ObjectStore, line: Line, count: int
) -> Iterator[_Question]:
    number = min(len(database), SPARE * count)
    spec = QuerySpec(number=number, seen_from=line.seen_from, distortions=line.chain)
    for start in range(0, number, 4 * count):
        part = slice(start, start + 4 * count)
        for query in draw_queries(database, spec, store=store, part=part):
            yield _Question(views=(query.asked.signature,), cell=query.cell, xy=query.xy)


def _walks(database: SignatureDatabase, line: Line) -> Iterator[_Question]:
    """Yield straight ways along cells, each photo with a direction and a compass of its own."""
    rng = np.random.default_rng(0)
    spoil = prepare_chain(line.chain, CitySights.of(database))
    for start in rng.permutation(len(database)).tolist():
        cells = straight_walk(database, start, line.photos, np.random.default_rng([start, 1]))
        if cells:
            numbers = itertools.count(start * line.photos)
            sights = (Sight.of_cell(database, cell) for cell in cells)
            seen = (spoil(one, 0, next(numbers)).signature for one in sights)
            places = database.xy[cells]
            x, y = places[-1].tolist()
            yield _Question(
                views=tuple(seen),
                legs=tuple(Leg(dx=dx, dy=dy) for dx, dy in np.diff(places, axis=0).tolist()),
                cell=cells[-1],
                xy=(x, y),
            )


@functools.cache
def _locator(file: str, seen_from: SeenFrom, heading: str) -> LikelihoodLocator:
    database = open_database(file)
    noise = NOISE if seen_from == "cells" else cell_noise(NOISE, database.grid.step)
    return LikelihoodLocator(
        index=build_index(database, noise), north_sigma=NORTHS[heading][1], top=1
    )


def _answers(
    file: str, seen_from: SeenFrom, heading: str, questions: Sequence[_Question]
) -> pd.DataFrame:
    """Return what came of questions, one row each."""
    locator = _locator(file, seen_from, heading)
    locator.locate(questions[0].views[-1])  # what is worked out once is not timed
    rows = []
    for question in questions:
        start = time.process_time()
        if question.legs:
            found = locator.locate_route(question.views, question.legs)[-1]
        else:
            found = locator.locate(question.views[-1])
        row = {"ms": 1e3 * (time.process_time() - start), "chance": found.answer.mass}
        row |= {"right": _right(found, question), "in_region": _in_region(found, question.cell)}
        if question.legs:
            row["alone"] = _right(locator.locate(question.views[-1]), question)
        rows.append(row)
    return pd.DataFrame(rows)


def _right(found: Location, question: _Question) -> float:
    error = math.dist((found.answer.x, found.answer.y), question.xy)
    return float(round(error, 6) <= NEAR_M)


def _in_region(found: Location, cell: int) -> float:
    """Return the chance that a cell is in a region of just 90 %: its last cells are so in part."""
    chances, region = found.chances, found.region
    least, own = chances[region[-1]], chances[cell]
    if own != least:
        return float(own > least)
    return float((REGION_SHARE - chances[chances > least].sum()) / chances[chances == least].sum())


def _figures(answers: pd.DataFrame) -> dict[str, Any]:
    """Return the figures of a line; ``off`` is how far the tenths with many queries are off."""
    tenths = calibration_bins(answers)
    off = (tenths["stated"] - tenths["true"])[tenths["n"] >= MANY].abs()
    values: dict[str, Any] = {
        "queries": len(answers),
        **_interval("p50", answers["right"]),
        "stated": _short(answers["chance"].mean()),
        **_interval("in_region", answers["in_region"]),
        "off": None if off.empty else _short(off.max()),
        "ms": _short(answers["ms"].mean()),
        "bins": [
            {key: _short(value) for key, value in one.items()} for one in plain_records(tenths)
        ],
    }
    if "alone" in answers:
        values |= _interval("alone", answers["alone"])
    return values


def _interval(name: str, hits: pd.Series[float]) -> dict[str, float | None]:
    share = float(hits.mean())
    low, high = wilson_interval(share, len(hits))
    return {name: _short(share), f"{name}_low": _short(low), f"{name}_high": _short(high)}


def _short(value: float | None) -> float | None:
    """Return a number to four digits."""
    return value if value is None or isinstance(value, int) else float(f"{value:.4g}")


def _text(row: dict[str, Any]) -> str:
    """Return a line for people."""
    off = "" if row["off"] is None else f", tenths at most {row['off']:.3f} off"
    alone = f" (the last photo alone {row['alone']:.3f})" if "alone" in row else ""
    return (
        f"{row['city']}, from {row['seen_from']}, {row['photos']} x {row['degrees']} degrees, "
        f"{row['least']} or more, heading {row['heading']}, {row['told']} (n={row['queries']}): "
        f"within 50 m {row['p50']:.3f} [{row['p50_low']:.3f}, {row['p50_high']:.3f}]{alone}, "
        f"stated {row['stated']:.3f}{off}, in the region of 90 % {row['in_region']:.3f}, "
        f"{row['ms']:.3g} ms"
    )


def bars(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[str, Bar]]:
    """Yield what was asked for of views, and what came out.

    Parameters
    ----------
    rows : sequence of dict
        Rows of ``views.json``.

    Yields
    ------
    tuple of (str, Bar)
        The city, and the bar: of shares in the Paris-like city, from cells; then, for every city,
        whether the chances come true.
    """
    told = [row for row in rows if row["told"] != NOT_TOLD]
    like_paris = [row for row in rows if row["city"] == PARIS_LIKE and row["seen_from"] == "cells"]
    yield from ((PARIS_LIKE, bar) for bar in _share_bars(like_paris))
    for row in like_paris:
        if "alone" in row:
            ratio = row["p50"] / row["alone"] if row["alone"] else math.inf
            what = f"route of {row['photos']} photos, {row['told']}, to the last one alone"
            yield PARIS_LIKE, Bar(what=what, value=ratio, low=3.0)
    for city, seen_from in dict.fromkeys((row["city"], row["seen_from"]) for row in told):
        lines = [row for row in told if (row["city"], row["seen_from"]) == (city, seen_from)]
        offs = [row["off"] for row in lines if row["off"] is not None]
        if offs:
            what = f"from {seen_from}: tenths of the chance off, at most, in all lines"
            yield city, Bar(what=what, value=max(offs), high=DECILE_OFF)
            what = f"from {seen_from}: how often exact chances would be off by as much, by luck"
            yield city, Bar(what=what, value=_luck(lines, max(offs)), low=LEAST_LUCK)


def _luck(rows: Sequence[dict[str, Any]], off: float) -> float:
    """Return how often exact chances would be off by `off` or more in a tenth of so many queries.

    A tenth of 100 queries with a chance of a half is .05 off as often as not.
    """
    tenths = [one for row in rows for one in row["bins"] if one["n"] >= MANY]
    sizes, stated = (np.array([one[name] for one in tenths]) for name in ("n", "stated"))
    hits = np.random.default_rng(0).binomial(sizes, stated, (LUCK_DRAWS, len(sizes)))
    return float((np.abs(hits / sizes - stated).max(axis=1) >= off).mean())


def _share_bars(rows: Iterable[dict[str, Any]]) -> Iterator[Bar]:
    known = [row for row in rows if row["heading"] == KNOWN]
    shares = {(row["degrees"], row["least"], row["told"]): row["p50"] for row in known}
    narrow, middle, full = DEGREES
    for told, low, lowest in ((SECTORS, 4.0, 0.08), (RANGES, 9.0, 0.20)):
        if {(middle, MANY_SEEN, told), (middle, MANY_SEEN, NOT_TOLD)} <= shares.keys():
            before = shares[middle, MANY_SEEN, NOT_TOLD]
            ratio = shares[middle, MANY_SEEN, told] / before if before else math.inf
            what = f"{_what(middle, MANY_SEEN, told)}, to {NOT_TOLD}"
            yield Bar(what=what, value=ratio, low=low)
        for least in LEAST:
            if (narrow, least, told) in shares:
                value = shares[narrow, least, told]
                yield Bar(what=_what(narrow, least, told), value=value, low=lowest)
    for least in LEAST:
        if {(full, least, RANGES), (full, least, NOT_TOLD)} <= shares.keys():
            gain = shares[full, least, RANGES] - shares[full, least, NOT_TOLD]
            yield Bar(what=f"{_what(full, least, RANGES)}, more than without", value=gain, low=0.1)


def _what(degrees: int, least: int, told: str) -> str:
    return f"{degrees} degrees, {least} or more, {told}"


if __name__ == "__main__":
    main()
