"""`semsig serve`: the workbench, a page in the browser to locate photos."""

from __future__ import annotations

import secrets
import webbrowser
from dataclasses import dataclass
from typing import Annotated

from semsig_gis.cli.console import say
from semsig_gis.commands import (
    Database,
    NoiseName,
    Objects,
    Option,
    Reporter,
    Result,
    command,
    object_store,
    read_noise,
)
from semsig_gis.core import extra

MOST_PORT = 65535


@command(
    "serve",
    title="Workbench",
    group="Ask",
    order=2,
    examples=(
        "semsig serve city.parquet",
        "semsig serve city.parquet --no-browser --port 8000",
    ),
)
@dataclass(frozen=True, kw_only=True)
class Serve:
    """Locate photos in a page of the browser, on this machine only.

    No data leaves the machine. Others cannot open the page: its address contains a secret.
    """

    database: Database
    port: Annotated[
        int, Option("Port of this machine; 0 for any free one.", low=0, high=MOST_PORT)
    ] = 0
    no_browser: Annotated[bool, Option("Print the address, but open no browser.")] = False
    noise: NoiseName = "by-hand"
    objects: Objects = None

    def run(self, reporter: Reporter) -> Result:
        """Serve the page until an interrupt."""
        with extra("serve", "the workbench"):
            from semsig_gis.serve import make_server, open_listener, server_address
        from semsig_gis.database import open_city
        from semsig_gis.localization import NOISES
        from semsig_gis.serve import Workbench

        city = open_city(self.database)
        noise = read_noise(self.noise, city.database)
        store = object_store(city, self.objects, reporter, needed=False)
        # The chosen noise comes first, since the page selects the first one.
        others = {name: other for name, other in NOISES.items() if name != self.noise}
        bench = Workbench(
            city=city,
            store=store,
            noises={self.noise: noise} | others,
            objects=self.objects,
        )
        token = secrets.token_urlsafe(32)
        with open_listener(self.port) as listener:
            bench.prepare()
            address = server_address(listener, token)
            say(f"The workbench of {city.path.name} is at {address}")
            reporter.remark("it runs until you press Ctrl-C")
            if not self.no_browser:
                webbrowser.open(address)
            make_server(bench, listener, token=token).run(sockets=[listener])
        return Result()
