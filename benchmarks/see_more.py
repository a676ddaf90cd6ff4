"""Measure what more kinds of things on the map are worth: ``python -m benchmarks.see_more``.

In real cities a person finds 70 % of the things that are seen from anywhere in a street cell,
misnames 5 % of them, is 8 degrees out and makes up few. The likelihood method has this noise model.
The views are from the same places for every line; what is on the map, and so in the views, grows
from line to line. Results are labels to ``benchmarks/see_more.json``, line by line. Lines that are
there are not measured again, so that an interrupted run continues. Places are not refined.
"""

from __future__ import annotations

import functools
import itertools
import math
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import shapely

from benchmarks._accuracy_rows import Bar
from benchmarks._measuring import add_geodata, option_parser, read_rows, short, write_rows
from benchmarks.views import KNOWN, NORTHS
from semsig_gis.core import NAME, Taxonomy, wilson_interval
from semsig_gis.database import build, open_city, visible_objects_at
from semsig_gis.evaluation import QuerySpec, calibration_bins, draw_queries, parse_chain
from semsig_gis.localization import (
    DEFAULT_RULE,
    AnswerRule,
    LikelihoodLocator,
    NoiseSpec,
    build_index,
    cell_noise,
)
from semsig_gis.objects import Loaded, StreetObjects, load
from semsig_gis.observation import View

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import geopandas as gpd
    from numpy.typing import NDArray

    from semsig_gis.core import ObjectClass, Signature
    from semsig_gis.database import City

__all__ = ["LINES", "bars", "main"]

CITIES = {
    "Helsinki": "helsinki_2019.osm.pbf",
    "Monaco": "monaco_2022.osm.pbf",
    "Neukölln": "neukolln_2024.osm",
    "Marais": "paris_marais_routing.osm.pbf",
}
PERSON = NoiseSpec(detection=0.7, misnamed=0.05, clutter=0.2, bearing_sigma=8.0, name="person")
# The classes that were read by default when the classes had no families.
BEFORE = frozenset(range(1, 30)) - {23, 24, 25}
SHOPS = frozenset({"shop", "food", "service", "worship"})
CORNERS, JUNCTIONS, LANDMARKS = "building", "junction", "landmark"
NEAR_M, THIN_M = DEFAULT_RULE.radius, 100.0
READ = 0.5  # share of the names
ON_STREET_M, SAME_M = 15.0, 1e-6
PARTS = 16  # of the views of a line, for the processes
# The targets: times the share of before, where it is low; shares; and the gap of chances.
LOW_SHARE, TIMES, LEAST_RIGHT, MOST_GAP = 0.4, 2.0, 0.96, 0.05
MORE, MOST_SHARE = 0.1, 0.97  # more with names, but not above this share
ENOUGH = 50  # answers; the share of fewer that is right says little


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """What is on the map: the first `steps` kinds of things, or only those of a `thin` place.

    With `names`, half of the names of shops and streets are read. Answers within `radius` metres
    are right.
    """

    name: str
    steps: int = 0
    thin: bool = False
    names: bool = False
    radius: float = NEAR_M

    def has(self, item: ObjectClass) -> bool:
        """Return whether a class is on the map."""
        step = _step(item)
        return step in THIN if self.thin else step < self.steps


TODAY, FURNITURE, WITH_SHOPS, WITH_JUNCTIONS, EXTENDED, FAR, WITH_CORNERS = STEPS = (
    "the classes of before",
    "+ more furniture",
    "+ shops, food, services and worship",
    "+ street junctions",
    "+ lines and areas",
    "+ landmarks",
    "+ building corners",
)
THIN = frozenset(map(STEPS.index, (WITH_JUNCTIONS, FAR, WITH_CORNERS)))
THIN_PLACE = "only junctions, buildings and landmarks"
NAMES_READ = "up to junctions, half of the names read"
LINES = (
    *(Line(name=name, steps=number) for number, name in enumerate(STEPS, start=1)),
    Line(name=NAMES_READ, steps=STEPS.index(WITH_JUNCTIONS) + 1, names=True),
    Line(name=THIN_PLACE, thin=True, radius=THIN_M),
)


