"""Overture Maps: GeoParquet files, or the parts of the object store that an area needs."""

from __future__ import annotations

import itertools
import json
import math
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import shapely
from pyarrow import fs

from semsig_gis.core import CatalogError, SourceError
from semsig_gis.sources.filters import ANY_VALUE, as_text
from semsig_gis.sources.http.cache import cache_key, checksum
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, cached_file
from semsig_gis.sources.osm.elements import TagIndex, element_layers
from semsig_gis.sources.registry import READERS, Source, fetch_by_tiles
from semsig_gis.sources.rows import WGS84
from semsig_gis.storage import groups_meeting, parse_json, rows_meeting

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Cache
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec
    from semsig_gis.sources.rows import LayerBuilder

    Boxes = Sequence[tuple[float, float, float, float]]

GEOMETRY, BOX, SOURCE_TAGS = "geometry", "bbox", "source_tags"
# Part of a path, such as theme=base.
PARTITION = re.compile(r"(theme|type)=([^/\\]+)")
# Kinds of OpenStreetMap elements by their type of geometry in Overture.
KIND_BY_GEOMETRY: dict[str, ElementKind] = {
    "Point": "node",
    "LineString": "way",
    "Polygon": "way",
    "MultiPolygon": "relation",
}
EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)
ROUNDING_DEG = 2e-5  # error of the largest degrees as 32-bit floats
THREADS = 8  # more than processors, because they mostly wait for the store
STORE = "s3"
STORE_OPTIONS = ("region", "endpoint_override", "scheme")


