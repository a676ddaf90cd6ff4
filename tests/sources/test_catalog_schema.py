"""The JSON Schema of catalogues says what the reader of catalogues says."""

from __future__ import annotations

import copy
import json
import tomllib
from functools import cache
from typing import TYPE_CHECKING, Any, get_args

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from town_catalog import MISTAKES, TOWN, mistake

from semsig_gis.core import CatalogError
from semsig_gis.sources import (
    CATALOG_KEYS,
    CLASS_BY_KEYS,
    CLASS_KEYS,
    LAYER_KEYS,
    MEASURES,
    READERS,
    WIDTH_BY_KEYS,
    ElementKind,
    GeometryKind,
    Role,
    catalog_names,
    data_folder,
    paper_taxonomy,
)
from semsig_gis.sources.catalog import _checked_catalog

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jsonschema import Draft202012Validator

SCHEMA = json.loads((data_folder() / "catalog.schema.json").read_text("utf-8"))
# Errors that only the reader detects: unknown names, duplicate names, CRSs, patterns, the order of
# numbers, NaN, and a decimal point in an integer.
ONLY_READER = (
    "street_ligth", "bus_stopp", "bus_shelter", "street_lamp = 5", 'symbol = "B"', "code = 3 ",
    '"bench"\\ntitle', "two layers named", "range_m of", "EPSG:99", "WGS 84", "Mercator",
    "Lambert", "[10, 1]", "/[/", "not valid TOML", "nan", "30.0",
)  # fmt: skip


def accepts(content: dict[str, Any]) -> bool:
    """Whether the reader accepts a catalogue."""
    try:
        _checked_catalog(copy.deepcopy(content), "it")
    except CatalogError:
        return False
    return True


@cache
def validator() -> Draft202012Validator:
    from jsonschema import Draft202012Validator  # which takes a second

    return Draft202012Validator(SCHEMA)


def test_schema_is_valid_and_has_the_keys_of_the_reader() -> None:
    validator().check_schema(SCHEMA)
    layer, of_class = SCHEMA["$defs"]["layer"]["properties"], SCHEMA["$defs"]["class"]["properties"]
    assert SCHEMA["properties"].keys() == CATALOG_KEYS.keys()
    assert layer.keys() == LAYER_KEYS.keys()
    assert of_class.keys() == {*CLASS_KEYS, *MEASURES}
    assert layer["class_by"]["properties"].keys() == {*CLASS_BY_KEYS, "otherwise"}
    assert layer["width_by"]["properties"].keys() == WIDTH_BY_KEYS.keys()
    assert {key: of_class[key]["maximum"] for key in MEASURES} == MEASURES
    assert tuple(layer["role"]["enum"]) == get_args(Role)
    assert tuple(layer["geometry"]["enum"]) == get_args(GeometryKind)
    assert tuple(layer["elements"]["items"]["enum"]) == get_args(ElementKind)
    assert SCHEMA["properties"]["reader"]["anyOf"][0]["enum"] == list(READERS.names)
    names = [item.name for item in paper_taxonomy().classes]
    assert SCHEMA["$defs"]["class_name"]["anyOf"][0]["enum"] == names


@pytest.mark.parametrize("name", catalog_names())
def test_built_in_catalogue_names_its_schema(name: str) -> None:
    text = (data_folder() / f"{name}.toml").read_text("utf-8")
    assert text.startswith("#:schema ./catalog.schema.json\n")
    validator().validate(tomllib.loads(text))


@pytest.mark.parametrize("row", MISTAKES)
def test_schema_and_reader_refuse_invalid_catalogues(row: str) -> None:
    old, new, _ = mistake(row)
    try:
        content = tomllib.loads(TOWN.replace(old, new))
    except tomllib.TOMLDecodeError:
        assert "not valid TOML" in row
        return
    assert not accepts(content)
    assert validator().is_valid(content) == any(words in row for words in ONLY_READER)


VALUES = st.sampled_from([
    "", "a", "bench", "objects", "streets", "point", "node", "class", "EPSG:4326", "<0", "<x",
    ">=0 or none", "a or <", "/a.*/", "=1", "*", 0, 1, 7.5, -1, True, False, [], ["a"], [""], [1],
    ["node"], [0, 5], [5], {}, {"a": "b"}, {"a": 1}, {"a": []}, {"bench": 5}, [{}], [{"a": "b"}],
    {"field": "f", "values": {"a": "bench"}}, {"field": "f", "values": {"a": 9}, "default": 5},
    {"field": "f", "values": {"a": "bench"}, "otherwise": "class"},
])  # fmt: skip
LAYER = {"name": "l", "class": "bench", "files": ["*"]}
CLASS = {"code": 30, "symbol": "Z", "name": "kiosk", "title": "Kiosk"}


@st.composite
def catalogs(draw: st.DrawFn) -> dict[str, Any]:
    """Return a catalogue in which some keys are missing and some have any value."""

    def table(good: dict[str, Any], keys: Mapping[str, object]) -> dict[str, Any]:
        item = {key: value for key, value in good.items() if draw(st.integers(0, 9))}
        for key in draw(st.lists(st.sampled_from([*sorted(keys), "zzz"]), max_size=2)):
            item[key] = draw(VALUES)
        return item

    good = {"name": "n", "title": "t", "layers": [LAYER], "classes": [CLASS]}
    catalog = table(good, CATALOG_KEYS)
    if catalog.get("layers") == [LAYER]:
        catalog["layers"] = [table(LAYER, LAYER_KEYS)]
    if catalog.get("classes") == [CLASS]:
        catalog["classes"] = [table(CLASS, {**CLASS_KEYS, **MEASURES})]
    return catalog


def names_that_exist(content: dict[str, Any]) -> bool:
    """Whether a catalogue that fits the schema has no error that only the reader detects."""
    layers, classes = content["layers"], {"bench", *(c["name"] for c in content.get("classes", ()))}
    names = {layer["class"] for layer in layers if "class" in layer}
    for layer in layers:
        names.update(layer.get("class_by", {}).get("values", {}).values())
    names.update(content.get("ranges", {}), content.get("conflate", {}))
    systems = {layer.get("crs", "EPSG:4326") for layer in layers}
    fields = [item.get("rows", [0, 0]) for item in layers]
    ordered = all(least <= most for least, most in fields)
    free = all(item["code"] > 11 for item in content.get("classes", ()))  # not a code of the paper
    valid = names <= classes and systems == {"EPSG:4326"} and ordered and free
    return valid and "metric_crs" not in content


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(catalogs())
def test_schema_and_reader_agree(content: dict[str, Any]) -> None:
    valid, accepted = validator().is_valid(content), accepts(content)
    assert valid or not accepted  # what the schema refuses, the reader refuses
    if valid and names_that_exist(content):
        assert accepted
