"""Inputs of tiles: files that every worker can read by box."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyproj import CRS
from pyproj.exceptions import CRSError

from semsig_gis.core import HALF_WIDTH, SourceError, temporary_folder
from semsig_gis.database.file import INPUTS
from semsig_gis.objects import open_objects, read_surroundings, save_objects, save_surroundings
from semsig_gis.storage import EMPTY_BOX, VERIFY_CHECKSUMS, digest, whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import geopandas as gpd

    Input = Literal["objects", "buildings", "streets"]


@contextlib.contextmanager
def input_files(
    objects: str | Path, out: str | Path, **tables: str | Path | gpd.GeoDataFrame | None
) -> Iterator[dict[str, Path]]:
    """Yield the files of buildings and streets; tables are written to files next to the result.

    So workers on other machines can read them.
    """
    files = {name: Path(path) for name, path in tables.items() if isinstance(path, str | Path)}
    in_memory: dict[Any, gpd.GeoDataFrame] = {
        name: table for name, table in tables.items() if table is not None and name not in files
    }
    if not in_memory:
        yield files
        return
    crs = open_objects(objects, box=EMPTY_BOX).crs
    with working_folder(out) as folder:
        for name, table in in_memory.items():
            files[name] = folder / f"{name}.parquet"
            save_surroundings(read_surroundings(table, role=name, crs=crs), files[name])
        yield files


@contextlib.contextmanager
def working_folder(out: str | Path) -> Iterator[Path]:
    """Yield a folder next to a result, for files of its workers; it is removed after the block."""
    parent = Path(os.path.realpath(out)).parent
    parent.mkdir(parents=True, exist_ok=True)
    with temporary_folder(parent) as folder:
        yield folder


def fingerprint(path: Path) -> str:
    """Return the digest of a file, of all files of a shapefile, or of a folder."""
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
    elif path.suffix.lower() == ".shp":
        files = sorted(path.parent.glob(f"{path.stem}.*"))
    else:
        files = [path]
    try:
        return digest(*files)
    except OSError as error:
        raise SourceError(f"{path} does not exist or cannot be read; give another file.") from error


def copy_with_bounds(
    name: Input, path: Path, crs: CRS, folder: Path, remark: Callable[[str], None] | None
) -> Path:
    """Copy an input to GeoParquet in `crs`, with the bounds of each row, and return its path."""
    copy = folder / INPUTS / f"{name}.parquet"
    if copy.exists():
        return copy
    if _has_bounds(path, crs):
        with whole_file(copy) as partial, path.open("rb") as source, partial.open("wb") as target:
            shutil.copyfileobj(source, target)
    elif name == "objects":  # older files have no bounds
        save_objects(open_objects(path), copy)
    else:
        save_surroundings(read_surroundings(path, role=name, crs=crs, remark=remark), copy)
    return copy


def _has_bounds(path: Path, crs: CRS) -> bool:
    """Whether a file is GeoParquet in this CRS with a column of bounds."""
    try:
        schema = pq.read_schema(path)
        geo = json.loads(schema.metadata[b"geo"])
        column = geo["columns"][geo["primary_column"]]
        bounds = column["covering"]["bbox"]["xmin"][0]
        return bounds in schema.names and CRS.from_user_input(column["crs"]) == crs
    except (pa.ArrowException, OSError, LookupError, TypeError, ValueError, CRSError):
        return False


def widest_street(streets: Path) -> float:
    """Return the largest half-width of the streets in metres, 0 if the file has none."""
    if HALF_WIDTH not in pq.read_schema(streets).names:
        return 0.0
    import pandas as pd  # noqa: PLC0415 - 0.4 s

    table = pq.read_table(streets, columns=[HALF_WIDTH], **VERIFY_CHECKSUMS)
    # As `read_surroundings` reads them.
    widths = pd.to_numeric(table[HALF_WIDTH].to_pandas(), errors="coerce").to_numpy(np.float64)
    return float(widths[np.isfinite(widths)].max(initial=0.0))
