"""The records of a file that a service sends: JSON of each kind, GML, CSV, Parquet."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import CrsError, SourceError
from semsig_gis.sources import require_file
from semsig_gis.sources.csv_file import open_csv
from semsig_gis.sources.http.errors import error_text
from semsig_gis.sources.rows import WGS84
from semsig_gis.sources.services.gml import (
    ID,
    features,
    local_name,
    parse_xml,
    read_feature,
    stated_crs,
)
from semsig_gis.storage import parse_json

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from semsig_gis.sources.csv_file import CsvFile

BATCH = 10_000
ESRI_CODES = 37_000  # from which on codes are Esri's own
# How services call the number of all rows: Opendatasoft 2.1 and 1, WFS and OGC API Features, CKAN.
TOTALS = ("total_count", "nhits", "numberMatched", "totalFeatures", "total")


class Record(NamedTuple):
    """One row: its fields, and the geometry that stands beside them, or what is wrong with it."""

    values: Mapping[str, Any]
    geometry: object = None


# A row that cannot be understood is the message that says why.
Records = Iterator[Record | str]


@dataclass(frozen=True)
class Table:
    """A file that has been opened.

    `records` takes the fields that are wanted and returns an iterator over the rows, which may have
    a geometry that is not a field (`has_geometry`). `crs` is what the file states, if it does,
    and `notes` what is to be told of it. `empty`: no rows, and so nothing to know
    the fields by. `rest`: rows that the portal has beyond these, where the file is a page of a
    longer answer.
    """

    fields: tuple[str, ...]
    records: Callable[[Sequence[str]], Records]
    has_geometry: bool = False
    crs: CRS | None = None
    empty: bool = False
    rest: int = 0
    notes: tuple[str, ...] = ()


def open_table(path: Path) -> Table:
    """Open a file by what is in it, whatever its name; SourceError if it cannot be used."""
    require_file(path, "a file that a service sends")
    with path.open("rb") as stream:
        begin = stream.read(256).removeprefix(b"\xef\xbb\xbf").lstrip()
    if begin.startswith(b"PAR1"):
        return _parquet(path)
    if begin.startswith((b"{", b"[")):
        return _json(path)
    if begin.startswith(b"<"):
        return _gml(path)
    return _csv(path)


def _json(path: Path) -> Table:
    try:
        content = parse_json(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise _not_utf8(path) from error
    except (ValueError, RecursionError) as error:
        raise SourceError(f"{path} is not whole JSON ({error}); download it again.") from error
    if isinstance(content, dict) and isinstance(content.get("result"), dict):
        content = content["result"]  # of CKAN, in an envelope
    collection = isinstance(content, dict) and content.get("type") == "FeatureCollection"
    items, system, places = content, None, False
    if isinstance(content, dict):
        keys = ("features",) if collection else ("features", "results", "records")
        items = next((content[key] for key in keys if key in content), None)
        places = "features" in content
        system = _member_crs(content, path) if collection else _esri_crs(content, path)
    records = [_record(item) for item in items] if isinstance(items, list) else [""]
    good = [record for record in records if isinstance(record, Record)]
    if records and not good:
        raise SourceError(
            f"{path} has no records; give an export of a portal, which is a list of them or has "
            "one under features, results or records."
        )
    return Table(
        fields=tuple(dict.fromkeys(name for record in good for name in record.values)),
        records=lambda _: iter(records),
        has_geometry=places or any(record.geometry for record in good),
        crs=system,
        empty=not records,
        rest=_rest(content, len(records)),
    )


def _rest(content: object, rows: int) -> int:
    """Return how many rows more a page says that there are, in the words of each service."""
    page = content if isinstance(content, dict) else {}
    total = next((page[name] for name in TOTALS if name in page), None)
    return max(total - rows, 0) if isinstance(total, int) else 0


def _record(item: object) -> Record | str:
    """Return a feature, one of Esri, a record of Opendatasoft 1 or 2.0, or a plain one."""
    if not isinstance(item, dict):
        return f"is {json.dumps(item)[:40]}, not a record"
    if isinstance(item.get("attributes"), dict):
        return Record(item["attributes"], item.get("geometry"))
    if item.get("type") == "Feature":
        fields = item.get("properties") or {}
        if not isinstance(fields, dict):
            return "has properties without names"
        own = item.get(ID)
        if own is not None and ID not in fields:
            fields = {**fields, ID: own}
        return Record(fields, item.get("geometry"))
    inner = item.get("record", item)
    if isinstance(inner, dict) and isinstance(inner.get("fields"), dict):
        return Record(inner["fields"], inner.get("geometry"))
    return Record(item)


def _member_crs(content: dict[str, Any], path: Path) -> CRS | None:
    """Return the CRS that a GeoJSON file of before RFC 7946 states."""
    if content.get("crs") is None:
        return None
    try:
        name = content["crs"]["properties"]["name"]
    except (KeyError, TypeError):
        name = content["crs"]
    return _stated_crs(name, path)


def _esri_crs(content: Mapping[str, Any], path: Path) -> CRS | None:
    """Return the CRS that the ArcGIS REST API states by its number."""
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
    return _usual(system)


def _usual(system: CRS) -> CRS:
    return WGS84 if system.equals(WGS84, ignore_axis_order=True) else system


def _gml(path: Path) -> Table:
    content = path.read_bytes()
    try:
        root = parse_xml(content)
    except ValueError as error:
        raise SourceError(f"{path} is not whole GML ({error}); download it again.") from error
    said = error_text(content)
    found = list(features(root))
    if said or not (found or local_name(root) == "FeatureCollection"):
        what = f"contains the error {said}" if said else "has no features"
        raise SourceError(f"{path} {what}; give GML as a Web Feature Service sends it.")
    crs, swap = stated_crs(content)
    records = [Record(*read_feature(item, swap=swap)) for item in found]
    return Table(
        fields=tuple(dict.fromkeys(name for record in records for name in record.values)),
        records=lambda _: iter(records),
        has_geometry=True,
        crs=None if crs is None else _usual(crs),
        empty=not records,
    )


def _csv(path: Path) -> Table:
    file = open_csv(lambda: path.open("rb"), str(path))
    separator = file.separator
    return Table(file.layouts[separator], lambda _: _csv_records(file, separator), notes=file.notes)


def _csv_records(file: CsvFile, separator: str) -> Records:
    for row in file.rows(separator):
        yield row if isinstance(row, str) else Record(row)


def _not_utf8(path: Path) -> SourceError:
    return SourceError(f"{path} is not UTF-8 text; save it as UTF-8.")


def _parquet(path: Path) -> Table:
    try:
        with pq.ParquetFile(path) as file:
            fields = tuple(file.schema_arrow.names)
            metadata = parse_json((file.schema_arrow.metadata or {}).get(b"geo", b"{}"))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _broken_parquet(path, error) from error
    # A portal's own exports name no geometry; those that other programs made of them do.
    primary = metadata.get("primary_column")
    stated = metadata.get("columns", {}).get(primary, {}).get("crs")
    return Table(
        fields,
        lambda columns: _parquet_records(path, columns, primary),
        has_geometry=primary is not None,
        crs=None if stated is None else _stated_crs(stated, path),
    )


def _parquet_records(path: Path, fields: Sequence[str], primary: str | None) -> Records:
    columns = list(dict.fromkeys([*fields, primary] if primary else fields))
    try:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(BATCH, columns=columns):
                for values in batch.to_pylist():
                    yield Record(values, values.get(primary))
    except (pa.ArrowException, OSError) as error:
        raise _broken_parquet(path, error) from error


def _broken_parquet(path: Path, error: Exception) -> SourceError:
    cause = " ".join(str(error).split()).partition(". ")[0].rstrip(".")
    return SourceError(f"{path} is not a whole Parquet file ({cause}); download it again.")
