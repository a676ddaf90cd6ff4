"""Names of places from streets and buildings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import shapely
from worlds import random_town, surroundings

from semsig_gis.core import place_links
from semsig_gis.database import ObjectStore

if TYPE_CHECKING:
    import geopandas as gpd


def named(shapes: dict[str, shapely.Geometry]) -> gpd.GeoDataFrame:
    return surroundings(*shapes.values()).assign(name=[*shapes])


STREETS = named(
    {
        "High Street": shapely.LineString([(-500, 0), (500, 0)]),
        "Mill Lane": shapely.LineString([(0, -500), (0, -2)]),
        "Back Lane": shapely.LineString([(-500, 20), (-100, 20)]),
        "": shapely.LineString([(-500, 1), (500, 1)]),
    }
)
HALL = named({"Town Hall": shapely.box(200, 10, 220, 30), " ": shapely.box(200, -30, 220, -10)})


OBJECTS = random_town().street_objects


def store(
    streets: gpd.GeoDataFrame | None = None, buildings: gpd.GeoDataFrame | None = None
) -> ObjectStore:
    return ObjectStore.of(OBJECTS, streets=streets, footprints=buildings)


@pytest.mark.parametrize(
    ("xy", "name"),
    [
        ((300, 5), "on High Street"),
        ((10, -8), "at the corner of High Street and Mill Lane"),
        ((35, -8), "on High Street, near Mill Lane"),
        # Two streets side by side have no corner.
        ((-300, 12), "on Back Lane, near High Street"),
        ((230, 5), "on High Street, near Town Hall"),
        ((250, 55), "near Town Hall"),
        ((400, 55), "near High Street"),
        ((400, 155), "160 m from High Street"),
        ((300, 170), "160 m from Town Hall"),
        ((400, 355), ""),
    ],
)
def test_place_is_named_by_what_is_around(xy: tuple[float, float], name: str) -> None:
    assert store(STREETS, HALL).place_name(*xy) == name


def test_place_without_names_has_none() -> None:
    assert store().place_name(0.0, 0.0) == ""
    assert store(STREETS.drop(columns="name")).place_name(0.0, 0.0) == ""
    missing = STREETS.assign(name=[None, "Mill Lane", None, None])
    assert store(missing).place_name(5.0, -50.0) == "on Mill Lane"


def test_links_are_addresses_of_the_place() -> None:
    links = place_links(60.1708788, 24.9383631, heading=-90.0)
    assert [*links] == [
        "OpenStreetMap",
        "Google Street View",
        "Mapillary",
        "Panoramax",
        "KartaView",
    ]
    assert all(link.startswith("https://") for link in links.values())
    assert all("60.1708" in link and "24.9383" in link for link in links.values())
    assert links["Google Street View"].endswith("&heading=270")
    assert "heading" not in place_links(0.0, 0.0)["Google Street View"]
