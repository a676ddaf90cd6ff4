"""`semsig benchmark`: methods measured on real photographs with known places."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semsig_gis.commands.learn import learnt_noise
from semsig_gis.commands.localize import Localize
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.commands.options import MOST_QUERIES, adapted_noise
from semsig_gis.core import InputError, Table, UnknownNameError, nearest_name, percent

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.evaluation import Photograph, PhotographData, PhotographRecord
    from semsig_gis.localization import Locator, Noise


@dataclass(frozen=True, kw_only=True)
class _Task:
    """What a method may use: the data, its folder, city and views, --noise, a scratch folder."""

    data: PhotographData
    folder: Path
    city: City
    noise: Path | None
    scratch: Path
    views: Mapping[str, Sequence[Photograph]]
    reporter: Reporter

    def saved(self, noise: Noise) -> dict[str, Any]:
        """Return the options of `semsig localize` for a noise model, which is written."""
        from semsig_gis.localization import save_noise

        path = self.scratch / f"{noise.name}.toml"
        save_noise(noise, path)
        return {"noise": str(path)}


def _learned(task: _Task) -> dict[str, Any]:
    """Return the options for errors of the detector that are learnt from views of other places."""
    if task.noise is not None:
        return {"noise": str(task.noise)}
    if task.data.learning is None:
        raise InputError(
            "the data set has no views of other places to learn from; give --noise, or other "
            "--methods."
        )
    from semsig_gis.localization import read_samples

    database = task.city.database
    samples = read_samples(
        task.folder / task.data.learning, taxonomy=database.taxonomy, radius=database.spec.radius
    )
    return task.saved(learnt_noise(task.city, samples, task.reporter, name="learned").noise)


def _adapted(task: _Task) -> dict[str, Any]:
    """Return the options for errors of the detector that are learnt from the measured views."""
    (first, *_) = task.views.values()
    views = [photograph.view for photograph in first]
    noise = adapted_noise(
        task.city, views, "photo", objects=None, heading="known", reporter=task.reporter
    )
    return task.saved(noise)


METHODS: Mapping[str, Callable[[_Task], dict[str, Any]]] = {
    "paper": lambda _: {"paper": True},
    "default": lambda _: {},
    "generic": lambda _: {"noise": "generic"},
    "adapted": _adapted,
    "learned": _learned,
}
"""The options of `semsig localize` for each method."""


@command(
    "benchmark",
    title="Benchmark on photographs",
    group="Research",
    order=2,
    returns="semsig_gis.evaluation:PhotographRecord",
    examples=(
        "semsig benchmark flatlandia photos --out figures.json",
        "semsig benchmark london-lights photos --methods default --limit 50",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """Measure methods on real photographs with known places."""

    data: Annotated[
        str,
        Option("Data set: flatlandia or london-lights.", title="Data set", positional=True),
    ]
    folder: Annotated[
        Path,
        Option(
            "Folder with the files of the data set.", metavar="FOLDER", positional=True, reads=True
        ),
    ]
    out: Annotated[
        Path | None, Option("Results to write (.json).", title="Results", writes=".json")
    ] = None
    methods: Annotated[
        str,
        Option(
            "Methods with commas between them; --out has the worst failures of the last one.",
            metavar="NAME,...",
        ),
    ] = ",".join(METHODS)
    noise: Annotated[
        Path | None,
        Option(
            "Noise model of the method learned, written by `semsig learn`.",
            title="Noise model",
            default="learn it",
            reads=True,
        ),
    ] = None
    radius: Annotated[
        float,
        Option("Visibility range.", title="Visibility range", unit="m", low=0.01, high=6000),
    ] = 60.0
    limit: Annotated[
        int | None,
        Option("Use at most this many views a set.", title="Most views", low=1, high=MOST_QUERIES),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the figures and the worst failures; return them."""
        from semsig_gis.evaluation import (
            PHOTOGRAPHS,
            build_photographed_city,
            photograph_calibration,
            photograph_failures,
            photograph_table,
            plain_records,
            read_photographs,
            score_photographs,
        )
        from semsig_gis.localization import LikelihoodLocator
        from semsig_gis.storage import write_json

        self._keep_data()
        data = PHOTOGRAPHS[_known(self.data, PHOTOGRAPHS, "data set")]
        names = [_known(name.strip(), METHODS, "method") for name in self.methods.split(",")]
        with tempfile.TemporaryDirectory(prefix="semsig-") as name:
            scratch = Path(name)
            with reporter.progress("building"):
                city = build_photographed_city(
                    data, self.folder, scratch / "city.parquet", radius=self.radius
                )
            sets = {
                name: read_photographs(
                    self.folder / file,
                    taxonomy=city.database.taxonomy,
                    radius=self.radius,
                    limit=self.limit,
                )
                for name, file in data.views.items()
            }
            task = _Task(
                data=data,
                folder=self.folder,
                city=city,
                noise=self.noise,
                scratch=scratch,
                views=sets,
                reporter=reporter,
            )
            locators = {name: _locator(name, task) for name in names}
            with reporter.progress("locating") as advance:
                scored = score_photographs(locators, sets, progress=advance)
            result: PhotographRecord = {
                "data": self.data,
                "radius": self.radius,
                "cells": len(city.database),
                "limit": self.limit,
                "classes": city.database.taxonomy.to_list(),
                "table": plain_records(photograph_table(scored)),
                "calibration": plain_records(photograph_calibration(scored)),
            }
            method, locator = list(locators.items())[-1]
            if isinstance(locator, LikelihoodLocator):
                with reporter.progress("explaining failures"):
                    failures = photograph_failures(scored, locator, sets, city, method=method)
                result["failures"] = {"method": method, "views": failures}
        if self.out is not None:
            write_json(self.out, result)
        return Result(
            values=lambda: result,
            summary=[_table(result["table"])],
            files={} if self.out is None else {"results": self.out},
        )

    def _keep_data(self) -> None:
        """Raise InputError if a file of the data set would be overwritten."""
        if self.out is not None and self.folder.is_dir():
            files = {path.resolve() for path in self.folder.iterdir()}
            if self.out.resolve() in files:
                raise InputError(
                    f"{self.out} would be written, but this command uses it for something else as "
                    "well; give another name."
                )


