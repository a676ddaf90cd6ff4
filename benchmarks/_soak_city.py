"""The small city of the soak: its files, its commands, and the results of the commands."""

from __future__ import annotations

import functools
import http.server
import json
import os
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from benchmarks._contents import TIMES, digest, file_digest
from benchmarks._soak_runs import forked, run
from semsig_gis import load_catalog, open_database, open_objects

if TYPE_CHECKING:
    from collections.abc import Mapping

    from benchmarks._soak_runs import Ending
    from semsig_gis.sources import LayerSpec

TABLE = tomllib.loads(Path(__file__).with_name("soak.toml").read_text(encoding="utf-8"))
_TIMED = (".lock", ".meta.json")  # files of the cache that contain times
_LEAST_OBJECTS = 5  # of the cells from which queries are made


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command, the names that it writes in the folder, and the result of a normal run.

    `before` is a folder with the files of these names before the run; `old` and `new` are the
    digests of these files before and after.
    """

    text: str
    long: bool
    names: tuple[str, ...]
    before: Path
    ending: Ending
    old: Mapping[str, str]
    new: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class World:
    """A folder in which every command was run once, and the commands."""

    folder: Path
    commands: tuple[Command, ...]

    def command(self, number: int) -> Command:
        """Return the command of a trial: quick ones in turn, and sometimes a long one."""
        quick = [command for command in self.commands if not command.long]
        long = [command for command in self.commands if command.long]
        turn, at = divmod(number, len(quick))
        return long[turn // 2 % len(long)] if at == 0 and turn % 2 == 0 else quick[at]

    def copy(self, command: Command, to: Path) -> None:
        """Copy the folder for a new run of a command."""
        shutil.copytree(self.folder, to, ignore=shutil.ignore_patterns(*command.names))
        shutil.copytree(command.before, to, dirs_exist_ok=True)


def made_world(folder: Path, kills: int) -> World:
    """Make the city and its queries, run all commands, and save what they change.

    Only as many long commands are run as are needed for the number of kills.

    When a command is run again, its results are already there, with a byte added to each file;
    except for folders, because commands continue with them.
    """
    now = folder / "now"
    commands = []
    words = _prepared(now, _portal(folder))
    quick = _lines("writing", words)
    long = _lines("long", words)[: 1 + kills // (2 * len(quick))]
    for number, text in enumerate([*quick, *long]):
        before = folder / "before" / str(number)
        earlier = folder / "earlier"
        before.mkdir(parents=True)
        shutil.copytree(now, earlier)
        states = files_in(now)
        ending = _run_ok(text, now)
        changed = [name for name, state in files_in(now).items() if states.get(name) != state]
        names = sorted({Path(name).parts[0] for name in changed})
        for name in changed:
            if name in states:
                _put(before / name, (earlier / name).read_bytes())
            elif "/" not in name or ".objects/" in name:
                _put(before / name, (now / name).read_bytes() + b"\0")
        shutil.rmtree(earlier)
        commands.append(
            Command(
                text=text,
                long=number >= len(quick),
                names=tuple(names),
                before=before,
                ending=ending,
                old=digests(before, names),
                new=digests(now, names),
            )
        )
    return World(folder=now, commands=tuple(commands))


def _put(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def digests(folder: Path, names: tuple[str, ...] | list[str]) -> dict[str, str]:
    """Return the digest of every file under these names, by its path."""
    return {
        name: _digest(folder / name)
        for name in files_in(folder)
        if Path(name).parts[0] in names
        and Path(name).name not in TIMES
        and not name.endswith(_TIMED)
    }


def _digest(path: Path) -> str:
    try:
        return file_digest(path)
    except Exception:  # noqa: BLE001 - a damaged file
        return digest(path.read_bytes())


def files_in(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return the state of every file in a folder, by its path."""
    paths = (Path(root, name) for root, _, names in os.walk(folder) for name in names)
    return {
        str(path.relative_to(folder)): (stat.st_mtime_ns, stat.st_size, stat.st_ino)
        for path in paths
        for stat in [path.stat()]
    }


def _lines(table: str, words: Mapping[str, str]) -> list[str]:
    """Return the commands of a table."""
    return [
        " ".join(f"{shared} {rest}".split())
        for line in TABLE[table].format(**words).strip().splitlines()
        for shared, _, rests in [line.partition("|")]
        for rest in rests.split(";")
    ]


def _run_ok(command: str, folder: Path) -> Ending:
    """Run a command; raise if it fails."""
    ending = run(command, folder)
    if ending.code or ending.fault:
        raise RuntimeError(f"semsig {command} ended with {ending.code}:\n{ending.err}")
    return ending


