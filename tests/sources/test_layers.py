from __future__ import annotations

import dataclasses

from semsig_gis.sources.catalog import paper_taxonomy
from semsig_gis.sources.layers import LayerSpec, layer_of

SHARED = {"files": ("all.gpkg",), "reader": "vector_file", "license": "CC0", "attribution": "Town"}


def read(**item: object) -> LayerSpec:
    return layer_of(item, "town.toml", taxonomy=paper_taxonomy(), shared=SHARED)


def test_a_layer_has_what_all_of_the_catalogue_have() -> None:
    spec = read(**{"name": "benches", "class": "bench"})
    assert spec == LayerSpec(
        name="benches",
        class_name="bench",
        role="objects",
        elements=("node", "way", "relation"),
        files=("all.gpkg",),
        license="CC0",
        attribution="Town",
    )
    assert (spec.optional, spec.unique_id) == (False, False)
    assert len({spec, dataclasses.replace(spec), dataclasses.replace(spec, optional=True)}) == 2


def test_the_fields_of_a_layer_are_those_that_its_keys_name() -> None:
    by = {"field": "KIND", "values": {"Rue": 14}}
    spec = read(name="a", role="streets", width_by=by, width_field="W", where={"STATE": "open"})
    assert spec.fields == (("where", "STATE"), ("width_by", "KIND"), ("width_field", "W"))
