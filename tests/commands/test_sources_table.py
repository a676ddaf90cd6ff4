"""The table of sources in data_sources/README.md: each row is run with the same three objects.

SEMSIG_SNAPSHOTS=1 writes the rows again.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import geopandas as gpd
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from open_cities import CITIES, serve
from osm_xml import node, write_osm
from servers import Answer
from stand_ins import ArcGIS
from stores import keep_in_bucket

from semsig_gis.sources import catalog as catalogs
from semsig_gis.sources import data_folder, load_catalog

if TYPE_CHECKING:
    from collections.abc import Callable

    from servers import Server

    from conftest import Run, RunOk

README = Path(__file__).parents[2] / "data_sources" / "README.md"
TAGS: list[dict[str, str]] = [
    {"amenity": "bench"}, {"highway": "street_lamp"}, {"highway": "bus_stop"},
]  # fmt: skip
CLASSES = ["bench", "street_lamp", "bus_stop"]
PLACES = [(2.35, 48.85), (2.3501, 48.85), (2.3502, 48.85)]
POINTS = shapely.points(PLACES)
AREA = "2.34,48.84,2.36,48.86"
MINE = """name = "mine"
title = "My city"
reader = "arcgis"
endpoints = ["{url}"]

[[layers]]
name = "lamps"
class = "street_light"
dataset = "Street/FeatureServer/Lamps"
files = ["lamps*"]
"""


@pytest.fixture
def redirect(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str, str], None]:
    """Return a function that changes the address of a built-in catalogue."""

    def change(name: str, address: str) -> None:
        copy = tmp_path / "data_sources"
        shutil.copytree(str(data_folder()), copy)
        path = copy / f"{name}.toml"
        text = re.sub(
            r"^endpoints = \[[^]]*\]", f'endpoints = ["{address}"]', path.read_text("utf-8"),
            flags=re.MULTILINE,
        )  # fmt: skip
        path.write_text(text, "utf-8")
        monkeypatch.setattr(catalogs, "data_folder", lambda: copy)

    return change


def elements() -> dict[str, Any]:
    return {
        "elements": [
            {"type": "node", "id": number, "lon": x, "lat": y, "tags": tags}
            for number, ((x, y), tags) in enumerate(zip(PLACES, TAGS, strict=True), 1)
        ]
    }


def extract(folder: Path, _: Server) -> None:
    things = enumerate(zip(PLACES, TAGS, strict=True), 1)
    write_osm(folder / "city.osm", *(node(n, x, y, tags) for n, ((x, y), tags) in things))


def osmnx(folder: Path, _: Server) -> None:
    ids = {"element": ["node"] * 3, "id": [1, 2, 3]}
    frame = gpd.GeoDataFrame(pd.DataFrame(TAGS), geometry=POINTS, crs=4326)
    frame.assign(**ids).to_file(folder / "osmnx.gpkg")


def quackosm(folder: Path, _: Server) -> None:
    ids = [f"node/{number}" for number in (1, 2, 3)]
    frame = gpd.GeoDataFrame({"feature_id": ids, "tags": TAGS}, geometry=POINTS, crs=4326)
    frame.to_parquet(folder / "quackosm.parquet")


def overpass_file(folder: Path, _: Server) -> None:
    (folder / "overpass.json").write_text(json.dumps(elements()), "utf-8")


def geofabrik(folder: Path, _: Server) -> None:
    (folder / "geofabrik").mkdir()
    for name, number in (("pois", 0), ("traffic", 1), ("transport", 2)):
        columns = {"osm_id": [str(number + 1)], "code": [1], "fclass": [CLASSES[number]]}
        frame = gpd.GeoDataFrame(columns, geometry=[POINTS[number]], crs=4326)
        frame.to_file(folder / "geofabrik" / f"gis_osm_{name}_free_1.shp")


def overpass(_: Path, server: Server) -> None:
    server.on("/interpreter", Answer(json.dumps(elements()).encode()))


def overture(folder: Path, _: Server) -> None:
    path = folder / "release" / "theme=base" / "type=infrastructure" / "part-0.zstd.parquet"
    path.parent.mkdir(parents=True)
    sides = np.array(PLACES, np.float32).T
    box = [pa.array(sides[axis]) for axis in (0, 0, 1, 1)]
    table = {
        "id": ["a", "b", "c"],
        "geometry": list(shapely.to_wkb(POINTS)),
        "bbox": pa.StructArray.from_arrays(box, ["xmin", "xmax", "ymin", "ymax"]),
        "version": [1] * 3,
        "sources": [[{"dataset": "OpenStreetMap"}]] * 3,
        "class": CLASSES,
    }
    pq.write_table(pa.table(table), path)


def overture_store(folder: Path, server: Server) -> str:
    overture(folder, server)
    (folder / "releases").mkdir()
    (folder / "release").rename(folder / "releases" / "2026-08-19.0")
    return keep_in_bucket(server, "maps", folder / "releases")


def mapillary(_: Path, server: Server) -> None:
    values = ["object--bench", "object--street-light", "regulatory--stop--g1"]
    data = [
        {"id": str(number), "object_value": value, "geometry": {"coordinates": xy}}
        for number, (value, xy) in enumerate(zip(values, PLACES, strict=True))
    ]
    server.on("/map_features", Answer(json.dumps({"data": data}).encode()))


def table(folder: Path, _: Server) -> None:
    frame = gpd.GeoDataFrame({"id": [1, 2, 3]}, geometry=POINTS, crs=4326)
    frame.to_file(folder / "trees.gpkg")


def another_city(folder: Path, server: Server) -> None:
    (folder / "my_city.toml").write_text(MINE.format(url=ArcGIS(server).endpoint), "utf-8")


def city(name: str) -> Callable[[Path, Server], str]:
    def make(_: Path, server: Server) -> str:
        catalog = load_catalog(name)
        return serve(server, name, catalog.reader, catalog.layers)

    return make


def around(name: str) -> str:
    (x, y), _ = CITIES[name]
    return f"{x - 0.01:.2f},{y - 0.01:.2f},{x + 0.01:.2f},{y + 0.01:.2f}"


# The source or tool, the command without `--out objects.parquet`, and a function that prepares it.
ROWS: list[tuple[str, str, Callable[[Path, Server], str | None]]] = [
    ("OpenStreetMap, an extract (`.osm`, `.osm.pbf`)", "load city.osm", extract),
    ("OpenStreetMap, live (Overpass)", f"fetch openstreetmap --area {AREA}", overpass),
    ("osmnx", "load osmnx.gpkg", osmnx),
    ("QuackOSM", "load quackosm.parquet", quackosm),
    ("Overpass turbo, JSON", "load overpass.json", overpass_file),
    ("Geofabrik's shapefiles", "load geofabrik/", geofabrik),
    ("Overture Maps, files", f"load release/ --clip {AREA}", overture),
    ("Overture Maps, live", f"fetch overture --area {AREA}", overture_store),
    ("Mapillary", f"fetch mapillary --area {AREA}", mapillary),
    *(
        (f"{title} ({service})", f"fetch {name} --area {around(name)}", city(name))
        for title, service, name in (
            ("New York", "Socrata", "new_york"),
            ("Washington, D.C.", "ArcGIS", "washington"),
            ("Vienna", "WFS", "vienna"),
            ("Hamburg", "OGC API - Features", "hamburg"),
            ("Barcelona", "CKAN", "barcelona"),
            ("Melbourne", "Opendatasoft", "melbourne"),
        )
    ),
    ("any vector file", "load trees.gpkg --catalog draft.toml", table),
    ("another city on one of these services", f"fetch my_city.toml --area {AREA}", another_city),
]


def written(command: str, folder: Path) -> str:
    """Return what a user has to write for a command: names, paths, areas, and lines of TOML."""
    verb, first, *rest = command.split()
    files = [word for word in (first, *rest) if word.endswith(".toml")]
    parts = ["a path"] if verb == "load" else [] if files else ["a name"]
    parts += ["an area"] if {"--area", "--clip"} & {*rest} else []
    if "mapillary" in command:
        parts.append("a token (in the environment)")
    if files == ["draft.toml"]:
        parts.append("`semsig draft trees.gpkg > draft.toml`")
    elif files:
        lines = [line for line in (folder / files[0]).read_text("utf-8").splitlines() if line]
        parts.append(f"a catalogue of {len(lines)} lines")
    return ", ".join(parts)


@pytest.mark.parametrize(("source", "command", "make"), ROWS, ids=[row[0] for row in ROWS])
def test_row_matches_the_command(
    *,
    source: str,
    command: str,
    make: Callable[[Path, Server], str | None],
    run_ok: RunOk,
    run: Run,
    server: Server,
    redirect: Callable[[str, str], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MAPILLARY_ACCESS_TOKEN", "MLY|of|nobody")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    verb, name, *_ = command.split()
    address = make(tmp_path, server)
    if verb == "fetch" and not name.endswith(".toml"):
        redirect(name, address or server.url)
    if "draft.toml" in command:
        (tmp_path / "draft.toml").write_text(run_ok("draft trees.gpkg"), "utf-8")
    code, out, err = run(f"{command} --out objects.parquet --json")
    assert code == 0, err
    if verb == "fetch" and not name.endswith(".toml"):
        catalog = load_catalog(name)
        assert any(spec.terms in err for spec in catalog.layers)  # the licence of the objects
    report = json.loads(out)
    cells = (source, f"`semsig {command}`", f"{report['objects']}", written(command, tmp_path))
    row = f"| {' | '.join(cells)} |"
    text = README.read_text("utf-8")
    if os.environ.get("SEMSIG_SNAPSHOTS"):
        text = re.sub(rf"^\| {re.escape(source)} \|.*$", lambda _: row, text, flags=re.MULTILINE)
        README.write_text(text, "utf-8")
    assert row in text.splitlines()


def test_table_has_no_other_rows() -> None:
    text = README.read_text("utf-8").partition("## Sources at a glance")[2].partition("\n## ")[0]
    first = [line.split(" | ")[0].removeprefix("| ") for line in text.splitlines() if "|" in line]
    assert first[2:] == [source for source, *_ in ROWS]
