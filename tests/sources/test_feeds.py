"""Feeds of shared bicycles (GBFS) and of public transport (GTFS)."""

from __future__ import annotations

import json
import zipfile
from typing import TYPE_CHECKING, Any

import pytest
from sentences import refused

from semsig_gis.core import SourceError
from semsig_gis.objects import draft_catalog, load

if TYPE_CHECKING:
    from pathlib import Path

STATIONS = [
    {"station_id": str(number), "name": f"S{number}", "lat": 45.76 + number / 1e4, "lon": 4.83}
    for number in range(4)
]
LANGUAGES = [
    item | {"name": [{"text": item["name"], "language": "en"}], "is_virtual_station": number == 0}
    for number, item in enumerate(STATIONS)
]
STOPS = {"0": "", "1": "0", "2": "1", "3": "2", "4": "0", "5": "3", "6": "0"}
FEED = {
    "agency.txt": "agency_id\n1\n",
    "routes.txt": "route_id,route_type\nA,704\nB,0\nC,1\n",
    "trips.txt": "route_id,service_id,trip_id\nA,1,1\nB,1,2\nC,1,3\n",
    "stop_times.txt": "trip_id,stop_id,stop_sequence\n1,0,1\n1,1,2\n2,1,1\n2,4,2\n3,6,1\n",
}


def stops(*, types: bool = True) -> str:
    rows = (
        f'{stop},"Stop, {stop}",{45.76 + number / 1e3},4.83{f",{kind}" if types else ""}\n'
        for number, (stop, kind) in enumerate(STOPS.items())
    )
    head = f"\ufeffstop_id, stop_name,stop_lat,stop_lon{',location_type' if types else ''}\n"
    return head + "".join(rows)


def kinds(path: Path) -> dict[str, str]:
    """Return the classes of the objects in a file, by their identifiers."""
    objects = load(path, collapse=False).objects
    names = {item.code: item.name for item in objects.taxonomy.classes}
    table = objects.table
    codes = [names[code] for code in table["class_code"]]
    return dict(zip(table["source_id"], codes, strict=True))


@pytest.mark.parametrize(("stations", "ids"), [(STATIONS, "0123"), (LANGUAGES, "123")])
def test_stations_of_bicycles_are_read(
    tmp_path: Path, stations: list[dict[str, Any]], ids: str
) -> None:
    path = tmp_path / "download.json"
    feed = {"last_updated": 1, "ttl": 10, "version": "3.0", "data": {"stations": stations}}
    path.write_text(json.dumps(feed, indent=1))
    assert kinds(path) == dict.fromkeys(ids, "bike_station")
    with refused(SourceError, "no catalogue is needed", "gbfs"):
        draft_catalog(path)
    # Numbers of stations are those of their feed.
    path.rename(tmp_path / "station_information.json")
    (tmp_path / "other").mkdir()
    other = tmp_path / "other" / "station_information.json"
    other.write_text(json.dumps({"data": {"stations": [STATIONS[1] | {"lat": 45.77}]}}))
    both = load([tmp_path / "station_information.json", other], collapse=False)
    assert len(both.objects) == len(ids) + 1


def test_status_of_stations_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "station_status.json"
    path.write_text(json.dumps({"data": {"stations": [{"station_id": "1", "status": "open"}]}}))
    with refused(SourceError, "station_information.json"):
        load(path)


def test_stops_of_a_feed_have_the_class_of_their_vehicles(tmp_path: Path) -> None:
    path = tmp_path / "download.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in {**FEED, "stops.txt": stops()}.items():
            archive.writestr(f"city/{name}", text)
    expected = {"0": "bus_stop", "1": "bus_stop", "4": "tram_stop", "3": "subway_entrance"}
    assert kinds(path) == expected


@pytest.mark.parametrize("types", [True, False])
def test_stops_without_trips_are_bus_stops(tmp_path: Path, *, types: bool) -> None:
    path = tmp_path / "stops.txt"
    path.write_text(stops(types=types), encoding="utf-8")
    ids = "0146" if types else "0123456"
    classes = kinds(path)
    assert {stop for stop, kind in classes.items() if kind == "bus_stop"} == set(ids)
    assert len(classes) == len(ids) + types
