"""Damage files of every format: each must be refused in one sentence, or read."""

from __future__ import annotations

import bz2
import gzip
import json
import os
import random
import re
import resource
import select
import shutil
import signal
import tomllib
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import osmium

import semsig_gis as sg
from benchmarks._contents import digest
from benchmarks._soak_runs import LIMIT_S
from semsig_gis.database import open_dataset, open_store
from semsig_gis.evaluation import open_experiment_spec, open_identifiability
from semsig_gis.localization import open_noise, open_rule, raster_prior
from semsig_gis.objects import read_area
from semsig_gis.observation import read_queries, read_route
from semsig_gis.output import read_geopackage
from semsig_gis.sources import reader

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks._soak_city import World

BATCH = 200
_RESPELT = 0.6  # share of the damages to texts that change a number, a word or a line
_SMALL = 30  # objects in files of foreign formats
_MEMORY = 6 * 2**30  # bytes, in addition to those in use at the beginning

_CATALOG = """
name = "fuzz"
title = "Fuzz"
url = "https://example.org"
license = "CC0"
attribution = "nobody"
metric_crs = "EPSG:32631"
[conflate]
bench = 3
[[layers]]
name = "objects"
class = "bench"
files = ["objects*"]
id_field = "source_id"
crs = "EPSG:4326"
"""
_NASTY = (
    *("NaN", "Infinity", "-Infinity", "1e308", "-1e308", "1e-320", "-0.0", "0", "-1", "9" * 30),
    *("null", "true", '""', "[]", "{}", '"\\u0000"', '"\\ud800"', "2147483648", "0.1", "'", '"'),
    *("180", "90.0001", "[" * 2000, "é", "\u202e", "\x1b[31m", "1_0", "٣", "0x10", ",", "\n", "="),
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_WORD = re.compile(rb"[A-Za-z_]\w*")


@dataclass(frozen=True, kw_only=True)
class Format:
    """A kind of file, and the function that reads it.

    `ours` are files that only the package writes; if a damaged one is read, its contents must be
    the same as before.
    """

    name: str
    file: str
    read: Callable[[Path], object]
    ours: bool = False


def _database(path: Path) -> object:
    return _arrays(sg.open_database(path))


def _arrays(database: sg.SignatureDatabase) -> str:
    parts = (database.columns, database.rows, database.offsets, database.codes,
             database.bearing_units, database.distance_units)  # fmt: skip
    specs = (database.grid, database.spec, database.taxonomy, database.crs.to_wkt(),
            database.licenses, database.viewpoints, database.occlusion)  # fmt: skip
    return digest(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)) + repr(specs)


def _objects(path: Path) -> str:
    objects = sg.open_objects(path)
    return f"{objects.table.to_csv()}{objects.taxonomy!r}{objects.licenses!r}"


def _store(path: Path) -> str:
    store = open_store(path.parents[1] / "known.parquet")
    return f"{store.objects.table.to_csv()}"


def _loaded(path: Path) -> None:
    catalog = sg.load_catalog(path.parent / "fuzz.toml")
    layers, _ = sg.read_files(catalog.layers, [path])
    sg.assemble(layers, catalog)


def _osm(path: Path) -> None:
    catalog = sg.load_catalog("openstreetmap")
    layers, _ = sg.read_files(catalog.layers, [path])
    sg.assemble(layers, catalog)


def _portal(path: Path) -> None:
    catalog = sg.load_catalog(path.parent / "service.toml")
    layers = reader("opendatasoft")(path, catalog.layers)
    sg.assemble(layers, catalog)


def _draft(path: Path) -> None:
    sg.draft_catalog(path)


def _taxonomy(path: Path) -> sg.Taxonomy:
    return sg.open_database(path.parent / "known.parquet").taxonomy


