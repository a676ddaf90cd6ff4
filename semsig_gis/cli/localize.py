"""`semsig localize`: queries, and where they were seen from."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.app import (
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
from semsig_gis.cli.console import print_json, print_rows, progress
from semsig_gis.cli.maps import draw_ground
from semsig_gis.cli.options import Heading, NoiseName, Objects, OnGrid, Refine, locator
from semsig_gis.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semsig_gis.core.signature import Signature
    from semsig_gis.core.taxonomy import Taxonomy
    from semsig_gis.database.answer import Answer, Locator
    from semsig_gis.database.city import City
    from semsig_gis.database.database import SignatureDatabase
    from semsig_gis.likelihood.locate import LikelihoodLocator, Location
    from semsig_gis.likelihood.route import Leg
    from semsig_gis.matching.search import Localization
    from semsig_gis.queries.file import Queries, Route


VERDICTS = ("matched", "misnamed", "missed", "false")


def print_answer(result: dict[str, Any]) -> None:
    """Print an answer, as its `to_dict` gives it."""
    by_chance = "noise" in result
    said = f"likelihood ({result['noise']} noise)" if by_chance else result["used"]
    score = "chance" if by_chance else "distance"
    candidates = result["candidates"]
    print_rows(
        f"{len(candidates)} best of {result['cells']:,} cells, by {said}",
        ("rank", "cell", "x", "y", "lon", "lat", score, "types"),
        (
            [
                row["rank"] if by_chance else _rank_text(row["rank_low"], row["rank_high"]),
                row["cell_id"],
                f"{row['x']:.1f}",
                f"{row['y']:.1f}",
                f"{row['lon']:.6f}",
                f"{row['lat']:.6f}",
                f"{row[score]:.4f}",
                row["types"],
            ]
            for row in candidates
        ),
    )
    if by_chance:
        _print_explanations(candidates)
        _print_place(result)
    elif result["tied_beyond"]:
        tied = result["tied_beyond"]
        more = "1 further cell ties" if tied == 1 else f"{tied:,} further cells tie"
        typer.echo(f"{more} with the last one.")


def _print_place(result: dict[str, Any]) -> None:
    place, region = result["place"], result["region"]
    where = f"{place['lat']:.6f}, {place['lon']:.6f} (lat, lon)"
    chance = f"within {place['within_m']:g} m of it with a chance of {place['chance']:.1%}"
    if result["answered"]:
        typer.echo(f"{where}, {chance}.")
    else:
        typer.echo(f"Cannot tell: the best place is {where}, {chance}.")
    ellipse = place["ellipse_90"]
    typer.echo(
        f"If there, at x {place['x']:.1f}, y {place['y']:.1f}, give or take {place['sigma']:.1f} m "
        f"(90%: {ellipse['longer']:.1f} m along {ellipse['bearing']:.0f}°, "
        f"{ellipse['shorter']:.1f} m across)."
    )
    if place["heading"] is not None:
        typer.echo(
            f"The north of the query lies at {place['heading'] % 360.0:.1f}°, give or take "
            f"{place['heading_sigma']:.1f}°."
        )
    typer.echo(
        f"{region['share']:.0%} of the chance is in {region['cells']:,} "
        f"cell{'' if region['cells'] == 1 else 's'} "
        f"({_area_text(region['km2'])})."
    )


def _area_text(km2: float) -> str:
    return f"{km2:.3f} km²" if km2 >= 0.1 else f"{km2 * 1e6:,.0f} m²"  # noqa: PLR2004 - 10 ha


def _print_explanations(candidates: list[dict[str, Any]]) -> None:
    """Print the objects of the best candidate, and the counts of the others."""
    for row in candidates:
        if "explanation" not in row:
            break
        why = row["explanation"]
        counts = ", ".join(f"{why['counts'][verdict]} {verdict}" for verdict in VERDICTS)
        title = f"Rank {row['rank']}, at x {why['x']:.1f}, y {why['y']:.1f}: {counts}"
        if row["rank"] > 1:
            typer.echo(title)
            continue
        print_rows(
            title,
            (
                "verdict",
                "chance",
                "seen",
                "at",
                "object",
                "at",
                "off by",
                "distance",
                "source",
                "id",
            ),
            (
                [
                    one["verdict"],
                    f"{one['chance']:.2f}",
                    one["query_class"] or "",
                    _measure(one["query_bearing"], "°"),
                    one["object_class"] or "",
                    _measure(one["object_bearing"], "°"),
                    _measure(one["bearing_error"], "°", sign="+"),
                    _measure(one["distance"], " m"),
                    one["source"] or "",
                    one["source_id"] or "",
                ]
                for one in sorted(why["rows"], key=lambda one: VERDICTS.index(one["verdict"]))
            ),
        )


def _measure(value: float | None, unit: str, *, sign: str = "") -> str:
    return "" if value is None else f"{value:{sign}.1f}{unit}"


def _rank_text(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"


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
    from semsig_gis.database.city import open_city

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
    city = open_city(database)
    taxonomy = city.database.taxonomy
    # Before the index, which takes much longer than to find a slip in a query.
    views = _views(str(queries), taxonomy) if route else None
    asked = [] if route else _asked(taxonomy, queries, types, bearings)
    ready = locator(
        city,
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
        located = _Answerer(city, taxonomy, ready, top, _draw_location)
        _answer(located, asked, files, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Answerer:
    """A city and what answers a query to it."""

    city: City
    taxonomy: Taxonomy
    locator: Locator[Any]
    top: int
    draw: Callable[[Any, SignatureDatabase], Any]


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
    from semsig_gis.database.city import open_city
    from semsig_gis.database.requirement import Requirement
    from semsig_gis.matching.method import Method
    from semsig_gis.matching.search import DistanceLocator

    chosen = Method.parse(method)
    city = open_city(path)
    opened = city.dataset
    wanted = None if require is None else Requirement.parse(require, opened.taxonomy)
    found = DistanceLocator(database=opened, method=chosen, requirement=wanted, top=top)
    return _Answerer(city, opened.taxonomy, found, top, _draw_localization)


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
    from semsig_gis.core.signature import Signature
    from semsig_gis.queries.file import parse_queries, read_queries

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
            print_json({"id": name, **answerer.locator.locate(query).to_dict()}, indent=None)
        return
    found = answerer.locator.locate(asked)
    if files.map is not None:
        _draw(answerer, found, files.map)
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
    from semsig_gis.queries.file import parse_route, read_route

    if source == "-":
        return parse_route(sys.stdin.read(), "standard input", taxonomy=taxonomy)
    return read_route(source, taxonomy=taxonomy)


def _answer_route(ready: LikelihoodLocator, views: Queries, legs: Sequence[Leg]) -> None:
    """Answer the views of a route, each given all of them."""
    found = ready.locate_route([query for _, query in views], legs)
    for (name, _), location in zip(views, found, strict=True):
        print_json({"id": name, **location.to_dict()}, indent=None)


def _write(
    answerer: _Answerer, query: Signature, found: Answer, files: _Files
) -> dict[str, Any] | None:
    """Write the regions to search, and return what there is to say of them."""
    if files.out is None:
        return None
    from semsig_gis.database.answer import REGION_SHARE
    from semsig_gis.exports import export_answer

    if found.tied_beyond:
        # No cell is left out of the search that is as good as the last candidate.
        found = answerer.locator.locate(query, top=answerer.top + found.tied_beyond)
    share = REGION_SHARE if files.share is None else files.share
    regions = export_answer(
        found, answerer.city.database, files.out, share=share, within=files.within
    )
    return None if files.holds_chances else regions.to_dict()


def _draw(answerer: _Answerer, found: Answer, out: Path) -> None:
    from semsig_gis.maps.page import save_map

    with progress("drawing the map"):
        drawn = answerer.draw(found, answerer.city.database)
        draw_ground(drawn, answerer.city)
        tell_if_online(save_map(drawn, out))


def _draw_localization(found: Localization, opened: SignatureDatabase) -> Any:  # noqa: ANN401 - folium's
    from semsig_gis.maps.localization import localization_map

    return localization_map(found, opened)


def _draw_location(found: Location, _opened: SignatureDatabase) -> Any:  # noqa: ANN401 - folium's
    from semsig_gis.maps.location import location_map

    return location_map(found)
