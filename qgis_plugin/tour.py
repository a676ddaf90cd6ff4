"""Run the plugin in a fresh QGIS and take pictures: `tour.py --wheels FOLDER --out DIR`.

On a virtual screen (Xvfb), the plugin is installed from its zip file, and its engine from a folder
of wheels with the button. OpenStreetMap is downloaded for the canvas from a local server in place
of Overpass, a database is built, a cell is clicked, a view is composed and its place is found. Each
step writes a picture. The network and any other `semsig` are not used.

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
# The south-west corner of the town of the server, and the length of a degree there.
SOUTH, WEST = 43.6, 3.87
METRES_NORTH, METRES_EAST = 111_100.0, 80_600.0


def town() -> list[dict[str, object]]:
    """Return a town in the format of Overpass: streets with lamps, trees and other objects."""
    nodes: list[dict[str, object]] = []

    def place(east: float, north: float, **tags: str) -> None:
        lat, lon = SOUTH + north / METRES_NORTH, WEST + east / METRES_EAST
        node = {"type": "node", "id": len(nodes) + 1, "lat": lat, "lon": lon}
        nodes.append(node | {"tags": tags})

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
    """Serve elements like an Overpass server, and yield its address.

    Parameters
    ----------
    elements : list of dict
        The answer to every request.

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
    """Start a virtual screen, and yield its name."""
    read, write = os.pipe()
    line = ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    with subprocess.Popen(line, pass_fds=[write], stderr=subprocess.DEVNULL) as server:  # noqa: S603
        try:
            os.close(write)
            with os.fdopen(read) as output:
                yield f":{output.readline().strip()}"
        finally:
            server.terminate()


def play(
    out: Path, wheels: Path | None, *, command: str = "", language: str = "en", minutes: float = 20
) -> int:
    """Run the tour.

    Parameters
    ----------
    out : Path
        Folder for the pictures.
    wheels : Path or None
        Folder of the wheels of the engine.
    command : str, optional
        A `semsig` to use instead of an engine.
    language : str, default "en"
        Language of QGIS.
    minutes : float, default 20
        Time limit.

    Returns
    -------
    int
        0 if all steps succeeded.
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
        # Without inherited variables, so that the engine of the tour is the only one.
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
            process = subprocess.run(  # noqa: S603
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
    return 1 if failed.exists() or not (out / "done.txt").exists() else process.returncode


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wheels", type=Path, help="folder of the wheels")
    parser.add_argument("--command", default="", help="a semsig to use instead of an engine")
    parser.add_argument("--out", type=Path, default=Path("pictures"), help="folder for pictures")
    parser.add_argument("--lang", default="en", help="language of QGIS: en, de or fr")
    options = parser.parse_args()
    for name in ("Xvfb", "qgis"):
        if shutil.which(name) is None:
            sys.exit(f"The tour needs {name}, which is not on this computer; install it.")
    if not (options.wheels or options.command):
        sys.exit("Give --wheels, or --command to use an installed semsig.")
    sys.exit(play(options.out, options.wheels, command=options.command, language=options.lang))
