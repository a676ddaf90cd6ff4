"""Show the plugin from nothing, in a fresh QGIS: `tour.py --wheels FOLDER --out DIR`.

On a screen that need not be real (Xvfb), the plugin is installed from its zip file, its engine from
a folder of wheels by the button, OpenStreetMap is downloaded for the canvas from a server on this
machine that plays Overpass, a database is built, a cell is clicked, a view composed, and its place
found. Each step leaves a picture. Nothing of the network is used, and no other `semsig`.

The folder of wheels is filled once with ``pip download -c constraints.txt -d FOLDER
'.[raster,serve]'``.
"""

from __future__ import annotations

import argparse
import contextlib
import http.server
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import TYPE_CHECKING

import package

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["overpass", "play", "town"]

HERE = Path(__file__).parent
SESSION = HERE / "tour_session.py"
SCREEN = "1440x900x24"
# The south-west corner of the town that the server knows, and a degree's length there.
SOUTH, WEST = 43.6, 3.87
METRES_NORTH, METRES_EAST = 111_100.0, 80_600.0


def town() -> list[dict[str, object]]:
    """Return a town as Overpass sends it: lamps and trees in streets, and what else is there."""
    nodes: list[dict[str, object]] = []

    def place(east: float, north: float, **tags: str) -> None:
        lat, lon = SOUTH + north / METRES_NORTH, WEST + east / METRES_EAST
        told = {name.replace("__", ":"): value for name, value in tags.items()}
        nodes.append({"type": "node", "id": len(nodes) + 1, "lat": lat, "lon": lon, "tags": told})

    for street in range(8):
        along = 40.0 + street * 75.0
        for step in range(24):
            near = 20.0 + step * 25.0 + 3.0 * ((step * (street + 2)) % 5)
            place(along + 5.0, near, highway="street_lamp")
            place(near + 7.0, along - 5.0, highway="street_lamp")
            if (step * 7 + street * 3) % 4 != 0:
                place(along - 5.0, near + 8.0 + street, natural="tree")
            if (step * 5 + street) % 3 == 0:
                place(near, along + 6.0, natural="tree")
        place(along + 7.0, 60.0 + street * 55.0, amenity="bench")
        place(along + 6.0, 380.0 - street * 30.0, highway="bus_stop")
        place(90.0 + street * 65.0, along + 4.0, amenity="fountain")
    place(310.0, 320.0, amenity="toilets")
    place(120.0, 440.0, amenity="taxi")
    return nodes


@contextlib.contextmanager
def overpass(elements: list[dict[str, object]]) -> Iterator[str]:
    """Serve elements as an Overpass server does, and yield its address.

    Parameters
    ----------
    elements : list of dict
        What is sent, whatever is asked for.

    Yields
    ------
    str
        The address.
    """
    answer = json.dumps({"version": 0.6, "generator": "tour", "elements": elements}).encode()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self._send(answer, "application/json")

        def do_GET(self) -> None:
            self._send(b"2 slots available now.\n", "text/plain")

        def _send(self, body: bytes, kind: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_arguments: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/api"
    finally:
        server.shutdown()


@contextlib.contextmanager
def screen() -> Iterator[str]:
    """Start a screen that is not real, and yield its name."""
    read, write = os.pipe()
    line = ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    with subprocess.Popen(line, pass_fds=[write], stderr=subprocess.DEVNULL) as server:  # noqa: S603
        try:
            os.close(write)
            with os.fdopen(read) as told:
                yield f":{told.readline().strip()}"
        finally:
            server.terminate()


def play(
    out: Path, wheels: Path | None, *, command: str = "", language: str = "en", minutes: float = 20
) -> int:
    """Play the tour.

    Parameters
    ----------
    out : Path
        Where the pictures go.
    wheels : Path or None
        Folder of the wheels of the engine.
    command : str, optional
        A `semsig` to take instead of an engine.
    language : str, default "en"
        Language of QGIS.
    minutes : float, default 20
        How long it may take.

    Returns
    -------
    int
        0 where all went well.
    """
    out.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as home,
        screen() as display,
        overpass(town()) as server,
    ):
        place = Path(home)
        wheel = None if command else package.build_wheel(place)
        plugin = package.write_zip(place, wheel)
        story = {
            "plugin": str(plugin),
            "command": command,
            "wheels": "" if wheels is None else str(wheels.absolute()),
            "overpass": server,
            "extent": [WEST, SOUTH, WEST + 640 / METRES_EAST, SOUTH + 640 / METRES_NORTH],
            "out": str(out.absolute()),
            "work": str(place),
        }
        # Nothing is inherited: the engine of the tour is the only one.
        environment = {
            "DISPLAY": display,
            "HOME": home,
            "LANG": "C.UTF-8",
            "PATH": os.defpath,
            "SEMSIG_TOUR": json.dumps(story),
            "XDG_RUNTIME_DIR": home,
        }
        line = ["qgis", "--nologo", "--noversioncheck", "--lang", language]
        line += ["--profiles-path", str(place / "profile"), "--code", str(SESSION)]
        with (out / "qgis.log").open("wb") as log:
            done = subprocess.run(  # noqa: S603
                line,
                env=environment,
                cwd=home,
                check=False,
                stdout=log,
                stderr=log,
                timeout=minutes * 60,
            )
    failed = out / "failed.txt"
    if failed.exists():
        print(failed.read_text("utf-8"), file=sys.stderr)
    return 1 if failed.exists() or not (out / "done.txt").exists() else done.returncode


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wheels", type=Path, help="folder of the wheels")
    parser.add_argument("--command", default="", help="a semsig to take instead of an engine")
    parser.add_argument("--out", type=Path, default=Path("pictures"), help="where to put pictures")
    parser.add_argument("--lang", default="en", help="language of QGIS: en, de or fr")
    given = parser.parse_args()
    for name in ("Xvfb", "qgis"):
        if shutil.which(name) is None:
            sys.exit(f"The tour needs {name}, which is not on this computer; install it.")
    if not (given.wheels or given.command):
        sys.exit("Give --wheels, or --command to take a semsig that is there.")
    sys.exit(play(given.out, given.wheels, command=given.command, language=given.lang))
