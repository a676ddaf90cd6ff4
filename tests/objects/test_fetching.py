"""From the service that a catalogue names."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from sentences import assert_sentence
from servers import Answer, Server

from semsig_gis.core.errors import InputError, SourceError
from semsig_gis.objects.load import fetch_layers, find_area, open_cache
from semsig_gis.sources.catalog import Catalog, load_catalog, paper_taxonomy
from semsig_gis.sources.layers import LayerSpec

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

BENCH = LayerSpec(name="benches", class_name="bench")


def catalog_of(**values: object) -> Catalog:
    plain = {"name": "town", "title": "Town", "taxonomy": paper_taxonomy(), "layers": (BENCH,)}
    return Catalog(**{**plain, **values})  # type: ignore[arg-type]


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as running:
        yield running


def benches(*places: tuple[float, float]) -> bytes:
    return json.dumps(
        {
            "elements": [
                {"type": "node", "id": i, "lon": x, "lat": y, "tags": {"amenity": "bench"}}
                for i, (x, y) in enumerate(places, start=1)
            ]
        }
    ).encode()


def test_openstreetmap_is_fetched_cut_to_the_area_and_kept(server: Server, tmp_path: Path) -> None:
    osm = load_catalog("openstreetmap")
    here = catalog_of(
        taxonomy=osm.taxonomy,
        layers=(osm.layer("benches"),),
        reader="osm_file",
        endpoints=(f"{server.url}/api",),
        geocoder=f"{server.url}/search",
    )
    server.on("/api/interpreter", Answer(benches((7.42, 43.73), (7.49, 43.73))))
    cache, http = open_cache(tmp_path / "cache")
    area = find_area("7.41,43.72,7.43,43.74", here, cache=cache, http=http)
    (layer,) = fetch_layers(here.layers, here, area=area, cache=cache, http=http)
    assert layer.table["source_id"].tolist() == ["node/1"]
    assert (layer.counts.read, layer.counts.filtered) == (2, 1)
    asked = len(server.seen)
    _, offline = open_cache(tmp_path / "cache", offline=True)
    (again,) = fetch_layers(here.layers, here, area=area, cache=cache, http=offline)
    assert again.table["source_id"].tolist() == ["node/1"]
    assert len(server.seen) == asked
    far = find_area("1,2,3,4", here, cache=cache, http=offline)
    with pytest.raises(SourceError) as caught:
        fetch_layers(here.layers, here, area=far, cache=cache, http=offline)
    assert_sentence(caught.value, "127.0.0.1")


def test_a_place_is_looked_up_only_where_the_catalogue_says(server: Server, tmp_path: Path) -> None:
    cache, http = open_cache(tmp_path)
    with pytest.raises(InputError) as caught:
        find_area("Monaco", catalog_of(), cache=cache, http=http)
    assert_sentence(caught.value, "'town'", "'Monaco'", "polygon file")
    with pytest.raises(InputError) as refused:
        fetch_layers(
            [BENCH],
            catalog_of(),
            area=find_area("1,2,3,4", catalog_of(), cache=cache, http=http),
            cache=cache,
            http=http,
        )
    assert_sentence(refused.value, "'town'", "semsig load")
    assert server.seen == []
