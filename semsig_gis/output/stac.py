"""Describe a database as an item of a SpatioTemporal Asset Catalog (STAC)."""

from __future__ import annotations

import json
import os
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import pystac
from pystac.extensions.file import FileExtension
from pystac.extensions.projection import ProjectionExtension
from shapely.geometry import box, mapping

from semsig_gis.core import to_degrees
from semsig_gis.database import database_specs
from semsig_gis.output.layers.cells import cells_layer
from semsig_gis.storage import digest, write_whole

if TYPE_CHECKING:
    from semsig_gis.database import City


PARQUET = "application/vnd.apache.parquet"
SHA2_256 = "1220"  # prefix of a multihash: a SHA-256 of 32 bytes
# A line of licences: the owner of the data, the licence, and the layers.
LICENCE = re.compile(r"(?P<owner>[^(]+) \((?P<licence>.*)\)(?::[^()]*)?")
LICENCE_ID = re.compile(r"(?!unknown$)[\w.+-]+")
OMITTED_SPECS = {"licenses", "kind", "format"}


def write_item(city: City, path: str | Path, *, objects: str | Path | None = None) -> None:
    """Write the description of a database as one STAC 1.1 item (see `export_item`)."""
    database = city.database
    bounds = cells_layer(database).bounds
    sides = to_degrees(database.crs).transform_bounds(*bounds)
    left, bottom, right, top = (round(side, 7) for side in sides)
    written = int(max(file.stat().st_mtime for file in city.files))
    matches = {line: LICENCE.fullmatch(line) for line in database.licenses}
    # One licence of all sources is stated if its name is a single word.
    licences = {match["licence"] if match else "" for match in matches.values()}
    licence = licences.pop() if len(licences) == 1 else ""
    owners = dict.fromkeys(match["owner"] if match else line for line, match in matches.items())
    item = pystac.Item(
        id=city.path.stem,
        geometry=mapping(box(left, bottom, right, top)),
        bbox=[left, bottom, right, top],
        datetime=datetime.fromtimestamp(written, tz=UTC),
        properties={
            "title": f"Signatures of {city.path.stem}",
            "description": (
                f"What is seen of the street from {len(database):,} cells of "
                f"{database.grid.step:g} m. " + "; ".join(database.licenses)
            ).strip(),
            "license": licence if LICENCE_ID.fullmatch(licence) else "other",
            "providers": [{"name": owner, "roles": ["producer", "licensor"]} for owner in owners],
            "semsig:cells": len(database),
            "semsig:licenses": list(database.licenses),
            **{
                f"semsig:{name}": fact
                for name, fact in database_specs(database).items()
                if name not in OMITTED_SPECS
            },
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
    # Assets: the files, with paths relative to the folder of the item.
    folder = Path(os.path.realpath(path)).parent
    files = {"database" if len(city.files) == 1 else file.stem: file for file in city.files}
    titles = dict.fromkeys(files, "Signature database (GeoParquet)")
    if objects is not None:
        files["objects"], titles["objects"] = Path(objects), "Street objects (GeoParquet)"
    for name, file in files.items():
        href = Path(os.path.relpath(os.path.realpath(file), folder)).as_posix()
        asset = pystac.Asset(href, titles[name], None, PARQUET, ["data"])
        item.add_asset(name, asset)
        content = FileExtension.ext(asset, add_if_missing=True)
        content.apply(size=file.stat().st_size, checksum=SHA2_256 + digest(file))
    members = item.to_dict(include_self_link=False)
    write_whole(path, json.dumps(members, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
