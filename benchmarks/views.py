"""Measure how well narrow views can be localized: ``python -m benchmarks.views``.

A detector finds 80 % of the objects, misnames 10 % of these, is 4 degrees out and makes up one
object in a full turn; a camera sees 70, 120 or 360 degrees. The likelihood method has this noise
model. It gets the same queries as if they were full turns, with their sectors, or with sectors and
rough distances. Results are written to ``benchmarks/views.json``, line by line. Lines that are
there are not measured again, so that an interrupted run continues.
"""

from __future__ import annotations

import functools
import itertools
import math
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from benchmarks._accuracy_queries import straight_walk
from benchmarks._accuracy_rows import Bar
from benchmarks._cities import MONTPELLIER, PARIS_LIKE, made_up, made_up_streets, real
from benchmarks._measuring import (
    INPUTS,
    LAST_ONLY,
    add_geodata,
    available_cities,
    option_parser,
    read_rows,
    short,
    write_rows,
)
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
    from pathlib import Path

    from semsig_gis.core import Signature
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import QueryDistortion, SeenFrom
    from semsig_gis.localization import Location

__all__ = ["FULL_TURN", "RANGES", "SECTORS", "bars", "lines", "main"]

NOISE = NoiseSpec(detection=0.8, misnamed=0.1, clutter=1.0, bearing_sigma=4.0, name="views")
CITIES = (PARIS_LIKE, MONTPELLIER, "Helsinki")
DEGREES = (70, 120, 360)
MANY_SEEN = 5
LEAST = (1, MANY_SEEN)
KNOWN, OFF, UNKNOWN = "known", "10 degrees off", "unknown"
NORTHS = {KNOWN: ("", 0.0), OFF: (", compass:10", 10.0), UNKNOWN: (", compass:360", math.inf)}
FULL_TURN, SECTORS, RANGES = "as a full turn", "sectors", "sectors and ranges"
PHOTOS = 5
NEAR_M = 50.0
MANY, DECILE_OFF = 100, 0.05  # queries in a tenth of the chance, and how far off it may be
LEAST_LUCK, LUCK_DRAWS = 0.05, 20_000  # smallest chance that still is luck; number of draws
PARTS = 16  # of the queries of a line, for the processes
SPARE = 40  # at most 40 times as many queries are drawn, to get enough with five detections


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """Queries of a line of the results.

    `degrees` is the field of view of the photos, `least` the least number of detections in the last
    photo, and `inputs` what the method gets: `FULL_TURN`, `SECTORS` or `RANGES`.
    """

    seen_from: SeenFrom
    photos: int
    degrees: int
    least: int
    heading: str
    inputs: str

    @property
    def chain(self) -> tuple[QueryDistortion, ...]:
        """Distortions of the queries; they are the same for all `inputs`."""
        sector = ":told=false" if self.inputs == FULL_TURN else ""
        ranges = ", ranges:25" if self.inputs == RANGES else ""
        view = f"view:{self.degrees}{sector}{NORTHS[self.heading][0]}"
        return parse_chain(f"detector:{NOISE.name}{ranges}, {view}", noises={NOISE.name: NOISE})

    def to_dict(self) -> dict[str, Any]:
        """Return the line as values of a row of ``views.json``."""
        values = asdict(self)
        values[INPUTS] = values.pop("inputs")
        return values


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Question:
    """Views with the legs between them, and the true place of the last one."""

    views: tuple[Signature, ...]
    legs: tuple[Leg, ...] = ()
    cell: int
    xy: tuple[float, float]


def main() -> None:
    """Measure, print and write."""
    parser = option_parser("views", __doc__)
    add_geodata(parser)
    parser.add_argument("--queries", type=int, metavar="N", help="of each line (default: by line)")
    parser.add_argument("--city", choices=CITIES, action="append", help="default: all of them")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    small = options.size == "small"
    rows = read_rows(options.out)
    for name in available_cities(options.city or CITIES, options.geodata, made_up=PARIS_LIKE):
        missing = {}
        for line in lines():
            count = options.queries or (10 if small else _number(name, line))
            case = {"city": name, **line.to_dict(), "wanted": count}
            if not any(case.items() <= row.items() for row in rows):
                missing[line] = count
        for row in _rows(name, options.geodata, missing, options.processes, small=small):
            print(_text(row), flush=True)
            rows.append(row)
            write_rows(options.out, rows)
    for name, bar in bars(rows):
        print(f"{name}: {bar}")


