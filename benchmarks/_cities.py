"""Cities of the benchmarks: made-up ones, and real ones from the folder of open data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semsig_gis.database import ViewpointSpec, build_database
from semsig_gis.objects import build_objects, choose_layers, read_files
from semsig_gis.sources import load_catalog, paper_taxonomy, synthetic_city, synthetic_surroundings

if TYPE_CHECKING:
    from pathlib import Path

    from semsig_gis.database import SignatureDatabase
    from semsig_gis.objects import StreetObjects
    from semsig_gis.sources import CitySpec

__all__ = ["MADE_UP", "MONTPELLIER", "PARIS_LIKE", "made_up", "made_up_streets", "real"]

PARIS_LIKE, MADE_UP, MONTPELLIER = "Paris-like", "made up", "Montpellier"
_WHERE_FROM = {
    "Helsinki": ("openstreetmap", "osm/helsinki_2019.osm.pbf", "EPSG:32635"),
    "Monaco": ("openstreetmap", "osm/monaco_2021.osm.pbf", "EPSG:32632"),
    "Monaco a year later": ("openstreetmap", "osm/monaco_2022.osm.pbf", "EPSG:32632"),
    MONTPELLIER: ("montpellier", "montpellier", "EPSG:2154"),
}


def made_up(spec: CitySpec) -> StreetObjects:
    """Return the street objects of a made-up city."""
    layers = synthetic_city(spec)
    return build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)[0]


def made_up_streets(spec: CitySpec, objects: StreetObjects) -> SignatureDatabase:
    """Return the database of a made-up city, with viewpoints only along its streets."""
    _, streets = synthetic_surroundings(spec)
    return build_database(objects, viewpoints=ViewpointSpec(mode="streets"), streets=streets.table)


def real(geodata: Path, name: str) -> StreetObjects:
    """Return the street objects of a city from the folder of open data."""
    catalog_name, path, crs = _WHERE_FROM[name]
    catalog = load_catalog(catalog_name)
    layers, _ = read_files(choose_layers(catalog), [geodata / path])
    return build_objects(layers, taxonomy=catalog.taxonomy, crs=crs)[0]
