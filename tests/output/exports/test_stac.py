"""STAC items are valid, and have the extent, the licences and the files of the database."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import pystac
import pytest
from pyproj import CRS
from pystac.extensions.file import FileExtension
from pystac.extensions.projection import ProjectionExtension
from sentences import refused
from small_city import small_city

from semsig_gis.core import DatabaseError, InputError
from semsig_gis.database import save_database
from semsig_gis.objects import save_objects
from semsig_gis.output import export_item

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CITY, OBJECTS = small_city()
NUMBERS = {"type": "array", "items": {"type": "number"}}
# The fields of the two extensions, because their schemas are on a server.
FIELDS: dict[str, dict[str, Any]] = {
    "projection/v2.0.0": {
        "proj:code": {"type": ["string", "null"], "pattern": "^[A-Z]+:[0-9]+$"},
        "proj:projjson": {"type": ["object", "null"], "required": ["type", "name"]},
        "proj:bbox": {**NUMBERS, "minItems": 4, "maxItems": 4},
        "proj:shape": {"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2},
        "proj:transform": {**NUMBERS, "minItems": 6, "maxItems": 9},
    },
    "file/v2.1.0": {
        "file:size": {"type": "integer", "minimum": 0},
        "file:checksum": {"type": "string", "pattern": "^[a-f0-9]+$"},
    },
}


@pytest.fixture(autouse=True)
def _schemas() -> Iterator[None]:
    """Make pystac validate without a network."""
    # Imported here, because jsonschema takes more than a second.
    from pystac.validation import RegisteredValidator
    from pystac.validation.stac_validator import JsonSchemaSTACValidator

    validator = JsonSchemaSTACValidator()
    for name, fields in FIELDS.items():
        prefix = next(iter(fields)).partition(":")[0]
        strict = {
            "properties": fields,
            "patternProperties": {f"^(?!{prefix}:)": {}},
            "additionalProperties": False,
        }
        address = f"https://stac-extensions.github.io/{name}/schema.json"
        validator.schema_cache[address] = {
            "$schema": "http://json-schema.org/draft-07/schema#",
            "$id": address,
            "properties": {"properties": strict, "assets": {"additionalProperties": strict}},
        }
    before = RegisteredValidator.get_validator()
    RegisteredValidator.set_validator(validator)
    yield
    RegisteredValidator.set_validator(before)


def test_item_is_valid_and_describes_the_database(tmp_path: Path) -> None:
    save_database(CITY, tmp_path / "data" / "city.parquet")
    save_objects(OBJECTS, tmp_path / "objects.parquet")
    file = tmp_path / "items" / "city.json"
    city, objects = tmp_path / "data" / "city.parquet", tmp_path / "objects.parquet"
    export_item(city, file, objects=objects)
    item = pystac.Item.from_file(str(file))
    assert len(item.validate()) == 3
    projected = ProjectionExtension.ext(item)
    assert projected.code == "EPSG:32631"
    assert projected.bbox is not None
    west, south, east, north = projected.bbox
    assert (CITY.xy.min(axis=0) - 5).tolist() == [west, south]
    assert (CITY.xy.max(axis=0) + 5).tolist() == [east, north]
    assert (projected.shape, projected.transform) == (
        [(north - south) / 10, (east - west) / 10],
        [10.0, 0.0, west, 0.0, -10.0, north],
    )
    lon, lat = np.array(item.bbox).reshape(2, 2).mean(axis=0)
    assert (round(lon, 1), 48 < lat < 49) == (3.0, True)
    assert item.datetime == datetime.fromtimestamp(int(city.stat().st_mtime), tz=UTC)
    assert item.properties["license"] == "CC0"
    assert item.properties["providers"][0]["name"] == "Town"
    assert item.properties["semsig:licenses"] == list(CITY.licenses)
    assert item.properties["semsig:taxonomy"] == CITY.taxonomy.to_list()
    hrefs = {"database": "../data/city.parquet", "objects": "../objects.parquet"}
    assert {name: asset.href for name, asset in item.assets.items()} == hrefs
    for name, path in {"database": city, "objects": objects}.items():
        asset = FileExtension.ext(item.assets[name])
        assert item.assets[name].media_type == pystac.MediaType.VND_APACHE_PARQUET
        assert asset.size == path.stat().st_size
        assert asset.checksum == "1220" + hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("licenses", "licence", "owners"),
    [
        ((), "other", []),
        (("OSM (ODbL-1.0): trees",), "ODbL-1.0", ["OSM"]),
        (("A (ODbL-1.0): trees", "B (CC0-1.0): lamps"), "other", ["A", "B"]),
        (("A (Open (Etalab)): trees, lamps", "A (APIE): lamps"), "other", ["A"]),
        (("no attribution given (unknown)",), "other", ["no attribution given"]),
        (("A (CC0-1.0)", "no brackets"), "other", ["A", "no brackets"]),
    ],
)
def test_licence_and_providers_of_an_item(
    licenses: tuple[str, ...], licence: str, owners: list[str], tmp_path: Path
) -> None:
    save_database(dataclasses.replace(CITY, licenses=licenses), tmp_path / "a.parquet")
    export_item(tmp_path / "a.parquet", tmp_path / "a.json")
    item = pystac.Item.from_dict(json.loads((tmp_path / "a.json").read_text()))
    item.validate()
    assert item.properties["license"] == licence
    assert [provider["name"] for provider in item.properties["providers"]] == owners


def test_crs_without_a_code_is_stored_as_projjson(tmp_path: Path) -> None:
    local = CRS("+proj=tmerc +lat_0=48 +lon_0=3.1 +x_0=500000 +y_0=5400000 +ellps=GRS80 +units=m")
    save_database(dataclasses.replace(CITY, crs=local), tmp_path / "a.parquet")
    export_item(tmp_path / "a.parquet", tmp_path / "a.json")
    item = pystac.Item.from_file(str(tmp_path / "a.json"))
    item.validate()
    projection = ProjectionExtension.ext(item)
    assert projection.code is None
    assert projection.projjson is not None
    assert CRS.from_json_dict(projection.projjson) == local


def test_wrong_suffix_missing_file_and_missing_pystac_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_database(CITY, tmp_path / "a.parquet")
    with refused(InputError, "a.yaml does not end in .json"):
        export_item(tmp_path / "a.parquet", tmp_path / "a.yaml")
    with refused(DatabaseError, "nowhere.parquet"):
        export_item(tmp_path / "a.parquet", tmp_path / "a.json", objects="nowhere.parquet")
    monkeypatch.delitem(sys.modules, "semsig_gis.output.stac", raising=False)
    monkeypatch.setitem(sys.modules, "pystac", None)
    with refused(InputError, "pystac", "semsig_gis[stac]"):
        export_item(tmp_path / "a.parquet", tmp_path / "a.json")
    assert [path.name for path in tmp_path.iterdir()] == ["a.parquet"]
