"""The first rows of a file's layers with all their fields, for a look at data not yet described."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from semsig_gis.core.errors import SourceError
from semsig_gis.sources.opendatasoft.reader import POINT, SHAPE, fold
from semsig_gis.sources.opendatasoft.table import Record, open_table
from semsig_gis.sources.vector.reader import (
    NO_GEOMETRY,
    LayerInfo,
    _columns,
    _describe,
    _layers,
    _opened,
    listening,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    import fiona

VECTOR = "vector_file"
TABLE = "opendatasoft"
OSM_SUFFIXES = frozenset({".osm", ".pbf", ".bz2"})
# Files that may be a plain table of records, which GDAL takes for nothing or for rows of text.
TABLE_SUFFIXES = frozenset({".csv", ".json", ".parquet"})
POINT_TYPE = "Point"


@dataclass(frozen=True, slots=True)
class Sample:
    """One layer, the name of its reader, and the fields of its first rows.

    `placed` says whether the reader finds the positions by itself; `coordinates` are the two fields
    in which it finds them, where they are two.
    """

    reader: str
    info: LayerInfo
    rows: tuple[Mapping[str, Any], ...]
    placed: bool = True
    coordinates: tuple[str, ...] = ()


def samples(path: Path, *, limit: int) -> tuple[Sample, ...]:
    """Return the layers of a file that may hold positions; SourceError for one not to describe."""
    suffix = path.suffix.lower()
    if suffix in OSM_SUFFIXES:
        msg = f"{path} is OpenStreetMap data; load it with the built-in catalogue 'openstreetmap'."
        raise SourceError(msg)
    try:
        layers = () if suffix == ".parquet" else tuple(_vector(path, limit))
    except SourceError:
        if suffix not in TABLE_SUFFIXES:
            raise
        layers = ()
    if suffix in TABLE_SUFFIXES and all(item.info.geometry == NO_GEOMETRY for item in layers):
        return (_table(path, limit),)
    return layers


def _vector(path: Path, limit: int) -> Iterator[Sample]:
    with listening():
        for member in _layers(path):
            columns = _columns(member, None, where=str(member))
            with _opened(member, columns) as source:
                rows = tuple(_properties(source, limit))
            coordinates = (columns.x, columns.y) if columns and columns.x and columns.y else ()
            yield Sample(VECTOR, _describe(member), rows, coordinates=coordinates)


def _properties(source: Iterable[fiona.Feature], limit: int) -> Iterator[Mapping[str, Any]]:
    features = iter(source)
    for _ in range(limit):
        try:
            feature = next(features, None)
        except Exception:  # noqa: BLE001, S112 - a load reports it; here the other rows will do
            continue
        if feature is None:
            return
        yield feature.properties


def _table(path: Path, limit: int) -> Sample:
    table = open_table(path)
    records = (item for item in table.records(table.fields) if isinstance(item, Record))
    rows = tuple(record.values for record in itertools.islice(records, limit))
    folded = {fold(field) for field in table.fields}
    info = LayerInfo(
        name=path.stem,
        geometry=POINT_TYPE,
        crs="EPSG:4326",
        rows=len(rows) + sum(1 for _ in records),
        fields=tuple((field, "") for field in table.fields),
    )
    placed = table.has_geometry or bool(folded & {fold(SHAPE), fold(POINT)})
    return Sample(TABLE, info, rows, placed)
