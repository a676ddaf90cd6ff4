"""`semsig benchmark`: methods measured on real photographs with known places."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import (
    MOST_QUERIES,
    AsJson,
    app,
    keep_inputs,
    print_json,
    print_rows,
    progress,
    require_suffix,
    say,
)
from semsig_gis.cli.learn import estimate_noise
from semsig_gis.cli.localize import LocalizeOptions, query_locator
from semsig_gis.cli.options import adapted_noise
from semsig_gis.core import LIKELIHOOD, InputError, UnknownNameError, nearest_name, percent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pandas as pd

    from semsig_gis.database import City
    from semsig_gis.evaluation import Photograph, PhotographData
    from semsig_gis.localization import Locator


@dataclass(frozen=True, kw_only=True)
class _Task:
    """What a method may use: the data, its folder, city and views, --noise, a scratch folder."""

    data: PhotographData
    folder: Path
    city: City
    noise: Path | None
    scratch: Path
    views: Mapping[str, Sequence[Photograph]]


def _learnt(task: _Task) -> dict[str, Any]:
    """Return the options for errors of the detector that are learnt from views of other places."""
    if task.noise is not None:
        return {"noise": str(task.noise)}
    if task.data.learning is None:
        raise InputError(
            "the data set has no views of other places to learn from; give --noise, or other "
            "--methods."
        )
    from dataclasses import replace

    from semsig_gis.localization import read_samples, save_noise

    database = task.city.database
    samples = read_samples(
        task.folder / task.data.learning, taxonomy=database.taxonomy, radius=database.spec.radius
    )
    with progress("learning"):
        estimate = estimate_noise(task.city, samples, None)
    path = task.scratch / "learned.toml"
    spec = replace(estimate.spec, position_sigma=0.0, name=path.stem)
    save_noise(replace(estimate, spec=spec).noise, path)
    return {"noise": str(path)}


def _adapted(task: _Task) -> dict[str, Any]:
    """Return the options for errors of the detector that are learnt from the measured views."""
    from semsig_gis.localization import save_noise

    (first, *_) = task.views.values()
    views = [photograph.view for photograph in first]
    path = task.scratch / "adapted.toml"
    save_noise(adapted_noise(task.city, views, "photo", None, "known"), path)
    return {"noise": str(path)}


METHODS: Mapping[str, Callable[[_Task], dict[str, Any]]] = {
    "paper": lambda _: {"paper": True},
    "default": lambda _: {},
    "generic": lambda _: {"noise": "generic"},
    "adapted": _adapted,
    "learned": _learnt,
}
"""The options of `semsig localize` for each method."""


@app.command()
def benchmark(
    data: Annotated[
        str, typer.Argument(metavar="DATA", help="Data set: flatlandia or london-lights.")
    ],
    folder: Annotated[Path, typer.Argument(help="Folder with the files of the data set.")],
    *,
    out: Annotated[Path | None, typer.Option(help="Results to write (.json).")] = None,
    methods: Annotated[
        str,
        typer.Option(
            help="Methods with commas between them; --out has the worst failures of the last one."
        ),
    ] = ",".join(METHODS),
    noise: Annotated[
        Path | None,
        typer.Option(
            help="Noise model of the method learned, written by `semsig learn`; default: learn it."
        ),
    ] = None,
    radius: Annotated[
        float, typer.Option(min=0.01, max=6000, help="Visibility range in metres.")
    ] = 60.0,
    limit: Annotated[
        int | None, typer.Option(min=1, max=MOST_QUERIES, help="Use at most this many views a set.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure methods on real photographs with known places."""
    from semsig_gis.evaluation import (
        PHOTOGRAPHS,
        build_photographed_city,
        read_photographs,
        score_photographs,
    )
    from semsig_gis.storage import write_json

    require_suffix(".json", out)
    keep_inputs(out, read=(noise, *(folder.iterdir() if folder.is_dir() else ())))
    files = PHOTOGRAPHS[_known(data, PHOTOGRAPHS, "data set")]
    names = [_known(name.strip(), METHODS, "method") for name in methods.split(",")]
    with tempfile.TemporaryDirectory(prefix="semsig-") as name:
        scratch = Path(name)
        with progress("building"):
            city = build_photographed_city(files, folder, scratch / "city.parquet", radius=radius)
        sets = {
            name: read_photographs(
                folder / file, taxonomy=city.database.taxonomy, radius=radius, limit=limit
            )
            for name, file in files.views.items()
        }
        task = _Task(data=files, folder=folder, city=city, noise=noise, scratch=scratch, views=sets)
        locators = {name: _locator(name, task) for name in names}
        with progress("locating") as advance:
            scored = score_photographs(locators, sets, progress=advance)
        settings: dict[str, Any] = {
            "data": data,
            "radius": radius,
            "cells": len(city.database),
            "limit": limit,
        }
        settings["classes"] = city.database.taxonomy.to_list()
        with progress("explaining failures"):
            result = settings | _result(scored, locators, sets, city)
    if out is not None:
        write_json(out, result)
    if as_json:
        print_json(result)
        return
    _print(result["table"])
    if out is not None:
        say(f"results: {out}")


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
    from semsig_gis.localization import Method
    from semsig_gis.observation import GRID_NORTH

    options = LocalizeOptions(database=task.city.path, queries=method, **METHODS[method](task))
    ranking = None if options.ranking == LIKELIHOOD else Method.parse(options.ranking)
    return query_locator(options, task.city, ranking, GRID_NORTH)


def _result(
    scored: pd.DataFrame, locators: Mapping[str, Locator[Any]], sets: Mapping[str, Any], city: City
) -> dict[str, Any]:
    """Return the tables of the result as values for JSON."""
    from semsig_gis.evaluation import (
        photograph_calibration,
        photograph_failures,
        photograph_table,
        plain_records,
    )
    from semsig_gis.localization import LikelihoodLocator

    method, locator = list(locators.items())[-1]
    failures = {}
    if isinstance(locator, LikelihoodLocator):
        rows = photograph_failures(scored, locator, sets, city, method=method)
        failures = {"failures": {"method": method, "views": rows}}
    return {
        "table": plain_records(photograph_table(scored)),
        "calibration": plain_records(photograph_calibration(scored)),
        **failures,
    }


SHARES = ("p5", "p10", "p25", "p50", "answered", "right")
HEADER = (
    *("method", "set", "detections", "views", "5 m", "10 m", "25 m", "50 m", "answered"),
    *("right", "heading error", "Brier", "calibration error", "s per view"),
)


def _print(table: list[dict[str, Any]]) -> None:
    """Print the table of the figures."""

    def text(row: dict[str, Any], name: str, spec: str, unit: str = "") -> str:
        return "" if row[name] is None else f"{row[name]:{spec}}{unit}"

    print_rows(
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
            for row in table
        ],
    )
