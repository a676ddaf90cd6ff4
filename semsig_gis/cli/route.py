"""`semsig route`: find the places of views along a route."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from semsig_gis.cli.console import AsJson, Database, print_json, print_tables, progress
from semsig_gis.cli.options import (
    Day,
    Explain,
    NorthName,
    SearchOptions,
    Top,
    command,
    query_north,
)

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.observation import North, Route


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Options for the database, the views and the steps between them."""

    database: Database
    views: Annotated[
        str,
        typer.Argument(
            help="Views in their order: a CSV or JSON lines file, or - for JSON lines from "
            "standard input. Each after the first has the step from the previous view, dx,dy or "
            "distance,bearing (metres, degrees), and its sigma; or use --track."
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
        """Return the views with their names, and the steps between them."""
        from semsig_gis.observation import parse_route, read_route, read_track

        dataset = city.dataset
        settings: dict[str, Any] = {
            "taxonomy": dataset.taxonomy,
            "radius": dataset.spec.radius,
            "north": north,
            "track": None if self.track is None else read_track(self.track, crs=dataset.crs),
        }
        if self.views == "-":
            return parse_route(sys.stdin.buffer, "standard input", **settings)
        return read_route(self.views, **settings)


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
    from semsig_gis.output import route_tables

    city = open_city(options.database)
    north = query_north(city, options.north, options.date)
    views, legs = options.read(city, north)
    locator = options.locator(city, north, top=options.top, explain=options.explain)
    with progress(f"answering {len(views):,} views"):
        locations = locator.locate_route([query for _, query in views], legs)
    names = [name for name, _ in views]
    if options.as_json:
        for name, location in zip(names, locations, strict=True):
            print_json({"id": name, **location.to_dict()}, indent=None)
        return
    print_tables(route_tables(city.path.name, names, locations))
