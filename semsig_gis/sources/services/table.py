"""Records of a file from a service: JSON in several forms, GML, CSV or Parquet."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import CrsError, SourceError
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.http.errors import error_text
from semsig_gis.sources.paths import require_file
from semsig_gis.sources.rows import WGS84
from semsig_gis.sources.services.gml import (
    ID,
    features,
    local_name,
    parse_xml,
    read_feature,
    stated_crs,
)
from semsig_gis.sources.services.json_records import find_records
from semsig_gis.sources.vector.formats import require_text
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

BATCH = 10_000
ESRI_CODES = 37_000  # codes from here on are Esri's, lower ones EPSG's
# Names of the number of all rows: Opendatasoft 2.1 and 1, WFS and OGC API Features, CKAN.
TOTALS = ("total_count", "nhits", "numberMatched", "totalFeatures", "total")


class ServiceRecord(NamedTuple):
    """A row: its fields, and its geometry outside the fields, or the error in that geometry."""

    values: Mapping[str, Any]
    geometry: object = None

    @classmethod
    def parse(cls, item: object) -> Self | str:
        """Return the record in an item, or an error message if it has none.

        Items are of GeoJSON, Esri's JSON, Opendatasoft 1 or 2.0, or plain JSON.
        """
        if not isinstance(item, dict):
            return f"is {json.dumps(item)[:40]}, not a record"
        if isinstance(item.get("attributes"), dict):
            return cls(item["attributes"], item.get("geometry"))
        if item.get("type") == "Feature":
            fields = item.get("properties") or {}
            if not isinstance(fields, dict):
                return "has properties without names"
            own = item.get(ID)
            if own is not None and ID not in fields:
                fields = {**fields, ID: own}
            return cls(fields, item.get("geometry"))
        inner = item.get("record", item)
        if isinstance(inner, dict) and isinstance(inner.get("fields"), dict):
            return cls(inner["fields"], inner.get("geometry"))
        return cls(item)


# A row that cannot be read is an error message.
Records = Iterator[ServiceRecord | str]


@dataclass(frozen=True)
class ServiceTable:
    """An opened file.

    `records` takes the names of the required fields and returns an iterator over the rows. The
    rows of a file with `has_geometry` have a geometry outside the fields. `crs` is the one that the
    file states, or None; `notes` are for the user. An `empty` file has no rows, so that its fields
    are unknown. `rest` is the number of further rows on the portal, if the file is one page.
    """

    fields: tuple[str, ...]
    records: Callable[[Sequence[str]], Records]
    has_geometry: bool = False
    crs: CRS | None = None
    empty: bool = False
    rest: int = 0
    notes: tuple[str, ...] = ()


def open_table(path: Path, *, encoding: str | None = None) -> ServiceTable:
    """Open a file by its content, not its name; SourceError if it cannot be used.

    `encoding` is that of a CSV file, if it is stated.
    """
    require_file(path, "a file that a service sends")
    with path.open("rb") as stream:
        start = stream.read(4096).removeprefix(b"\xef\xbb\xbf").lstrip()
    require_text(path, start)
    if start.startswith(b"PAR1"):
        return _parquet(path)
    if start.startswith((b"{", b"[")):
        return _json(path)
    if start.startswith(b"<"):
        return _gml(path)
    file = open_csv(lambda: path.open("rb"), str(path), encoding=encoding)
    separator = file.separator

    def records(_: Sequence[str]) -> Records:
        for row in file.rows(separator):
            yield row if isinstance(row, str) else ServiceRecord(row)

    return ServiceTable(file.layouts[separator], records, notes=file.notes)


def _json(path: Path) -> ServiceTable:
    try:
        content = parse_json(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SourceError(f"{path} is not UTF-8 text; save it as UTF-8.") from error
    except (ValueError, RecursionError) as error:
        raise SourceError(f"{path} is not whole JSON ({error}); download it again.") from error
    if isinstance(content, dict) and isinstance(content.get("result"), dict):
        content = content["result"]  # CKAN wraps its answers
    (items, notes), system, has_geometry = find_records(content), None, False
    if isinstance(content, dict):
        has_geometry = "features" in content
        system = _json_crs(content, path)
    records = [ServiceRecord.parse(item) for item in items] if isinstance(items, list) else [""]
    readable = [record for record in records if isinstance(record, ServiceRecord)]
    if records and not readable:
        raise SourceError(
            f"{path} has no records; give JSON with a list of them, such as "
            '[{"id": 1, "lat": 45.76, "lon": 4.84}].'
        )
    page = content if isinstance(content, dict) else {}
    total = next((page[name] for name in TOTALS if name in page), None)
    return ServiceTable(
        fields=tuple(dict.fromkeys(name for record in readable for name in record.values)),
        records=lambda _: iter(records),
        has_geometry=has_geometry or any(record.geometry for record in readable),
        crs=system,
        empty=not records,
        rest=max(total - len(records), 0) if isinstance(total, int) else 0,
        notes=notes,
    )


def _json_crs(content: dict[str, Any], path: Path) -> CRS | None:
    """Return the CRS in GeoJSON from before RFC 7946, or in JSON of the ArcGIS REST API."""
    if content.get("type") == "FeatureCollection":
        stated = content.get("crs")
        if stated is None:
            return None
        with contextlib.suppress(KeyError, TypeError):
            stated = stated["properties"]["name"]
        return _stated_crs(stated, path)
    stated = content.get("spatialReference")
    if not isinstance(stated, dict):
        return None
    code = stated.get("latestWkid", stated.get("wkid"))
    if code is None:
        return None if "wkt" not in stated else _stated_crs(stated["wkt"], path)
    return _stated_crs(f"{'ESRI' if code >= ESRI_CODES else 'EPSG'}:{code}", path)


def _stated_crs(definition: object, path: Path) -> CRS:
    try:
        system = CRS.from_user_input(definition)
    except CRSError as error:
        raise CrsError(
            f"{path} states a CRS that is unknown ({str(definition)[:60]}); correct it."
        ) from error
    return _without_axis_order(system)


def _without_axis_order(system: CRS) -> CRS:
    """Return WGS 84 with longitude first for WGS 84 in any axis order."""
    return WGS84 if system.equals(WGS84, ignore_axis_order=True) else system


def _gml(path: Path) -> ServiceTable:
    content = path.read_bytes()
    try:
        root = parse_xml(content)
    except ValueError as error:
        raise SourceError(f"{path} is not whole GML ({error}); download it again.") from error
    message = error_text(content)
    items = list(features(root))
    if message or not (items or local_name(root) == "FeatureCollection"):
        what = f"contains the error {message}" if message else "has no features"
        raise SourceError(f"{path} {what}; give GML as a Web Feature Service sends it.")
    crs, swap = stated_crs(content)
    records = [ServiceRecord(*read_feature(item, swap=swap)) for item in items]
    return ServiceTable(
        fields=tuple(dict.fromkeys(name for record in records for name in record.values)),
        records=lambda _: iter(records),
        has_geometry=True,
        crs=None if crs is None else _without_axis_order(crs),
        empty=not records,
    )


def _parquet(path: Path) -> ServiceTable:
    try:
        with pq.ParquetFile(path) as file:
            fields = tuple(file.schema_arrow.names)
            metadata = parse_json((file.schema_arrow.metadata or {}).get(b"geo", b"{}"))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _broken_parquet(path, error) from error
    # Exports of portals have no GeoParquet metadata; files from other programs have.
    primary = metadata.get("primary_column")
    stated = metadata.get("columns", {}).get(primary, {}).get("crs")

    def records(names: Sequence[str]) -> Records:
        columns = list(dict.fromkeys([*names, primary] if primary else names))
        try:
            with pq.ParquetFile(path) as file:
                for batch in file.iter_batches(BATCH, columns=columns):
                    for values in batch.to_pylist():
                        yield ServiceRecord(values, values.get(primary))
        except (pa.ArrowException, OSError) as error:
            raise _broken_parquet(path, error) from error

    return ServiceTable(
        fields,
        records,
        has_geometry=primary is not None,
        crs=None if stated is None else _stated_crs(stated, path),
    )


def _broken_parquet(path: Path, error: Exception) -> SourceError:
    cause = " ".join(str(error).split()).partition(". ")[0].rstrip(".")
    return SourceError(f"{path} is not a whole Parquet file ({cause}); download it again.")
