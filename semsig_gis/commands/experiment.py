"""`semsig experiment`: the evaluations of an experiment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import Scheduler, Workers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from semsig_gis.evaluation import Evaluation


@command(
    "experiment",
    title="Run an experiment",
    group="Research",
    order=1,
    returns="semsig_gis.evaluation:ExperimentRecord",
    examples=(
        "semsig experiment methods.toml --out results",
        "semsig experiment methods.toml --out results --workers 4",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Run the evaluations of an experiment, or resume them."""

    spec: Annotated[
        Path, Option("Experiment, a .toml file.", title="Experiment", positional=True, reads=True)
    ]
    out: Annotated[
        Path,
        Option(
            "Folder to write the results to.",
            title="Folder for the results",
            metavar="FOLDER",
            writes="",
        ),
    ]
    workers: Workers = 0
    scheduler: Scheduler = None

    def run(self, reporter: Reporter) -> Result:
        """Write the results; return the figures of each evaluation by its name."""
        from semsig_gis.evaluation import experiment_tables, open_experiment_spec, run_experiment

        spec = open_experiment_spec(self.spec)
        with reporter.progress("answering") as advance:
            results = run_experiment(
                spec,
                self.out,
                folder=self.spec.parent,
                workers=self.workers,
                scheduler=self.scheduler,
                progress=advance,
            )

        return Result(
            values=lambda: {name: item.summary() for name, item in results.items()},
            summary=self._summary(results),
            tables=experiment_tables(spec, results),
            files={"results": self.out},
        )

    def _summary(self, results: Mapping[str, Evaluation]) -> Iterator[str]:
        from semsig_gis.output import evaluation_headline

        name, best = max(results.items(), key=lambda pair: pair[1].means()["value"]["p50"])
        yield f"The best of {len(results):,} evaluations is {name}. {evaluation_headline(best)}"
