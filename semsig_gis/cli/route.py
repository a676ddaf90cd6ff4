"""`semsig route`: views along a way, and where they were seen from."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import AsJson, Database, print_json, print_rows, progress
from semsig_gis.cli.localize import print_place
from semsig_gis.cli.options import (
    Day,
    Explain,
    NorthName,
    SearchOptions,
    Top,
    command,
    seen_north,
)
from semsig_gis.core import percent

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.observation import North, Route


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """The views, the way between them, and which database is asked."""

    database: Database
    views: Annotated[
        str,
        typer.Argument(
            help="Views in their order: a CSV or JSON lines file, or - for JSON lines from "
            "standard input. Each after the first has its step from the one before, dx,dy or "
            "distance,bearing (metres, degrees), and the sigma of that step; or use --track."
        ),
    ]
    track: Annotated[
        Path | None,
        typer.Option(
            help="GPX track of the route, matched by the time of each view, or with one point "
            "for each view."
        ),
    ] = None
    north: NorthName = "grid"
    date: Day = None

    def read(self, city: City, north: North) -> Route:
        """Return the views with their names, and the legs between them."""
        from semsig_gis.observation import parse_route, read_route, read_track

        dataset = city.dataset
        way: dict[str, Any] = {
            "taxonomy": dataset.taxonomy,
            "radius": dataset.spec.radius,
            "north": north,
            "track": None if self.track is None else read_track(self.track, crs=dataset.crs),
        }
        if self.views == "-":
            return parse_route(sys.stdin.buffer, "standard input", **way)
        return read_route(self.views, **way)


@dataclass(frozen=True, kw_only=True)
class RouteOptions(SearchOptions, ViewOptions):
    """The options of `semsig route`."""

    top: Top = 10
    explain: Explain = False
    as_json: AsJson = False


@command(RouteOptions)
def route(options: RouteOptions) -> None:
    """Find where the views of a route were seen from."""
    from semsig_gis.database import open_city

    city = open_city(options.database)
    north = seen_north(city, options.north, options.date)
    views, legs = options.read(city, north)
    locator = options.locator(city, north, top=options.top, explain=options.explain)
    with progress(f"answering {len(views):,} views"):
        locations = locator.locate_route([query for _, query in views], legs)
    answers = [
        {"id": name, **location.to_dict()}
        for (name, _), location in zip(views, locations, strict=True)
    ]
    if options.as_json:
        for answer in answers:
            print_json(answer, indent=None)
        return
    print_rows(
        f"{len(answers)} views of {city.path.name}",
        ("view", "x", "y", "lon", "lat", "± m", "chance", "answered"),
        [
            [
                answer["id"],
                *(f"{answer['place'][axis]:.1f}" for axis in ("x", "y")),
                *(f"{answer['place'][axis]:.6f}" for axis in ("lon", "lat")),
                f"{answer['place']['sigma']:.1f}",
                percent(answer["place"]["chance"]),
                "yes" if answer["answered"] else "cannot tell",
            ]
            for answer in answers
        ],
    )
    print_place(answers[-1])
