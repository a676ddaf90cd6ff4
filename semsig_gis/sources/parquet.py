"""Tables of features from GeoParquet files of any writer."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pyarrow.parquet as pq
import shapely

from semsig_gis.core import SourceError
from semsig_gis.sources.paths import require_file
from semsig_gis.storage import UNREADABLE, VERIFY_CHECKSUMS, check_footer_checksum

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from pathlib import Path

    import geopandas as gpd

SUFFIXES: frozenset[str] = frozenset({".geoparquet", ".parquet"})


def column_names(path: Path) -> list[str]:
    """Return the column names of a Parquet file; SourceError if it is not one."""
    try:
        names: list[str] = pq.read_schema(path).names
    except UNREADABLE as error:
        raise SourceError(
            f"{path} is damaged or is not a Parquet file; download it again."
        ) from error
    return names


def read_parquet(
    path: Path,
    *,
    kind: str,
    columns: Collection[str] | None = None,
    box: Sequence[float] | None = None,
) -> gpd.GeoDataFrame:
    """Read the features of a GeoParquet file; `kind` describes them in messages.

    Only `columns` that exist are read, and the geometry. SourceError if the file cannot be read.
    """
    import geopandas as gpd  # noqa: PLC0415 - 0.7 s

    require_file(path, f"a file of {kind}")
    try:
        check_footer_checksum(path)
        names = None
        if columns is not None:
            schema = pq.read_schema(path)
            geometry = json.loads(schema.metadata[b"geo"])["primary_column"]
            names = [name for name in schema.names if name in columns or name == geometry]
        return gpd.read_parquet(
            path, columns=names, bbox=None if box is None else tuple(box), **VERIFY_CHECKSUMS
        )
    except shapely.errors.ShapelyError as error:
        cause = str(error).partition(": ")[2] or str(error)
        raise SourceError(
            f"{path} has shapes that cannot be read ({cause.rstrip('.')}); correct the file."
        ) from error
    except UNREADABLE as error:
        raise SourceError(
            f"{path} is damaged or is not GeoParquet; give a file of {kind}."
        ) from error
