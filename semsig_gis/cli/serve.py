"""`semsig serve`: the workbench, a page in the browser to locate photos."""

from __future__ import annotations

import secrets
import webbrowser
from typing import Annotated

import typer

from semsig_gis.cli.console import Database, app, remark, say
from semsig_gis.cli.options import NoiseName, Objects, object_store, read_noise
from semsig_gis.core import extra

MOST_PORT = 65535


@app.command()
def serve(
    database: Database,
    *,
    port: Annotated[
        int, typer.Option(min=0, max=MOST_PORT, help="Port of this machine; 0 for any free one.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address, but open no browser.")
    ] = False,
    noise: NoiseName = "by-hand",
    objects: Objects = None,
) -> None:
    """Locate photos in a page of the browser, on this machine only.

    No data leaves the machine. Others cannot open the page: its address contains a secret.
    """
    with extra("serve", "the workbench"):
        from semsig_gis.serve import make_server, open_listener, server_address
    from semsig_gis.database import open_city
    from semsig_gis.localization import NOISES
    from semsig_gis.serve import Workbench

    city = open_city(database)
    model = read_noise(noise, city.database)
    store = object_store(city, objects, needed=False)
    # The chosen noise comes first, since the page selects the first one.
    noises = {noise: model} | {name: other for name, other in NOISES.items() if name != noise}
    options = [str(database), *(["--objects", str(objects)] if objects is not None else [])]
    bench = Workbench(city=city, store=store, noises=noises, options=options)
    token = secrets.token_urlsafe(32)
    with open_listener(port) as listener:
        bench.prepare()
        address = server_address(listener, token)
        say(f"The workbench of {city.path.name} is at {address}")
        remark("it runs until you press Ctrl-C")
        if not no_browser:
            webbrowser.open(address)
        make_server(bench, listener, token=token).run(sockets=[listener])
