from __future__ import annotations

from typing import TYPE_CHECKING

import geopandas as gpd
import pytest
import shapely
from small_city import small_city
from workbench import serving

from semsig_gis import ObjectStore, open_city, save_with_store
from semsig_gis.serve import Workbench

if TYPE_CHECKING:
    from collections.abc import Iterator

    from workbench import Page


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Workbench:
    database, objects = small_city()
    path = tmp_path_factory.mktemp("serve") / "town.parquet"
    (west, south), (east, north) = database.xy.min(axis=0), database.xy.max(axis=0)
    line = shapely.LineString([(west, south), (east, north)])
    streets = gpd.GeoDataFrame({"name": ["Rue de l'École"]}, geometry=[line], crs=database.crs)
    save_with_store(database, ObjectStore.of(objects, streets=streets), path)
    city = open_city(path)
    return Workbench(city=city, store=city.store)


@pytest.fixture(scope="session")
def page(bench: Workbench) -> Iterator[Page]:
    """Serve a small town until the tests are over."""
    with serving(bench) as running:
        yield running