def read_layers(
    path: str | Path | Sequence[Path],
    specs: Sequence[LayerSpec],
    *,
    filters: bool = True,
    crs: str | None = None,
    area: Area | None = None,
) -> tuple[RawLayer, ...]:
    """Read the layers of `specs` from GeoParquet files of Overture Maps.

    The ``tags`` of a layer are columns of the file (``subtype``, ``class``) or keys of its
    ``source_tags``, the tags of OpenStreetMap. A file is skipped if its path has another theme or
    type than the ``dataset`` of a layer. Row groups outside `area` are skipped by the statistics of
    ``bbox``. SourceError if a file is not from Overture Maps.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
    layers = element_layers(specs, filters=filters, where=where)
    for file in paths:
        present = [layer for layer in layers if _may_hold(str(file), layer.spec)]
        if present:
            present_specs = [layer.spec for layer in present]
            for table in _slices(fs.LocalFileSystem(), str(file), present_specs, _boxes(area)):
                _add_rows(table, present)
    return tuple(layer.layer(WGS84, requested=crs) for layer in layers)


def _may_hold(path: str, spec: LayerSpec) -> bool:
    """Whether a file may contain a layer, by the theme and type in its path."""
    parts: dict[str, str] = dict(PARTITION.findall(path))
    theme, _, kind = (spec.dataset or "").partition("/")
    return parts.get("theme", theme) == theme and parts.get("type", kind) == kind


def _add_rows(table: pa.Table, layers: Sequence[LayerBuilder]) -> None:
    """Add the rows of a table to the layers that they belong to by their tags."""
    index = TagIndex([layer.spec for layer in layers])
    geometry = table.column(GEOMETRY)
    geometry = pa.chunked_array(geometry.chunks, geometry.type).combine_chunks()
    if isinstance(geometry.type, pa.BaseExtensionType):  # a column with the type of GeoArrow
        geometry = geometry.storage
    shapes = shapely.from_wkb(geometry.to_numpy(zero_copy_only=False), on_invalid="ignore")
    own = [n for n in table.column_names if n != GEOMETRY and not n.startswith(f"{BOX}.")]
    for row, shape in zip(table.select(own).to_pylist(), shapes, strict=True):
        values = {key: value for key, value in row.items() if value is not None}
        values = {**dict(values.pop(SOURCE_TAGS, ())), **values}
        texts = {key: as_text(value) for key, value in values.items() if value is not None}
        kind = None if shape is None else KIND_BY_GEOMETRY.get(shape.geom_type)
        for layer in (layers[number] for number in index.layers(texts)):
            if kind in {*layer.spec.elements, None}:
                layer.rows.add(values, str(row.get("id") or ""), shape)
            else:
                layer.rows.skip()


# --- The needed parts of a file -------------------------------------------------------------------


def _boxes(area: Area | None) -> Boxes:
    """Return the boxes of an area, a little larger, because the boxes in a file are rounded."""
    if area is None:
        return [EVERYWHERE]
    return [
        (west - ROUNDING_DEG, south - ROUNDING_DEG, east + ROUNDING_DEG, north + ROUNDING_DEG)
        for west, south, east, north in area.boxes
    ]


def _slices(
    system: fs.FileSystem, path: str, specs: Sequence[LayerSpec], boxes: Boxes
) -> Iterator[pa.Table]:
    """Yield the rows of a file that may be in the layers and boxes, with the needed columns.

    Columns of structures are flattened: ``names.primary``.
    """
    try:
        with system.open_input_file(path) as stream, pq.ParquetFile(stream) as file:
            columns = _columns(file.schema_arrow, specs, where=path)
            for number in groups_meeting(file, *boxes):
                table = rows_meeting(file.read_row_group(number, columns=columns), *boxes).flatten()
                yield table.filter(pa.array(_may_match(table, specs)))
    except (OSError, pa.ArrowException) as error:
        raise SourceError(
            f"{path} cannot be read as GeoParquet ({_cause(error)}); download it again."
        ) from error


def _columns(schema: pa.Schema, specs: Iterable[LayerSpec], *, where: str) -> list[str]:
    """Return the columns to read; SourceError if the file is not from Overture Maps."""
    keys = {key for spec in specs for tags in spec.tags for key, _ in tags}
    # Files of places of older releases lack the key of the layer, yet not these categories.
    columns = {*keys, "categories"}
    if not {"id", GEOMETRY} <= {*schema.names} or columns.isdisjoint(schema.names):
        raise SourceError(
            f"{where} is not a file of Overture Maps, which would have the columns id, geometry "
            f"and class; its columns are {', '.join(schema.names) or 'none at all'}."
        )
    keys |= {field for spec in specs for _, field in spec.fields}
    key_columns = {key for key in keys if {key, key.partition(".")[0]} & {*schema.names}}
    # Keys that are not columns may be tags of OpenStreetMap.
    optional = {BOX, SOURCE_TAGS} if keys - key_columns else {BOX}
    return sorted({"id", GEOMETRY, *key_columns} | (optional & {*schema.names}))


def _may_match(table: pa.Table, specs: Iterable[LayerSpec]) -> NDArray[np.bool_]:
    """Return the mask of the rows that may be in a layer; tags in `source_tags` are not checked."""
    tagged = np.zeros(len(table), bool)
    for tags in itertools.chain.from_iterable(spec.tags for spec in specs):
        # A row matches one of the alternatives in all its keys.
        rows = np.ones(len(table), bool)
        for key, accepted in tags:
            column = table.column(key) if key in table.column_names else None
            if column is not None and column.type in {pa.string(), pa.large_string()}:
                is_in = (
                    pc.is_valid(column)
                    if ANY_VALUE in accepted
                    else pc.is_in(column, value_set=pa.array(accepted, column.type))
                )
                rows &= is_in.to_numpy()
        tagged |= rows
    return tagged


def _cause(error: BaseException) -> str:
    """Return the message of a library as a part of a sentence."""
    text = " ".join(str(error).partition(". Detail:")[0].split())
    return re.sub(r"^\[Errno \d+\] ", "", text).rstrip(".").replace(". ", ", ")


# --- Live -----------------------------------------------------------------------------------------


def fetch_layers(
    specs: Sequence[LayerSpec],
    *,
    endpoints: Sequence[str],
    area: Area,
    cache: Cache,
    spec: HttpSpec = DEFAULT_HTTP,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Download the Overture features of layers in an area as files for `read_layers`.

    The first of `endpoints` is used.

    A store is ``s3://bucket/folder`` (with ``?region=``, ``endpoint_override=`` and ``scheme=``,
    read without credentials) or a local folder. It contains one or several releases; the latest is
    used. Of each file of the layers' themes and types, the metadata at its end and the row groups
    that meet the area are read. The results are cached file by file, so that a later run continues
    an interrupted one. SourceError if the store cannot be read.
    """
    address, boxes = endpoints[0], _boxes(area)
    layers = [layer for layer in specs if layer.dataset is not None]
    kinds = sorted({layer.dataset or "" for layer in layers})
    system, folder = _open_store(address, spec)
    release, files = _listing(system, folder, kinds, address=address, cache=cache, spec=spec)
    spec.report(f"{address.partition('?')[0]}: release {release}, {len(files):,} files")

    def fetch_part(file: str) -> Path:
        present = [layer for layer in layers if _may_hold(file, layer)]
        rules = [[layer.name, layer.tags, layer.fields] for layer in present]
        what = [address, file, boxes, rules]
        key = cache_key(what)
        if spec.offline:
            return cached_file(cache, key, what=f"{file} of {address}").path
        if (cached := cache.entry(key).cached_file()) is not None:  # a release does not change
            return cached.path
        with cache.locked(key) as entry:
            tables = [table for table in _slices(system, file, present, boxes) if len(table)]
            body = entry.temporary_path(".parquet")
            # A file without columns records that there is nothing in the area.
            pq.write_table(pa.concat_tables(tables) if tables else pa.table({}), body)
            url = f"{address.partition('?')[0]} {file}"
            content = {"read": what}
            return entry.store(body, sha256=checksum(body), url=url, request=content).path

    with ThreadPoolExecutor(THREADS) as pool:
        paths = []
        for path in pool.map(fetch_part, files):
            paths.append(path)
            if progress is not None:
                progress(len(paths), len(files))
    return [path for path in paths if pq.read_schema(path).names]


