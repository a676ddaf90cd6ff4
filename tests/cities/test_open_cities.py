"""Cities with a catalogue written from documentation: rows of the documented form are read."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from open_cities import CITIES, serve, write_files

from semsig_gis.objects import assemble, choose_layers, read_files
from semsig_gis.sources import data_folder, fetch_layers, load_catalog, open_cache, parse_area

if TYPE_CHECKING:
    from pathlib import Path

    from servers import Server


@pytest.mark.parametrize("name", CITIES)
def test_documented_rows_become_objects(name: str, tmp_path: Path) -> None:
    catalog = load_catalog(name)
    _, layers = CITIES[name]
    write_files(name, tmp_path)
    loaded_layers, absent = read_files(choose_layers(catalog), [tmp_path])
    assert not absent
    assert {layer.spec.name: layer.counts.kept for layer in loaded_layers} == {
        layer: len(good) for layer, (_, good, _) in layers.items()
    }
    assert not any(layer.errors for layer in loaded_layers)
    loaded = assemble(loaded_layers, catalog)  # in the CRS of the catalogue
    assert len(loaded.objects) == sum(len(good) for _, good, _ in layers.values())
    assert loaded.objects.crs.to_string() == catalog.metric_crs
    assert not loaded.notes


@pytest.mark.parametrize("name", CITIES)
def test_layers_are_fetched_from_the_service_of_a_city(
    name: str, server: Server, tmp_path: Path
) -> None:
    catalog = load_catalog(name)
    (x, y), layers = CITIES[name]
    address = serve(server, name, catalog.reader, catalog.layers)
    area = parse_area(f"{x - 0.01},{y - 0.01},{x + 0.01},{y + 0.01}")
    cache, http = open_cache(tmp_path)
    loaded_layers = fetch_layers(
        choose_layers(catalog),
        replace(catalog, endpoints=(address,)),
        area=area,
        cache=cache,
        http=http,
    )
    assert {layer.spec.name: layer.counts.kept for layer in loaded_layers} == {
        layer: len(good) for layer, (_, good, _) in layers.items()
    }


@pytest.mark.parametrize("name", CITIES)
def test_a_catalogue_documents_its_checks(name: str) -> None:
    catalog = load_catalog(name)
    assert catalog.endpoints
    assert "unknown" not in {spec.license for spec in catalog.layers}
    assert all(spec.attribution for spec in catalog.layers)
    text = (data_folder() / f"{name}.toml").read_text("utf-8")
    assert re.search(r"# Checked on \d{4}-\d\d-\d\d", text)
    assert "Not checked: " in text.replace("\n# ", " ")
