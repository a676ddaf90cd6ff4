"""Building and updating a country of fifty towns in tiles, with two processes of dask."""

from __future__ import annotations

import logging
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import geopandas as gpd
import numpy as np
from distributed import Client, LocalCluster

from benchmarks.comparison import Comparison
from benchmarks.memory import own_peak
from semsig_gis.core import GridSpec, SignatureSpec
from semsig_gis.database import (
    TileSpec,
    ViewpointSpec,
    build_tile,
    build_tiles,
    open_database,
    open_store,
    plan_tiles,
    save_with_store,
    update_tiles,
)
from semsig_gis.objects import build_objects, open_objects, save_objects
from semsig_gis.sources import CitySpec, paper_taxonomy, synthetic_city

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semsig_gis.database import Manifest
    from semsig_gis.sources import RawLayer

__all__ = ["comparisons"]

_SEED = 50
_SPACING = 25_000.0  # metres between towns
_CORNER = np.array([400_000.0, 5_300_000.0])
_ROW = 10  # towns from west to east
_SAMPLE = 12  # tiles to build again and compare
_MOST_MB = 2048.0
_CHANGED = 0.01  # share of the objects
_SEEN = 12  # objects in the view that is localized
_ANSWER = """
import atexit, sys
from benchmarks.memory import own_peak
from semsig_gis.cli import main
atexit.register(lambda: print(own_peak(), file=sys.stderr))
main()
"""


@dataclass(frozen=True, slots=True)
class _Size:
    """Size of the country, and number of towns (`few`) of the smaller one for comparison."""

    towns: int
    few: int
    metres: float
    tile: float


_SIZES = {"full": _Size(50, 10, 2_800.0, 2_000.0), "small": _Size(3, 1, 300.0, 200.0)}


@dataclass(frozen=True, slots=True)
class _Run:
    """The result of a build, its time and its memory."""

    manifest: Manifest
    seconds: float
    peak_mb: float


def comparisons(size: str) -> Iterator[Comparison]:
    """Measure time and memory of building and updating one country."""
    scale = _SIZES[size]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _save_country(folder / "few.parquet", scale.few, scale.metres)
        _save_country(folder / "country.parquet", scale.towns, scale.metres)
        with _cluster(2) as (client, address):
            few = _build(folder, "few", scale, client, address)
        with _cluster(1) as (client, address):
            single = _build(folder, "country", scale, client, address)
        with _cluster(2) as (client, address):
            two = _build(folder, "country", scale, client, address)
            equal = _check_sample(folder, "country", scale)
            if single.manifest != two.manifest:
                raise ArithmeticError("the results of one and of two processes differ.")
            updates = list(_updates(folder, scale, address))
        answers = list(_answers(folder))
    what = f"{two.manifest.cells:,} cells of {scale.towns} towns in {len(two.manifest.parts)} tiles"
    print(
        f"{what}: {two.manifest.cells / two.seconds:,.0f} cells a second; the files of one process "
        f"and of {equal} tiles built here are equal, byte for byte"
    )
    yield Comparison(
        name=f"building {what} by 2 processes",
        unit="s",
        ours=two.seconds,
        peer=single.seconds,
        peer_name="by 1 process",
        bar=None,
    )
    yield Comparison(
        name=f"peak memory of a process that builds {what}",
        unit="MB",
        ours=two.peak_mb,
        peer=_MOST_MB,
        peer_name="2 GB",
        bar=1.0,
    )
    yield Comparison(
        name=f"growth of that memory from {scale.few} to {scale.towns} towns",
        unit="MB",
        ours=two.peak_mb,
        peer=few.peak_mb,
        peer_name=f"with {scale.few} towns in {len(few.manifest.parts)} tiles",
        bar=0.8,
    )
    yield from updates
    yield from answers


def _answers(folder: Path) -> Iterator[Comparison]:
    """Compare `semsig localize` in the tiles and in one file of the same cells."""
    database = open_database(folder / "country")
    save_with_store(database, open_store(folder / "country"), folder / "country.semsig.parquet")
    cell = int(np.abs(database.lengths - _SEEN).argmin())
    bearings = database.bearings[database.offsets[cell] : database.offsets[cell + 1]].tolist()
    options = ["--types", database.types(cell), "--bearings", ",".join(map(str, bearings))]
    for name in ("country", "country.semsig.parquet"):
        _answer(folder / name, options)  # so that the files are in memory and kernels compiled
    (tiles, *ours), (file, *peer) = (
        _answer(folder / name, options) for name in ("country", "country.semsig.parquet")
    )
    if tiles != file:
        raise ArithmeticError("the answers of the tiles and of one file differ.")
    for what, unit, mine, other in zip(
        ("time", "peak memory"), ("s", "MB"), ours, peer, strict=True
    ):
        yield Comparison(
            name=f"{what} of `semsig localize` in the tiles of {len(database):,} cells",
            unit=unit,
            ours=mine,
            peer=other,
            peer_name="in one file",
            bar=None,
        )


