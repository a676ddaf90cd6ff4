"""`semsig demo`: every step on a made-up city."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typing_extensions import TypedDict

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import MOST_QUERIES, MOST_SEED, online_notes

if TYPE_CHECKING:
    from semsig_gis.evaluation import Evaluation


class Demonstrated(TypedDict):
    """The files of the made-up city, and its counts."""

    objects: int
    cells: int
    queries: int
    files: list[str]


@command("demo", title="Demonstration", group="Street objects", order=6, returns=Demonstrated)
@dataclass(frozen=True, kw_only=True)
class Demo:
    """Run every step on a small made-up city, offline."""

    out: Annotated[
        Path, Option("Folder to write to.", title="Folder", metavar="FOLDER", writes="")
    ] = Path("demo")
    queries: Annotated[
        int,
        Option("Number of queries to ask.", title="Number of queries", low=1, high=MOST_QUERIES),
    ] = 200
    seed: Annotated[int, Option("Seed of the city and the queries.", low=0, high=MOST_SEED)] = 0

    def run(self, reporter: Reporter) -> Result:
        """Write the city, its database, its evaluation and a map; return their files."""
        from semsig_gis.database import build_database, save_database
        from semsig_gis.evaluation import evaluate, save_evaluation
        from semsig_gis.objects import build_objects, save_objects
        from semsig_gis.output import evaluation_map, export_database, objects_map, save_map
        from semsig_gis.sources import CitySpec, paper_taxonomy, synthetic_city

        layers = synthetic_city(CitySpec(seed=self.seed))
        objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
        save_objects(objects, self.out / "objects.parquet")
        reporter.remark(f"a synthetic city with {len(objects):,} street objects")
        with reporter.progress("building") as advance:
            database = build_database(objects, progress=advance)
        save_database(database, self.out / "city.parquet")
        reporter.remark(f"its signature database: {len(database):,} cells")
        with reporter.progress("evaluating") as advance:
            evaluation = evaluate(database, queries=self.queries, seed=self.seed, progress=advance)
        save_evaluation(evaluation, self.out / "evaluation")
        with reporter.progress("drawing the map"):
            map_ = objects_map(objects, map_=evaluation_map(evaluation, database))
            offline = save_map(map_, self.out / "map.html")
        with reporter.progress("writing the GeoPackage") as advance:
            export_database(
                database,
                self.out / "city.gpkg",
                objects=objects,
                evaluation=evaluation,
                progress=advance,
            )
        names = ("objects.parquet", "city.parquet", "evaluation", "map.html", "city.gpkg")
        values: Demonstrated = {
            "objects": len(objects),
            "cells": len(database),
            "queries": self.queries,
            "files": [str(self.out / name) for name in names],
        }
        return Result(
            values=lambda: values,
            summary=self._summary(evaluation),
            files={
                "map": self.out / "map.html",
                "GeoPackage": self.out / "city.gpkg",
                "signature database": self.out / "city.parquet",
            },
            notes=online_notes(offline),
        )

    def _summary(self, evaluation: Evaluation) -> Iterator[str]:
        from semsig_gis.output import evaluation_headline

        yield evaluation_headline(evaluation)