def _known(name: str, names: Mapping[str, Any], what: str) -> str:
    """Return a name, or raise UnknownNameError if it is not one of some names."""
    if name not in names:
        raise UnknownNameError(
            f"{what} {name!r} is unknown{nearest_name(name, names)}; give one of "
            f"{', '.join(names)}."
        )
    return name


def _locator(method: str, task: _Task) -> Locator[Any]:
    """Return the locator of a method, as `semsig localize` makes it."""
    from semsig_gis.observation import GRID_NORTH

    request = Localize(database=task.city.path, **METHODS[method](task))
    return request.query_locator(task.city, task.reporter, GRID_NORTH)


SHARES = ("p5", "p10", "p25", "p50", "answered", "right")
HEADER = (
    *("method", "set", "detections", "views", "5 m", "10 m", "25 m", "50 m", "answered"),
    *("right", "heading error", "Brier", "calibration error", "s per view"),
)


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table of the figures."""

    def text(row: Mapping[str, Any], name: str, form: str, unit: str = "") -> str:
        return "" if row[name] is None else f"{row[name]:{form}}{unit}"

    return Table.of(
        "Real photographs",
        HEADER,
        [
            [
                *(row[name] for name in ("method", "set", "detections", "n")),
                *("" if row[name] is None else percent(row[name], 0) for name in SHARES),
                text(row, "heading_error", ".1f", "°"),
                text(row, "brier", ".3f"),
                text(row, "calibration_error", ".3f"),
                text(row, "seconds", ".3f"),
            ]
            for row in rows
        ],
        minor=("5 m", "10 m", "heading error", "Brier", "calibration error", "s per view"),
    )
