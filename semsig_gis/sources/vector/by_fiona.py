"""Read a vector file row by row with fiona, and report the error of each bad row.

pyogrio reads whole layers; fiona reads a layer again if a row may be damaged.
"""

from __future__ import annotations

import contextvars
import itertools
import logging
import math
from typing import TYPE_CHECKING, Any

import fiona
import numpy as np
import shapely
import shapely.geometry

from semsig_gis.sources.rows import BadFeatureError, Rows
from semsig_gis.sources.vector.formats import GEOJSON
from semsig_gis.sources.vector.member import NOT_UTF8, OUT_OF_REACH, unreadable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.vector.member import Member

# After this number of failures in succession, the reader does not advance any more.
MOST_FAILURES = 1_000

# Loggers of fiona: a filter acts only on the logger of a message, not on its parents.
LOGGERS = ("fiona._env", "fiona._err", "fiona.collection", "fiona.ogrext")
_records: contextvars.ContextVar[list[logging.LogRecord] | None] = contextvars.ContextVar(
    "_records", default=None
)


def _capture(record: logging.LogRecord) -> bool:
    records = _records.get()
    if records is None:
        return True
    records.append(record)
    return False


# A filter and not a handler: other users of fiona in the process keep their messages, and threads
# that read at the same time do not capture each other's messages.
for _name in LOGGERS:
    logging.getLogger(_name).addFilter(_capture)


def read_each(member: Member, fields: Sequence[str], count: int) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of a layer of `count` rows with errors of bad rows, and notes."""
    options: dict[str, Any] = {"enabled_drivers": [member.driver], "encoding": member.gdal_encoding}
    if member.driver != GEOJSON:  # its driver cannot select fields
        options["include_fields"] = list(fields)
    records: list[logging.LogRecord] = []
    token = _records.set(records)
    try:
        try:
            source = fiona.open(member.address, layer=member.layer, **options)
        except Exception as error:
            raise unreadable(member, error) from error
        with source:
            # GDAL parses a GeoJSON file as a whole, so that its messages do not belong to a row.
            rows = _rows(source, fields, count, records if member.driver != GEOJSON else [])
    finally:
        _records.reset(token)
    undecoded = any(record.getMessage().startswith("Failed to decode") for record in records)
    return rows, (NOT_UTF8,) if undecoded else ()


def _rows(
    source: Iterable[fiona.Feature],
    fields: Sequence[str],
    count: int,
    records: list[logging.LogRecord],
) -> Rows:
    rows = Rows.of(fields)
    damage = ""
    features = iter(source)
    failures = 0
    while failures < MOST_FAILURES:
        start = len(records)
        try:
            feature = next(features, None)
        except Exception as error:  # noqa: BLE001 - any error; the other rows are read
            failures += 1
            rows.skip(f"cannot be read ({error})")
            continue
        failures = 0
        # Keep the first error that GDAL reports without an exception.
        if not damage:
            new_records = itertools.islice(records, start, None)
            errors = (record for record in new_records if record.levelno >= logging.ERROR)
            damage = next((record.getMessage().rstrip(".") for record in errors), "")
        if feature is None:
            break
        rows.closed += feature.geometry is not None and _has_open_ring(feature.geometry)
        try:
            position = _position(feature.geometry)
            # After the first damage, GDAL returns null for geometries that it cannot read.
            place: Position | str = (damage or None) if position is None else position
        except BadFeatureError as error:
            place = str(error)
        rows.add(feature.properties, feature.id, place)
    if damage or failures:
        rows.mark_unreadable(count, damage or OUT_OF_REACH)
    return rows


def _position(geometry: fiona.Geometry | None) -> Position:
    if geometry is None:
        return None
    if geometry.type == "Point":
        x, y = geometry.coordinates[:2]
        # An empty point in a GeoPackage has NaN coordinates.
        return shapely.Point() if math.isnan(x) and math.isnan(y) else (x, y)
    try:
        with np.errstate(invalid="ignore"):  # NaN is checked later for all geometries at once
            return shapely.geometry.shape(geometry)
    except (AttributeError, TypeError, ValueError, shapely.errors.ShapelyError) as error:
        raise BadFeatureError(f"its {geometry.type} is not valid ({error})") from error


def _has_open_ring(geometry: fiona.Geometry) -> bool:
    """Whether a ring of a polygon is not closed; shapely closes it without a message."""
    if geometry.type not in {"Polygon", "MultiPolygon"}:
        return False
    parts = [geometry.coordinates] if geometry.type == "Polygon" else geometry.coordinates
    return any(ring[0] != ring[-1] for part in parts for ring in part if ring)
