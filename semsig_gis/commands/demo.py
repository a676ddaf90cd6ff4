"""`semsig demo`: every step on a made-up town."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typing_extensions import TypedDict

from semsig_gis.commands.localize import Localize
from semsig_gis.commands.model import Option, Reporter, Result, command, command_line
from semsig_gis.commands.options import MOST_QUERIES, MOST_SEED, draw_ground, online_notes
from semsig_gis.core import InputError

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.evaluation import Evaluation, SimulatedQuery
    from semsig_gis.localization import Location

SIDE_M = 1200.0  # of the square town
VIEWS = 60  # one that is answered and one that is not are shown
OBJECTS = range(3, 9)  # in a view that is shown


class Demonstrated(TypedDict):
    """The files of the made-up town, and its counts."""

    objects: int
    cells: int
    queries: int
    files: list[str]


@dataclass(frozen=True, kw_only=True)
class _Example:
    """A view from a known place, as a person would type it, and the answer."""

    request: Localize
    place: str
    metres: float
    answer: Location


@command(
    "demo",
    title="Demonstration",
    group="Look",
    order=1,
    returns=Demonstrated,
    examples=(
        "semsig demo",
        "semsig demo --out town --seed 7",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Demo:
    """Run every step on a small made-up town, offline."""

    out: Annotated[
        Path, Option("Folder to write to.", title="Folder", metavar="FOLDER", writes="")
    ] = Path("demo")
    queries: Annotated[
        int,
        Option("Number of queries to ask.", title="Number of queries", low=1, high=MOST_QUERIES),
    ] = 100
    seed: Annotated[int, Option("Seed of the town and the queries.", low=0, high=MOST_SEED)] = 0

    def run(self, reporter: Reporter) -> Result:
        """Write the town, its database, its evaluation and maps; return their files."""
        from semsig_gis.database import ObjectStore, open_city, save_with_store
        from semsig_gis.evaluation import evaluate, save_evaluation
        from semsig_gis.output import export_database

        city_file = self.out / "city.parquet"
        with reporter.progress("building a town") as advance:
            objects, surroundings, database = self._town(advance, reporter)
        save_with_store(database, ObjectStore.of(objects, **surroundings), city_file)
        city = open_city(city_file)
        with reporter.progress("evaluating") as advance:
            evaluation = evaluate(database, queries=self.queries, seed=self.seed, progress=advance)
        save_evaluation(evaluation, self.out / "evaluation")
        with reporter.progress("localizing"):
            examples = self._examples(city, reporter)
        with reporter.progress("drawing"):
            files, notes = self._draw(city, evaluation, examples)
        with reporter.progress("writing the GeoPackage") as advance:
            geopackage = self.out / "city.gpkg"
            export_database(
                database,
                geopackage,
                objects=objects,
                evaluation=evaluation,
                **city.store.ground,
                progress=advance,
            )
        files |= {"layers for QGIS": geopackage, "signature database": city_file}
        values: Demonstrated = {
            "objects": len(objects),
            "cells": len(database),
            "queries": self.queries,
            "files": [*map(str, [*files.values(), self.out / "evaluation"])],
        }
        return Result(
            values=lambda: values,
            summary=self._summary(city, evaluation, examples),
            files=files,
            notes=notes,
        )

    def _town(
        self,
        advance: Any,  # noqa: ANN401 - slow to import
        reporter: Reporter,
    ) -> tuple[Any, dict[str, Any], Any]:
        """Return the street objects, the buildings and streets, and the database of a town."""
        from semsig_gis.database import ViewpointSpec, build_database
        from semsig_gis.objects import build_objects, save_with_ground
        from semsig_gis.sources import (
            CitySpec,
            paper_taxonomy,
            synthetic_city,
            synthetic_surroundings,
        )

        spec = CitySpec(size=SIDE_M, seed=self.seed)
        layers = synthetic_city(spec)
        objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
        houses, streets = (layer.table for layer in synthetic_surroundings(spec))
        objects_file = self.out / "objects.parquet"
        save_with_ground(
            objects, objects_file, buildings=houses, streets=streets, remark=reporter.remark
        )
        surroundings = {"footprints": houses, "streets": streets}
        database = build_database(
            objects, viewpoints=ViewpointSpec(mode="streets"), progress=advance, **surroundings
        )
        return objects, surroundings, database

    def _examples(self, city: City, reporter: Reporter) -> list[_Example]:
        """Return a view that is answered and one that is not, if there are any."""
        from semsig_gis.evaluation import QuerySpec, draw_queries, parse_chain

        spec = QuerySpec(
            number=min(VIEWS, len(city.database)),
            seeds=(self.seed,),
            seen_from="anywhere",
            distortions=tuple(parse_chain("light")),
        )
        locator = Localize(database=city.path).locator(
            city, reporter, usual_noise="by-hand", top=10, explain=True
        )

        def example(view: SimulatedQuery) -> _Example:
            request = Localize(database=city.path, seen=_sentence(city, view))
            answer = locator.locate(request.query(city.database))
            return _Example(
                request=request,
                place=city.store.place_name(*view.xy),
                metres=math.dist(view.xy, answer.xy),
                answer=answer,
            )

        queries = draw_queries(city.database, spec, store=city.store)
        views = [view for view in queries if len(view.asked) in OBJECTS]
        # Few places see many objects of many classes, and many places few objects of one class.
        views.sort(key=lambda view: (-len(set(view.asked.codes.tolist())), -len(view.asked)))
        certain = (item for item in map(example, views) if item.answer.answer.given)
        uncertain = (item for item in map(example, views[::-1]) if not item.answer.answer.given)
        return [item for some in (certain, uncertain) for item in itertools.islice(some, 1)]

    def _draw(
        self, city: City, evaluation: Evaluation, examples: list[_Example]
    ) -> tuple[dict[str, Path], list[str]]:
        """Write the maps and the report; return their files and notes on them."""
        from semsig_gis.output import city_map, location_map, save_map

        files = {}
        if examples:
            files["answer on a map"] = self.out / "place.html"
            page = location_map(examples[0].answer)
            draw_ground(page, city)
            save_map(page, files["answer on a map"], title="A made-up town")
        files["errors on a map"] = self.out / "map.html"
        page = city_map(city.database, evaluation=evaluation, objects=city.objects)
        draw_ground(page, city)
        notes = online_notes(save_map(page, files["errors on a map"], title="A made-up town"))
        try:
            from semsig_gis.output import evaluation_page, write_page
        except InputError as error:  # matplotlib may be missing
            return files, [*notes, str(error)]
        files["evaluation report"] = self.out / "report.html"
        report = evaluation_page(
            evaluation, city.database, name="A made-up town", command=command_line(self)
        )
        write_page(report, files["evaluation report"])
        return files, notes

    def _summary(
        self, city: City, evaluation: Evaluation, examples: list[_Example]
    ) -> Iterator[str]:
        from semsig_gis.output import evaluation_headline, place_sentences

        yield (
            f"A made-up town: {len(city.store.objects):,} street objects between buildings, "
            f"{len(city.database):,} cells of 10 m along its streets."
        )
        for example in examples:
            place = f" {example.place}" if example.place else ""
            yield f"Standing{place}, you would see: {example.request.seen}."
            sentence = place_sentences(example.answer)[0]
            truth = f" In truth, it is {example.metres:.0f} m off."
            yield f"semsig says: {sentence}{truth if example.answer.answer.given else ''}"
        yield evaluation_headline(evaluation)
        for example in examples[:1]:
            yield f"Next, type:\n  {command_line(example.request)}"


def _sentence(city: City, view: SimulatedQuery) -> str:
    """Return a view as a person would type it."""
    words = city.database.taxonomy.words
    return ", ".join(
        f"{words([code])} at {bearing:.0f}"
        for code, bearing in zip(view.asked.codes, view.asked.bearings, strict=True)
    )
