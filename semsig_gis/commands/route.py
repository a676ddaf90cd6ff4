"""`semsig route`: find the places of views along a route."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semsig_gis.commands.model import SAW, Option, Reporter, Result, command
from semsig_gis.commands.options import (
    Database,
    Day,
    Explain,
    NorthName,
    SearchOptions,
    Top,
    query_north,
)

if TYPE_CHECKING:
    from semsig_gis.database import City
    from semsig_gis.observation import North
    from semsig_gis.observation import Route as Views


@dataclass(frozen=True, kw_only=True)
class _Views:
    """The fields for the database, the views and the steps between them."""

    database: Database
    views: Annotated[
        str,
        Option(
            "Views in their order: a CSV or JSON lines file, or - for JSON lines from "
            "standard input. Each after the first has the step from the previous view, dx,dy or "
            "distance,bearing (metres, degrees), and its sigma; or use --track.",
            title="Views",
            metavar="FILE|-",
            positional=True,
            reads=True,
        ),
    ]
    track: Annotated[
        Path | None,
        Option(
            "GPX track of the route, matched by the time of each view, or with one point "
            "for each view.",
            title="GPX track",
            reads=True,
            panel=SAW,
        ),
    ] = None
    north: NorthName = "grid"
    date: Day = None


@command(
    "route",
    title="Localize a route",
    group="Ask",
    order=4,
    returns="semsig_gis.output:RouteRecord",
    examples=(
        "semsig route city.parquet views.jsonl",
        "semsig route city.parquet views.jsonl --track walk.gpx",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Route(SearchOptions, _Views):
    """Find where the views of a route were seen from."""

    top: Top = 10
    explain: Explain = False

    def run(self, reporter: Reporter) -> Result:
        """Answer the views together."""
        from semsig_gis.database import open_city
        from semsig_gis.output import route_summary

        city = open_city(self.database)
        north = query_north(city, self.north, self.date)
        views, legs = self._read(city, north)
        locator = self.locator(city, reporter, north, top=self.top, explain=self.explain)
        with reporter.progress(f"answering {len(views):,} views"):
            locations = locator.locate_route([query for _, query in views], legs)
        names = [name for name, _ in views]

        def values() -> Iterator[dict[str, Any]]:
            for name, location in zip(names, locations, strict=True):
                yield {"id": name, **location.to_dict()}

        return Result(
            values=values, summary=route_summary(city.path.name, names, locations), stream=True
        )

    def _read(self, city: City, north: North) -> Views:
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
