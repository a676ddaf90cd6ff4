"""A database as an item of a SpatioTemporal Asset Catalog (STAC), for catalogues of data."""

from __future__ import annotations

import json
import os
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pystac
from pystac.extensions.file import FileExtension
from pystac.extensions.projection import ProjectionExtension
from shapely.geometry import box, mapping

from semsig_gis.core import to_degrees
from semsig_gis.database import database_specs, digest
from semsig_gis.exports.layers import cells_layer
from semsig_gis.storage import write_whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semsig_gis.database import City


PARQUET = "application/vnd.apache.parquet"
SHA2_256 = "1220"  # how a multihash begins that is a SHA-256 of 32 bytes
# How a line of licences says whose the data are, and under which licence.
LICENCE = re.compile(r"(?P<owner>[^(]+) \((?P<licence>.*)\)(?::[^()]*)?")
NAMED = re.compile(r"(?!unknown$)[\w.+-]+")
LEFT_OUT = {"licenses", "kind", "format"}


def write_item(city: City, path: str | Path, *, objects: str | Path | None = None) -> None:
    """Write what a database is as one STAC 1.1 item, which appears whole, by rename.

    The item has the extent, the CRS and the grid (extension ``projection``), the licences, and as
    assets the files of the database and of its objects, with their sizes and checksums (extension
    ``file``). Its date is that of the database's file. ``semsig:`` begins the specs.
    """
    database = city.database
    bounds = cells_layer(database).bounds
    sides = to_degrees(database.crs).transform_bounds(*bounds)
    left, bottom, right, top = (round(side, 7) for side in sides)
    facts = {name: fact for name, fact in database_specs(database).items() if name not in LEFT_OUT}
    item = pystac.Item(
        id=city.path.stem,
        geometry=mapping(box(left, bottom, right, top)),
        bbox=[left, bottom, right, top],
        datetime=max(_written(file) for file in city.files),
        properties={
            "title": f"Signatures of {city.path.stem}",
            "description": (
                f"What is seen of the street from {len(database):,} cells of "
                f"{database.grid.step:g} m. " + "; ".join(database.licenses)
            ).strip(),
            "license": _licence(database.licenses),
            "providers": _owners(database.licenses),
            "semsig:cells": len(database),
            "semsig:licenses": list(database.licenses),
            **{f"semsig:{name}": fact for name, fact in facts.items()},
        },
    )
    west, south, east, north = bounds
    step, code = database.grid.step, database.crs.to_authority()
    ProjectionExtension.ext(item, add_if_missing=True).apply(
        code=None if code is None else ":".join(code),
        projjson=database.crs.to_json_dict() if code is None else None,
        bbox=[west, south, east, north],
        shape=[round((north - south) / step), round((east - west) / step)],
        transform=[step, 0.0, west, 0.0, -step, north],
    )
    folder = Path(os.path.realpath(path)).parent
    files = {"database" if len(city.files) == 1 else file.stem: file for file in city.files}
    titles = dict.fromkeys(files, "Signature database (GeoParquet)")
    if objects is not None:
        files["objects"], titles["objects"] = Path(objects), "Street objects (GeoParquet)"
    for name, file in files.items():
        asset = pystac.Asset(_href(file, folder), titles[name], None, PARQUET, ["data"])
        item.add_asset(name, asset)
        content = FileExtension.ext(asset, add_if_missing=True)
        content.apply(size=file.stat().st_size, checksum=SHA2_256 + digest(file))
    told: Mapping[str, Any] = item.to_dict(include_self_link=False)
    write_whole(path, json.dumps(told, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def _written(file: Path) -> datetime:
    return datetime.fromtimestamp(int(file.stat().st_mtime), tz=UTC)


def _href(file: Path, folder: Path) -> str:
    """Return where a file is, as seen from a folder."""
    return Path(os.path.relpath(os.path.realpath(file), folder)).as_posix()


def _licence(lines: tuple[str, ...]) -> str:
    """Return the one licence of all sources if it has a name of one word, else ``other``."""
    matches = map(LICENCE.fullmatch, lines)
    found = {match["licence"] if match else "" for match in matches}
    only = found.pop() if len(found) == 1 else ""
    return only if NAMED.fullmatch(only) else "other"


def _owners(lines: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return who gave the data, as providers."""
    matches = [LICENCE.fullmatch(line) for line in lines]
    names = [match["owner"] if match else line for match, line in zip(matches, lines, strict=True)]
    return [{"name": name, "roles": ["producer", "licensor"]} for name in dict.fromkeys(names)]
