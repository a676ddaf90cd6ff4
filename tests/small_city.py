"""A city of a few hundred cells with an evaluation, answers and identifiability."""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
import shapely

from semsig_gis.core import LICENSES
from semsig_gis.database import build_database
from semsig_gis.evaluation import BANDS, ClassGain, Identifiability, evaluate
from semsig_gis.localization import Method, build_index, localize, locate, named_noise
from semsig_gis.objects import Licence, build_objects
from semsig_gis.sources import CitySpec, paper_taxonomy, synthetic_city

if TYPE_CHECKING:
    from semsig_gis.database import SignatureDatabase
    from semsig_gis.evaluation import Evaluation
    from semsig_gis.localization import Localization, Location
    from semsig_gis.objects import StreetObjects


@functools.cache
def small_city() -> tuple[SignatureDatabase, StreetObjects]:
    layers = synthetic_city(CitySpec(size=300.0))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs="EPSG:32631")
    licensed = dataclasses.replace(objects, licenses=(Licence("Town (CC0)", ("trees", "lamps")),))
    return build_database(licensed), licensed


@functools.cache
def small_ground() -> dict[str, gpd.GeoDataFrame]:
    """Return buildings and streets of the city with names, one of them far away."""
    west, south, east, north = small_city()[1].table.total_bounds
    steps = np.linspace(0.0, 1.0, 12)
    x, y = west + (east - west) * steps, south + (north - south) * steps
    houses = [*shapely.box(x, y, x + 8.0, y + 8.0), shapely.box(east + 900, y[0], east + 910, y[1])]
    lines = [shapely.LineString([(place, south), (place, north)]) for place in x]
    names = [f"No. {number}" for number in range(len(houses))]
    ground = {
        "buildings": gpd.GeoDataFrame({"name": names}, geometry=houses, crs="EPSG:32631"),
        "streets": gpd.GeoDataFrame({"name": names[:-1]}, geometry=lines, crs="EPSG:32631"),
    }
    for table in ground.values():
        table.attrs[LICENSES] = ["Map (ODbL 1.0)"]
    return ground


@functools.cache
def small_evaluation(distortion: str = "strong") -> Evaluation:
    """Return an evaluation with successful, failed and, if strong, empty queries."""
    return evaluate(small_city()[0], queries=60, method=Method(), distortion=distortion)


@functools.cache
def small_location() -> Location:
    database, _ = small_city()
    index = build_index(database, named_noise("light"))
    return locate(index, database.signature(7), refined=False, explained=1)


@functools.cache
def small_localization() -> Localization:
    database, _ = small_city()
    return localize(database, database.signature(7), top=20, method=Method())


def chances_of(database: SignatureDatabase, *, seed: int = 0) -> Identifiability:
    """Return a random identifiability of the cells of a database."""
    rng = np.random.default_rng(seed)
    places = 3
    cells, codes = len(database), database.present_codes.tolist()
    lookalikes = rng.integers(0, cells, (cells, places))
    lookalikes[rng.random(cells) < 0.2, places - 1] = -1
    chances = rng.random((4, cells)).round(3)
    return Identifiability(
        database=database,
        noise=named_noise("medium"),
        radius=30.0,
        view=360.0,
        itself=chances[0],
        near=chances[1],
        found=np.where(rng.random(cells) < 0.5, rng.choice([*BANDS, 1.0], cells), chances[2]),
        bits=(chances[3] * np.log2(cells)).round(3),
        lookalikes=lookalikes,
        lookalike_chances=np.where(lookalikes < 0, 0.0, rng.random((cells, places)).round(3)),
        gains=rng.uniform(-0.1, 0.9, (cells, len(codes))).round(3),
        classes=tuple(
            ClassGain(code=code, near=float(near), bits=float(bits))
            for code, near, bits in zip(codes, *rng.random((2, len(codes))), strict=True)
        ),
        trials=60,
        seed=4,
    )
