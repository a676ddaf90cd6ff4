from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from small_city import small_city
from workbench import serving

from semsig_gis import ObjectStore, open_city, save_with_store
from semsig_gis.serve.workbench import Workbench

if TYPE_CHECKING:
    from collections.abc import Iterator

    from workbench import Page


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Workbench:
    database, objects = small_city()
    path = tmp_path_factory.mktemp("serve") / "town.parquet"
    save_with_store(database, ObjectStore.of(objects), path)
    city = open_city(path)
    return Workbench(city=city, store=city.store)


@pytest.fixture(scope="session")
def page(bench: Workbench) -> Iterator[Page]:
    """Serve a small town until the tests are over."""
    with serving(bench) as running:
        yield running
