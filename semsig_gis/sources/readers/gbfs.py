"""Stations of shared bicycles in files of the General Bikeshare Feed Specification (GBFS)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from semsig_gis.core import SourceError
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.registry import READERS, Source
from semsig_gis.sources.rows import WGS84, LayerBuilder
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import LayerSpec
    from semsig_gis.sources.rows import Position

FIELDS = ("station_id", "name", "short_name", "address", "capacity", "is_virtual_station")


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from ``station_information.json`` of any version.

    A name in several languages is the first one. SourceError if the file has no stations.
    """
    if not isinstance(path, str | Path):
        # An identifier is one only in its feed, so each has its own layers.
        return tuple(
            layer for file in path for layer in read_layers(file, specs, filters=filters, crs=crs)
        )
    path = Path(path)
    stations = _load_stations(path)
    layers = []
    for spec in specs:
        where = f"layer {spec.name!r} ({path})"
        builder = LayerBuilder(spec, FIELDS, filters=filters, where=where)
        for number, station in enumerate(stations, start=1):
            values = station
            try:
                position: Position | str = float(station["lon"]), float(station["lat"])
            except (KeyError, TypeError, ValueError):
                position = f"station {station.get('station_id')} has no position"
            names = station.get("name")
            if isinstance(names, list):
                values = {**station, "name": names[0].get("text") if names else None}
            builder.rows.add(values, str(number), position)
        layers.append(builder.layer(WGS84, requested=crs))
    return tuple(layers)


def _load_stations(path: Path) -> list[dict[str, Any]]:
    require_file(path, "station_information.json of a GBFS feed")
    try:
        stations = parse_json(path.read_bytes().removeprefix(b"\xef\xbb\xbf"))["data"]["stations"]
    except (KeyError, TypeError, ValueError):
        stations = None
    if not isinstance(stations, list) or not all(isinstance(item, dict) for item in stations):
        raise SourceError(
            f"{path} has no list of stations; give station_information.json of a GBFS feed."
        )
    if stations and not any("lat" in item for item in stations):
        raise SourceError(
            f"{path} has no positions, as station_status.json has none; give "
            "station_information.json of the same feed."
        )
    return stations


READERS.register(Source(read=read_layers, merging=True), __name__)