def _open_store(address: str, spec: HttpSpec) -> tuple[fs.FileSystem, str]:
    """Return the file system of a store and the folder in it."""
    parts = urlsplit(address)
    if parts.scheme != STORE:
        if "://" in address:
            raise CatalogError(
                f"{address!r} is not a store; write s3://bucket/folder, or a folder of this "
                "machine."
            )
        return fs.LocalFileSystem(), str(Path(address))
    options = dict(parse_qsl(parts.query))
    unknown = sorted(options.keys() - {*STORE_OPTIONS})
    if unknown or not parts.netloc:
        what = f"the unknown option {unknown[0]!r}" if unknown else "no bucket"
        raise CatalogError(
            f"{address!r} has {what}; write s3://bucket/folder?region=REGION, and perhaps "
            f"{' and '.join(STORE_OPTIONS[1:])}."
        )
    connect, read = spec.timeout
    system = fs.S3FileSystem(
        anonymous=True,
        connect_timeout=connect,
        request_timeout=read,
        retry_strategy=fs.AwsStandardS3RetryStrategy(max_attempts=spec.attempts),
        **options,
    )
    return system, f"{parts.netloc}{parts.path}".rstrip("/")


def _listing(
    system: fs.FileSystem,
    folder: str,
    kinds: Sequence[str],
    *,
    address: str,
    cache: Cache,
    spec: HttpSpec,
) -> tuple[str, list[str]]:
    """Return the latest release in a folder and its files of `kinds`; offline, from the cache."""
    what = [address, *kinds]
    key = cache_key(what)
    if spec.offline:
        cached = cached_file(cache, key, what=f"{folder} of {address}")
        content = parse_json(cached.path.read_bytes())
        return content["release"], content["files"]
    try:
        release = _latest(system, folder)
        files = []
        for kind in kinds:
            theme, _, name = kind.partition("/")
            path = f"{release}/theme={theme}/type={name}"  # a local release may lack it
            infos = system.get_file_info(fs.FileSelector(path, allow_not_found=True))
            files += [info.path for info in infos if info.path.endswith(".parquet")]
    except OSError as error:
        raise SourceError(
            f"{address} cannot be listed ({_cause(error)}); check the address, or load files of "
            "Overture Maps instead."
        ) from error
    if not files:
        raise SourceError(
            f"{release} contains no files of {', '.join(kinds)}; name another store in endpoints."
        )
    with cache.locked(key) as entry:
        body = entry.temporary_path(".json")
        body.write_text(json.dumps({"release": Path(release).name, "files": files}), "utf-8")
        entry.store(body, sha256=checksum(body), url=address, request={"read": what})
    return Path(release).name, files


def _latest(system: fs.FileSystem, folder: str) -> str:
    """Return the folder of the latest release: the folder itself if it contains themes."""
    names = sorted(info.path for info in system.get_file_info(fs.FileSelector(folder)))
    if not names:
        raise FileNotFoundError("it contains nothing")
    return folder if any(PARTITION.search(Path(name).name) for name in names) else names[-1]


FETCH = fetch_by_tiles(fetch_layers, read_layers)
READERS.register(Source(read=read_layers, fetch=FETCH, merging=True, pruning=True), __name__)