def lines() -> Iterator[Line]:
    """Yield all lines of a city, those with the heading known first."""
    cells: SeenFrom = "cells"
    anywhere: SeenFrom = "anywhere"
    for heading, seen_from in (*((north, cells) for north in NORTHS), (KNOWN, anywhere)):
        for degrees, least in itertools.product(DEGREES, LEAST):
            for inputs in (FULL_TURN, SECTORS, RANGES):
                if not (degrees == DEGREES[-1] and inputs == SECTORS):  # the same as FULL_TURN
                    yield Line(
                        seen_from=seen_from,
                        photos=1,
                        degrees=degrees,
                        least=least,
                        heading=heading,
                        inputs=inputs,
                    )
    for inputs in (SECTORS, RANGES):
        yield Line(
            seen_from=cells,
            photos=PHOTOS,
            degrees=DEGREES[0],
            least=LEAST[0],
            heading=OFF,
            inputs=inputs,
        )


def _number(city: str, line: Line) -> int:
    """Return the number of queries of a line, fewer if each takes longer or contributes less."""
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
    """Yield the row of each line, with its number of queries."""
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
        for line, count in lines.items():
            questions = _questions(database, store, line, count)
            parts = [questions[start::PARTS] for start in range(min(PARTS, len(questions)))]
            answer = functools.partial(_answers, file, line.seen_from, line.heading)
            answers = pd.concat(pool.map(answer, parts))
            yield {
                "city": name,
                **line.to_dict(),
                "wanted": count,
                "cells": len(database),
                **_figures(answers),
            }