FORMATS = (
    Format(name="database", file="known.parquet", read=_database, ours=True),
    Format(name="street objects", file="objects.parquet", read=_objects, ours=True),
    Format(name="object store", file="known.objects/objects.parquet", read=_store, ours=True),
    Format(name="object store, manifest", file="known.objects/manifest.json", read=_store),
    Format(
        name="tiles, manifest",
        file="tiles/_manifest.json",
        read=lambda path: [*map(_arrays, open_dataset(path.parent).parts())],
    ),
    Format(
        name="surroundings",
        file="objects.buildings.parquet",
        read=lambda path: sg.read_surroundings(path, crs="EPSG:32631", role="buildings"),
    ),
    Format(
        name="identifiability",
        file="plain.parquet",
        read=lambda path: open_identifiability(sg.open_database(path), path),
    ),
    Format(
        name="evaluation",
        file="evaluation/queries.parquet",
        read=lambda path: sg.open_evaluation(path.parent),
    ),
    Format(name="GeoPackage of ours", file="known.gpkg", read=read_geopackage),
    Format(name="catalogue", file="fuzz.toml", read=sg.load_catalog),
    Format(name="noise, TOML", file="noise.toml", read=open_noise),
    Format(name="noise, JSON", file="noise.json", read=open_noise),
    Format(name="rule", file="rule.json", read=open_rule),
    Format(name="experiment", file="experiment.toml", read=open_experiment_spec),
    Format(
        name="queries, JSON lines",
        file="queries.jsonl",
        read=lambda path: list(read_queries(path, taxonomy=_taxonomy(path))),
    ),
    Format(
        name="queries, CSV",
        file="queries.csv",
        read=lambda path: list(read_queries(path, taxonomy=_taxonomy(path))),
    ),
    Format(
        name="route",
        file="route.jsonl",
        read=lambda path: read_route(path, taxonomy=_taxonomy(path)),
    ),
    Format(
        name="samples",
        file="samples.jsonl",
        read=lambda path: sg.read_samples(path, taxonomy=_taxonomy(path)),
    ),
    Format(
        name="area, GeoJSON",
        file="area.geojson",
        read=lambda path: read_area(path, crs="EPSG:32631"),
    ),
    Format(
        name="raster",
        file="cells.tif",
        read=lambda path: raster_prior(sg.open_database(path.parent / "known.parquet"), path),
    ),
    *(
        Format(name=f"vector, {suffix}", file=f"objects.{suffix}", read=_loaded)
        for suffix in ("geojson", "csv", "gpkg", "fgb", "zip")
    ),
    Format(name="draft of a GeoJSON", file="objects.geojson", read=_draft),
    Format(name="draft of a CSV", file="objects.csv", read=_draft),
    Format(name="portal, GeoJSON", file="portal.geojson", read=_portal),
    *(
        Format(name=f"OpenStreetMap, {suffix}", file=f"city.{suffix}", read=_osm)
        for suffix in ("osm", "osm.gz", "osm.bz2", "osm.pbf")
    ),
)


