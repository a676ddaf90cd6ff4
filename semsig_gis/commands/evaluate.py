"""`semsig evaluate`: how well queries from known places are located."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from semsig_gis.commands.model import Option, Reporter, Result, command, command_line
from semsig_gis.commands.options import (
    MOST_QUERIES,
    Database,
    DriftReport,
    MapAge,
    MethodText,
    NoiseName,
    Paper,
    Seed,
    SurelyHere,
    chosen_method,
    city_name,
    read_noise,
)
from semsig_gis.core import LIKELIHOOD, InputError, Table, percent

if TYPE_CHECKING:
    import pandas as pd

    from semsig_gis.database import City
    from semsig_gis.evaluation import Evaluation, EvaluationRecord, QueryDistortion
    from semsig_gis.localization import LikelihoodIndex, Method


@command(
    "evaluate",
    title="Evaluate",
    group="Measure",
    order=1,
    returns="semsig_gis.evaluation:EvaluationRecord",
    examples=(
        "semsig evaluate city.parquet --out results --report report.html",
        "semsig evaluate city.parquet --distortion light --queries 100",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Measure how often, and how closely, queries from known places are located."""

    database: Database
    queries: Annotated[
        int,
        Option("Number of queries to ask.", title="Number of queries", low=1, high=MOST_QUERIES),
    ] = 500
    distortion: Annotated[
        str,
        Option(
            "Distort queries: none, light, medium or strong, or several, such as "
            "medium,compass:10,view:90.",
            metavar="NAME,...",
        ),
    ] = "medium"
    keep_order: Annotated[
        bool,
        Option(
            "Do not sort the objects again after the bearing noise.",
            title="Keep the order of the objects",
            advanced=True,
        ),
    ] = False
    false_class: Annotated[
        Literal["uniform", "frequency"] | None,
        Option(
            "How the class of a false object is drawn.",
            title="Class of false objects",
            default="uniform",
            advanced=True,
        ),
    ] = None
    method: MethodText = None
    paper: Paper = False
    noise: NoiseName = "generic"
    map_age: MapAge = 0.0
    drift_report: DriftReport = None
    surely_here: SurelyHere = False
    foreign: Annotated[
        Path | None,
        Option(
            "Database of another city: also count how many of its views are answered, which "
            "is wrong for all of them.",
            title="Database of another city",
            reads=True,
            advanced=True,
        ),
    ] = None
    top: Annotated[
        int,
        Option(
            "Count the best of this many candidates (t).",
            title="Candidates that count",
            low=1,
            high=MOST_QUERIES,
            advanced=True,
        ),
    ] = 1
    seed: Seed = 0
    out: Annotated[
        Path | None,
        Option(
            "Folder to write the results to.",
            title="Folder for the results",
            metavar="FOLDER",
            writes="",
        ),
    ] = None
    report: Annotated[
        Path | None,
        Option(
            "Write a page with curves, a map and the worst failures (.html).",
            title="Report page",
            writes=".html",
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the results and the report; return the figures."""
        ranking = chosen_method(self.method, paper=self.paper)
        if ranking != LIKELIHOOD:
            self._refuse_likelihood(ranking)
        from semsig_gis.database import open_city
        from semsig_gis.evaluation import (
            evaluate,
            foreign_answers,
            plain_records,
            save_evaluation,
        )

        if self.report is not None:  # if matplotlib is missing, fail before the work
            from semsig_gis.output import evaluation_page, write_page
        chain = self._chain()
        city = open_city(self.database)
        measured = self._method(city, ranking)
        with reporter.progress("evaluating") as advance:
            evaluation = evaluate(
                city.database,
                queries=self.queries,
                method=measured,
                distortion=chain,
                top=self.top,
                seed=self.seed,
                surely_here=self.surely_here,
                progress=advance,
            )
        others = None if self.foreign is None else open_city(self.foreign).database
        foreign = None if others is None else foreign_answers(evaluation, city.database, others)
        if self.out is not None:
            save_evaluation(evaluation, self.out)
        if self.report is not None:
            with reporter.progress("drawing the report"):
                page = evaluation_page(
                    evaluation,
                    city.database,
                    name=city_name(self.database),
                    command=command_line(self),
                )
                write_page(page, self.report)

        def values() -> EvaluationRecord:
            summary = evaluation.summary()
            return summary if foreign is None else {**summary, "foreign": plain_records(foreign)}

        files = {"results": self.out, "report": self.report}
        return Result(
            values=values,
            summary=self._summary(evaluation, foreign),
            tables=self._tables(evaluation, foreign),
            files={what: path for what, path in files.items() if path is not None},
        )

    def _refuse_likelihood(self, ranking: str) -> None:
        """Raise InputError for an option that works only with the likelihood method."""
        likelihood_options = {
            "--noise": self.noise != "generic",
            "--map-age": self.map_age,
            "--drift-report": self.drift_report,
            "--surely-here": self.surely_here,
            "--foreign": self.foreign,
        }
        for option in (name for name, value in likelihood_options.items() if value):
            raise InputError(
                f"{option} works only with the likelihood method, not with {ranking!r}; leave it "
                "out."
            )

    def _chain(self) -> list[QueryDistortion]:
        """Return the steps of the distortion."""
        from semsig_gis.evaluation import Distortion, parse_chain

        return [
            replace(
                step,
                resort=step.resort and not self.keep_order,
                false_class=self.false_class or step.false_class,
            )
            if isinstance(step, Distortion)
            else step
            for step in parse_chain(self.distortion)
        ]

    def _method(self, city: City, ranking: str) -> LikelihoodIndex | Method:
        from semsig_gis.localization import Method, build_index

        if ranking != LIKELIHOOD:
            return Method.parse(ranking)
        noise = read_noise(
            self.noise, city.database, map_age=self.map_age, drift_report=self.drift_report
        )
        return build_index(city.database, noise)

    def _summary(self, evaluation: Evaluation, foreign: pd.DataFrame | None) -> Iterator[str]:
        from semsig_gis.output import evaluation_headline

        yield evaluation_headline(evaluation)
        if foreign is not None:
            number = int(foreign["foreign"].sum())
            answered = (foreign["foreign"] * foreign["answered_foreign"]).sum() / number
            yield f"Of {number:,} views of the other city, {percent(answered, 1)} were answered."

    def _tables(self, evaluation: Evaluation, foreign: pd.DataFrame | None) -> Iterator[Table]:
        from semsig_gis.output import evaluation_tables

        yield from evaluation_tables(evaluation)
        if foreign is not None:
            yield Table.of(
                "Views of this city and of another",
                ("objects in the view", "own", "answered", "foreign", "answered"),
                foreign.round(3).astype(object).fillna("").to_numpy().tolist(),
            )