def _questions(
    database: SignatureDatabase, store: ObjectStore, line: Line, count: int
) -> list[_Question]:
    """Return at most `count` questions with enough detections."""
    single = line.photos == 1
    questions = _single(database, store, line, count) if single else _walks(database, line)
    enough = (question for question in questions if len(question.views[-1]) >= line.least)
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
    """Yield straight routes along cells, with another direction and compass for each photo."""
    rng = np.random.default_rng(0)
    distort = prepare_chain(line.chain, CitySights.of(database))
    for start in rng.permutation(len(database)).tolist():
        cells = straight_walk(database, start, line.photos, np.random.default_rng([start, 1]))
        if cells:
            numbers = itertools.count(start * line.photos)
            sights = (Sight.of_cell(database, cell) for cell in cells)
            signatures = (distort(sight, 0, next(numbers)).signature for sight in sights)
            places = database.xy[cells]
            x, y = places[-1].tolist()
            yield _Question(
                views=tuple(signatures),
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
    """Return the outcomes of questions, one row each."""
    locator = _locator(file, seen_from, heading)
    locator.locate(questions[0].views[-1])  # one-time work is not timed
    rows = []
    for question in questions:
        start = time.process_time()
        if question.legs:
            location = locator.locate_route(question.views, question.legs)[-1]
        else:
            location = locator.locate(question.views[-1])
        row = {
            "ms": 1e3 * (time.process_time() - start),
            "chance": location.answer.mass,
            "right": _right(location, question),
            "in_region": _in_region(location, question.cell),
        }
        if question.legs:
            row[LAST_ONLY] = _right(locator.locate(question.views[-1]), question)
        rows.append(row)
    return pd.DataFrame(rows)


def _right(location: Location, question: _Question) -> float:
    error = math.dist((location.answer.x, location.answer.y), question.xy)
    return float(round(error, 6) <= NEAR_M)


def _in_region(location: Location, cell: int) -> float:
    """Return the chance that a cell is in a region of exactly 90 %; its last cells are in part."""
    chances, region = location.chances, location.region
    least, own = chances[region[-1]], chances[cell]
    if own != least:
        return float(own > least)
    return float((REGION_SHARE - chances[chances > least].sum()) / chances[chances == least].sum())


def _figures(answers: pd.DataFrame) -> dict[str, Any]:
    """Return the figures of a line; ``off`` is the largest error of tenths with many queries."""
    tenths = calibration_bins(answers)
    off = (tenths["stated"] - tenths["true"])[tenths["n"] >= MANY].abs()
    values: dict[str, Any] = {
        "queries": len(answers),
        **_interval("p50", answers["right"]),
        "stated": short(answers["chance"].mean()),
        **_interval("in_region", answers["in_region"]),
        "off": None if off.empty else short(off.max()),
        "ms": short(answers["ms"].mean()),
        "bins": [
            {key: short(value) for key, value in tenth.items()} for tenth in plain_records(tenths)
        ],
    }
    if LAST_ONLY in answers:
        values |= _interval(LAST_ONLY, answers[LAST_ONLY])
    return values


def _interval(name: str, hits: pd.Series[float]) -> dict[str, float | None]:
    share = float(hits.mean())
    low, high = wilson_interval(share, len(hits))
    return {name: short(share), f"{name}_low": short(low), f"{name}_high": short(high)}


def _text(row: dict[str, Any]) -> str:
    """Return a row as text."""
    off = "" if row["off"] is None else f", tenths at most {row['off']:.3f} off"
    last = f" (only the last photo {row[LAST_ONLY]:.3f})" if LAST_ONLY in row else ""
    return (
        f"{row['city']}, from {row['seen_from']}, {row['photos']} x {row['degrees']} degrees, "
        f"{row['least']} or more, heading {row['heading']}, {row[INPUTS]} (n={row['queries']}): "
        f"within 50 m {row['p50']:.3f} [{row['p50_low']:.3f}, {row['p50_high']:.3f}]{last}, "
        f"stated {row['stated']:.3f}{off}, in the region of 90 % {row['in_region']:.3f}, "
        f"{row['ms']:.3g} ms"
    )


def bars(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[str, Bar]]:
    """Yield the bars of rows of ``views.json``, each with its city.

    Shares have bars in the Paris-like city, from cells; chances have bars in every city.
    """
    with_sectors = [row for row in rows if row[INPUTS] != FULL_TURN]
    like_paris = [row for row in rows if row["city"] == PARIS_LIKE and row["seen_from"] == "cells"]
    yield from ((PARIS_LIKE, bar) for bar in _share_bars(like_paris))
    for row in like_paris:
        if LAST_ONLY in row:
            ratio = row["p50"] / row[LAST_ONLY] if row[LAST_ONLY] else math.inf
            what = f"route of {row['photos']} photos, {row[INPUTS]}, to only the last one"
            yield PARIS_LIKE, Bar(what=what, value=ratio, low=3.0)
    for city, seen_from in dict.fromkeys((row["city"], row["seen_from"]) for row in with_sectors):
        lines = [
            row for row in with_sectors if (row["city"], row["seen_from"]) == (city, seen_from)
        ]
        offs = [row["off"] for row in lines if row["off"] is not None]
        if offs:
            what = f"from {seen_from}: tenths of the chance off, at most, in all lines"
            yield city, Bar(what=what, value=max(offs), high=DECILE_OFF)
            what = f"from {seen_from}: how often exact chances would be off by as much, by luck"
            yield city, Bar(what=what, value=_luck(lines, max(offs)), low=LEAST_LUCK)


def _luck(rows: Sequence[dict[str, Any]], off: float) -> float:
    """Return how often exact chances would be off by `off` or more in any tenth of the rows.

    A tenth of 100 queries with a chance of a half is .05 off as often as not.
    """
    tenths = [tenth for row in rows for tenth in row["bins"] if tenth["n"] >= MANY]
    sizes, stated = (np.array([tenth[name] for tenth in tenths]) for name in ("n", "stated"))
    hits = np.random.default_rng(0).binomial(sizes, stated, (LUCK_DRAWS, len(sizes)))
    return float((np.abs(hits / sizes - stated).max(axis=1) >= off).mean())


def _share_bars(rows: Iterable[dict[str, Any]]) -> Iterator[Bar]:
    shares = {
        (row["degrees"], row["least"], row[INPUTS]): row["p50"]
        for row in rows
        if row["heading"] == KNOWN
    }
    narrow, middle, full = DEGREES
    for inputs, low, lowest in ((SECTORS, 4.0, 0.08), (RANGES, 9.0, 0.20)):
        if {(middle, MANY_SEEN, inputs), (middle, MANY_SEEN, FULL_TURN)} <= shares.keys():
            before = shares[middle, MANY_SEEN, FULL_TURN]
            ratio = shares[middle, MANY_SEEN, inputs] / before if before else math.inf
            what = f"{_what(middle, MANY_SEEN, inputs)}, to {FULL_TURN}"
            yield Bar(what=what, value=ratio, low=low)
        for least in LEAST:
            if (narrow, least, inputs) in shares:
                value = shares[narrow, least, inputs]
                yield Bar(what=_what(narrow, least, inputs), value=value, low=lowest)
    for least in LEAST:
        if {(full, least, RANGES), (full, least, FULL_TURN)} <= shares.keys():
            gain = shares[full, least, RANGES] - shares[full, least, FULL_TURN]
            yield Bar(what=f"{_what(full, least, RANGES)}, more than without", value=gain, low=0.1)


def _what(degrees: int, least: int, inputs: str) -> str:
    return f"{degrees} degrees, {least} or more, {inputs}"


if __name__ == "__main__":
    main()
