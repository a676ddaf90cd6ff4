"""The JSON Schema of catalogues, and catalogues with any value at any place."""

from __future__ import annotations

import json
import os
import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from mutations import with_mistakes
from sentences import assert_sentence
from town_catalog import TOWN

from semsig_gis.core import CatalogError
from semsig_gis.sources import catalog_names, catalog_schema, data_folder
from semsig_gis.sources.catalog import _checked_catalog

if TYPE_CHECKING:
    from jsonschema import Draft202012Validator


@cache
def validator() -> Draft202012Validator:
    from jsonschema import Draft202012Validator  # which takes a second

    return Draft202012Validator(catalog_schema())


def test_published_schema_is_the_schema_of_the_reader() -> None:
    file = Path(str(data_folder() / "catalog.schema.json"))
    if os.environ.get("SEMSIG_SNAPSHOTS"):
        text = json.dumps(catalog_schema(), indent=1, ensure_ascii=False, sort_keys=True)
        file.write_text(text + "\n", "utf-8")
    assert json.loads(file.read_text("utf-8")) == catalog_schema()
    validator().check_schema(catalog_schema())


def test_schema_describes_every_key_of_catalogues_and_layers() -> None:
    schema = catalog_schema()
    for table in (schema, schema["$defs"]["LayerSpec"], schema["$defs"]["ObjectClass"]):
        assert all("description" in key for key in table["properties"].values())


@pytest.mark.parametrize("name", catalog_names())
def test_built_in_catalogue_names_its_schema(name: str) -> None:
    text = (data_folder() / f"{name}.toml").read_text("utf-8")
    assert text.startswith("#:schema ./catalog.schema.json\n")
    validator().validate(tomllib.loads(text))


NAMES = ["layers", "classes", "class", "files", "where", "values", "crs", "role", "code", "zzz"]


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(with_mistakes(tomllib.loads(TOWN), *NAMES))
def test_changed_catalogue_is_refused_in_a_sentence_or_fits_the_schema(
    content: dict[str, Any],
) -> None:
    try:
        _checked_catalog(content, "it")
    except CatalogError as error:
        assert_sentence(error, "catalogue it")
    else:
        assert validator().is_valid(content)
