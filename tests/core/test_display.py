from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import folium
import pytest
from html_pages import HtmlPage
from map_pages import HOSTILE
from worlds import random_town

from semsig_gis import (
    City,
    Footprints,
    Method,
    ObjectStore,
    Reproduction,
    Sight,
    StreetObjects,
    View,
    build_index,
    cell_scene,
    check_identifiability,
    draw_scene,
    evaluate,
    identify,
    load_catalog,
    localize,
    locate,
    named_noise,
    open_objects,
    quality_report,
    save_objects,
    synthetic_city,
)
from semsig_gis.core import Displayed
from semsig_gis.database import PartitionedDatabase, update_database
from semsig_gis.evaluation import error_field
from semsig_gis.localization import LikelihoodIndex, named_drift, search_regions
from semsig_gis.objects import assemble
from semsig_gis.output import GeopackageContents, Scene, show_map
from semsig_gis.sources import CitySpec

if TYPE_CHECKING:
    from pathlib import Path


LONGEST_LINE = 250


@dataclasses.dataclass(repr=False)
class Town(Displayed):
    name: str

    def _facts(self) -> dict[str, object]:
        return {"name": self.name, "cells": 312_806}


@pytest.fixture(scope="module")
def results() -> dict[str, object]:
    town = random_town()
    database = town.database
    index = build_index(database, named_noise("generic"))
    query, store = database.signature(3), ObjectStore.of(town.street_objects)
    location = locate(index, query, store=store, explained=1)
    evaluation = evaluate(database, queries=5)
    identifiability = identify(index, trials=5, class_trials=2)
    layers = synthetic_city(CitySpec(size=100.0))
    loaded = assemble(layers, load_catalog("openstreetmap"))
    return {
        "SignatureDatabase": database,
        "StreetObjects": store.objects,
        "ObjectStore": store,
        "City": City("city.parquet"),
        "Footprints": Footprints([location.to_geodataframe().geometry.buffer(9).iloc[0]]),
        "LikelihoodIndex": index,
        "NoiseMixture": index.noise,
        "NoiseSpec": named_noise("light"),
        "Location": location,
        "PlaceEstimate": location.estimate,
        "Posterior": location.posterior,
        "Explanation": location.explanations[0],
        "Localization": localize(database, query, method=Method()),
        "SearchRegions": search_regions(location, database),
        "Evaluation": evaluation,
        "ErrorField": error_field(evaluation, database),
        "Identifiability": identifiability,
        "IdentifiabilityCheck": check_identifiability(identifiability, index, queries=5),
        "Sight": Sight.of_cell(database, 3),
        "Scene": cell_scene(database, 3),
        "Drift": named_drift(),
        "Signature": query,
        "View": View.of(query),
        "Taxonomy": database.taxonomy,
        "Catalog": load_catalog("montpellier"),
        "RawLayer": layers[0],
        "Loaded": loaded,
        "LoadReport": loaded.report,
        "ConflationReport": loaded.conflation,
        "PartitionedDatabase": PartitionedDatabase((), 5),
        "GeopackageContents": GeopackageContents(
            database=database, objects=None, identifiability=None, notes=()
        ),
        "Reproduction": Reproduction(
            database=database,
            summary={},
            variants={},
            experiments={},
            seconds={},
            settings={"queries": 300},
        ),
        "UpdateReport": update_database(database, store, store.objects)[2],
        "QualityReport": quality_report(loaded.objects, loaded.report, loaded.conflation),
    }


def test_every_result_has_a_one_line_text_and_an_html_table(results: dict[str, object]) -> None:
    for name, result in results.items():
        assert isinstance(result, Displayed)
        line = repr(result)
        assert line.startswith(f"<{name}: ")
        assert line.isprintable()
        assert len(line) < LONGEST_LINE
        page = HtmlPage(result._repr_html_())
        assert page.text_of["caption"] == [name]
        facts = zip(page.text_of["th"], page.text_of["td"], strict=True)
        assert f"<{name}: {'; '.join(' '.join(fact) for fact in facts)}>" == line


def test_text_of_a_database_and_of_an_answer(results: dict[str, object]) -> None:
    index = results["LikelihoodIndex"]
    assert isinstance(index, LikelihoodIndex)
    database = index.database
    assert f"cells {len(database):,}; objects seen " in repr(database)
    assert "CRS EPSG:2154; bounds x 765,175 to " in repr(database)
    assert "answer " in repr(results["Location"])
    assert "bounds none" in repr(database.select(slice(0)))


def test_objects_of_a_file_have_the_same_text(results: dict[str, object], tmp_path: Path) -> None:
    objects = results["StreetObjects"]
    assert isinstance(objects, StreetObjects)
    save_objects(objects, tmp_path / "objects.parquet")
    assert repr(open_objects(tmp_path / "objects.parquet")) == repr(objects)


@pytest.mark.parametrize("text", [HOSTILE, "two\nlines\0", "long " * 100])
def test_text_from_data_is_escaped_and_shortened(text: str) -> None:
    town = Town(text)
    assert repr(town).isprintable()
    assert len(repr(town)) < 100
    assert repr(town).endswith("; cells 312,806>")
    assert HtmlPage(town._repr_html_()).tags <= {"table", "caption", "tbody", "tr", "th", "td"}


def test_texts_of_pictures_and_maps_are_short(results: dict[str, object]) -> None:
    scene = results["Scene"]
    assert isinstance(scene, Scene)
    assert len(repr(draw_scene(scene))) < 1000
    assert repr(show_map(folium.Map(tiles=None))) == "MapFrame(height=520)"
