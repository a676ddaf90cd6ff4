"""`semsig fetch`: street objects from the services of open data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from semsig_gis.commands.load import LoadOptions, Quality, catalogs
from semsig_gis.commands.model import Option, Reporter, Result, command
from semsig_gis.core import CatalogError, EmptyResultError, InputError, SourceError, nearest_town


@command(
    "fetch",
    title="Download street objects",
    group="Prepare",
    order=2,
    returns=Quality,
    examples=(
        "semsig fetch overpass --area 7.40,43.72,7.44,43.75 --out objects.parquet",
        "semsig fetch opendata_paris --area quarter.geojson --out objects.parquet",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Fetch(LoadOptions):
    """Download the street objects of an area."""

    catalog: Annotated[
        str,
        Option(
            "Catalogue with a service, by name or .toml.",
            title="Catalogue",
            positional=True,
            reads=True,
            suggestions=catalogs,
        ),
    ]
    area: Annotated[
        str,
        Option(
            "Box in degrees, a polygon file, or the name of a place.",
            metavar="WEST,SOUTH,EAST,NORTH|FILE|PLACE",
            reads=True,
        ),
    ]
    cache: Annotated[
        Path | None,
        Option(
            "Folder of the cache.",
            title="Folder of the cache",
            metavar="FOLDER",
            default="semsig's own",
            advanced=True,
        ),
    ] = None
    offline: Annotated[bool, Option("Use the cache only.", title="Without a network")] = False
    timeout: Annotated[
        float,
        Option(
            "Give up a download after this time, all attempts together.",
            title="Time limit",
            unit="s",
            low=1,
            high=86_400,
            advanced=True,
        ),
    ] = 600.0
    server: Annotated[
        str | None,
        Option(
            "Address of a server to use instead of the catalogue's.", metavar="URL", advanced=True
        ),
    ] = None

    def run(self, reporter: Reporter) -> Result:
        """Write the street objects; return their quality report."""
        from urllib.parse import urlsplit

        from semsig_gis.objects import assemble, choose_layers
        from semsig_gis.sources import (
            advice,
            fetch_layers,
            find_area,
            load_catalog,
            open_cache,
            other_orders,
        )

        catalog = load_catalog(self.catalog)
        if self.server is not None:
            if not self.server.startswith(("http://", "https://")):
                raise InputError(
                    f"--server is {self.server!r}; give an address that begins with https://."
                )
            catalog = replace(catalog, endpoints=(self.server,))
        specs = choose_layers(
            catalog,
            self.layer or (),
            selection=self.selection,
            surroundings=self.with_ground,
        )
        store, http = open_cache(
            self.cache, offline=self.offline, deadline_s=self.timeout, remark=reporter.remark
        )
        unit: Literal["steps", "bytes"] = "bytes" if catalog.reader == "opendatasoft" else "steps"
        hosts = ", ".join(dict.fromkeys(urlsplit(url).netloc for url in catalog.endpoints))
        if not self.offline:
            layers_ = f"{len(specs)} layer{'' if len(specs) == 1 else 's'}"
            reporter.remark(
                f"asking {hosts} for {layers_} of {self.area}, attempt 1 of {http.attempts}"
            )
        with reporter.progress(f"fetching from {hosts}", unit=unit) as advance:
            place = find_area(self.area, catalog, cache=store, http=http)
            fetch = partial(
                fetch_layers,
                catalog=catalog,
                area=place,
                cache=store,
                http=http,
                filters=self.filter,
                progress=advance,
                remark=reporter.remark,
            )
            try:
                layers = fetch(specs)
            except (CatalogError, SourceError) as error:
                ground = [spec for spec in specs if spec.role != "objects"]
                explicit = self.buildings is not None or self.streets is not None
                if explicit or not any(f"layer {spec.name!r}" in str(error) for spec in ground):
                    raise
                reporter.remark(f"without buildings and streets: {error}")
                layers = fetch([spec for spec in specs if spec not in ground])
        if not any(map(len, layers)):
            low, high = place.bounds[:2], place.bounds[2:]
            middle = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)
            orders = other_orders(place.numbers) if place.numbers else ()
            raise EmptyResultError(
                f"nothing was found in {self.area}, latitude {low[1]:.10g} to {high[1]:.10g} and "
                f"longitude {low[0]:.10g} to {high[0]:.10g}, {nearest_town(*middle)}; give another "
                f"area, and a box as west,south,east,north{advice(orders)}."
            )
        with reporter.progress("joining the objects"):
            loaded = assemble(
                layers,
                catalog,
                metric_crs=self.metric_crs,
                collapse=self.collapse,
                merge=self.merge,
                max_distortion=self.max_distortion,
                keep_far=True,
            )
        return self.save(loaded)