def _step(item: ObjectClass) -> int:
    """Return the number of the step that puts a class on the map."""
    if item.code in BEFORE:
        return STEPS.index(TODAY)
    if item.tall or item.family == LANDMARKS:
        return STEPS.index(FAR)
    families = {CORNERS: WITH_CORNERS, JUNCTIONS: WITH_JUNCTIONS}
    if item.family in families:
        return STEPS.index(families[item.family])
    if item.shape != "point":
        return STEPS.index(EXTENDED)
    return STEPS.index(WITH_SHOPS if item.family in SHOPS else FURNITURE)


def main() -> None:
    """Measure, print and write."""
    parser = option_parser("see_more", __doc__)
    add_geodata(parser)
    parser.add_argument("--views", type=int, default=1000, metavar="N", help="of each line")
    parser.add_argument("--city", choices=CITIES, action="append", help="default: all of them")
    parser.add_argument("--line", action="append", metavar="TEXT", help="only lines with this text")
    parser.add_argument("--north", choices=NORTHS, action="append", help="default: all of them")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    if options.geodata is None:
        parser.error("SEMSIG_GEODATA does not name the folder of open data")
    small = options.size == "small"
    count = 5 if small else options.views
    norths = options.north or list(NORTHS)
    texts = options.line or [""]
    lines = [line for line in LINES if any(text in line.name for text in texts)]
    rows = read_rows(options.out)
    for name in options.city or list(CITIES):
        missing = [
            (line, north)
            for line, north in itertools.product(lines, norths)
            if not any(_case(name, line, north, count).items() <= row.items() for row in rows)
        ]
        file = Path(options.geodata) / "osm" / CITIES[name]
        for row in _rows(name, file, missing, count, options.processes) if missing else ():
            print(_text(row), flush=True)
            # A row of another number of views is replaced.
            others = [item for item in rows if _order(item) != _order(row)]
            rows = sorted([*others, row], key=_order)
            write_rows(options.out, rows)
    for name, bar in bars(rows):
        print(f"{name}: {bar}")


def _order(row: dict[str, Any]) -> tuple[int, int, int]:
    names = [line.name for line in LINES]
    return [*CITIES].index(row["city"]), names.index(row["line"]), [*NORTHS].index(row["heading"])


def _case(city: str, line: Line, north: str, count: int) -> dict[str, Any]:
    """Return the values that identify a row."""
    values = {"city": city, "line": line.name, "heading": north}
    return {**values, "radius": line.radius, "wanted": count}


def _rows(
    name: str, file: Path, missing: Sequence[tuple[Line, str]], count: int, processes: int
) -> Iterator[dict[str, Any]]:
    """Yield the row of each line and north of a city."""
    loaded = load(file, selection="all")
    everything = build(loaded, viewpoints="streets")
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool,
    ):
        for line, norths in itertools.groupby(missing, key=lambda pair: pair[0]):
            path = Path(folder) / f"{LINES.index(line)}.parquet"
            objects = _objects(loaded.objects, line)
            if objects is None:
                print(f"{name}, {line.name}: nothing of this is on the map")
                continue
            part = Loaded(
                objects=objects,
                report=loaded.report,
                conflation=loaded.conflation,
                buildings=loaded.buildings,
                streets=loaded.streets,
            )
            city = build(part, path, viewpoints="streets")
            for _, north in norths:
                questions = _questions(city, everything, north, count)
                if line.names:
                    questions = _with_names(questions, everything)
                parts = [questions[start::PARTS] for start in range(min(PARTS, count))]
                answer = functools.partial(_answers, str(path), north, line.radius)
                answers = pd.concat(pool.map(answer, parts))
                yield {
                    **_case(name, line, north, count),
                    "objects": len(objects),
                    "classes": len(city.database.present_codes),
                    "cells": len(city.database),
                    **_figures(answers),
                }


