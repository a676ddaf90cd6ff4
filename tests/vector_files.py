"""Vector files of points that tests write."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    import geopandas as gpd


def write(table: gpd.GeoDataFrame, folder: Path, suffix: str, **options: str) -> Path:
    """Write a table of points; a zip has a shapefile. `options` are those of GDAL."""
    path = folder / f"things.{suffix}"
    if suffix == "csv":
        columns = table.drop(columns="geometry").assign(x=table.geometry.x, y=table.geometry.y)
        columns.to_csv(path, sep=";", index=False)
    elif suffix == "zip":
        inner = folder / "inner"
        inner.mkdir(exist_ok=True)
        write(table, inner, "shp", **options)
        pack(path, *inner.iterdir())
    else:
        table.to_file(path, **options)
    return path


def pack(archive: Path, *files: Path, inside: str = "") -> Path:
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as target:
        for file in sorted(files):
            target.write(file, inside + file.name)
    return archive
