"""Stops of public transport in feeds of the General Transit Feed Specification (GTFS)."""

from __future__ import annotations

import zipfile
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from semsig_gis.core import SourceError
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.numbers import decimal
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.registry import READERS, Source
from semsig_gis.sources.rows import WGS84, LayerBuilder
from semsig_gis.sources.vector.contents import members

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.sources.csv_file import CsvFile
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

FIELDS = ("stop_id", "stop_code", "stop_name", "location_type", "parent_station", "platform_code",
          "vehicles")  # fmt: skip
STOPS = "stops.txt"
# Vehicles by the type of a route, also of the extended types; the others are "other".
VEHICLES = {
    "bus": {3, 11, *range(200, 300), *range(700, 900)},
    "tram": {0, 5, *range(900, 1000)},
}
UNKNOWN = "unknown"


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from the archive of a feed, or from its ``stops.txt``.

    The field ``location_type`` is 0 where the feed has none. ``vehicles``, which is not a field of
    the feed, is ``bus``, ``tram`` or ``other``, the first that stops there, or ``unknown`` without
    the tables of trips. SourceError if there is no table of stops.
    """
    if not isinstance(path, str | Path):
        # An identifier is one only in its feed, so each has its own layers.
        return tuple(
            layer for file in path for layer in read_layers(file, specs, filters=filters, crs=crs)
        )
    path = Path(path)
    file, vehicles = _stops(path), _vehicles(path)
    layers = [
        LayerBuilder(spec, FIELDS, filters=filters, where=f"layer {spec.name!r} ({path})")
        for spec in specs
    ]
    for number, row in enumerate(file.rows(file.separator), start=1):
        for layer in layers:
            if isinstance(row, str):
                layer.rows.skip(row)
                continue
            values = {name.strip(): (value or "").strip() for name, value in row.items()}
            stop = values.get("stop_id", "")
            values["location_type"] = values.get("location_type") or "0"
            values["vehicles"] = vehicles.get(stop, "other" if vehicles else UNKNOWN)
            try:
                longitude, latitude = (
                    decimal(values.get(name, ""), english=True) for name in ("stop_lon", "stop_lat")
                )
                position: Position | str = longitude, latitude
            except ValueError:
                position = f"stop {stop} has no position"
            layer.rows.add(values, str(number), position)
    return tuple(layer.layer(WGS84, requested=crs) for layer in layers)


def _stops(path: Path) -> CsvFile:
    """Open the table of stops; SourceError if it is not one."""
    require_file(path, "an archive of a GTFS feed, or its stops.txt")
    tables = [item for item in members(path) if item.path.name.lower() == STOPS or not item.inner]
    if tables:
        file = open_csv(tables[0].open, str(tables[0]))
        if {"stop_lat", "stop_lon"} <= {name.strip() for name in file.layouts[file.separator]}:
            return file
    raise SourceError(
        f"{path} has no stops with stop_lat and stop_lon; give the archive of a GTFS feed, or its "
        "stops.txt."
    )


def _vehicles(path: Path) -> dict[str, str]:
    """Return the first of bus, tram and other that stops at each stop; empty if it is unknown."""
    if not zipfile.is_zipfile(path):
        return {}
    with zipfile.ZipFile(path) as archive:
        names = {PurePosixPath(name).name.lower(): name for name in archive.namelist()}

        def table(name: str, *columns: str) -> pa.Table:
            options = csv.ConvertOptions(
                include_columns=columns, column_types=dict.fromkeys(columns, pa.string())
            )
            with archive.open(names[name]) as stream:
                return csv.read_csv(stream, convert_options=options).select([*columns])

        try:
            routes = table("routes.txt", "route_id", "route_type")
            trips = table("trips.txt", "trip_id", "route_id")
            times = table("stop_times.txt", "trip_id", "stop_id")
        except (KeyError, pa.ArrowException, ValueError):
            return {}
    kinds = dict(zip(*(routes[name].to_pylist() for name in routes.column_names), strict=True))
    kind_of_trip = trips.set_column(
        1,
        "vehicles",
        pa.array([_vehicle(kinds.get(route)) for route in trips["route_id"].to_pylist()]),
    )
    pairs = times.join(kind_of_trip, "trip_id").group_by(["stop_id", "vehicles"]).aggregate([])
    pairs = pairs.filter(pc.is_valid(pairs["vehicles"])).to_pylist()
    order = [*VEHICLES, "other"]
    pairs.sort(key=lambda pair: order.index(pair["vehicles"]), reverse=True)
    return {pair["stop_id"]: pair["vehicles"] for pair in pairs}


def _vehicle(route_type: str | None) -> str:
    """Return the vehicle of a type of route."""
    number = int(route_type) if route_type and route_type.strip().isdigit() else -1
    return next((name for name, numbers in VEHICLES.items() if number in numbers), "other")


READERS.register(Source(read=read_layers, merging=True), __name__)