def _prepared(folder: Path, port: int) -> dict[str, str]:
    """Make a city, its queries and all inputs of the commands; return words for the commands."""
    folder.mkdir()
    for command in _lines("city", {}):
        _run_ok(command, folder)
    words: dict[str, str] = forked(lambda: _write_inputs(folder, port))
    for command in _lines("prepare", words):
        _run_ok(command, folder)
    return words


def _write_inputs(folder: Path, port: int) -> dict[str, str]:
    """Write the city as files of OpenStreetMap and of a portal, and views of it."""
    database = open_database(folder / "known.parquet")
    views: list[dict[str, Any]] = []
    for cell, (x, y) in enumerate(database.xy.tolist()):
        bearings = database.signature(cell).bearings
        if bearings is not None and len(bearings) >= _LEAST_OBJECTS:
            view = {"types": database.types(cell), "bearings": bearings.round(1).tolist()}
            views.append(view | {"x": x + 2, "y": y - 1})
    _write_rows(folder / "samples.jsonl", views[:30])
    _write_rows(
        folder / "queries.jsonl",
        [{"id": f"q{number}"} | view for number, view in enumerate(views[:5])],
    )
    rows = [f"{view['types']},{' '.join(map(str, view['bearings']))}" for view in views[:5]]
    (folder / "queries.csv").write_text("\n".join(["types,bearings", *rows, ""]), encoding="utf-8")
    (folder / "experiment.toml").write_text(TABLE["experiment"], encoding="utf-8")
    (folder / "service.toml").write_text(
        TABLE["service"].format(address=f"http://127.0.0.1:{port}/{folder.name}"), encoding="utf-8"
    )
    places = open_objects(folder / "in" / "objects.parquet").table.to_crs("EPSG:4326")
    places.drop(columns="source").to_file(folder / "portal.geojson", driver="GeoJSON")
    fields = [{"name": "geo_shape", "type": "geo_shape"}]
    (folder / "portal.json").write_text(json.dumps({"fields": fields}), encoding="utf-8")
    catalog = load_catalog("openstreetmap")
    tags = {
        catalog.taxonomy.by_name(layer.class_name).code: layer
        for layer in reversed(catalog.layers)
        if layer.class_name and layer.tags and "node" in layer.elements
    }
    nodes = "".join(
        _node(number, tags[code], point.x, point.y)
        for number, (code, point) in enumerate(
            zip(places["class_code"], places.geometry, strict=True), start=1
        )
    )
    (folder / "city.osm").write_text(f"<osm version='0.6'>{nodes}</osm>\n", encoding="utf-8")
    west, south, east, north = places.total_bounds.round(4).tolist()
    view = views[len(views) // 2]
    angles = ",".join(map(str, view["bearings"]))
    return {
        "query": f"--types {view['types']} --bearings {angles}",
        "box": f"{west},{south},{east},{north}",
    }


def _node(number: int, layer: LayerSpec, lon: float, lat: float) -> str:
    tags = "".join(
        f"<tag k={quoteattr(key)} v={quoteattr(values[0].replace('*', 'yes'))}/>"
        for key, values in layer.tags[0]
    )
    return f"<node id='{number}' version='1' lat='{lat:.7f}' lon='{lon:.7f}'>{tags}</node>\n"


def _write_rows(path: Path, rows: list[dict[str, object]]) -> None:
    path.write_text("".join(f"{json.dumps(row)}\n" for row in rows), encoding="utf-8")


class _Portal(http.server.SimpleHTTPRequestHandler):
    """Server of a folder: a description for ``/CITY/.../objects``, the export for others."""

    def translate_path(self, path: str) -> str:
        """Return the file of an address."""
        parts = path.partition("?")[0].split("/")
        name = "portal.json" if parts[-1] == "objects" else "portal.geojson"
        return str(Path(self.directory) / parts[1] / name)

    def log_message(self, *_: object) -> None:
        """Log nothing."""


def _portal(folder: Path) -> int:
    """Serve a folder on the loopback until this process ends; return the port."""
    folder.mkdir(parents=True, exist_ok=True)
    server = http.server.HTTPServer(
        ("127.0.0.1", 0), functools.partial(_Portal, directory=str(folder))
    )
    parent = os.getpid()
    if os.fork() == 0:
        server.timeout = 1.0
        while os.getppid() == parent:
            server.handle_request()
        os._exit(0)
    server.socket.close()
    return server.server_port
