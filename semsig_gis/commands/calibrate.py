"""`semsig calibrate`: the rule for when a place is given as an answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semsig_gis.commands.learn import SAMPLES, read_grid_samples, sample_places
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import (
    Database,
    Day,
    DriftReport,
    Heading,
    MapAge,
    NoiseName,
    NorthName,
    Objects,
    OnGrid,
    Refine,
    SearchOptions,
    query_north,
)
from semsig_gis.core import percent

if TYPE_CHECKING:
    from semsig_gis.localization import AnswerRule


@command(
    "calibrate",
    title="Calibrate the answers",
    group="Measure",
    order=5,
    returns="semsig_gis.localization:RuleRecord",
    examples=(
        "semsig calibrate city.parquet --samples known.csv --out rule.json",
        "semsig calibrate city.parquet --samples known.csv --out rule.json --refine",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Calibrate:
    """Choose from which chance on a place is given as an answer."""

    database: Database
    samples: Annotated[Path, SAMPLES]
    out: Annotated[
        Path,
        Option(
            "Rule to write (.json), for --rule.", title="Rule for answers", writes=(".json", "")
        ),
    ]
    precision: Annotated[
        float,
        Option("Share of the answers that should be right.", low=0.01, high=0.9999),
    ] = 0.98
    noise: NoiseName = "generic"
    map_age: MapAge = 0.0
    drift_report: DriftReport = None
    heading: Heading = "known"
    north: NorthName = "grid"
    date: Day = None
    on_grid: OnGrid = False
    refine: Refine = None
    objects: Objects = None

    def run(self, reporter: Reporter) -> Result:
        """Write the rule; return it."""
        import numpy as np

        from semsig_gis.database import open_city
        from semsig_gis.localization import calibrate, save_rule

        city = open_city(self.database)
        north = query_north(city, self.north, self.date)
        samples = read_grid_samples(self.samples, city, north)
        locator = SearchOptions(
            noise=self.noise,
            map_age=self.map_age,
            drift_report=self.drift_report,
            heading=self.heading,
            on_grid=self.on_grid,
            refine=self.refine,
            objects=self.objects,
        ).locator(city, reporter)
        radius = locator.rule.radius
        masses, errors = np.zeros(len(samples)), np.full(len(samples), np.inf)
        places = sample_places(city.database, samples)
        with reporter.progress("answering") as advance:
            for number, sample in enumerate(samples):
                if len(sample.signature):  # a view of nothing has no answer
                    location = locator.locate(sample.signature)
                    masses[number] = location.answer.mass
                    position = location.estimate.x, location.estimate.y
                    errors[number] = math.dist(position, places[number])
                advance(number + 1, len(samples))
        rule = calibrate(masses, errors <= radius, precision=self.precision, radius=radius)
        save_rule(rule, self.out)
        return Result(values=rule.to_dict, summary=[self._sentence(rule)], files={"rule": self.out})

    def _sentence(self, rule: AnswerRule) -> str:
        share = percent(self.precision, 0)
        if not rule.answered:
            return (
                f"These {rule.queries:,} samples do not prove for any chance that {share} of the "
                "answers are right, so nothing is answered; give more samples, or a lower "
                "--precision."
            )
        return (
            f"Answers from a chance of {rule.threshold:.4f} that the place is within "
            f"{rule.radius:g} m: {rule.answered:,} of {rule.queries:,} samples "
            f"({percent(rule.coverage, 1)}) are answered, {rule.wrong:,} of them wrongly; {share} "
            f"are right with a confidence of {percent(rule.confidence, 0)}."
        )
