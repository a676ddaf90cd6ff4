"""Overture Maps from files and from a local object store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import shapely
from sentences import refused
from stores import keep_in_bucket

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources import (
    HttpSpec,
    NotCachedError,
    clip_layer,
    find_files,
    load_catalog,
    parse_area,
)
from semsig_gis.sources.readers.overture import fetch_layers, read_layers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from servers import Server
    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources import Cache, RawLayer

CATALOG = load_catalog("overture")
SPECS = CATALOG.layers
# A hundred features a degree of longitude, in ten row groups a degree.
WEST = 2.0
AREA = parse_area("2.30,48.8,2.355,48.9")
INFRASTRUCTURE = ["bench", "street_lamp", "bus_stop", "power_tower"]


def feature(number: int, shape: BaseGeometry, **values: object) -> dict[str, object]:
    xmin, ymin, xmax, ymax = (float(np.float32(side)) for side in shape.bounds)
    box = {"xmin": xmin, "xmax": xmax, "ymin": ymin, "ymax": ymax}
    plain: dict[str, object] = {"version": 1, "level": None, "source_tags": {}, "names": None}
    name = {"id": f"gers-{number}", "geometry": shapely.to_wkb(shape), "bbox": box}
    return {**name, **plain, **values}


SCHEMA = pa.schema(
    [
        ("id", pa.string()),
        ("geometry", pa.binary()),
        ("bbox", pa.struct([(side, pa.float32()) for side in ("xmin", "xmax", "ymin", "ymax")])),
        ("version", pa.int32()),
        ("subtype", pa.string()),
        ("class", pa.string()),
        ("level", pa.int32()),
        ("names", pa.struct([("primary", pa.string())])),
        ("source_tags", pa.map_(pa.string(), pa.string())),
    ]
)


def write(folder: Path, kind: str, rows: Sequence[dict[str, object]], **more: pa.DataType) -> Path:
    """Write a file of a release: ``theme=base/type=land/part-0.zstd.parquet``."""
    theme, _, name = kind.partition("/")
    path = folder / f"theme={theme}" / f"type={name}" / "part-0.zstd.parquet"
    path.parent.mkdir(parents=True, exist_ok=True)
    schema = pa.schema([*SCHEMA, *more.items()])
    records = [{key: list(v.items()) if isinstance(v, dict) and key == "source_tags" else v
             for key, v in row.items()} for row in rows]  # fmt: skip
    pq.write_table(
        pa.Table.from_pylist(records, schema), path, row_group_size=10, compression="zstd"
    )
    return path


@pytest.fixture
def release(tmp_path: Path) -> Path:
    """Return a release of made-up features along a line."""
    folder = tmp_path / "release" / "2026-08-19.0"
    places = [shapely.Point(WEST + number / 100, 48.85) for number in range(100)]
    write(folder, "base/infrastructure", [
        feature(n, place, subtype="pedestrian", **{"class": INFRASTRUCTURE[n % 4]},
                level=-1 if n == 32 else None)
        for n, place in enumerate(places)
    ])  # fmt: skip
    trees = [feature(n, p, subtype="tree", **{"class": "tree"}) for n, p in enumerate(places)]
    wood = feature(200, shapely.box(2.3, 48.84, 2.4, 48.86), subtype="forest", **{"class": "wood"})
    write(folder, "base/land", [*trees, wood])
    street = shapely.LineString([(2.3, 48.85), (2.34, 48.85)])
    way = feature(1, street, subtype="road", **{"class": "primary"}, names={"primary": "Rue"})
    write(folder, "transportation/segment", [way])
    house = feature(1, shapely.box(2.31, 48.85, 2.3101, 48.8501), has_parts=False,
                    is_underground=False)  # fmt: skip
    shop = {"basic_category": "bakery", "operating_status": "open", "names": {"primary": "Pain"}}
    closed = {"basic_category": "bank", "operating_status": "permanently_closed"}
    write(folder, "places/place", [
        feature(1, places[31], **shop), feature(2, places[32], **closed),
        feature(3, places[33], basic_category="plumbing_service"),
    ], basic_category=pa.string(), operating_status=pa.string())  # fmt: skip
    cellar = {**house, "id": "cellar", "is_underground": True}
    write(folder, "buildings/building", [house, cellar], has_parts=pa.bool_(),
          is_underground=pa.bool_())  # fmt: skip
    (tmp_path / "release" / "2025-01-22.0" / "theme=base").mkdir(parents=True)
    return folder


def kept(layers: Sequence[RawLayer]) -> dict[str, list[str]]:
    clipped = [clip_layer(layer, AREA) for layer in layers]
    return {item.spec.name: list(item.table["source_id"]) for item in clipped if len(item.table)}


EXPECTED = {
    "trees": [f"gers-{n}" for n in range(30, 36)],
    "street_lights": ["gers-33"],
    "bus_stops": ["gers-30", "gers-34"],
    "places": ["gers-1"],
    "buildings": ["gers-1"],
    "streets": ["gers-1"],
}  # bench 32 is on a level below the ground


def test_release_is_read_by_type_class_and_level(release: Path) -> None:
    pairs, absent = find_files(SPECS, [release])
    paths = list(dict.fromkeys(path for _, path in pairs))
    assert not absent
    assert len(paths) == 5
    layers = read_layers(paths, SPECS)
    assert kept(layers) == kept(read_layers(paths, SPECS, area=AREA)) == EXPECTED
    by_name = {layer.spec.name: layer for layer in layers}
    assert by_name["benches"].counts.excluded == 1
    streets = by_name["streets"].table
    assert (streets["name"].item(), streets["half_width"].item()) == ("Rue", 12.0)
    # A file of any name, as other tools write it, says by its columns what it holds.
    renamed = paths[1].rename(release / "boston.parquet")
    assert "trees" in kept(read_layers(renamed, SPECS, area=AREA))


def test_row_groups_outside_the_area_are_skipped(
    release: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []
    original = pq.ParquetFile.read_row_group

    def spy(file: pq.ParquetFile, number: int, **options: object) -> pa.Table:
        read.append(number)
        return original(file, number, **options)

    monkeypatch.setattr(pq.ParquetFile, "read_row_group", spy)
    trees = [CATALOG.layer("trees")]
    file = next(release.glob("theme=base/type=land/*"))
    (layer,) = read_layers(file, trees, area=AREA)
    assert (read, layer.counts.read) == ([3, 10], 6)  # of eleven; the last one has the wood
    read.clear()
    read_layers(file, trees)
    assert read == list(range(11))


def test_store_sends_only_the_area_and_only_once(
    release: Path, server: Server, cache: Cache
) -> None:
    padding = np.random.default_rng(1).bytes(20_000)
    land = next(release.glob("theme=base/type=land/*"))
    table = pq.read_table(land, partitioning=None)
    spoiled = pa.array([wkb + padding for wkb in table["geometry"].to_pylist()])
    table = table.set_column(1, "geometry", spoiled)  # WKB ends where its geometry does
    pq.write_table(table, land, row_group_size=10)
    address = keep_in_bucket(server, "maps", release.parent)
    lines: list[str] = []
    spec = HttpSpec(attempts=1, report=lines.append)
    options: Any = {"endpoints": [address], "area": AREA, "cache": cache}
    steps: list[tuple[int, int]] = []
    files = fetch_layers(SPECS, spec=spec, progress=lambda *s: steps.append(s), **options)
    layers = read_layers(files, SPECS)
    assert kept(layers) == EXPECTED
    assert layers[-1].table["name"].item() == "Rue"
    assert steps == [(n, 5) for n in (1, 2, 3, 4, 5)]
    assert lines == ["s3://maps: release 2026-08-19.0, 5 files"]
    size = land.stat().st_size
    ranges = [s.headers.get("range", "") for s in server.requests if "type%3Dland" in s.path]
    spans = [text.removeprefix("bytes=").split("-") for text in ranges if text]
    sent = sum(min(int(last) + 1, size) - int(first) for first, last in spans)
    assert 0 < sent < size / 3
    server.requests.clear()
    assert fetch_layers(SPECS, spec=spec, **options) == files
    assert all(request.path == "/maps" for request in server.requests)  # a release does not change
    offline = HttpSpec(offline=True)
    assert fetch_layers(SPECS, spec=offline, **options) == files
    with refused(NotCachedError, address, "without --offline"):
        fetch_layers(SPECS[:1], spec=offline, **options)


@pytest.mark.parametrize(
    ("address", "error", "words"),
    [
        ("https://maps.example", CatalogError, ("https://maps.example", "s3://bucket/folder")),
        ("s3://maps?zone=1", CatalogError, ("'zone'", "region=REGION")),
        ("s3:///maps", CatalogError, ("no bucket",)),
        ("nowhere", SourceError, ("nowhere", "cannot be listed", "check the address")),
        ("empty", SourceError, ("contains no files of base/land", "endpoints")),
    ],
)
def test_invalid_store_is_refused(
    address: str, error: type[Exception], words: Sequence[str], cache: Cache, tmp_path: Path
) -> None:
    (tmp_path / "empty" / "2026" / "theme=base" / "type=land").mkdir(parents=True)
    where = address if "/" in address else str(tmp_path / address)
    with refused(error, *words):
        fetch_layers(SPECS[:1], endpoints=[where], area=AREA, cache=cache)