def _objects(objects: StreetObjects, line: Line) -> StreetObjects | None:
    """Return the objects of the classes of a line; None if there are none."""
    present = set(objects.class_counts)
    classes = [item for item in objects.taxonomy.classes if line.has(item) and item.code in present]
    if not classes:
        return None
    mask = np.isin(objects.codes, [item.code for item in classes])
    return StreetObjects(
        table=objects.table[mask].reset_index(drop=True),
        taxonomy=Taxonomy(tuple(classes)),
        licenses=objects.licenses,
        notes=objects.notes,
    )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Question:
    """A view and its true place; `distances` are those of its objects, NaN of false ones."""

    view: Signature
    xy: tuple[float, float]
    distances: NDArray[np.float64]


def _questions(city: City, everything: City, north: str, count: int) -> list[_Question]:
    """Return views of a city from random places of all street cells that see anything at all."""
    chain = parse_chain(f"detector:{PERSON.name}{NORTHS[north][0]}", noises={PERSON.name: PERSON})
    each = min(count, len(everything.database))
    spec = QuerySpec(
        number=each,
        seeds=tuple(range(math.ceil(count / each))),
        seen_from="anywhere",
        distortions=chain,
    )
    queries = draw_queries(
        city.database,
        spec,
        store=everything.store,
        city=everything.database,
        part=slice(count),
    )
    questions = []
    for query in queries:
        sight = query.asked
        false = np.zeros(len(sight), np.bool_) if sight.false is None else sight.false
        distances = np.where(false, np.nan, sight.distances)
        questions.append(_Question(view=sight.signature, xy=query.xy, distances=distances))
    return questions


def _with_names(questions: Sequence[_Question], city: City) -> list[_Question]:
    """Return questions with half of the names of shops and of the streets that they are on."""
    objects, streets = city.store.objects, city.store.streets
    families = {item.code: item.family for item in objects.taxonomy.classes}
    columns = objects.texts
    labels = [""] * len(objects)
    if columns is not None and NAME in columns.column_names:
        labels = [text or "" for text in columns[NAME].to_pylist()]
    rng = np.random.default_rng(0)
    results = []
    for question in questions:
        rows = _rows_seen(question, city)
        names = [
            labels[row]
            if row >= 0 and families[int(objects.codes[row])] in SHOPS and rng.random() < READ
            else ""
            for row in rows
        ]
        signs: tuple[str, ...] = ()
        if streets is not None and rng.random() < READ:
            street = _street_at(question.xy, streets)
            signs = (street,) if street else ()
        view = replace(View.of(question.view), texts=tuple(names), signs=signs)
        results.append(replace(question, view=view))
    return results


def _rows_seen(question: _Question, city: City) -> list[int]:
    """Return the row of each object of a view, by its true distance; -1 for a false one."""
    place, store, database = np.array([question.xy]), city.store, city.database
    views = visible_objects_at(
        store.objects,
        place,
        index=store.index,
        radius=database.spec.radius,
        footprints=store.buildings_around(place, distance=database.reach),
    )
    rows = []
    for distance in question.distances.tolist():
        gaps = np.abs(views.distances - distance)
        # The gap to the NaN of a false object is NaN, too.
        same = np.flatnonzero(gaps < SAME_M)
        rows.append(int(views.objects[same[0]]) if len(same) else -1)
    return rows


def _street_at(xy: tuple[float, float], streets: gpd.GeoDataFrame) -> str:
    """Return the name of the street of a place; empty if there is none, or none near."""
    (nearest,) = streets.sindex.nearest(
        shapely.Point(xy), return_all=False, return_distance=False, max_distance=ON_STREET_M
    )[1:]
    return str(streets[NAME].iloc[int(nearest[0])]) if len(nearest) else ""


@functools.cache
def _locator(path: str, north: str, radius: float) -> LikelihoodLocator:
    city = open_city(path)
    database = city.database
    return LikelihoodLocator(
        index=build_index(database, cell_noise(PERSON, database.grid.step)),
        store=city.store,  # for names
        north_sigma=NORTHS[north][1],
        rule=AnswerRule(threshold=DEFAULT_RULE.threshold, radius=radius),
        top=1,
        surely_here=True,
    )


