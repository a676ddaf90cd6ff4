"""Rows of a vector file one by one, through fiona, which says of each what is wrong with it."""

from __future__ import annotations

import contextlib
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
from semsig_gis.sources.vector.member import GEOJSON, NOT_UTF8, OUT_OF_REACH, unreadable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from semsig_gis.sources.rows import Position
    from semsig_gis.sources.vector.member import Member

# A reader that fails so often without a good row between does not move on.
FAILURES_IN_A_ROW = 1_000

# fiona's loggers; a filter acts on the very logger that emits, not on those below it.
LOGGERS = ("fiona._env", "fiona._err", "fiona.collection", "fiona.ogrext")
_heard: contextvars.ContextVar[list[logging.LogRecord] | None] = contextvars.ContextVar(
    "_heard", default=None
)


def _hear(record: logging.LogRecord) -> bool:
    heard = _heard.get()
    if heard is None:
        return True
    heard.append(record)
    return False


# A filter and not a handler: another user of fiona in the process keeps its messages, and two
# threads that read at once do not hear each other.
for _name in LOGGERS:
    logging.getLogger(_name).addFilter(_hear)


@contextlib.contextmanager
def _listening() -> Iterator[list[logging.LogRecord]]:
    """Collect the messages of the block in the list that is given."""
    heard: list[logging.LogRecord] = []
    token = _heard.set(heard)
    try:
        yield heard
    finally:
        _heard.reset(token)


def read_each(member: Member, fields: Sequence[str], count: int) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of a layer of `count` rows, what is wrong with bad ones, and notes."""
    options: dict[str, Any] = {"enabled_drivers": [member.driver]}
    if member.driver != GEOJSON:  # whose driver cannot select
        options["include_fields"] = list(fields)
    with _listening() as heard:
        try:
            source = fiona.open(member.address, layer=member.layer, **options)
        except Exception as error:
            raise unreadable(member, error) from error
        with source:
            # GDAL parses GeoJSON whole: what it says then belongs to no row.
            rows = _rows(source, fields, count, heard if member.driver != GEOJSON else [])
    blank = any(record.getMessage().startswith("Failed to decode") for record in heard)
    return rows, (NOT_UTF8,) if blank else ()


def _rows(
    source: Iterable[fiona.Feature],
    fields: Sequence[str],
    count: int,
    heard: list[logging.LogRecord],
) -> Rows:
    rows = Rows()
    damage = ""
    features = iter(source)
    failures = 0
    while failures < FAILURES_IN_A_ROW:
        said = len(heard)
        try:
            feature = next(features, None)
        except Exception as error:  # noqa: BLE001 - of many kinds, and one must not stop the rest
            failures += 1
            rows.read += 1
            rows.errors[rows.read] = f"cannot be read ({error})"
            continue
        failures = 0
        if not damage:
            errors = (r for r in itertools.islice(heard, said, None) if r.levelno >= logging.ERROR)
            damage = next((record.getMessage().rstrip(".") for record in errors), "")
        if feature is None:
            break
        rows.read += 1
        properties = feature.properties
        rows.closed += feature.geometry is not None and _has_open_ring(feature.geometry)
        try:
            position = _position(feature.geometry)
            # From the first damage on, GDAL gives null for what it cannot read.
            place: Position | str = (damage or None) if position is None else position
        except BadFeatureError as error:
            place = str(error)
        rows.add([properties[field] for field in fields], feature.id, place)
    if damage or failures:
        rows.lose(count, damage or OUT_OF_REACH)
    return rows


def _position(geometry: fiona.Geometry | None) -> Position:
    if geometry is None:
        return None
    if geometry.type == "Point":
        x, y = geometry.coordinates[:2]
        # A GeoPackage writes an empty point as one of NaN.
        return shapely.Point() if math.isnan(x) and math.isnan(y) else (x, y)
    try:
        with np.errstate(invalid="ignore"):  # NaN is looked for in all geometries at once
            return shapely.geometry.shape(geometry)
    except (AttributeError, TypeError, ValueError, shapely.errors.ShapelyError) as error:
        raise BadFeatureError(f"its {geometry.type} is not valid ({error})") from error


def _has_open_ring(geometry: fiona.Geometry) -> bool:
    """Tell whether a ring of a polygon does not end where it begins; shapely closes it untold."""
    if geometry.type not in {"Polygon", "MultiPolygon"}:
        return False
    parts = [geometry.coordinates] if geometry.type == "Polygon" else geometry.coordinates
    return any(ring[0] != ring[-1] for part in parts for ring in part if ring)