def made_corpus(world: World, folder: Path) -> None:
    """Write an undamaged file of every format into a folder."""
    here = world.folder
    folder.mkdir()
    for name in ("known.parquet", "plain.parquet", "known.gpkg", "noise.toml", "rule.json",
                 "experiment.toml", "queries.jsonl", "queries.csv", "samples.jsonl", "cells.tif",
                 "portal.geojson", "service.toml", "city.osm"):  # fmt: skip
        shutil.copy2(here / name, folder / name)
    shutil.copytree(here / "known.objects", folder / "known.objects")
    shutil.copytree(here / "tiles", folder / "tiles")
    shutil.copytree(here / "known_evaluation", folder / "evaluation")
    for name in ("objects.parquet", "objects.buildings.parquet"):
        shutil.copy2(here / "in" / name, folder / name)
    (folder / "fuzz.toml").write_text(_CATALOG, encoding="utf-8")
    noise = tomllib.loads((folder / "noise.toml").read_text(encoding="utf-8"))
    (folder / "noise.json").write_text(json.dumps(noise), encoding="utf-8")
    views = (folder / "queries.jsonl").read_text(encoding="utf-8").splitlines()
    route = [
        json.loads(view) | ({"dx": 10, "dy": 5} if leg else {}) for leg, view in enumerate(views)
    ]
    (folder / "route.jsonl").write_text("\n".join(map(json.dumps, route)), encoding="utf-8")
    lines = (folder / "city.osm").read_text(encoding="utf-8").splitlines()
    (folder / "city.osm").write_text("\n".join([*lines[:_SMALL], "</osm>"]), encoding="utf-8")
    text = (folder / "city.osm").read_bytes()
    (folder / "city.osm.gz").write_bytes(gzip.compress(text))
    (folder / "city.osm.bz2").write_bytes(bz2.compress(text))
    with osmium.SimpleWriter(str(folder / "city.osm.pbf")) as writer:
        for node in osmium.FileProcessor(str(folder / "city.osm")):
            writer.add(node)
    places = sg.open_objects(folder / "objects.parquet").table.head(_SMALL).to_crs("EPSG:4326")
    for suffix, driver in (("geojson", "GeoJSON"), ("gpkg", "GPKG"), ("fgb", "FlatGeobuf")):
        places.to_file(folder / f"objects.{suffix}", driver=driver)
    shapes = folder / "shapes"
    shapes.mkdir()
    places.to_file(shapes / "objects.shp")
    shutil.make_archive(str(folder / "objects"), "zip", shapes)
    points = places.geometry
    places.assign(lon=points.x, lat=points.y).drop(columns="geometry").to_csv(
        folder / "objects.csv", index=False
    )
    west, south, east, north = places.total_bounds.tolist()
    ring = [[west, south], [east, south], [east, north], [west, south]]
    shape = {"type": "Polygon", "coordinates": [ring]}
    (folder / "area.geojson").write_text(
        json.dumps({"type": "Feature", "properties": {}, "geometry": shape}), encoding="utf-8"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Mutants of one format, by number."""

    format: int
    first: int
    count: int
    seed: int


def batches(mutants: int, *, seed: int) -> Iterator[Batch]:
    """Yield batches with at least the given number of mutants, equally many of each format."""
    each = -(-mutants // len(FORMATS))
    for first in range(0, each, BATCH):
        for number in range(len(FORMATS)):
            yield Batch(format=number, first=first, count=min(BATCH, each - first), seed=seed)


def faults(batch: Batch, corpus: Path, folder: Path) -> list[tuple[int, str]]:
    """Return the numbers of mutants with a fault, and the faults.

    A child process reads the batch and reports each number, so that this process knows the mutant
    if it crashes or hangs.
    """
    faults: list[tuple[int, str]] = []
    start, end = batch.first, batch.first + batch.count
    while start < end:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            try:
                _read_all(batch, range(start, end), corpus, folder, writing)
            finally:
                os._exit(0)
        os.close(writing)
        last, fault = start, ""
        with open(reading, "rb", buffering=0) as pipe:  # noqa: PTH123 - a descriptor
            text = b""
            while True:
                if not select.select([pipe], [], [], LIMIT_S)[0]:
                    fault = "hangs"
                    break
                part = pipe.read(65536)
                if not part:
                    break
                *lines, text = (text + part).split(b"\n")
                for line in lines:
                    last, report = json.loads(line)
                    if report:
                        faults.append((last, report))
        if fault:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        if last == end:
            break
        fault = fault or f"crashes: {os.waitstatus_to_exitcode(status)}"
        faults.append((last, fault))
        start = last + 1
    return faults


def _read_all(batch: Batch, numbers: range, corpus: Path, folder: Path, writing: int) -> None:
    """Read mutants, and report each number before and each fault after reading."""
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * 4096
    resource.setrlimit(resource.RLIMIT_AS, (used + _MEMORY, used + _MEMORY))
    warnings.simplefilter("ignore")
    form = FORMATS[batch.format]
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(corpus, folder)
    path, sound = folder / form.file, (corpus / form.file).read_bytes()
    contents = form.read(path) if form.ours else None
    form.read(path)
    for number in numbers:
        generator = random.Random(f"{batch.seed} {form.name} {number}")  # noqa: S311
        mutant = mutated(sound, generator, text=form.file.endswith(_TEXTS))
        path.write_bytes(mutant)
        _report(writing, number, "")
        fault = ""
        try:
            result = form.read(path)
            if form.ours and result != contents:
                fault = "read differently"
        except sg.SemsigError as error:
            words = str(error)
            if not words.endswith(".") or "\n" in words:
                fault = f"no sentence: {words}"
        except BaseException:  # noqa: BLE001 - what a user would see
            fault = "tracebacks: " + "".join(traceback.format_exc().splitlines(keepends=True)[-7:])
        if fault:
            _report(writing, number, fault[:3000])
    _report(writing, numbers.stop, "")


def _report(writing: int, number: int, fault: str) -> None:
    os.write(writing, json.dumps([number, fault]).encode() + b"\n")


def mutated(sound: bytes, generator: random.Random, *, text: bool) -> bytes:
    """Return bytes with one to three damages; in texts, also to numbers and words."""
    damaged = bytearray(sound)
    for _ in range(generator.choice((1, 1, 1, 2, 3))):
        if text and generator.random() < _RESPELT:
            damaged = bytearray(_respelt(bytes(damaged), generator))
            continue
        at = generator.randrange(len(damaged) + 1)
        size = generator.choice((1, 1, 2, 4, 8, 64, 1024))
        block = bytes(damaged[at : at + size])
        match generator.randrange(7):
            case 0:
                if at < len(damaged):
                    damaged[at] ^= 1 << generator.randrange(8)
            case 1:
                damaged[at : at + size] = generator.randbytes(len(block))
            case 2:
                damaged[at : at + size] = b""
            case 3:
                damaged[at:at] = block or b"\0"
            case 4:
                damaged[at : at + size] = generator.choice((b"\0", b"\xff")) * len(block)
            case 5:
                del damaged[at:]
            case _:
                other = generator.randrange(len(damaged) + 1)
                damaged[other : other + len(block)] = block
    return bytes(damaged)


def _respelt(sound: bytes, generator: random.Random) -> bytes:
    """Return a text with another number, word or line in it."""
    nasty = generator.choice(_NASTY).encode("utf-8", "surrogatepass")
    kind = generator.choice(("number", "word", "repeated line", "other line"))
    parts = {"number": _NUMBER, "word": _WORD}.get(kind)
    places = [match.span() for match in parts.finditer(sound)] if parts else []
    if places:
        start, end = generator.choice(places)
        return sound[:start] + nasty + sound[end:]
    lines = sound.splitlines(keepends=True) or [b""]
    at = generator.randrange(len(lines))
    if kind == "repeated line":
        lines[at : at + 1] = [lines[at]] * generator.choice((0, 2, 50))
    else:
        lines[at] = nasty + b"\n"
    return b"".join(lines)


_TEXTS = (".toml", ".json", ".jsonl", ".csv", ".geojson", ".osm")
