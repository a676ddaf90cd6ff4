from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest
from small_city import small_city
from workbench import TOKEN, Page

from semsig_gis import ObjectStore, open_city, save_with_store
from semsig_gis.serve import server
from semsig_gis.serve.workbench import Workbench

if TYPE_CHECKING:
    from collections.abc import Iterator


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
    with server.listening(0) as listener:
        running = server.served(bench, listener, token=TOKEN)
        thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
        thread.start()
        yield Page(bench=bench, port=listener.getsockname()[1])
        running.should_exit = True
        thread.join()
