"""`semsig localize`: queries, and where they were seen from."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli._answers import print_answer
from semsig_gis.cli._app import (
    LIKELIHOOD,
    AsJson,
    Database,
    MethodText,
    app,
    keep_inputs,
    numbers,
    require_suffix,
    tell_if_online,
)
from semsig_gis.cli._ground import draw_ground
from semsig_gis.cli._likelihood import (
    Heading,
    NoiseName,
    Objects,
    OnGrid,
    Refine,
    locator,
)
from semsig_gis.console import print_json, progress
from semsig_gis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.cli._likelihood import Locator
    from semsig_gis.localization import Localization
    from semsig_gis.location import Location
    from semsig_gis.query_file import Queries, Route
    from semsig_gis.route import Leg
    from semsig_gis.signatures import Signature
    from semsig_gis.taxonomy import Taxonomy


@app.command()
def localize(
    database: Database,
    *,
    types: Annotated[
        str | None,
        typer.Option(help="Symbols clockwise from north, such as DDBL; ? where one is unknown."),
    ] = None,
    bearings: Annotated[
        str | None, typer.Option(help="Degrees clockwise from north, such as 10,80,200,310.")
    ] = None,
    queries: Annotated[
        str | None,
        typer.Option(
            help="Many queries: a CSV or JSON lines file with types and bearings, or - for JSON "
            "lines from standard input; the answers are JSON lines."
        ),
    ] = None,
    route: Annotated[
        bool,
        typer.Option(
            "--route",
            help="With likelihood: the lines of --queries are one route, and each after the first "
            "has dx,dy or distance,bearing (metres, degrees) from the one before, and its sigma.",
        ),
    ] = False,
    method: MethodText = "edit+edit",
    noise: NoiseName = "generic",
    heading: Heading = "known",
    on_grid: OnGrid = False,
    near: Annotated[
        str | None,
        typer.Option(help="With likelihood, the last known place: X,Y,SIGMA in metres."),
    ] = None,
    area: Annotated[
        Path | None, typer.Option(help="With likelihood: polygons that the place lies in.")
    ] = None,
    popularity: Annotated[
        Path | None,
        typer.Option(
            help="With likelihood: a raster of how likely each place is, such as of people."
        ),
    ] = None,
    require: Annotated[
        str | None,
        typer.Option(help="What a cell must see: M (one), 2B (two or more), B=0, ?<=10 (in all)."),
    ] = None,
    rule: Annotated[
        Path | None,
        typer.Option(
            help="With likelihood, when to answer: a file that `semsig calibrate` wrote; from a "
            "chance of 0.9 by default."
        ),
    ] = None,
    refine: Refine = None,
    explain: Annotated[
        bool,
        typer.Option(
            "--explain",
            help="With likelihood: tell which objects of the query are which street objects, "
            "which were missed, and which look false.",
        ),
    ] = False,
    objects: Objects = None,
    top: Annotated[int, typer.Option(help="Number of candidates.")] = 10,
    map_: Annotated[Path | None, typer.Option("--map", help="Map to write (.html).")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="What of the city must be searched: regions and candidates for QGIS (.gpkg), the "
            "regions alone (.parquet, .csv), or with likelihood the chance of every cell (.tif)."
        ),
    ] = None,
    share: Annotated[
        float | None,
        typer.Option(
            help="For --out, with likelihood: of the chance, that the regions hold; 0.9 by default."
        ),
    ] = None,
    within: Annotated[
        float, typer.Option(help="For --out: metres around these cells that are searched too.")
    ] = 0.0,
    as_json: AsJson = False,
) -> None:
    """Rank the cells of a database for a query, or for many."""
    from semsig_gis.database_file import open_database

    given = [value for value in (types, bearings, map_, out) if value is not None]
    if queries is not None and given:
        msg = (
            "--queries was given with --types, --bearings, --map or --out; give a file or one "
            "query."
        )
        raise InputError(msg)
    if out is None and (share is not None or within):
        msg = "--share and --within are for the regions of --out; give that too."
        raise InputError(msg)
    if route and queries is None:
        msg = "--route was given without --queries; give the file of its views."
        raise InputError(msg)
    keep_inputs(map_, out, read=(database, objects, area, popularity, rule, noise))
    require_suffix(".html", map_)
    files = _Files(map_, out, share, within)
    if files.holds_chances and (share is not None or within):
        msg = (
            f"{out} holds the chances of all cells, not the regions that --share and --within are "
            "for; leave them out, or write a GeoPackage."
        )
        raise InputError(msg)
    if method != LIKELIHOOD:
        _refuse_options(
            method,
            {
                "--noise": noise != "generic",
                "--heading": heading != "known",
                "--on-grid": on_grid,
                "--near": near is not None,
                "--area": area is not None,
                "--popularity": popularity is not None,
                "--rule": rule is not None,
                "--refine": refine is not None,
                "--explain": explain,
                "--objects": objects is not None,
                "--route": route,
                "--share": share is not None,
            },
        )
        ranked = _by_distance(database, method, require, top)
        asked = _asked(ranked.taxonomy, queries, types, bearings)
        _answer(ranked, asked, files, as_json=as_json)
        return
    opened = open_database(database)
    # Before the index, which takes much longer than to find a slip in a query.
    views = _views(str(queries), opened.taxonomy) if route else None
    asked = [] if route else _asked(opened.taxonomy, queries, types, bearings)
    ready = locator(
        database,
        opened,
        noise=noise,
        heading=heading,
        on_grid=on_grid,
        objects=objects,
        refine=refine,
        explain=explain,
        rule=rule,
        top=top,
        known={"near": near, "area": area, "popularity": popularity, "require": require},
    )
    if views is not None:
        _answer_route(ready, *views)
    else:
        located = _Answerer(database, opened.taxonomy, ready.locate)
        _answer(located, asked, files, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Answerer:
    """A database and what answers a query to it."""

    path: Path
    taxonomy: Taxonomy
    ask: Callable[..., Localization | Location]


@dataclass(frozen=True, slots=True)
class _Files:
    """What is written of an answer."""

    map: Path | None
    out: Path | None
    share: float | None
    within: float

    @property
    def holds_chances(self) -> bool:
        """Whether the file holds the chances of all cells, and no regions."""
        return self.out is not None and self.out.suffix.lower() in {".tif", ".tiff"}


def _by_distance(path: Path, method: str, require: str | None, top: int) -> _Answerer:
    from semsig_gis import matching
    from semsig_gis.database_file import open_database
    from semsig_gis.dataset import open_dataset
    from semsig_gis.patterns import Requirement

    chosen = matching.Method.parse(method)
    opened = open_dataset(path) if path.is_dir() else open_database(path)
    wanted = None if require is None else Requirement.parse(require, opened.taxonomy)

    def ask(query: Signature, more: int = 0) -> Localization:
        return matching.localize(opened, query, method=chosen, requirement=wanted, top=top + more)

    return _Answerer(path, opened.taxonomy, ask)


def _refuse_options(method: str, options: dict[str, bool]) -> None:
    """Refuse options that only the likelihood has."""
    given = [name for name, wanted in options.items() if wanted]
    if given:
        msg = (
            f"{' and '.join(given)} {'is' if len(given) == 1 else 'are'} for --method likelihood, "
            f"not for {method!r}; give that method, or leave out what is for it."
        )
        raise InputError(msg)


def _asked(
    taxonomy: Taxonomy, queries: str | None, types: str | None, bearings: str | None
) -> Signature | Queries:
    """Return the query, or the many with their names."""
    from semsig_gis.query_file import parse_queries, read_queries
    from semsig_gis.signatures import Signature

    if queries is None:
        angles = None if bearings is None else numbers(bearings, "--bearings")
        return Signature.parse(types, angles, taxonomy=taxonomy)
    if queries == "-":
        return parse_queries(sys.stdin.read(), "standard input", taxonomy=taxonomy)
    return read_queries(queries, taxonomy=taxonomy)


def _answer(
    answerer: _Answerer,
    asked: Signature | Queries,
    files: _Files,
    *,
    as_json: bool,
) -> None:
    """Answer a query, or many, and print it."""
    if isinstance(asked, list):
        for name, query in asked:
            print_json({"id": name, **answerer.ask(query).to_dict()}, indent=None)
        return
    found = answerer.ask(asked)
    if files.map is not None:
        _draw(found, answerer.path, files.map)
    searched = _write(answerer, asked, found, files)
    told = found.to_dict() | ({} if searched is None else {"searched": searched})
    if as_json:
        print_json(told)
        return
    print_answer(told)
    if files.map is not None:
        typer.echo(f"map: {files.map}")
    if searched is not None:
        count = searched["regions"]
        typer.echo(
            f"to search: {count:,} region{'' if count == 1 else 's'}, {searched['km2']:.4g} km2, "
            f"{searched['percent']:.3g} % of the city: {files.out}"
        )
    elif files.out is not None:
        typer.echo(f"chances: {files.out}")


def _views(source: str, taxonomy: Taxonomy) -> Route:
    """Return the views of a route with their names, and the legs between them."""
    from semsig_gis.query_file import parse_route, read_route

    if source == "-":
        return parse_route(sys.stdin.read(), "standard input", taxonomy=taxonomy)
    return read_route(source, taxonomy=taxonomy)


def _answer_route(ready: Locator, views: Queries, legs: Sequence[Leg]) -> None:
    """Answer the views of a route, each given all of them."""
    found = ready.route([query for _, query in views], legs)
    for (name, _), location in zip(views, found, strict=True):
        print_json({"id": name, **location.to_dict()}, indent=None)


def _write(
    answerer: _Answerer, query: Signature, found: Localization | Location, files: _Files
) -> dict[str, Any] | None:
    """Write the regions to search, and return what there is to say of them."""
    from semsig_gis.database_file import open_database
    from semsig_gis.exports import export_answer
    from semsig_gis.location import REGION_SHARE, Location

    if files.out is None:
        return None
    if isinstance(found, Location):
        opened = found.posterior.database
    else:
        opened = open_database(answerer.path)
        if found.tied_beyond:
            # No cell is left out of the search that is as good as the last candidate.
            found = answerer.ask(query, found.tied_beyond)
    share = REGION_SHARE if files.share is None else files.share
    regions = export_answer(found, opened, files.out, share=share, within=files.within)
    return None if files.holds_chances else regions.to_dict()


def _draw(found: Localization | Location, database: Path, out: Path) -> None:
    from semsig_gis.database_file import open_database
    from semsig_gis.localization import Localization
    from semsig_gis.map_location import location_map
    from semsig_gis.maps import localization_map, save_map

    with progress("drawing the map"):
        opened = open_database(database)
        drawn = (
            localization_map(found, opened)
            if isinstance(found, Localization)
            else location_map(found)
        )
        draw_ground(drawn, database, opened)
        tell_if_online(save_map(drawn, out))