def _answers(path: str, north: str, radius: float, questions: Sequence[_Question]) -> pd.DataFrame:
    """Return the outcomes of questions, one row each; those without any object have no answer."""
    locator = _locator(path, north, radius)
    rows = []
    for question in questions:
        row = {"seen": float(len(question.view)), "right": 0.0, "chance": math.nan}
        if len(question.view) or View.of(question.view).signs:
            location = locator.locate(question.view)
            error = math.dist((location.answer.x, location.answer.y), question.xy)
            row |= {
                "right": float(round(error, 6) <= radius),
                "chance": location.answer.mass,
                "region_m2": 1e6 * location.region_km2,
            }
        rows.append(row)
    return pd.DataFrame(rows, columns=["seen", "right", "chance", "region_m2"])


def _figures(answers: pd.DataFrame) -> dict[str, Any]:
    """Return the figures of a line; ``gap`` is how far off the chances are, on the average."""
    usable = answers[answers["chance"].notna()]
    sure = answers["right"][answers["chance"] >= DEFAULT_RULE.threshold]
    near = float(answers["right"].mean())
    low, high = wilson_interval(near, len(answers))
    gap = None
    if len(usable):
        tenths = calibration_bins(usable)
        gaps = (tenths["stated"] - tenths["true"]).abs() * tenths["n"]
        gap = float(gaps.sum() / tenths["n"].sum())
    return {
        "queries": len(answers),
        "detections": short(answers["seen"].mean()),
        "blind": short(1.0 - len(usable) / len(answers)),
        "near": short(near),
        "near_low": short(low),
        "near_high": short(high),
        "answered": len(sure),
        "right": int(sure.sum()),
        "stated": short(float(answers["chance"].fillna(0.0).mean())),
        "gap": short(gap),
        "region_m2": short(float(usable["region_m2"].median())) if len(usable) else None,
    }


def _text(row: dict[str, Any]) -> str:
    """Return a row as text."""
    gap = "" if row["gap"] is None else f", chances {row['gap']:.3f} off"
    region = "" if row["region_m2"] is None else f", region {row['region_m2']:,.0f} m²"
    return (
        f"{row['city']}, {row['line']}, north {row['heading']} (n={row['queries']}): within "
        f"{row['radius']:g} m {row['near']:.3f} [{row['near_low']:.3f}, {row['near_high']:.3f}], "
        f"answered {row['answered']}, right {row['right']}{gap}{region}, "
        f"{row['detections']:.1f} detections, {row['blind']:.3f} without any"
    )


def bars(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[str, Bar]]:
    """Yield the bars of rows of ``see_more.json``, each with its city."""
    for city in dict.fromkeys(row["city"] for row in rows):
        of_city = [row for row in rows if row["city"] == city]
        shares = {row["line"]: row["near"] for row in of_city if row["heading"] == KNOWN}
        if {TODAY, WITH_JUNCTIONS} <= shares.keys() and shares[TODAY] < LOW_SHARE:
            ratio = shares[WITH_JUNCTIONS] / shares[TODAY] if shares[TODAY] else math.inf
            yield city, Bar(what=f"{WITH_JUNCTIONS}, to {TODAY}", value=ratio, low=TIMES)
        if {NAMES_READ, WITH_JUNCTIONS} <= shares.keys():
            gain = shares[NAMES_READ] - shares[WITH_JUNCTIONS]
            low = min(MORE, round(MOST_SHARE - shares[WITH_JUNCTIONS], 3))
            yield city, Bar(what=f"{NAMES_READ}, more than without", value=gain, low=low)
        enough = [row for row in of_city if row["answered"] >= ENOUGH]
        if enough:
            least = min(row["right"] / row["answered"] for row in enough)
            yield city, Bar(what="right, of the answers of any line", value=least, low=LEAST_RIGHT)
        gaps = [row["gap"] for row in of_city if row["gap"] is not None]
        if gaps:
            yield (
                city,
                Bar(what="chances off, at most, in any line", value=max(gaps), high=MOST_GAP),
            )
        for row in of_city:
            if row["line"] == THIN_PLACE and row["heading"] == KNOWN:
                value = row["answered"] / row["queries"]
                yield city, Bar(what=f"answered, {THIN_PLACE}", value=value, low=1 / row["queries"])


if __name__ == "__main__":
    main()