def _answer(database: Path, options: list[str]) -> tuple[str, float, float]:
    """Localize a view in a new process; return its output, its seconds and its peak memory."""
    command = [sys.executable, "-c", _ANSWER, "localize", str(database), *options, "--json"]
    start = time.perf_counter()
    run = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    return run.stdout, time.perf_counter() - start, float(run.stderr.split()[-1])


def _updates(folder: Path, scale: _Size, scheduler: str) -> Iterator[Comparison]:
    """Compare updates after objects of one town or of all moved with a new build."""
    objects = open_objects(folder / "country.parquet")
    xy, count = objects.xy, int(_CHANGED * len(objects))
    from_first = np.hypot(*(xy - xy[0]).T)
    rng = np.random.default_rng(_SEED)
    for where, rows in (
        ("in one place", np.argsort(from_first, kind="stable")[:count]),
        ("everywhere", rng.permutation(len(objects))[:count]),
    ):
        table = objects.table.copy()
        shifts = np.zeros((len(table), 2))
        shifts[rows] = rng.uniform(-5.0, 5.0, (count, 2))
        table.geometry = gpd.GeoSeries.from_xy(*(xy + shifts).T, index=table.index, crs=table.crs)
        save_objects(replace(objects, table=table), folder / "later.parquet")
        start = time.perf_counter()
        fresh = _built(folder, "later", scale, scheduler)
        built = time.perf_counter()
        update_tiles(
            folder / "country",
            folder / "later.parquet",
            out=folder / "updated",
            scheduler=scheduler,
        )
        updated = time.perf_counter()
        for file in sorted((folder / "later").rglob("*.*")):
            part = file.relative_to(folder / "later")
            if file.read_bytes() != (folder / "updated" / part).read_bytes():
                raise ArithmeticError(
                    f"{file.name} of the update differs from that of a fresh build."
                )
        for name in ("later", "updated"):
            shutil.rmtree(folder / name)
        yield Comparison(
            name=f"updating {fresh.cells:,} cells where {count:,} objects {where} moved",
            unit="s",
            ours=updated - built,
            peer=built - start,
            peer_name="a fresh build",
            bar=None,
        )


def _save_country(path: Path, towns: int, metres: float) -> None:
    """Save the street objects of several towns, 25 km apart."""
    rng = np.random.default_rng(_SEED)
    layers: list[RawLayer] = []
    for town in range(towns):
        place = np.array(divmod(town, _ROW)[::-1]) + rng.uniform(-0.2, 0.2, 2)
        east, north = (_CORNER + place * _SPACING).tolist()
        layers += synthetic_city(CitySpec(size=metres, seed=town, centre=(east, north)))
    objects, _ = build_objects(layers, taxonomy=paper_taxonomy(), crs=layers[0].table.crs)
    save_objects(objects, path)


@contextmanager
def _cluster(workers: int) -> Iterator[tuple[Client, str]]:
    """Start new processes, which have used little memory, and import their modules."""
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            memory_limit=0,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.run(paper_taxonomy)
        yield client, cluster.scheduler_address


def _build(folder: Path, name: str, scale: _Size, client: Client, scheduler: str) -> _Run:
    """Build a country with the processes of a scheduler, and measure time and peak memory."""
    start = time.perf_counter()
    manifest = _built(folder, name, scale, scheduler)
    seconds = time.perf_counter() - start
    return _Run(manifest, seconds, max(client.run(own_peak).values()))


def _built(folder: Path, name: str, scale: _Size, scheduler: str) -> Manifest:
    """Build a country in tiles."""
    return build_tiles(
        folder / f"{name}.parquet", folder / name, tile=TileSpec(scale.tile), scheduler=scheduler
    )


def _check_sample(folder: Path, name: str, scale: _Size) -> int:
    """Build some tiles in this process and raise if a file differs; return their number."""
    plan = plan_tiles(
        folder / f"{name}.parquet",
        folder / "sample",
        tile=TileSpec(scale.tile),
        grid=GridSpec(),
        spec=SignatureSpec(),
        viewpoints=ViewpointSpec(),
    )
    files = sorted((folder / name).glob("*.parquet"))
    sample = np.random.default_rng(_SEED).permutation(len(files))[:_SAMPLE]
    for file in (files[number] for number in sample.tolist()):
        _, column, row = file.stem.split("_")
        part = build_tile(plan, (int(column), int(row)))
        if part is None or (plan.folder / part.file).read_bytes() != file.read_bytes():
            raise ArithmeticError(f"{file.name} differs from what this process builds.")
    return len(sample)
