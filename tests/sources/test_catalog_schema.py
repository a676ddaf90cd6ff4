"""The JSON Schema of catalogues, and catalogues with any value at any place."""

from __future__ import annotations

import copy
import json
import os
import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
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
PLAIN = st.one_of(
    st.sampled_from(
        ["", "bench", "streets", "class", "EPSG:4326", "<0", "<x", "/[/", "a or <", "*"]
    ),
    st.sampled_from([0, 1, 7.5, -1, 10**400, float("nan"), float("inf"), True, False]),
    st.text(max_size=3),
    st.dates(),
)
VALUES: st.SearchStrategy[Any] = st.recursive(
    PLAIN,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(NAMES), inner, max_size=3)
    ),
    max_leaves=6,
)


@st.composite
def catalogs(draw: st.DrawFn) -> dict[str, Any]:
    """Return a catalogue in which a few keys and items are changed, removed or added."""
    catalog = tomllib.loads(TOWN)
    for _ in range(draw(st.integers(1, 3))):
        parts: list[Any] = [catalog]
        for part in parts:  # which grows
            inner = part.values() if isinstance(part, dict) else part
            parts += [item for item in inner if isinstance(item, dict | list) and item]
        part = draw(st.sampled_from(parts))
        keys = list(part) if isinstance(part, dict) else list(range(len(part)))
        if isinstance(part, dict) and draw(st.booleans()):
            keys.append(draw(st.sampled_from(NAMES)))
        key = draw(st.sampled_from(keys))
        if isinstance(part, dict) and key in part and not draw(st.integers(0, 3)):
            del part[key]
        else:
            part[key] = draw(VALUES)
    return catalog


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow])
@given(catalogs())
def test_changed_catalogue_is_refused_in_a_sentence_or_fits_the_schema(
    content: dict[str, Any],
) -> None:
    try:
        _checked_catalog(copy.deepcopy(content), "it")
    except CatalogError as error:
        assert_sentence(error, "catalogue it")
    else:
        assert validator().is_valid(content)
