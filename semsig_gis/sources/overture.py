"""Overture Maps: GeoParquet files, or the object store, of which only what is needed is read."""

from __future__ import annotations

import hashlib
import json
import re
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlsplit

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import shapely
from pyarrow import fs

from semsig_gis.core.errors import CatalogError, SourceError
from semsig_gis.sources.filters import ANY_VALUE, as_text
from semsig_gis.sources.http.cache import Fetched, checksum
from semsig_gis.sources.http.fetch import DEFAULT_HTTP, NotCachedError
from semsig_gis.sources.osm.elements import TagIndex
from semsig_gis.sources.rows import WGS84, RowRules, Rows, raw_layer, settle_crs
from semsig_gis.storage.text import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from shapely.geometry.base import BaseGeometry

    from semsig_gis.sources.area import Area
    from semsig_gis.sources.http.cache import Cache, CacheEntry
    from semsig_gis.sources.http.fetch import HttpSpec
    from semsig_gis.sources.layer import RawLayer
    from semsig_gis.sources.layer_spec import ElementKind, LayerSpec

    Boxes = Sequence[tuple[float, float, float, float]]

GEOMETRY, BOX, SOURCE_TAGS = "geometry", "bbox", "source_tags"
SIDES = ("xmin", "ymin", "xmax", "ymax")
# A part of a path such as theme=base.
PARTITION = re.compile(r"(theme|type)=([^/\\]+)")
# What an element of OpenStreetMap is by the shape that Overture gives it.
KINDS: dict[str, ElementKind] = {
    "Point": "node",
    "LineString": "way",
    "Polygon": "way",
    "MultiPolygon": "relation",
}
ROUNDING_DEG = 2e-5  # of the largest numbers of degrees in 32 bits
THREADS = 8  # they wait for the store most of the time
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
    """Read layers of GeoParquet files of Overture Maps, one for each of `specs`.

    The ``tags`` of a layer are columns of the file (``subtype``, ``class``), or keys of its
    ``source_tags``, which are those of OpenStreetMap. A file whose path says another theme or type
    than the ``dataset`` of a layer holds nothing of it. Of an `area`, row groups outside are not
    read, by the statistics of ``bbox``. SourceError if a file is not of Overture Maps.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else list(path)
    where = str(paths[0]) if len(paths) == 1 else f"{len(paths)} files"
    layers = [_FeatureLayer(spec, filters=filters, where=where) for spec in specs]
    for file in paths:
        present = [layer for layer in layers if _may_hold(str(file), layer.spec)]
        if present:
            rules = [layer.spec for layer in present]
            for table in _slices(fs.LocalFileSystem(), str(file), rules, _boxes(area)):
                _add(table, present)
    return tuple(layer.raw(crs) for layer in layers)


def _may_hold(path: str, spec: LayerSpec) -> bool:
    """Tell whether a file may hold a layer, by what its path says of its theme and type."""
    said: dict[str, str] = dict(PARTITION.findall(path))
    theme, _, kind = (spec.dataset or "").partition("/")
    return said.get("theme", theme) == theme and said.get("type", kind) == kind


class _FeatureLayer:
    """A layer that is being read, of features that have its tags."""

    def __init__(self, spec: LayerSpec, *, filters: bool, where: str) -> None:
        self.spec = spec
        self.rows = Rows()
        fields = [field for _, field in spec.fields]  # any key of a tag may be one
        self._rules = RowRules(
            spec, fields, filters=filters, where=f"layer {spec.name!r} ({where})"
        )

    def add(self, values: Mapping[str, Any], name: str, shape: BaseGeometry | None) -> None:
        """Add a feature that has the tags of the layer, if it is of a shape that it wants."""
        self.rows.read += 1
        if shape is not None and KINDS.get(shape.geom_type) not in {*self.spec.elements, None}:
            self.rows.filtered += 1
            return
        self.rows.add([values.get(field) for field in self._rules.fields], name, shape)

    def raw(self, crs: str | None) -> RawLayer:
        """Return the layer; features are in WGS 84, whatever CRS the user states."""
        system, notes = settle_crs(
            WGS84, implicit=False, expected=self.spec.crs, given=crs, where=self._rules.file
        )
        return raw_layer(self.rows, self._rules, system, by_file=True, notes=notes)


def _add(table: pa.Table, layers: Sequence[_FeatureLayer]) -> None:
    """Add the rows of a table to the layers whose tags they have."""
    index = TagIndex([layer.spec for layer in layers])
    shapes = shapely.from_wkb(_wkb(table.column(GEOMETRY)), on_invalid="ignore")
    columns = {
        name: table.column(name).to_pylist()
        for name in table.column_names
        if name not in {GEOMETRY, SOURCE_TAGS} and not name.startswith(f"{BOX}.")
    }
    source_tags = (
        table.column(SOURCE_TAGS).to_pylist()
        if SOURCE_TAGS in table.column_names
        else [None] * len(table)
    )
    names = columns.get("id", [""] * len(table))
    for number, (row, tags) in enumerate(
        zip(zip(*columns.values(), strict=True), source_tags, strict=True)
    ):
        own = zip(columns, row, strict=True)
        values = {**dict(tags or ()), **{key: value for key, value in own if value is not None}}
        said = {key: as_text(value) for key, value in values.items() if value is not None}
        for place in index.layers(said):
            layers[place].add(values, str(names[number] or ""), shapes[number])


def _wkb(column: pa.ChunkedArray) -> Any:  # noqa: ANN401 - an array of objects
    """Return geometries as bytes, also where the file says that they are geometries."""
    whole = pa.chunked_array(column.chunks, column.type).combine_chunks()
    storage = whole.storage if isinstance(whole.type, pa.BaseExtensionType) else whole
    return storage.to_numpy(zero_copy_only=False)


# --- Of a file, what is needed ------------------------------------------------------------------


def _boxes(area: Area | None) -> Boxes | None:
    """Return the boxes of an area, a little larger, because those of a file are rounded."""
    if area is None:
        return None
    return [
        (west - ROUNDING_DEG, south - ROUNDING_DEG, east + ROUNDING_DEG, north + ROUNDING_DEG)
        for west, south, east, north in area.boxes
    ]


def _slices(
    system: fs.FileSystem, path: str, specs: Sequence[LayerSpec], boxes: Boxes | None
) -> Iterator[pa.Table]:
    """Yield the rows of a file that layers and boxes may want, with the columns that they need.

    Structures are flat: ``names.primary``.
    """
    try:
        with system.open_input_file(path) as stream, pq.ParquetFile(stream) as file:
            columns = _columns(file.schema_arrow, specs, where=path)
            for number in _row_groups(file.metadata, boxes):
                table = file.read_row_group(number, columns=columns).flatten()
                mask = pc.and_(_in_boxes(table, boxes), _may_have_tags(table, specs))
                yield table.filter(mask)
    except (OSError, pa.ArrowException) as error:
        raise SourceError(
            f"{path} cannot be read as GeoParquet ({_cause(error)}); download it again."
        ) from error


def _columns(schema: pa.Schema, specs: Iterable[LayerSpec], *, where: str) -> list[str]:
    """Return the columns to read; SourceError if the file is none of Overture Maps."""
    keys = {key for spec in specs for tags in spec.tags for key, _ in tags}
    if not {"id", GEOMETRY} <= {*schema.names} or keys.isdisjoint(schema.names):
        raise SourceError(
            f"{where} is not a file of Overture Maps, which would have the columns id, geometry "
            f"and class; its columns are {', '.join(schema.names) or 'none at all'}."
        )
    keys |= {field for spec in specs for _, field in spec.fields}
    own = {key for key in keys if {key, key.partition(".")[0]} & {*schema.names}}
    also = {SOURCE_TAGS} if keys - own else set()
    return sorted({"id", GEOMETRY, *own} | ({BOX, *also} & {*schema.names}))


def _row_groups(metadata: pq.FileMetaData, boxes: Boxes | None) -> list[int]:
    """Return the numbers of the row groups that may have something in one of the boxes."""
    groups = range(metadata.num_row_groups)
    return list(groups) if boxes is None else [n for n in groups if _meets(metadata, n, boxes)]


def _meets(metadata: pq.FileMetaData, group: int, boxes: Boxes) -> bool:
    """Tell whether the statistics of a row group leave open that it has something in a box."""
    rows = metadata.row_group(group)
    columns = (rows.column(number) for number in range(rows.num_columns))
    known = {
        column.path_in_schema.removeprefix(f"{BOX}."): column.statistics
        for column in columns
        if column.path_in_schema.startswith(f"{BOX}.")
        and column.statistics is not None
        and column.statistics.has_min_max
    }
    if not known.keys() >= {*SIDES}:
        return True
    least, most = ({side: getattr(known[side], end) for side in SIDES} for end in ("min", "max"))
    return any(
        least["xmin"] <= east
        and most["xmax"] >= west
        and least["ymin"] <= north
        and most["ymax"] >= south
        for west, south, east, north in boxes
    )


def _in_boxes(table: pa.Table, boxes: Boxes | None) -> pa.ChunkedArray:
    """Tell which rows meet one of the boxes; where nobody knows, all do."""
    if boxes is None or not {f"{BOX}.{side}" for side in SIDES} <= {*table.column_names}:
        return pa.array(np.ones(len(table), bool))
    xmin, ymin, xmax, ymax = (table.column(f"{BOX}.{side}").to_numpy() for side in SIDES)
    inside = np.zeros(len(table), bool)
    for west, south, east, north in boxes:
        inside |= (xmin <= east) & (xmax >= west) & (ymin <= north) & (ymax >= south)
    return pa.array(inside)


def _may_have_tags(table: pa.Table, specs: Iterable[LayerSpec]) -> pa.Array:
    """Tell which rows may have the tags of a layer, by the columns that the tags are."""
    mask = np.zeros(len(table), bool)
    for spec in specs:
        for tags in spec.tags:
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
            mask |= rows
    return pa.array(mask)


def _cause(error: BaseException) -> str:
    """Return what a library says went wrong, as part of a sentence."""
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
    """Fetch what layers have in an area from the first store, as files for `read_layers`.

    A store is ``s3://bucket/folder`` (with ``?region=``, ``endpoint_override=`` and ``scheme=``,
    asked without credentials) or a folder of this machine. It holds a release, or several, of which
    the latest counts. Of every file of the layers' themes and types its end is read, which says
    where its row groups lie, and then those that meet the area. What they have goes into the cache,
    file by file, so that a run that was interrupted goes on there. SourceError where that fails.
    """
    address, boxes = endpoints[0], _boxes(area)
    published = [layer for layer in specs if layer.dataset is not None]
    kinds = sorted({layer.dataset or "" for layer in published})
    system, folder = _open_store(address, spec)
    release, files = _listing(system, folder, kinds, address=address, cache=cache, spec=spec)
    spec.report(f"{address.partition('?')[0]}: release {release}, {len(files):,} files")

    def held(file: str) -> Path:
        rules = [layer for layer in published if _may_hold(file, layer)]
        what = [address, file, boxes, [[layer.name, layer.tags, layer.fields] for layer in rules]]
        key = _key(what)
        if (kept := cache.entry(key).cached_file()) is not None:  # a release does not change
            return kept.path
        if spec.offline:
            raise _not_cached(file, address, cache)
        with cache.locked(key) as entry:
            tables = [table for table in _slices(system, file, rules, boxes) if len(table)]
            body = entry.temporary_path(".parquet")
            # A file that has nothing here is known as such by one without columns.
            pq.write_table(pa.concat_tables(tables) if tables else pa.table({}), body)
            return _keep(entry, body, f"{address.partition('?')[0]} {file}", what)

    with ThreadPoolExecutor(THREADS) as pool:
        paths = []
        for path in pool.map(held, files):
            paths.append(path)
            if progress is not None:
                progress(len(paths), len(files))
    return [path for path in paths if pq.read_schema(path).names]


def _open_store(address: str, spec: HttpSpec) -> tuple[fs.FileSystem, str]:
    """Return the file system of a store, and the folder in it."""
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
    """Return the release in a folder, the latest of several, and its files of the kinds.

    Offline it is what the last run found.
    """
    what = [address, *kinds]
    key = _key(what)
    if spec.offline:
        held = cache.entry(key).cached_file()
        if held is None:
            raise _not_cached(folder, address, cache)
        found = parse_json(held.path.read_bytes())
        return found["release"], found["files"]
    try:
        release = _latest(system, folder)
        files = [
            info.path
            for kind in kinds
            for info in system.get_file_info(_files_of(release, kind))
            if info.path.endswith(".parquet")
        ]
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
        _keep(entry, body, address, what)
    return Path(release).name, files


def _latest(system: fs.FileSystem, folder: str) -> str:
    """Return the folder of the latest release, which is the folder itself if it has themes."""
    names = sorted(info.path for info in system.get_file_info(fs.FileSelector(folder)))
    if not names:
        raise FileNotFoundError("it contains nothing")
    return folder if any(PARTITION.search(Path(name).name) for name in names) else names[-1]


def _files_of(release: str, kind: str) -> fs.FileSelector:
    """Return what selects the files of a kind; part of a release may be all that is there."""
    theme, _, name = kind.partition("/")
    return fs.FileSelector(f"{release}/theme={theme}/type={name}", allow_not_found=True)


def _key(what: Sequence[object]) -> str:
    return hashlib.sha256(json.dumps(what).encode()).hexdigest()[:32]


def _keep(entry: CacheEntry, body: Path, address: str, what: Sequence[object]) -> Path:
    """Make a file that was written in the place for it the entry of the cache; return its path."""
    fetched = Fetched(
        path=body,
        sha256=checksum(body),
        fetched_at=datetime.now(UTC).isoformat(timespec="seconds"),
        url=address,
        from_cache=False,
        bytes=body.stat().st_size,
        content_type="",
        etag="",
        last_modified="",
    )
    return entry.store(fetched, {"read": what}).path


def _not_cached(what: str, address: str, cache: Cache) -> NotCachedError:
    return NotCachedError(
        f"{what} of {address} is not in the cache {cache.folder}; run once without --offline to "
        "fetch it."
    )
